// One workgroup closes an iteration: sums the partial losses in a fixed order (each lane strides, then a
// tree), writes the iteration's row of the trace that the host reads behind, and resets what the next
// iteration maximises.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer LossPartials { float loss_partials[]; };
layout(std430, set = 0, binding = 3) readonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Trace { uint trace[]; };

shared vec2 sums[WORKGROUP];

void main() {
    uint lane = gl_LocalInvocationID.x;
    vec2 sum = vec2(0.0);
    uint loss_groups = (scene.pairs * scene.bins + WORKGROUP - 1u) / WORKGROUP;
    uint l1_groups = (counts[COUNT_ACTIVE] + WORKGROUP - 1u) / WORKGROUP;
    for (uint i = lane; i < loss_groups; i += WORKGROUP) sum.x += loss_partials[i];
    for (uint i = lane; i < l1_groups; i += WORKGROUP) sum.y += l1_partials[i];
    sums[lane] = sum;
    barrier();
    for (uint stride = WORKGROUP / 2u; stride > 0u; stride >>= 1) {
        if (lane < stride) sums[lane] += sums[lane + stride];
        barrier();
    }
    if (lane != 0u) return;
    uint row = push.iteration * TRACE_ROW;
    trace[row + TRACE_DATA] = floatBitsToUint(sums[0].x * scene.loss_scale);
    trace[row + TRACE_L1] = floatBitsToUint(sums[0].y);
    trace[row + TRACE_ACTIVE] = counts[COUNT_ACTIVE];
    trace[row + TRACE_PEAK] = counts[COUNT_PEAK_ALBEDO];
    counts[COUNT_PEAK_ALBEDO] = 0u;
}
