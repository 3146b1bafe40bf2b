// Convolves histograms along time with the impulse response. BACK: the adjoint, for residuals. One invocation owns
// PULSE_RUN neighbouring cells of a row, so it reads each surrounding cell once. Padding (place.glsl) is written as
// zero and ignored when read. pulse_taps: number of taps before the path's own bin, number of taps, then weights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint BACK = 0u;
#ifdef ACCUMULATE_FIXED
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer Histograms { uvec2 histograms[]; };
#include "accumulated.glsl"
float value_of(uint cell) { return accumulated(cell); }
#else
layout(std430, set = 0, binding = 2) readonly buffer Source { float source[]; };
float value_of(uint cell) { return source[cell]; }
#endif
layout(std430, set = 0, binding = 3) readonly buffer PulseTaps { float pulse_taps[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Spread { float spread[]; };

void main() {
    uint run = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    uint runs = (scene.stride + PULSE_RUN - 1u) / PULSE_RUN;
    uint pair = run / runs;
    // The padding after the last row is the start of one more row.
    if (pair > scene.pairs) return;
    int bins = int(scene.bins);
    int bin = int(run % runs * PULSE_RUN) - int(PADDING);
    int row = int(pair * scene.stride + PADDING);
    vec4 sums = vec4(0.0);
    if (pair < scene.pairs) {
        int before = int(pulse_taps[0]);
        int count = int(pulse_taps[1]);
        int first = BACK != 0u ? bin - before : bin + before - (count - 1);
        // Taps from the current cell to each of the four cells.
        vec4 taps = vec4(0.0);
        for (int i = 0; i < count + int(PULSE_RUN) - 1; ++i) {
            float tap = i < count ? pulse_taps[2 + (BACK != 0u ? i : count - 1 - i)] : 0.0;
            taps = vec4(tap, taps.xyz);
            int at = first + i;
            if (at >= 0 && at < bins) sums += taps * value_of(uint(row + at));
        }
    }
    for (int k = 0; k < int(PULSE_RUN); ++k) {
        int at = bin + k;
        bool in_row = pair < scene.pairs ? at < bins : at < 0;
        if (in_row) spread[row + at] = at >= 0 ? sums[k] : 0.0;
    }
}
