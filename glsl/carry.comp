// Moves the state of the paper's solver after a change of the domain: voxels that remain touched keep their state
// under new indices, others start at zero. DOUBLED: the old domain has half the lateral resolution, and state is
// interpolated, zero for untouched voxels. One invocation owns one touched voxel of the new domain. Writes `target`,
// copied back later, because other invocations still read the old indices.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint CONTINUOUS = 1u;
layout(constant_id = 11) const uint DOUBLED = 0u;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer MaskBefore { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer RanksBefore { uint ranks[]; };
layout(std430, set = 0, binding = 5) readonly buffer RimBefore { uint rim_mask[]; };
layout(std430, set = 0, binding = 6) readonly buffer RimRanksBefore { uint rim_ranks[]; };
layout(std430, set = 0, binding = 7) readonly buffer Source { vec4 source[]; };
layout(std430, set = 0, binding = 8) writeonly buffer Target { vec4 carried[]; };

#include "slots.glsl"
#include "touched.glsl"

vec4 state_at(uint index) {
    uint at = state_of(index);
    return at == NOWHERE ? vec4(0.0) : source[at];
}

// Linear along x and y, cell-centred (weights 1/4 and 3/4, clamped at the grid's edges).
vec4 doubled(uvec3 c) {
    ivec3 last = ivec3(grid_size()) / ivec3(2, 2, 1) - 1;
    uvec3 parent = parent_of(c);
    // The other parent is on this child's side of its own parent.
    uvec2 other = uvec2(clamp(ivec2(parent.xy) + ivec2(c.xy & 1u) * 2 - 1, ivec2(0), last.xy));
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        uvec2 take = uvec2(i, i >> 1) & 1u;
        vec2 weights = mix(vec2(0.75), vec2(0.25), vec2(take));
        sum += weights.x * weights.y * state_at(coarse_index(uvec3(parent.xy + take * (other - parent.xy), c.z)));
    }
    return sum;
}

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= counts[COUNT_TOUCHED]) return;
    uint index = active_voxels[at];
    if (DOUBLED == 0u) {
        carried[at] = state_at(index);
        return;
    }
    carried[at] = doubled(voxel_at(index));
}
