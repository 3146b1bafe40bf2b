// End of an iteration: sums of partial losses, and the row of the trace, by one workgroup of 64 lanes. Needs
// grid.glsl, sums.glsl, and the buffers counts, loss_partials, l1_partials and trace.
layout(constant_id = 11) const uint SUMMED = WORKGROUP; // samples per partial sum
layout(constant_id = 14) const uint ROWS = 0u; // 1: one partial loss per row of residual_rows.comp, else per workgroup of residual.comp

// Objective, plain loss and L1 term as sums in a fixed order, for all lanes.
vec3 sum_of_partials() {
    uint lane = gl_LocalInvocationID.x;
    vec3 sum = vec3(0.0);
    uint tile = WORKGROUP * RESIDUAL_BINS;
    uint losses = ROWS != 0u ? scene.pairs : (cell_count() + tile - 1u) / tile;
    // Unrolled 32 times: otherwise lavapipe's limit of 65,535 loop turns would end the sum after 2^22 rows.
#define ADD(k) if (i + k * WORKGROUP < losses) sum.xy += loss_partials[i + k * WORKGROUP];
#define ADD_4(k) ADD((k)) ADD((k + 1u)) ADD((k + 2u)) ADD((k + 3u))
    uint sample_groups = (counts[COUNT_ACTIVE] + SUMMED - 1u) / SUMMED;
    for (uint i = lane; i < losses; i += 32u * WORKGROUP) {
        ADD_4(0u) ADD_4(4u) ADD_4(8u) ADD_4(12u) ADD_4(16u) ADD_4(20u) ADD_4(24u) ADD_4(28u)
    }
    for (uint i = lane; i < sample_groups; i += WORKGROUP) sum.z += l1_partials[i];
    return sum_over_group(sum);
}

// Writes the iteration's row of the trace, and resets the maximum. Single lane.
void write_row(vec3 sum) {
    uint row = push.iteration * TRACE_ROW;
    trace[row + TRACE_DATA] = floatBitsToUint(sum.y * scene.loss_scale);
    trace[row + TRACE_L1] = floatBitsToUint(sum.z);
    trace[row + TRACE_ACTIVE] = counts[COUNT_ACTIVE];
    trace[row + TRACE_PEAK] = counts[COUNT_PEAK_ALBEDO];
    trace[row + TRACE_OBJECTIVE] = floatBitsToUint(sum.x * scene.loss_scale);
    // Includes faults found by other workgroups of the same dispatch.
    trace[row + TRACE_FAULTS] = atomicOr(counts[COUNT_FAULTS], 0u);
    trace[row + TRACE_LEAST] = counts[COUNT_LEAST_SMOOTH];
    counts[COUNT_PEAK_ALBEDO] = 0u;
}
