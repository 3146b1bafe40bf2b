// Compaction, step 3 of 3: writes the list of set voxels in storage order (bricks, Morton order inside), up to the
// room, and the slot offset of each word of the mask. The rim follows the active voxels. One invocation owns one word
// of the mask.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint RIM = 0u;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) readonly buffer BrickOffsets { uint brick_offsets[]; };
layout(std430, set = 0, binding = 3) writeonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 5) readonly buffer Counts { uint counts[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint word = mask[at];
    uint room = RIM == 0u ? scene.capacity : scene.touched_capacity;
    uint offset = brick_offsets[at >> 4] + (RIM == 0u ? 0u : counts[COUNT_ACTIVE]);
    for (uint i = at & ~15u; i < at; ++i) offset += bitCount(mask[i]);
    ranks[at] = offset;
    for (uint i = 0u; i < 32u; ++i) {
        if ((word >> i & 1u) == 0u) continue;
        if (offset < room) active_voxels[offset] = at * 32u + i;
        ++offset;
    }
}
