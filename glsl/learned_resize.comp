// Convolution of 2 x 2 x 2 cells to one, or its transpose. One invocation owns a coarse cell of one output. Weights are those of
// the file, [output][input][8] or, of the transpose, [input][output][8], biases behind them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 40) const uint TRANSPOSED = 0u;
layout(std430, set = 0, binding = 2) readonly buffer LearnedIn { float learned_in[]; };
layout(std430, set = 0, binding = 3) writeonly buffer LearnedOut { float learned_out[]; };
#include "learned.glsl"
#include "learned_weights.glsl"

void main() {
    uint cells = cell_count();
    uint cell = gl_WorkGroupID.x * 64u + gl_LocalInvocationID.x;
    uint o = gl_WorkGroupID.y;
    if (cell >= cells) return;
    uvec3 at = 2u * cell_at(cell);
    uint fine = (at.x * 2u * layer.n_y + at.y) * 2u * layer.n_z + at.z;
    float bias = weight(layer.weights + 8u * layer.inputs * layer.outputs + o);
    float sums[8];
    [[unroll]] for (uint t = 0u; t < 8u; ++t) sums[t] = 0.0;
    for (uint i = 0u; i < layer.inputs; ++i) {
        uint w = layer.weights + 8u * (TRANSPOSED != 0u ? i * layer.outputs + o : o * layer.inputs + i);
        [[unroll]] for (uint t = 0u; t < 8u; ++t) {
            uint inside = ((t >> 2) * 2u * layer.n_y + (t >> 1 & 1u)) * 2u * layer.n_z + (t & 1u);
            uint from = TRANSPOSED != 0u ? i * cells + cell : i * 8u * cells + fine + inside;
            sums[t] += weight(w + t) * learned_in[from];
        }
    }
    float sum = bias;
    [[unroll]] for (uint t = 0u; t < 8u; ++t) {
        uint inside = ((t >> 2) * 2u * layer.n_y + (t >> 1 & 1u)) * 2u * layer.n_z + (t & 1u);
        if (TRANSPOSED != 0u) learned_out[o * 8u * cells + fine + inside] = bias + sums[t];
        sum += sums[t];
    }
    if (TRANSPOSED == 0u) learned_out[o * cells + cell] = sum;
}
