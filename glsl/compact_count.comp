// Compaction, step 1 of 3: counts the set voxels of each brick, unless threshold.comp did. One invocation owns one
// brick, 16 words of the mask.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) writeonly buffer BrickOffsets { uint brick_offsets[]; };

void main() {
    uint brick = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (brick >= brick_count()) return;
    uint sum = 0u;
    for (uint i = 0u; i < 16u; ++i) sum += bitCount(mask[brick * 16u + i]);
    brick_offsets[brick] = sum;
}
