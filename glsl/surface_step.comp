// A pixel's depth and amplitude after a step of Adam (Kingma & Ba 2015) whose rate falls to nothing as half a cosine. The
// gradient of the depth takes in what all slopes that come from it are told (surface_combine.comp), through the very
// coefficients that they come by. One invocation owns one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uvec4 pixels[]; };
layout(std430, set = 0, binding = 2) readonly buffer PixelOf { uint pixel_of[]; };
layout(std430, set = 0, binding = 3) buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 4) readonly buffer Stencils { vec2 stencils[]; };
layout(std430, set = 0, binding = 5) readonly buffer HeightGradient { vec4 height_gradient[]; };
layout(std430, set = 0, binding = 6) readonly buffer SurfaceWeights { float surface_weights[]; };
layout(std430, set = 0, binding = 7) buffer HeightMoments { vec4 height_moments[]; }; // first ones, second ones
layout(std430, set = 0, binding = 8) buffer Counts { uint counts[]; };

#include "heights.glsl"
#include "faults.glsl"

const float BETA_1 = 0.9;
const float BETA_2 = 0.99;
const float LAST_RATE = 0.02; // of the first
const float QUIET = 1e-3;     // of the largest gradient: what is less is rounding, and makes no full step
const float LEAST = 1e-18;    // its square is the least that fp32 holds

void main() {
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pixel >= push.last) return;
    vec4 own = height_gradient[pixel];
    vec2 g = own.zw;
    for (uint k = 0u; k < 8u; ++k) {
        uint other = neighbour(pixel, k);
        if (other == NOWHERE) continue;
        g.x += dot(stencils[8u * other + 7u - k], height_gradient[other].xy) - dot(stencils[8u * pixel + k], own.xy);
    }
    vec4 moments = height_moments[pixel];
    vec2 first = mix(g, moments.xy, BETA_1);
    vec2 second = mix(g * g, moments.zw, BETA_2);
    height_moments[pixel] = vec4(first, second);
    float done = float(push.step - 1u) / surface_weights[SURFACE_ITERATIONS];
    float rate = 0.5 * (1.0 + cos(3.14159265 * done)) + LAST_RATE;
    float age = float(push.step);
    vec2 largest = vec2(surface_weights[SURFACE_LARGEST], surface_weights[SURFACE_LARGEST + 1u]);
    vec2 scale = sqrt(second / (1.0 - pow(BETA_2, age)));
    vec2 step = first / (1.0 - pow(BETA_1, age)) / max(scale, max(QUIET * largest, vec2(LEAST)));
    vec2 height = heights[pixel] - rate * vec2(surface_weights[SURFACE_DEPTH_RATE], surface_weights[SURFACE_AMPLITUDE_RATE]) * step;
    vec2 limits = depth_limits();
    watch(finite(height.x + height.y), FAULT_UPDATE);
    heights[pixel] = vec2(clamp(height.x, limits.x, limits.y), max(height.y, 0.0));
}
