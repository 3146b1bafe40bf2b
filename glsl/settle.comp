// After a change of the domain: what is not active holds nothing, and the momentum rests (v before = v). One
// invocation owns one voxel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 2) buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Momentum { float momentum[]; };

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (index >= brick_count() * 512u) return;
    if (index == 0u) {
        momentum[MOMENTUM_T] = 1.0;
        momentum[MOMENTUM_BETA] = 0.0;
        momentum[MOMENTUM_OBJECTIVE] = uintBitsToFloat(0x7f800000u);
    }
    if ((mask[index >> 5] >> (index & 31u) & 1u) == 0u) raw[index] = vec4(0.0);
    before[index] = raw[index];
}
