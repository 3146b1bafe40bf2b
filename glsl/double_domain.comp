// Domain of a finer grid: a voxel is active if its parent was. One invocation owns one word of the new mask. The
// scene is the new one; `coarse_mask` is in the old brick order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer CoarseMask { uint coarse_mask[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Mask { uint mask[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint word = 0u;
    for (uint i = 0u; i < 32u; ++i) {
        uvec3 c = voxel_at(at * 32u + i);
        if (!in_grid(c)) continue;
        uint index = coarse_index(parent_of(c));
        if ((coarse_mask[index >> 5] >> (index & 31u) & 1u) != 0u) word |= 1u << i;
    }
    mask[at] = word;
}
