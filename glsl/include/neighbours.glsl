// Numbers of the pixels of columns, or NOWHERE. Needs heights.glsl.

layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
uint pixel_at(uint column) { return column == NOWHERE ? NOWHERE : pixel_of[column]; }

// Number of a pixel's k-th neighbour.
uint neighbour(uint pixel, uint k) { return pixel_at(column_beside(pixel, k)); }
