// Slopes of a pixel from its neighbours' depths: those of the plane that fits the neighbours best, each weighted by
// its bond (heights.glsl), as coefficients of their depths minus the pixel's own. Bonds follow the present depths and
// remain until the next update, so slopes are linear in the depths in between. One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; }; // columns
layout(std430, set = 0, binding = 3) readonly buffer Heights { vec2 heights[]; }; // depth, albedo
layout(std430, set = 0, binding = 4) writeonly buffer Stencils { vec2 stencils[]; };
layout(std430, set = 0, binding = 5) writeonly buffer BondDepths { float bond_depths[]; };

#include "heights.glsl"
#include "neighbours.glsl"

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    float depth = heights[pixel].x;
    float weights[8];
    float all = 1.0; // the pixel's own
    vec2 mean = vec2(0.0);
    mat2 spread = mat2(0.0);
    for (uint k = 0u; k < 8u; ++k) {
        uint other = neighbour(pixel, k);
        weights[k] = other == NOWHERE ? 0.0 : bond(k, heights[other].x - depth);
        vec2 d = vec2(AROUND[k]);
        all += weights[k];
        mean += weights[k] * d;
        spread += outerProduct(weights[k] * d, d);
    }
    mean /= all;
    spread -= outerProduct(all * mean, mean);
    // A pixel without neighbours, or with collinear ones, is level in undetermined directions.
    spread += mat2(SURFACE_LEVEL);
    float area = determinant(spread);
    for (uint k = 0u; k < 8u; ++k) {
        vec2 d = weights[k] * (vec2(AROUND[k]) - mean);
        vec2 c = vec2(spread[1][1] * d.x - spread[1][0] * d.y, spread[0][0] * d.y - spread[0][1] * d.x) / area;
        stencils[8u * pixel + k] = c / pixel_pitch();
    }
    bond_depths[pixels[pixel]] = depth;
}
