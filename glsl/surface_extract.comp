// Maps of the surface over those that it began from: depth and normal of each of its pixels; as albedo the geometric mean of
// the map's and of the surface's own per area as the wall sees it, smoothed, for neighbouring amplitudes may make up for each
// other: volume and surface err in different ways. One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uvec4 pixels[]; };
layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
layout(std430, set = 0, binding = 3) readonly buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 4) readonly buffer Slopes { vec2 slopes[]; };
layout(std430, set = 0, binding = 5) buffer Columns { vec4 columns[]; };

#include "heights.glsl"

// A Gaussian of 0.7 pixels, at the sides and at the corners.
const float SIDE = 0.36044779;
const float CORNER = 0.12992261;

float seen(uint pixel) { return heights[pixel].y * -facing(slopes[pixel]).z; }

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    float around = seen(pixel);
    for (uint k = 0u; k < 8u; ++k) {
        uint other = neighbour(pixel, k);
        bool corner = AROUND[k].x != 0 && AROUND[k].y != 0;
        if (other != NOWHERE) around += (corner ? CORNER : SIDE) * seen(other);
    }
    around /= 1.0 + 4.0 * (SIDE + CORNER);
    uint column = pixels[pixel].x;
    columns[2u * column] = vec4(sqrt(uintBitsToFloat(pixels[pixel].y) * around), heights[pixel].x, 0.0, 1.0);
    columns[2u * column + 1u] = vec4(facing(slopes[pixel]), 0.0);
}
