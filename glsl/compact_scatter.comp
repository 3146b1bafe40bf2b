// Compaction, step 3 of 3: writes the list of set voxels in storage (brick, Morton) order, and for the active
// list where each voxel stands in it. One invocation owns one word of the mask.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint WRITE_SLOTS = 1u;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) readonly buffer BrickOffsets { uint brick_offsets[]; };
layout(std430, set = 0, binding = 3) writeonly buffer List { uint list[]; };
layout(std430, set = 0, binding = 4) writeonly buffer SlotOf { uint slot_of[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint word = mask[at];
    if (word == 0u && WRITE_SLOTS == 0u) return;
    uint offset = brick_offsets[at >> 4];
    for (uint i = at & ~15u; i < at; ++i) offset += bitCount(mask[i]);
    for (uint i = 0u; i < 32u; ++i) {
        uint index = at * 32u + i;
        bool set = (word >> i & 1u) != 0u;
        if (WRITE_SLOTS != 0u) slot_of[index] = set ? offset : NOWHERE;
        if (set) list[offset++] = index;
    }
}
