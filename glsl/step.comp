// Backward pass and proximal gradient step in one: a lane owns one active voxel, gathers its gradient over the
// pairs as in backward.comp, and writes the next iterate. The gradient never leaves registers.
//   v' = shrink(cone(y - g / D), lambda / D)
// D majorises the operator (bound.comp), so a step of 1 / D does not overshoot, unless it turns a vector across the
// edge where a cosine starts. Steps divide by a share of D, kept by finish.comp: it stays small while the objective
// falls. shrink is the group soft threshold on |v|; cone keeps surfaces facing the wall: v_z <= 0, |v_xy| <= cone
// |v_z|. In this order they are the proximal map of both together: the cone shortens the vector first, the threshold
// applies to the rest.
// Surfaces without normals are vectors along -z: for them the cone keeps albedo from going below zero.
// Sums begin with the gradient of the roughness, written by extrapolate.comp. Partial sums: group term and roughness
// at y, and (y - v') . (v' - v), which is positive where the momentum leads uphill.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(constant_id = 12) const uint SPLIT = 1u;
layout(constant_id = 13) const uint EXACT = 1u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 3) readonly buffer SampleNormals { vec4 sample_normals[]; }; // y, its roughness
layout(std430, set = 0, binding = 6) buffer Gradient { vec4 gradient[]; };
layout(std430, set = 0, binding = 8) readonly buffer Bounds { vec2 bounds[]; }; // D, lambda
layout(std430, set = 0, binding = 9) buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 10) buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 13) readonly buffer Momentum { float momentum[]; };
layout(std430, set = 0, binding = 11) writeonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 12) writeonly buffer AgainstPartials { float against_partials[]; };

#include "seats.glsl"
#include "slope.glsl"
#include "faults.glsl"

// Nearest point of the cone v_z <= 0, |v_xy| <= cone * |v_z|.
vec3 into_cone(vec3 v) {
    float across = length(v.xy);
    float along = -v.z;
    if (across <= scene.cone * along) return v;
    float at = (along + scene.cone * across) / (1.0 + scene.cone * scene.cone);
    if (at <= 0.0) return vec3(0.0);
    return vec3(v.xy * (scene.cone * at / across), -at);
}

vec3 shrink(vec3 v, float by) {
    float size = length(v);
    return size <= by ? vec3(0.0) : v * (1.0 - by / size);
}

// The sum over the samples of a workgroup in a fixed order, for its first lane.
vec2 sum_of_samples(Seat seat, vec2 told) {
    // The lanes may still read the gradient's parts.
    if (SLICES > 1u) barrier();
    if (seat.slice == 0u) parts[seat.own] = vec4(told, 0.0, 0.0);
    barrier();
    vec2 all = vec2(0.0);
    if (SLICES == 1u) {
        // Barriers cost a CPU more than a loop.
        if (seat.own != 0u) return all;
        for (uint i = 0u; i < VOXELS; ++i) all += parts[i].xy;
        return all;
    }
    for (uint n = seat.wide; n > 1u; n = (n + 1u) / 2u) {
        if (gl_LocalInvocationIndex < n / 2u) parts[gl_LocalInvocationIndex] += parts[gl_LocalInvocationIndex + (n + 1u) / 2u];
        barrier();
    }
    return parts[0].xy;
}

void main() {
    Seat seat = seat_of(counts[COUNT_ACTIVE]);
    uint group = group_index();
    // Groups that only fill the last row of a dispatch (GROUPS_X) have no partial sums. All lanes leave together.
    if (group * seat.wide >= counts[COUNT_ACTIVE]) return;
    uint slot = seat.slot;
    bool owned = slot < counts[COUNT_ACTIVE];
    vec4 point = owned ? sample_points[slot] : vec4(0.0);
    vec3 y = NORMALS ? (owned ? sample_normals[slot].xyz : vec3(0.0)) : vec3(0.0, 0.0, -point.w);
    // A zero vector has no direction: it may grow toward the wall.
    vec3 seen = y == vec3(0.0) ? vec3(0.0, 0.0, -1.0) : y;
    vec4 sum = together(seat, owned ? gather_slope(point.xyz, seen, seat.slice, seat.slices) : vec4(0.0));
    vec2 told = vec2(0.0);
    if (seat.slice == 0u && owned) {
        if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += gradient[slot];
        if ((push.flags & BACKWARD_FINISH) == 0u) {
            gradient[slot] = sum;
        } else {
            vec2 bound = bounds[slot] * vec2(momentum[MOMENTUM_SHARE], 1.0);
            vec3 v = raw[slot].xyz;
            vec3 g = NORMALS ? sum.yzw : vec3(0.0, 0.0, -sum.x);
            float rough = NORMALS ? sample_normals[slot].w : sum.y;
            vec3 next = bound.x > 0.0 ? shrink(into_cone(y - g / bound.x), bound.y / bound.x) : vec3(0.0);
            told = vec2(bound.y * length(y) + rough, bound.x * dot(y - next, next - v));
            bool given = finite(g.x + g.y + g.z);
            watch(given, FAULT_BACKWARD);
            watch(!given || finite(next.x + next.y + next.z + told.x + told.y), FAULT_UPDATE);
            before[slot] = vec4(v, 0.0);
            raw[slot] = vec4(next, 0.0);
        }
    }
    if ((push.flags & BACKWARD_FINISH) == 0u) return;
    vec2 all = sum_of_samples(seat, told);
    if (gl_LocalInvocationIndex != 0u) return;
    l1_partials[group] = all.x;
    against_partials[group] = all.y;
}
