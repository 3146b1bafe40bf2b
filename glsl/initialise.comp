// Initial domain of the paper's solver: all voxels beyond the minimum depth and within reach of a bin. One invocation
// owns one word of the mask, 32 voxels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) writeonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) readonly buffer Reachable { uint reachable[]; }; // by brick

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint word = 0u;
    for (uint i = 0u; reachable[at >> 4] != 0u && i < 32u; ++i) {
        uvec3 c = voxel_at(at * 32u + i);
        if (in_grid(c) && c.z >= scene.near_z) word |= 1u << i;
    }
    mask[at] = word;
}
