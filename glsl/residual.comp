// One invocation owns RESIDUAL_BINS cells, a workgroup apart. For each it converts the accumulated sum to the
// rendered value, adds the noise term, compares with the measurement and writes dLoss / d(accumulated value) for the
// backward kernel. It then clears the sum for the next iteration, which saves a pass. Padding (place.glsl) adds no
// loss and becomes zero in both. Squared differences are summed in a fixed order: per workgroup here, then in finish.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "paper_block.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint NOISE = 0u;    // 0 none, 1 a weight per bin, 2 a weight per histogram
layout(constant_id = 11) const uint WEIGHTED = 0u; // weigh squared differences by the inverse falloff
layout(constant_id = 13) const uint SEEN = 0u;     // 1: compare the output of pulse.comp or spot.comp
layout(constant_id = 14) const uint SPOT = 0u;     // 1: rendered pairs differ from measured ones: clear nothing
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer Measured { float measured[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Residual { float residual[]; };
#ifdef ACCUMULATE_FIXED
layout(std430, set = 0, binding = 4) buffer Histograms { uvec2 histograms[]; };
#else
layout(std430, set = 0, binding = 4) buffer Histograms { float histograms[]; };
#endif
layout(std430, set = 0, binding = 5) buffer LossPartials { vec2 loss_partials[]; }; // objective, plain
layout(std430, set = 0, binding = 6) readonly buffer NoiseState { float noise_state[]; };
layout(std430, set = 0, binding = 7) readonly buffer Spread { float spread[]; };

#include "sums.glsl"
#include "weight.glsl"
#include "faults.glsl"

#include "accumulated.glsl"

// Squared difference in one bin of a pair, weighted and plain, and the magnitude of the rendered value.
vec3 compare(uint cell, uint pair, uint bin) {
    uint index = pair * scene.bins + bin;
    float rendered = (SEEN != 0u ? spread[cell] : accumulated(cell)) * scene.render_scale;
    float open = 1.0;
    if (NOISE != 0u) {
        float w = noise_state[3u * (NOISE == 1u ? index : pair)];
        rendered += paper.noise_base + paper.noise_span / (1.0 + exp(-w));
        open = rendered > 0.0 ? 1.0 : 0.0;
        rendered = max(rendered, 0.0);
    }
    float difference = rendered - measured[index];
    float weight = WEIGHTED != 0u ? bin_weight(bin) : 1.0;
    residual[cell] = 2.0 * scene.loss_scale * scene.render_scale * open * weight * difference;
    return vec3(difference * difference * vec2(weight, 1.0), abs(rendered));
}

void main() {
    uint group = group_index();
    uint end = cell_count();
    // Groups that only fill the last row of a dispatch (GROUPS_X) have no partial sums.
    if (group * WORKGROUP * RESIDUAL_BINS >= end) return;
    uint first = group * WORKGROUP * RESIDUAL_BINS + gl_LocalInvocationID.x;
    vec3 squared = vec3(0.0);
    // Remainders are computed once, then updated by subtraction.
    uint pair = first / scene.stride;
    uint at = first % scene.stride;
    uint rows = WORKGROUP / scene.stride;
    uint on = WORKGROUP % scene.stride;
    for (uint cell = first, i = 0u; i < RESIDUAL_BINS && cell < end; ++i, cell += WORKGROUP) {
        if (at >= PADDING && pair < scene.pairs) squared += compare(cell, pair, at - PADDING);
        else residual[cell] = 0.0;
        if (SPOT == 0u) histograms[cell] = ZERO;
        pair += rows;
        at += on;
        if (at >= scene.stride) {
            at -= scene.stride;
            ++pair;
        }
    }
    vec3 all = sum_over_group(vec3(squared.xy, 0.0));
    if (gl_LocalInvocationID.x == 0u) loss_partials[group] = all.xy;
    bool rendered = finite(squared.z);
    watch(rendered, FAULT_FORWARD);
    watch(!rendered || finite(squared.x + squared.y), FAULT_RESIDUAL);
}
