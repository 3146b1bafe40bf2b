// Comparison as in residual.comp, with the high-pass F along time of transport/high_pass.rs. With S the roots of the bins'
// weights and d the difference of a row from its measurement, the loss is |F S d|^2, and the residual S F F S d times the
// factor of residual.comp. One invocation owns a row. It applies F twice by elimination: forward along the bins, backward
// with the solution and immediately the second elimination from the other end, and backward once more; from either end the
// factors are the same. In between, the row of `residual` holds the right-hand side of a solve, and the compared row the
// result of its elimination. Two bins per turn: lavapipe stops after 65,535 turns.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "surface_block.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
#include "compared.glsl"

// The compared row keeps values between two walks.
#ifdef ACCUMULATE_FIXED
#define KEPT(cell) (SEEN != 0u ? spread[cell] : uintBitsToFloat(histograms[cell].x))
#define KEEP(cell, value) if (SEEN != 0u) spread[cell] = value; else histograms[cell] = uvec2(floatBitsToUint(value), 0u)
#else
#define KEPT(cell) (SEEN != 0u ? spread[cell] : histograms[cell])
#define KEEP(cell, value) if (SEEN != 0u) spread[cell] = value; else histograms[cell] = value
#endif

uint row;
uint data;
vec3 sums = vec3(0.0); // squared differences, filtered and plain, and the magnitude of rendered values
float before = 0.0;
float answer = 0.0;

// Eliminates at bin number `at` from the end where the walk began.
void eliminate(uint at, float value) {
    vec4 factors = row_factors[at];
    before = factors.y * value + factors.z * before;
}

void compare(uint bin) {
    uint cell = row + bin;
    float rendered = compared(cell);
    float difference = rendered - measured[data + bin];
    sums.yz += vec2(difference * difference, abs(rendered));
    float value = row_factors[bin].x * difference;
    eliminate(bin, value);
    residual[cell] = value;
    KEEP(cell, before);
}

void turn(uint bin) {
    uint cell = row + bin;
    answer = KEPT(cell) + row_factors[bin].z * answer;
    float value = residual[cell] - surface.slow_share * answer;
    sums.x += value * value;
    eliminate(scene.bins - 1u - bin, value);
    residual[cell] = value;
    KEEP(cell, before);
}

void close(uint bin) {
    uint cell = row + bin;
    answer = KEPT(cell) + row_factors[scene.bins - 1u - bin].z * answer;
    float value = residual[cell] - surface.slow_share * answer;
    residual[cell] = 2.0 * scene.loss_scale * scene.render_scale * row_factors[bin].x * value;
    if (SPOT == 0u) histograms[cell] = ZERO;
}

void main() {
    uint pair = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pair >= scene.pairs) return;
    uint bins = scene.bins;
    row = pair * scene.stride + PADDING;
    data = pair * bins;
    uint end = bins & ~1u;
    for (uint bin = 0u; bin < end; bin += 2u) {
        compare(bin);
        compare(bin + 1u);
    }
    if (end < bins) compare(end);
    before = 0.0;
    if (end < bins) turn(end);
    for (uint bin = end; bin > 0u; bin -= 2u) {
        turn(bin - 1u);
        turn(bin - 2u);
    }
    answer = 0.0;
    for (uint bin = 0u; bin < end; bin += 2u) {
        close(bin);
        close(bin + 1u);
    }
    if (end < bins) close(end);
    // Padding before each row, and after the last.
    for (uint k = 0u; k < (pair == scene.pairs - 1u ? 2u : 1u); ++k) {
        for (uint i = 0u; i < PADDING; ++i) clear_padding(row - PADDING + i + k * scene.stride);
    }
    close_row(pair, sums.xy, finite(sums.z));
}
