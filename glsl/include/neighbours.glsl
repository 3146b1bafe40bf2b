// Number of a pixel's k-th neighbour, or NOWHERE. Typed as in tables.glsl. Needs heights.glsl.

#ifdef TEXELS
layout(set = 0, binding = 2, r32ui) readonly uniform uimageBuffer pixel_of;
uint pixel_at(uint column) { return imageLoad(pixel_of, int(column)).x; }
#else
layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
uint pixel_at(uint column) { return pixel_of[column]; }
#endif

uint neighbour(uint pixel, uint k) {
    uint column = column_beside(pixel, k);
    return column == NOWHERE ? NOWHERE : pixel_at(column);
}
