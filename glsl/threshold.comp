// Domain reduction. A voxel becomes active if its smoothed albedo is above the given share of the maximum and not
// below the minimum that fits (room.comp), and if it is beyond the minimum depth and within reach of a bin. It may
// have been inactive before: smoothing lets the domain grow back a little, as in the paper. push.flags has the
// share's bits. Without a positive smoothed albedo there is no maximum: the domain stays unchanged if it has at most
// push.first voxels. Keeps the old mask and its ranks for moving state. Counts the voxels of each brick, as
// compact_count.comp does for other masks. One invocation owns one word of the mask, 32 voxels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 3) buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer Reachable { uint reachable[]; }; // by brick
layout(std430, set = 0, binding = 5) writeonly buffer MaskBefore { uint mask_before[]; };
layout(std430, set = 0, binding = 6) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 7) writeonly buffer RanksBefore { uint ranks_before[]; };
layout(std430, set = 0, binding = 8) writeonly buffer BrickOffsets { uint brick_offsets[]; };

shared uint voxels[WORKGROUP]; // of each word

uint kept(uint at) {
    float above = uintBitsToFloat(push.flags) * uintBitsToFloat(counts[COUNT_PEAK_SMOOTH]);
    float least = uintBitsToFloat(counts[COUNT_LEAST_SMOOTH]);
    uint word = 0u;
    for (uint i = 0u; reachable[at >> 4] != 0u && i < 32u; ++i) {
        uint index = at * 32u + i;
        uvec3 c = voxel_at(index);
        if (in_grid(c) && c.z >= scene.near_z && source[index] > above && source[index] >= least) word |= 1u << i;
    }
    return word;
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint at = group_index() * WORKGROUP + lane;
    bool owned = at < brick_count() * 16u;
    uint word = 0u;
    if (owned) {
        mask_before[at] = mask[at];
        ranks_before[at] = ranks[at];
        bool stays = counts[COUNT_PEAK_SMOOTH] == 0u && counts[COUNT_ACTIVE] <= push.first;
        word = stays ? mask[at] : kept(at);
        mask[at] = word;
    }
    voxels[lane] = bitCount(word);
    barrier();
    if (!owned || lane % 16u != 0u) return;
    uint sum = 0u;
    for (uint i = 0u; i < 16u; ++i) sum += voxels[lane + i];
    brick_offsets[at >> 4] = sum;
}
