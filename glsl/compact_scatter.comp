// Compaction, step 3 of 3: writes the list of set voxels in storage (brick, Morton) order, as far as there is room, and
// for the active list how many are set before each word of the mask. One invocation owns one word of the mask.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint WRITE_RANKS = 1u;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) readonly buffer BrickOffsets { uint brick_offsets[]; };
layout(std430, set = 0, binding = 3) writeonly buffer List { uint list[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Ranks { uint ranks[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint word = mask[at];
    if (word == 0u && WRITE_RANKS == 0u) return;
    uint offset = brick_offsets[at >> 4];
    for (uint i = at & ~15u; i < at; ++i) offset += bitCount(mask[i]);
    if (WRITE_RANKS != 0u) ranks[at] = offset;
    for (uint i = 0u; i < 32u; ++i) {
        if ((word >> i & 1u) == 0u) continue;
        if (offset < scene.capacity) list[offset] = at * 32u + i;
        ++offset;
    }
}
