// Comparison as in residual.comp, with a high-pass along time: unmodelled light is smooth in time. With S the roots
// of the bins' weights, d the difference of a row from its measurement, and
//   F = 1 - slow_share (1 + k L)^-1,   k = a / (1 - a)^2, a = slow_decay, L the second difference with free ends.
// The loss is |F S d|^2, and the residual S F F S d times the factor of residual.comp (transport/high_pass.rs). F is
// symmetric with eigenvalues between 1 - slow_share and 1. One invocation owns a row. It solves the tridiagonal
// system of L by elimination: forward along the bins, backward with the solution and immediately the second
// elimination from the other end, and backward once more. In between, the row of `residual` holds the right-hand side
// of a solve, and the compared row the result of its elimination. Two bins per turn: lavapipe stops after 65,535
// turns.
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

uint bins;
float decay;
float along_decay; // log2
float inverse;     // 1 / k
float last_along;

// Factor of the elimination step at bin number `at`, by hyperbolic cosines for the free start of the row.
float along(uint at) {
    float p = exp2(along_decay * float(2u * at + 1u));
    return decay * (1.0 + p) / (1.0 + p * decay * decay);
}

float eliminated(uint at, float value, float before) {
    return (at == bins - 1u ? last_along : along(at)) * (value * inverse + before);
}

uint row;
uint data;
vec3 sums = vec3(0.0); // squared differences, filtered and plain, and the magnitude of rendered values
float before = 0.0;
float answer = 0.0;

void compare(uint bin) {
    uint cell = row + bin;
    float rendered = compared(cell);
    float difference = rendered - measured[data + bin];
    sums.yz += vec2(difference * difference, abs(rendered));
    float value = root_weight(bin) * difference;
    before = eliminated(bin, value, before);
    residual[cell] = value;
    KEEP(cell, before);
}

void turn(uint bin) {
    uint cell = row + bin;
    answer = KEPT(cell) + along(bin) * answer;
    float value = residual[cell] - surface.slow_share * answer;
    sums.x += value * value;
    before = eliminated(bins - 1u - bin, value, before);
    residual[cell] = value;
    KEEP(cell, before);
}

void close(uint bin) {
    uint cell = row + bin;
    answer = KEPT(cell) + along(bins - 1u - bin) * answer;
    float value = residual[cell] - surface.slow_share * answer;
    residual[cell] = 2.0 * scene.loss_scale * scene.render_scale * root_weight(bin) * value;
    if (SPOT == 0u) histograms[cell] = ZERO;
}

void main() {
    uint pair = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (pair >= scene.pairs) return;
    bins = scene.bins;
    decay = surface.slow_decay;
    along_decay = log2(decay);
    inverse = (1.0 - decay) * (1.0 - decay) / decay;
    last_along = 1.0 / (inverse + (bins > 1u ? 1.0 - along(bins - 2u) : 0.0));
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
