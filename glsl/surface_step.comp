// One step of Adam (Kingma & Ba 2015) for a pixel's depth and albedo; the rate decays to zero as half a cosine. The
// gradient is averaged (surface_pull.comp) by an edge-stopping Gaussian that narrows to the pixel itself: shapes come
// before details. From then on it is the pixel's own (pull.glsl). One invocation, or several, own one pixel
// (pixel_lanes.glsl). The last workgroup to finish closes the iteration (finish.glsl): it sums results of earlier dispatches; the faults are of all
// workgroups. The scene is that of the compared pairs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "sums.glsl"
layout(std430, set = 0, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, set = 0, binding = 8) buffer Heights { vec2 heights[]; };
layout(std430, set = 0, binding = 5) readonly buffer SurfaceWeights { float surface_weights[]; };
layout(std430, set = 0, binding = 6) buffer HeightMoments { vec4 height_moments[]; }; // xy first, zw second
layout(std430, set = 0, binding = 7) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 9) readonly buffer HeightPull { vec4 height_pull[]; };
layout(std430, set = 0, binding = 10) readonly buffer LossPartials { vec2 loss_partials[]; };
layout(std430, set = 0, binding = 11) readonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 12) writeonly buffer Trace { uint trace[]; };

#include "heights.glsl"
#include "neighbours.glsl"
#include "pixel_lanes.glsl"
#include "pull.glsl"
#include "faults.glsl"
#include "finish.glsl"

const float BETA_1 = 0.9;
const float BETA_2 = 0.99;
const float LAST_RATE = 0.02; // share of the initial rate
const float QUIET = 1e-3;     // share of the largest gradient: smaller ones may be rounding errors and cause no full step
const float LEAST = 1e-18;    // its square is about the smallest normal fp32 value

// 1 / (1 - (1 - rest)^age), which takes the bias off a moment: 1 - a b = (1 - a) + (1 - b) - (1 - a)(1 - b), so that nothing
// is lost near one.
float unbias(float rest, uint age) {
    float all = 0.0;
    for (; age > 0u; age >>= 1u) {
        if ((age & 1u) != 0u) all += rest - all * rest;
        rest *= 2.0 - rest;
    }
    return 1.0 / all;
}

// The part of one of the pixel's lanes.
vec2 from_around(uint pixel, float sigma) {
    int reach = reach_of(sigma);
    uint layer = layer_start(pixel);
    ivec2 centre = pixel_xy(pixel);
    float depth = height_pull[pixels[pixel]].z;
    vec2 sum = vec2(0.0);
    for (int x = int(gl_LocalInvocationID.y) - reach; x <= reach; x += int(PIXEL_LANES)) {
        for (int y = -reach; y <= reach; ++y) {
            uint column = column_at(layer, centre + ivec2(x, y));
            if (column == NOWHERE) continue;
            // Columns without a pixel are zero.
            vec4 other = height_pull[column];
            sum += bond(ivec2(x, y), 0.5 / (sigma * sigma), other.z - depth) * other.xy;
        }
    }
    return sum;
}

// The part of the pixel's gradient from one of its lanes.
vec2 gradient_of(uint pixel) {
    float sigma = spread_at(surface_weights[SURFACE_SPREAD], push.step, surface_weights[SURFACE_ITERATIONS]);
    return sigma > 0.0 ? from_around(pixel, sigma) : pulled(pixel);
}

void make_step(uint pixel, vec2 g) {
    float iterations = surface_weights[SURFACE_ITERATIONS];
    vec4 moments = height_moments[pixel];
    vec2 first = mix(g, moments.xy, BETA_1);
    vec2 second = mix(g * g, moments.zw, BETA_2);
    height_moments[pixel] = vec4(first, second);
    float rate = 0.5 * (1.0 + cos(3.14159265 * float(push.step - 1u) / iterations)) + LAST_RATE;
    vec2 largest = vec2(surface_weights[SURFACE_LARGEST], surface_weights[SURFACE_LARGEST + 1u]);
    uint age = push.step - uint(surface_weights[SURFACE_RESTED]);
    vec2 scale = sqrt(second * unbias(1.0 - BETA_2, age));
    vec2 step = first * unbias(1.0 - BETA_1, age) / max(scale, max(QUIET * largest, vec2(LEAST)));
    vec2 height = heights[pixel] - rate * vec2(surface_weights[SURFACE_DEPTH_RATE], surface_weights[SURFACE_ALBEDO_RATE]) * step;
    vec2 limits = depth_limits();
    watch(finite(height.x + height.y), FAULT_UPDATE);
    heights[pixel] = vec2(clamp(height.x, limits.x, limits.y), max(height.y, 0.0));
}

shared bool is_last;

void main() {
    // Groups that only fill the last row of a dispatch (GROUPS_X) have no pixels. All lanes return together.
    if (group_index() * WORKGROUP >= push.last) return;
    uint pixel = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    bool owned = pixel < push.last;
    vec2 g = over_lanes(owned ? vec4(gradient_of(pixel), vec2(0.0)) : vec4(0.0)).xy;
    if (owned && gl_LocalInvocationID.y == 0u) make_step(pixel, g);
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        is_last = atomicAdd(counts[COUNT_ARRIVED], 1u) + 1u == (push.last + WORKGROUP - 1u) / WORKGROUP;
    }
    barrier();
    if (!is_last) return;
    memoryBarrierBuffer();
    vec3 sum = sum_of_partials();
    if (gl_LocalInvocationIndex != 0u) return;
    write_row(sum);
    counts[COUNT_ARRIVED] = 0u;
}
