// Learns the noise term from the residual. A workgroup owns one pair. PER_HISTOGRAM: one weight per pair, from the
// sum of the residual over its bins. Otherwise one weight per bin, strided over invocations. State is (weight, first
// moment, second moment), 12 bytes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "paper_block.glsl"
#include "grid.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint PER_HISTOGRAM = 0u;
layout(std430, set = 0, binding = 1) readonly buffer Residual { float residual[]; };
layout(std430, set = 0, binding = 2) buffer NoiseState { float noise_state[]; };
layout(std430, set = 0, binding = 3) buffer Counts { uint counts[]; };

#include "sums.glsl"
#include "faults.glsl"

// residual is dLoss / d accumulated = dLoss / d rendered * render_scale.
void learn(uint at, float gradient_of_sum) {
    float s = 1.0 / (1.0 + exp(-noise_state[at]));
    float gradient = gradient_of_sum / scene.render_scale * paper.noise_span * s * (1.0 - s);
    float m = mix(gradient, noise_state[at + 1u], paper.beta1);
    float v = mix(gradient * gradient, noise_state[at + 2u], paper.beta2);
    // Counted from the start of the solve: the noise term is not restarted with the volume's optimiser.
    float m_hat = m * push.unbias_first;
    float v_hat = v * push.unbias_second;
    noise_state[at] -= paper.learning_rate * m_hat / (sqrt(v_hat) + paper.epsilon);
    watch(finite(noise_state[at]), FAULT_NOISE);
    noise_state[at + 1u] = m;
    noise_state[at + 2u] = v;
}

void main() {
    uint pair = group_index();
    if (pair >= scene.pairs) return;
    uint lane = gl_LocalInvocationID.x;
    uint row = pair * scene.bins;
    uint cells = pair * scene.stride + PADDING;
    float sum = 0.0;
    for (uint bin = lane; bin < scene.bins; bin += WORKGROUP) {
        if (PER_HISTOGRAM != 0u) sum += residual[cells + bin];
        else learn(3u * (row + bin), residual[cells + bin]);
    }
    if (PER_HISTOGRAM == 0u) return;
    sum = sum_over_group(vec3(sum)).x;
    if (lane == 0u) learn(3u * pair, sum);
}
