// Filters histograms for back-projection: inverse falloff weights, then a filter along time. One invocation owns one
// cell; padding (place.glsl) becomes zero. hat_taps: [0] = radius, then weights from the centre outward. A negative
// radius denotes an odd filter: weights of earlier bins are the negatives of those of later ones.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "weight.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Measured { float measured[]; };
layout(std430, set = 0, binding = 2) readonly buffer HatTaps { float hat_taps[]; };
layout(std430, set = 0, binding = 3) writeonly buffer Residual { float residual[]; };

void main() {
    uint cell = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (cell >= cell_count()) return;
    uint pair = cell / scene.stride;
    int bin = int(cell % scene.stride) - int(PADDING);
    float sum = 0.0;
    if (pair < scene.pairs && bin >= 0) {
        int radius = int(abs(hat_taps[0]));
        float earlier = hat_taps[0] < 0.0 ? -1.0 : 1.0;
        for (int i = max(bin - radius, 0); i <= min(bin + radius, int(scene.bins) - 1); ++i) {
            float side = i < bin ? earlier : 1.0;
            sum += side * hat_taps[1 + abs(i - bin)] * bin_weight(uint(i)) * measured[pair * scene.bins + uint(i)];
        }
    }
    residual[cell] = sum;
}
