// Moves the state of the paper's solver after a change of the domain: voxels that stay touched take their state from
// the old indices to the new ones, all others start at zero. DOUBLED: the old domain has half the lateral resolution,
// and state is interpolated (doubled.glsl), zero where nothing was touched. One invocation owns one voxel that is
// touched now. Writes `target`, which is copied back later, because other invocations still read the old indices.
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

vec4 coarse_at(uvec3 c) { return state_at(coarse_index(c)); }

#include "doubled.glsl"

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
