// Scale and offset of each channel from the moments that workgroups left: no mean and unit variance in a group of channels
// (Wu & He 2018), then the weights of the layer; or a mean square of a ninth. One workgroup owns a group of channels.
// layer: inputs = moments of a channel, more = all channels, outputs = channels of a group.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 40) const uint OF_BANDS = 0u;
layout(std430, set = 0, binding = 2) readonly buffer LearnedMoments { vec2 learned_moments[]; };
layout(std430, set = 0, binding = 3) writeonly buffer LearnedScales { vec2 learned_scales[]; };
#include "learned.glsl"
#include "learned_weights.glsl"

shared vec2 sums[64];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint first = gl_WorkGroupID.x * layer.outputs;
    vec2 own = vec2(0.0);
    for (uint i = lane; i < layer.outputs * layer.inputs; i += 64u) own += learned_moments[first * layer.inputs + i];
    sums[lane] = own;
    barrier();
    for (uint stride = 32u; stride > 0u; stride /= 2u) {
        if (lane < stride) sums[lane] += sums[lane + stride];
        barrier();
    }
    vec2 means = sums[0] / (float(cell_count()) * float(layer.outputs));
    for (uint channel = first + lane; channel < first + layer.outputs; channel += 64u) {
        if (OF_BANDS != 0u) {
            learned_scales[channel] = vec2(1.0 / (3.0 * max(sqrt(means.y), 1e-20)), 0.0);
        } else {
            float variance = max(means.y - means.x * means.x, 0.0);
            float scale = weight(layer.weights + channel) / sqrt(variance + 1e-5);
            learned_scales[channel] = vec2(scale, weight(layer.weights + layer.more + channel) - means.x * scale);
        }
    }
}
