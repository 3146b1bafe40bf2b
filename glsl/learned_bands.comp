// Light of a pair along the path, in five bands. One workgroup owns a pair: its invocations sum counts, less the pair's
// background, into samples in shared memory, each over the bins that it covers, times the cube of its path; then each filters
// samples of all bands. layer: inputs = bins.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer LearnedScan { float learned_scan[]; };
layout(std430, set = 0, binding = 2) readonly buffer LearnedPairs { vec4 learned_pairs[]; };
layout(std430, set = 0, binding = 3) readonly buffer LearnedCounts { float learned_counts[]; };
layout(std430, set = 0, binding = 4) writeonly buffer LearnedBands { vec4 learned_bands[]; };
layout(std430, set = 0, binding = 5) writeonly buffer LearnedBroad { float learned_broad[]; };

shared float light[LEARNED_SAMPLES + 2u * LEARNED_TAPS];

float light_at(float path, uint row, float background) {
    float bins = float(layer.inputs);
    float middle = (path - learned_scan[SCAN_START]) / learned_scan[SCAN_WIDTH];
    float reach = 0.5 * learned_scan[SCAN_STEP] / learned_scan[SCAN_WIDTH];
    float from = clamp(middle - reach, 0.0, bins);
    float to = clamp(middle + reach, 0.0, bins);
    float sum = 0.0;
    for (uint i = uint(from); float(i) < to; ++i) {
        sum += (min(to, float(i + 1u)) - max(from, float(i))) * (learned_counts[row + i] - background);
    }
    return sum * path * path * path;
}

void main() {
    uint pair = gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationID.x;
    float background = learned_pairs[2u * pair].w;
    for (uint i = lane; i < LEARNED_SAMPLES + 2u * LEARNED_TAPS; i += 64u) {
        bool is_sample = i >= LEARNED_TAPS && i < LEARNED_TAPS + LEARNED_SAMPLES;
        float path = float(i - LEARNED_TAPS) * learned_scan[SCAN_STEP];
        light[i] = is_sample ? light_at(path, pair * layer.inputs, background) : 0.0;
    }
    barrier();
    const uint count = 2u * LEARNED_TAPS + 1u;
    for (uint i = lane; i < LEARNED_SAMPLES; i += 64u) {
        vec4 bands = vec4(0.0);
        float broad = 0.0;
        for (uint k = 0u; k < count; ++k) {
            float value = light[i + 2u * LEARNED_TAPS - k];
            uint at = SCAN_TAPS + k;
            bands += value * vec4(learned_scan[at], learned_scan[at + count], learned_scan[at + 2u * count], learned_scan[at + 3u * count]);
            broad += value * learned_scan[at + 4u * count];
        }
        learned_bands[pair * LEARNED_SAMPLES + i] = bands;
        learned_broad[pair * LEARNED_SAMPLES + i] = broad;
    }
}
