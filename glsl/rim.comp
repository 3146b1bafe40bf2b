// Rim: inactive voxels among the 26 neighbours of an active voxel, which its samples may read. One invocation owns
// one word of the result; a word of 32 Morton-ordered voxels is a 4 x 4 x 2 block of a brick.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) writeonly buffer RimMask { uint rim_mask[]; };

bool active_at(uvec3 c) {
    uint index = voxel_index(c);
    return (mask[index >> 5] >> (index & 31u) & 1u) != 0u;
}

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    uint active_here = mask[at];
    uint word = active_here;
    if (word != 0xffffffffu) {
        // Only active voxels within one voxel of this block can touch it.
        ivec3 corner = ivec3(voxel_at(at * 32u));
        ivec3 low = max(corner - 1, ivec3(0));
        ivec3 high = min(corner + ivec3(4, 4, 2), ivec3(grid_size()) - 1);
        for (int z = low.z; z <= high.z; ++z) {
            for (int y = low.y; y <= high.y; ++y) {
                for (int x = low.x; x <= high.x; ++x) {
                    if (!active_at(uvec3(x, y, z))) continue;
                    ivec3 from = max(ivec3(x, y, z) - 1, corner);
                    ivec3 to = min(min(ivec3(x, y, z) + 1, corner + ivec3(3, 3, 1)), ivec3(grid_size()) - 1);
                    for (int k = from.z; k <= to.z; ++k) {
                        for (int j = from.y; j <= to.y; ++j) {
                            for (int i = from.x; i <= to.x; ++i) word |= 1u << (voxel_index(uvec3(i, j, k)) & 31u);
                        }
                    }
                }
            }
        }
    }
    rim_mask[at] = word & ~active_here;
}
