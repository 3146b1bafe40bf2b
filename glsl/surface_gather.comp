// Gradient at a point of the surface, gathered over pairs (slope.glsl): by its vector (or albedo) and by its depth.
// Depth moves the point's path along the residual's slope and changes the point's value. Writes (d/d vector, d/d
// depth), or (d/d albedo, d/d depth, 0, 0) for surfaces without normals. One or several lanes own a point
// (slices.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
const uint SPLIT = 1u;
const uint EXACT = 1u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 3) readonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 6) buffer Gradient { vec4 gradient[]; };

#include "seats.glsl"
#define OWN_MEET
#include "slope.glsl"
#include "faults.glsl"

float deeper = 0.0; // d/d depth through the value at unit albedo
float longer = 0.0; // d/d depth through the path, bins

void meet(Arm a, Arm b, vec2 r) {
    slope_of(a, b, r.x);
    float toward_a = NORMALS ? dot(normal, a.way) : 1.0;
    float toward_b = REFLECTANCE == LAMBERTIAN ? dot(normal, b.way) : 1.0;
    if (toward_a <= 0.0 || toward_b <= 0.0) return;
    float steep_a = a.way.z * a.inverse;
    float steep_b = b.way.z * b.inverse;
    // Angle-independent part of the value; each inverse length increases by `steep` times itself.
    float factor = a.falloff * b.falloff;
    float powers_a = REFLECTANCE == RETROREFLECTIVE ? 1.0 : 2.0;
    float powers_b = powers_a;
    float value = factor;
    float turns = 0.0;
    if (REFLECTANCE == COSINE) {
        factor *= a.inverse;
        powers_a += 1.0;
        value = factor * toward_a;
        turns = -factor * normal.z;
    } else if (REFLECTANCE == LAMBERTIAN) {
        float both = a.inverse * b.inverse;
        factor *= both * both;
        powers_a += 2.0;
        powers_b += 2.0;
        float walls = a.wall * b.wall;
        if (walls <= 0.0) return;
        float cosines = toward_a * toward_b;
        value = factor * walls * cosines;
        turns = factor * (cosines * (a.wall_rise * b.wall + b.wall_rise * a.wall) - walls * normal.z * (toward_a + toward_b));
    }
    float grows = powers_a * (steep_a * a.inverse) + powers_b * (steep_b * b.inverse);
    deeper += r.x * (value * grows + turns);
    longer -= r.y * value * (steep_a + steep_b);
}

void main() {
    Seat seat = seat_of(counts[COUNT_ACTIVE]);
    uint slot = seat.slot;
    bool owned = slot < counts[COUNT_ACTIVE];
    vec4 point = owned ? sample_points[slot] : vec4(0.0);
    vec3 own = NORMALS && owned ? sample_normals[slot].xyz : vec3(0.0, 0.0, -1.0);
    vec4 sum = owned ? gather_slope(point.xyz, own, seat.slice, seat.slices) : vec4(0.0);
    deeper = point.w * (deeper + scene.bins_per_metre * longer);
    sum = together(seat, NORMALS ? vec4(sum.yzw, deeper) : vec4(sum.x, deeper, 0.0, 0.0));
    if (seat.slice != 0u || !owned) return;
    if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += gradient[slot];
    watch(finite(sum.x + sum.y + sum.z + sum.w), FAULT_BACKWARD);
    gradient[slot] = sum;
}
