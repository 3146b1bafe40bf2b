// Gradient of a pixel's depth and albedo: its own (surface_combine.comp), plus the gradients of all slopes that
// depend on it, through the same coefficients. Returns the part of one of the pixel's lanes. Needs neighbours.glsl and
// pixel_lanes.glsl.

layout(std430, set = 0, binding = 3) readonly buffer Stencils { vec2 stencils[]; };
layout(std430, set = 0, binding = 4) readonly buffer HeightGradient { vec4 height_gradient[]; };

vec2 pulled(uint pixel) {
    vec4 own = height_gradient[pixel];
    vec2 g = gl_LocalInvocationID.y == 0u ? own.zw : vec2(0.0);
    for (uint k = gl_LocalInvocationID.y; k < 8u; k += PIXEL_LANES) {
        uint other = neighbour(pixel, k);
        if (other == NOWHERE) continue;
        g.x += dot(stencils[8u * other + 7u - k], height_gradient[other].xy) - dot(stencils[8u * pixel + k], own.xy);
    }
    return g;
}
