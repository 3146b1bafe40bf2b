// Slopes of a pixel, and its points as samples that share its light. A pixel represents its tilted square, whose
// paths span several bins if the pixel is large. One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
#include "largest.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint POINTS = 4u; // of a pixel: 4 or 1
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 4) readonly buffer Stencils { vec2 stencils[]; };
layout(std430, set = 0, binding = 5) writeonly buffer Slopes { vec2 slopes[]; };
layout(std430, set = 0, binding = 6) writeonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 7) writeonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 8) buffer Counts { uint counts[]; };

#include "heights.glsl"
#include "neighbours.glsl"
#include "faults.glsl"

// Writes the samples of a pixel. Returns their albedo.
float write_points(uint pixel) {
    vec2 height = heights[pixel];
    vec2 slope = vec2(0.0);
    for (uint k = 0u; k < 8u; ++k) {
        uint other = neighbour(pixel, k);
        if (other != NOWHERE) slope += stencils[8u * pixel + k] * (heights[other].x - height.x);
    }
    slopes[pixel] = slope;
    float albedo = height.y * stretch(slope) / float(POINTS);
    vec2 limits = depth_limits();
    vec3 centre = position(vec3(pixel_xy(pixel), 0.0));
    for (uint k = 0u; k < POINTS; ++k) {
        vec2 d = part(k, POINTS);
        float z = clamp(height.x + dot(slope, d), limits.x, limits.y);
        uint slot = POINTS * pixel + k;
        sample_points[slot] = vec4(centre.xy + d, z, albedo);
        // Unit length: a dark pixel keeps its direction, and with it a gradient that can light it again.
        if (NORMALS) sample_normals[slot] = vec4(facing(slope), 0.0);
    }
    watch(finite(slope.x + slope.y + albedo), FAULT_SAMPLE);
    return albedo;
}

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    float albedo = pixel < push.last ? write_points(pixel) : 0.0;
    // For the fixed-point scale.
    uint peak = largest_of_group(vec2(albedo, 0.0)).x;
    if (gl_LocalInvocationID.x == 0u) atomicMax(counts[COUNT_PEAK_ALBEDO], peak);
}
