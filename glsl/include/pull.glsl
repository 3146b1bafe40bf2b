// Gradient of a pixel's depth and albedo: its own (surface_combine.comp), plus the gradients of all slopes that
// depend on it, through the same coefficients. Returns the part of one of the pixel's lanes. Typed as in tables.glsl. Needs
// neighbours.glsl and pixel_lanes.glsl.

#ifdef TEXELS
layout(set = 0, binding = 3, rgba32f) readonly uniform imageBuffer stencils;
layout(set = 0, binding = 4, rgba32f) readonly uniform imageBuffer height_gradient;
vec4 height_gradient_at(uint pixel) { return imageLoad(height_gradient, int(pixel)); }
vec2 stencil_at(uint pixel, uint k) {
    vec4 both = imageLoad(stencils, int(4u * pixel + (k >> 1)));
    return (k & 1u) == 0u ? both.xy : both.zw;
}
#else
layout(std430, set = 0, binding = 3) readonly buffer Stencils { vec2 stencils[]; };
layout(std430, set = 0, binding = 4) readonly buffer HeightGradient { vec4 height_gradient[]; };
vec4 height_gradient_at(uint pixel) { return height_gradient[pixel]; }
vec2 stencil_at(uint pixel, uint k) { return stencils[8u * pixel + k]; }
#endif

vec2 pulled(uint pixel) {
    vec4 own = height_gradient_at(pixel);
    vec2 g = gl_LocalInvocationID.y == 0u ? own.zw : vec2(0.0);
    for (uint k = gl_LocalInvocationID.y; k < 8u; k += PIXEL_LANES) {
        uint other = neighbour(pixel, k);
        if (other == NOWHERE) continue;
        g.x += dot(stencil_at(other, 7u - k), height_gradient_at(other).xy) - dot(stencil_at(pixel, k), own.xy);
    }
    return g;
}
