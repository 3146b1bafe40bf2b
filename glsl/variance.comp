// Weighted variance of every bin as a residual, for bound.comp: (2 loss_scale render_scale weight)^2 * variance. The
// variance is proportional to the measured value, plus a floor. One invocation owns one cell; padding (place.glsl)
// becomes zero.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "weight.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Measured { float measured[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Residual { float residual[]; };

void main() {
    uint cell = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    uint pair = cell / scene.stride;
    uint bin = cell % scene.stride - PADDING;
    if (pair < scene.pairs && bin < scene.bins) {
        float scale = 2.0 * scene.loss_scale * scene.render_scale * bin_weight(bin);
        float counts = max(measured[pair * scene.bins + bin], 0.0);
        residual[cell] = scale * scale * (scene.variance * counts + scene.variance_floor);
    } else if (cell < cell_count()) {
        residual[cell] = 0.0;
    }
}
