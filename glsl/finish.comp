// Closes an iteration. One workgroup sums the partial losses in a fixed order (each lane strides, then a tree), writes
// the iteration's row of the trace, which the host reads later, and resets the maxima for the next iteration. With
// ACCELERATED it also decides the next extrapolation: FISTA's sequence (Beck & Teboulle 2009), restarted where the step
// goes against the momentum or the objective rose (O'Donoghue & Candes 2015). Where the objective rose by more than
// rounding, steps become shorter, down to the one that is proven safe.
// Where several devices share the pairs, one dispatch adds up the partial losses of a device (FINISH_ADD), then the devices
// exchange this one sum, and a second dispatch takes it for all (FINISH_ADDED).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "sums.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint ACCELERATED = 0u;
layout(constant_id = 11) const uint SUMMED = WORKGROUP; // voxels of one partial sum; 0: those of a workgroup of step.comp
layout(constant_id = 12) const uint GROUPED = 0u; // 1: one partial loss of a workgroup of residual.comp
layout(constant_id = 14) const uint ROWS = 0u;    // 1: one partial loss of a row of residual_rows.comp
#include "slices.glsl"
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) buffer LossPartials { vec2 loss_partials[]; };
layout(std430, set = 0, binding = 3) readonly buffer L1Partials { float l1_partials[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Trace { uint trace[]; };
layout(std430, set = 0, binding = 5) buffer Momentum { float momentum[]; };
layout(std430, set = 0, binding = 6) readonly buffer AgainstPartials { float against_partials[]; };

const float ROUNDING = 1e-5; // share of the objective: a smaller rise may be rounding

void main() {
    uint lane = gl_LocalInvocationID.x;
    vec4 sum = vec4(0.0);
    uint tile = WORKGROUP * RESIDUAL_BINS;
    uint losses = (cell_count() + tile - 1u) / tile * (GROUPED != 0u ? 1u : WORKGROUP);
    if (ROWS != 0u) losses = scene.pairs;
    if ((push.flags & FINISH_ADDED) != 0u) losses = 1u;
    // Unrolled 32 times: otherwise lavapipe's limit of 65,535 loop turns would end the sum after 2^26 bins in total.
#define ADD(k) if (i + k * WORKGROUP < losses) sum.xy += loss_partials[i + k * WORKGROUP];
#define ADD_4(k) ADD((k)) ADD((k + 1u)) ADD((k + 2u)) ADD((k + 3u))
    uint summed = SUMMED == 0u ? samples_of_group(slices_of(counts[COUNT_ACTIVE])) : SUMMED;
    uint voxel_groups = (counts[COUNT_ACTIVE] + summed - 1u) / summed;
    for (uint i = lane; i < losses; i += 32u * WORKGROUP) {
        ADD_4(0u) ADD_4(4u) ADD_4(8u) ADD_4(12u) ADD_4(16u) ADD_4(20u) ADD_4(24u) ADD_4(28u)
    }
    for (uint i = lane; i < voxel_groups; i += WORKGROUP) {
        sum.z += l1_partials[i];
        if (ACCELERATED != 0u) sum.w += against_partials[i];
    }
    sum = sum_over_group(sum);
    if (lane != 0u) return;
    if ((push.flags & FINISH_ADD) != 0u) {
        loss_partials[0] = sum.xy;
        return;
    }
    float objective = sum.x * scene.loss_scale;
    uint row = push.iteration * TRACE_ROW;
    trace[row + TRACE_DATA] = floatBitsToUint(sum.y * scene.loss_scale);
    trace[row + TRACE_L1] = floatBitsToUint(sum.z);
    trace[row + TRACE_ACTIVE] = counts[COUNT_ACTIVE];
    trace[row + TRACE_PEAK] = counts[COUNT_PEAK_ALBEDO];
    trace[row + TRACE_OBJECTIVE] = floatBitsToUint(objective);
    trace[row + TRACE_FAULTS] = counts[COUNT_FAULTS];
    trace[row + TRACE_LEAST] = counts[COUNT_LEAST_SMOOTH];
    counts[COUNT_PEAK_ALBEDO] = 0u;
    if (ACCELERATED == 0u) return;
    objective += sum.z;
    float t = momentum[MOMENTUM_T];
    bool rose = objective > (1.0 + ROUNDING) * momentum[MOMENTUM_OBJECTIVE];
    bool restart = rose || sum.w > 0.0;
    if (rose) momentum[MOMENTUM_SHARE] = min(1.5 * momentum[MOMENTUM_SHARE], 1.0);
    if (restart) momentum[MOMENTUM_RESTARTS] += 1.0;
    float next = restart ? 1.0 : 0.5 + sqrt(0.25 + t * t);
    momentum[MOMENTUM_BETA] = restart ? 0.0 : (t - 1.0) / next;
    momentum[MOMENTUM_T] = next;
    momentum[MOMENTUM_OBJECTIVE] = objective;
    trace[row + TRACE_RESTARTS] = floatBitsToUint(momentum[MOMENTUM_RESTARTS]);
}
