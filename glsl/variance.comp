// Weighted variance of every bin as a residual, for bound.comp: (2 loss_scale render_scale weight)^2 * variance,
// variance proportional to the measured value, and a floor. One invocation owns one bin.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "weight.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer Measured { float measured[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Residual { float residual[]; };

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (index >= scene.pairs * scene.bins) return;
    float scale = 2.0 * scene.loss_scale * scene.render_scale * bin_weight(index % scene.bins);
    residual[index] = scale * scale * (scene.variance * max(measured[index], 0.0) + scene.variance_floor);
}
