// Takes a caller's counts as the measurement: the bins that are kept, pairs in the order of the model, scaled, without
// background. One invocation owns one measured value.
// push.first: first bin that is kept; push.step: bins that are kept; push.iteration: pairs; push.flags: the rows
// (lent.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "lent.glsl"
layout(local_size_x = 64) in;
// Bits of the factor, bits of what is taken off, then the caller's pair of every row.
layout(std430, set = 0, binding = 2) readonly buffer Rows { uint rows[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Measured { float measured[]; };

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    uint row = index / push.step;
    if (row >= push.iteration) return;
    float count = bin_of(rows[2u + row], push.first + index % push.step, row_of(push.flags));
    measured[index] = count * uintBitsToFloat(rows[0]) - uintBitsToFloat(rows[1]);
}
