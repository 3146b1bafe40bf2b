// Filters what a volume leaves of the measurement for back-projection, as filter.comp filters the measurement itself.
// `source` is what residual.comp wrote at another level: the weighted difference, rendered less measured, in bins of that
// level. Its bins are summed to those of this scene: bin b belongs to the bin that its centre lies in. One invocation owns
// one cell; padding (place.glsl) becomes zero. Both levels are of one model: push.first and push.step say how many of its
// bins are one at the other level and here, push.last how many bins the other level has. push.flags holds the bits of the
// factor from that difference to what is left of the measurement.
// hat_taps: [0] = radius, then weights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 2) readonly buffer HatTaps { float hat_taps[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Residual { float residual[]; };

// The first bin of the other level whose centre is not before bin `bin` of this one.
uint first_in(uint bin) {
    return min((2u * bin * push.step + push.first - 1u) / (2u * push.first), push.last);
}

void main() {
    uint cell = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (cell >= cell_count()) return;
    uint pair = cell / scene.stride;
    int bin = int(cell % scene.stride) - int(PADDING);
    float sum = 0.0;
    if (pair < scene.pairs && bin >= 0) {
        int radius = int(hat_taps[0]);
        uint row = pair * (push.last + PADDING) + PADDING;
        for (int i = max(bin - radius, 0); i <= min(bin + radius, int(scene.bins) - 1); ++i) {
            float left = 0.0;
            for (uint b = first_in(uint(i)); b < first_in(uint(i) + 1u); ++b) left += source[row + b];
            sum += hat_taps[1 + abs(i - bin)] * left;
        }
    }
    residual[cell] = uintBitsToFloat(push.flags) * sum;
}
