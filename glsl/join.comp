// Adds the domain that was there before to a new one. One invocation owns one word of the mask, 32 voxels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer MaskBefore { uint before[]; };
layout(std430, set = 0, binding = 2) buffer Mask { uint mask[]; };

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= brick_count() * 16u) return;
    mask[at] |= before[at];
}
