// Draws the sample of each active voxel, interpolates the raw variables there and writes the surface element seen by
// every pair. One invocation owns one active voxel. This is done once per voxel and iteration, so the forward and
// backward kernels read two vec4 instead of looking up eight voxels in the masks. The workgroup sums |albedo| for the
// L1 term in a fixed order and records the maximum for the fixed-point scale.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
layout(constant_id = 10) const uint CONTINUOUS = 1u;
#include "grid.glsl"
#include "random.glsl"
#include "sampling.glsl"
#include "surface.glsl"
#include "reflectance.glsl"
#include "largest.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 4) writeonly buffer SamplePoints { vec4 sample_points[]; };    // xyz, albedo
layout(std430, set = 0, binding = 5) writeonly buffer SampleNormals { vec4 sample_normals[]; }; // unit normal, length before
layout(std430, set = 0, binding = 6) writeonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 7) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 8) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 9) readonly buffer RimMask { uint rim_mask[]; };
layout(std430, set = 0, binding = 10) readonly buffer RimRanks { uint rim_ranks[]; };

#include "sums.glsl"
#include "faults.glsl"
#include "slots.glsl"
#include "touched.glsl"

// Raw variables of a voxel, zero without room for its state.
vec4 raw_at(uvec3 c) {
    uint at = state_of(voxel_index(c));
    return at == NOWHERE ? vec4(0.0) : raw[at];
}

vec4 interpolate(vec3 g) {
    uvec3 last = grid_size() - 1u;
    uvec3 c0 = min(uvec3(g), last);
    uvec3 c1 = min(c0 + 1u, last);
    vec3 f = g - vec3(c0);
    vec4 s00 = mix(raw_at(c0), raw_at(uvec3(c1.x, c0.yz)), f.x);
    vec4 s10 = mix(raw_at(uvec3(c0.x, c1.y, c0.z)), raw_at(uvec3(c1.xy, c0.z)), f.x);
    vec4 s01 = mix(raw_at(uvec3(c0.xy, c1.z)), raw_at(uvec3(c1.x, c0.y, c1.z)), f.x);
    vec4 s11 = mix(raw_at(uvec3(c0.x, c1.yz)), raw_at(c1), f.x);
    return mix(mix(s00, s10, f.y), mix(s01, s11, f.y), f.z);
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint group = group_index();
    // Groups that only fill the last row of a dispatch (GROUPS_X) have no partial sum. All lanes return together.
    if (group * WORKGROUP >= counts[COUNT_ACTIVE]) return;
    uint slot = group * WORKGROUP + lane;
    float magnitude = 0.0;
    if (slot < counts[COUNT_ACTIVE]) {
        uint index = active_voxels[slot];
        uvec3 c = voxel_at(index);
        vec3 g = sample_point(c, index);
        vec4 v = CONTINUOUS == 0u ? raw[slot] : interpolate(g);
        float albedo = elu(v.x);
        vec3 u = toward_wall(v.yzw);
        float length_u = safe_length(u);
        sample_points[slot] = vec4(position(g), albedo);
        if (NORMALS) sample_normals[slot] = vec4(u / length_u, length_u);
        magnitude = abs(albedo);
        watch(finite(v.x + v.y + v.z + v.w), FAULT_SAMPLE);
    }
    float sum = sum_over_group(vec3(magnitude)).x;
    // For the fixed-point scale.
    uint peak = largest_of_group(vec2(magnitude, 0.0)).x;
    if (lane == 0u) {
        l1_partials[group] = sum;
        atomicMax(counts[COUNT_PEAK_ALBEDO], peak);
    }
}
