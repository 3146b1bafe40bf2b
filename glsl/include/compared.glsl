// Rows that residual_rows.comp and residual_scan.comp compare with the measurement: their buffers, and what both
// kernels compute alike.
layout(constant_id = 13) const uint SEEN = 0u;    // 1: compare the output of pulse.comp or spot.comp
layout(constant_id = 14) const uint SPOT = 0u;    // 1: rendered pairs differ from measured ones: clear nothing
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer Measured { float measured[]; };
layout(std430, set = 0, binding = 3) buffer Residual { float residual[]; };
#ifdef ACCUMULATE_FIXED
layout(std430, set = 0, binding = 4) buffer Histograms { uvec2 histograms[]; };
#else
layout(std430, set = 0, binding = 4) buffer Histograms { float histograms[]; };
#endif
layout(std430, set = 0, binding = 5) buffer LossPartials { vec2 loss_partials[]; }; // objective, plain
// By bin: root of its weight; elimination of the smoother: inverse of the pivot, that times kappa; slow_decay to the power of
// the bin's number. The last one is that of the row's end (transport/high_pass.rs).
layout(std430, set = 0, binding = 6) readonly buffer RowFactors { vec4 row_factors[]; };
layout(std430, set = 0, binding = 7) buffer Spread { float spread[]; };

#include "faults.glsl"
#include "accumulated.glsl"

// Rendered value of a cell.
float compared(uint cell) { return (SEEN != 0u ? spread[cell] : accumulated(cell)) * scene.render_scale; }

void clear_padding(uint cell) {
    residual[cell] = 0.0;
    if (SPOT == 0u) histograms[cell] = ZERO;
}

// Writes the partial sums of a row: squared differences, filtered and plain.
void close_row(uint pair, vec2 sums, bool is_rendered) {
    loss_partials[pair] = sums;
    watch(is_rendered, FAULT_FORWARD);
    watch(!is_rendered || finite(sums.x + sums.y), FAULT_RESIDUAL);
}
