// Moves the state of the vector solver after a change of the domain: voxels that stay active take their vectors and
// bounds from the old slots to the new ones, all others start at zero. The momentum is then at rest (v before = v).
// DOUBLED: the old domain has larger voxels, and vectors are interpolated (doubled.glsl), zero where
// nothing was active. One invocation owns one voxel that is active now. Writes `before` and `gradient`, which
// points.comp copies back, because other invocations still read the old slots.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint DOUBLED = 0u;
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer MaskBefore { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer RanksBefore { uint ranks[]; };
layout(std430, set = 0, binding = 5) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 6) readonly buffer Bounds { vec2 bounds[]; }; // D, lambda
layout(std430, set = 0, binding = 7) writeonly buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 8) writeonly buffer Gradient { vec2 kept_bounds[]; };

#include "slots.glsl"

vec4 coarse_at(uvec3 c) {
    uint slot = slot_of(coarse_index(c));
    return slot == NOWHERE ? vec4(0.0) : raw[slot];
}

#include "doubled.glsl"

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= counts[COUNT_ACTIVE]) return;
    uint index = active_voxels[at];
    if (DOUBLED == 0u) {
        uint slot = slot_of(index);
        before[at] = slot == NOWHERE ? vec4(0.0) : raw[slot];
        kept_bounds[at] = slot == NOWHERE ? vec2(0.0) : bounds[slot];
        return;
    }
    before[at] = doubled(voxel_at(index));
    kept_bounds[at] = vec2(0.0);
}
