// Albedo, depth and normal of each pixel of a layer, from push.first to push.last, written to the maps. One
// invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, set = 0, binding = 2) readonly buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 3) readonly buffer Slopes { vec2 slopes[]; };
layout(std430, set = 0, binding = 4) buffer Columns { vec4 columns[]; };

#include "heights.glsl"

void main() {
    uint pixel = push.first + group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    uint column = pixel_column(pixel);
    columns[2u * column] = vec4(heights[pixel].y, heights[pixel].x, 0.0, 1.0);
    columns[2u * column + 1u] = vec4(facing(slopes[pixel]), 0.0);
}
