// Numbers of the pixels of columns, or NOWHERE. Typed as in tables.glsl. Needs heights.glsl.

#ifdef TEXELS
layout(set = 0, binding = 2, r32ui) readonly uniform uimageBuffer pixel_of;
uint pixel_at(uint column) { return column == NOWHERE ? NOWHERE : imageLoad(pixel_of, int(column)).x; }
#else
layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
uint pixel_at(uint column) { return column == NOWHERE ? NOWHERE : pixel_of[column]; }
#endif

// Number of a pixel's k-th neighbour.
uint neighbour(uint pixel, uint k) { return pixel_at(column_beside(pixel, k)); }
