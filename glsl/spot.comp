// Weighted sums of histograms over the instrument's spots on the wall: rendered pairs are ideal, and a measured pair
// sees several. With transposed tables the adjoint, for residuals. One invocation owns PULSE_RUN neighbouring cells
// of one sum, so the table is read once for them. Padding (place.glsl) is written as zero and ignored when read.
// spot_taps from push.first (transport/spot/taps.rs): rows, columns and inner; offset of every row's entries; total
// number of entries; for every entry its column and the bits of its weight. push.last: number of sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
#ifdef ACCUMULATE_FIXED
layout(std430, set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer Histograms { uvec2 histograms[]; };
#include "accumulated.glsl"
float value_of(uint cell) { return accumulated(cell); }
#else
layout(std430, set = 0, binding = 2) readonly buffer Source { float source[]; };
float value_of(uint cell) { return source[cell]; }
#endif
layout(std430, set = 0, binding = 3) readonly buffer SpotTaps { uint spot_taps[]; };
layout(std430, set = 0, binding = 4) writeonly buffer Target { float target[]; };

void main() {
    uint run = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    uint runs = (scene.stride + PULSE_RUN - 1u) / PULSE_RUN;
    uint sum = run / runs;
    // The padding after the last row is the start of one more row.
    if (sum > push.last) return;
    uint cell = run % runs * PULSE_RUN;
    vec4 sums = vec4(0.0);
    if (sum < push.last) {
        uint rows = spot_taps[push.first];
        uint columns = spot_taps[push.first + 1u];
        uint inner = spot_taps[push.first + 2u];
        uint offsets = push.first + 3u;
        uint entries = offsets + rows + 1u;
        uint part = sum / inner;
        uint row = part % rows;
        uint first = part / rows * columns;
        uint end = spot_taps[offsets + row + 1u];
        for (uint i = spot_taps[offsets + row]; i < end; ++i) {
            uint from = (first + spot_taps[entries + 2u * i]) * inner + sum % inner;
            float weight = uintBitsToFloat(spot_taps[entries + 2u * i + 1u]);
            // At least PADDING cells follow a row's last cell, so PULSE_RUN cells exist; the surplus is unused.
            uint at = from * scene.stride + cell;
            sums += weight * vec4(value_of(at), value_of(at + 1u), value_of(at + 2u), value_of(at + 3u));
        }
    }
    for (uint k = 0u; k < PULSE_RUN; ++k) {
        uint at = cell + k;
        bool in_row = sum < push.last ? at < scene.stride : at < PADDING;
        if (in_row) target[sum * scene.stride + at] = at >= PADDING ? sums[k] : 0.0;
    }
}
