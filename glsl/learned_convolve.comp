// Convolution over the channels of one or two volumes. One invocation owns LEARNED_RUN cells along y of as many outputs, so
// that a value that it loads meets up to twelve weights; lanes lie along z. Weights of eight channels at a time are staged in
// shared memory, [outputs / 4][input][x][z][y][4], biases behind them. A workgroup leaves sums and sums of squares of its
// cells for the normalisation.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 40) const uint REACH_X = 1u; // neighbours on each side along x
layout(constant_id = 41) const uint REACH = 1u;   // along y and z
layout(constant_id = 42) const uint FINISH = 0u;  // one of the following
const uint MOMENTS = 1u;   // leaves moments
const uint ACTIVATE = 2u;  // x sigmoid(x)
const uint ADD_INPUT = 3u; // plus the input
layout(std430, set = 0, binding = 2) readonly buffer LearnedIn { float learned_in[]; };
layout(std430, set = 0, binding = 3) readonly buffer LearnedMore { float learned_more[]; };
layout(std430, set = 0, binding = 4) writeonly buffer LearnedOut { float learned_out[]; };
layout(std430, set = 0, binding = 5) writeonly buffer LearnedMoments { vec2 learned_moments[]; };
#include "learned.glsl"
#include "learned_weights.glsl"

const uint CHANNELS = 8u; // whose weights are staged together
const uint WIDE_X = 2u * REACH_X + 1u;
const uint WIDE = 2u * REACH + 1u;
shared vec4 pool[CHANNELS * 27u];

vec4 four_weights(uint i) {
    return vec4(unpackHalf2x16(learned_weights[i >> 1]), unpackHalf2x16(learned_weights[(i >> 1) + 1u]));
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint cells = cell_count();
    uint runs = (layer.n_y + LEARNED_RUN - 1u) / LEARNED_RUN;
    uint run = gl_WorkGroupID.x * 64u + lane;
    uvec3 at = uvec3(run / (layer.n_z * runs), run / layer.n_z % runs * LEARNED_RUN, run % layer.n_z);
    bool is_in = at.x < layer.n_x;
    uint first = gl_WorkGroupID.y * LEARNED_RUN; // output
    uint all = layer.inputs + layer.more;
    uint taps = WIDE_X * WIDE * WIDE;
    uint packed = (layer.outputs + LEARNED_RUN - 1u) / LEARNED_RUN * all * taps * LEARNED_RUN;
    vec4 bias = four_weights(layer.weights + packed + first);
    vec4 sums[LEARNED_RUN];
    [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) sums[r] = bias;
    // Cells along y from the one before the run on. Below zero is large.
    uint rows[LEARNED_RUN + 2u];
    bool is_row[LEARNED_RUN + 2u];
    [[unroll]] for (uint r = 0u; r < LEARNED_RUN + 2u; ++r) {
        uint y = at.y + r - 1u;
        is_row[r] = y < layer.n_y;
        rows[r] = min(y, layer.n_y - 1u) * layer.n_z;
    }
    for (uint from = 0u; from < all; from += CHANNELS) {
        uint count = min(CHANNELS, all - from);
        barrier();
        for (uint i = lane; i < count * taps; i += 64u) {
            pool[i] = four_weights(layer.weights + first * all * taps + (from * taps + i) * LEARNED_RUN);
        }
        barrier();
        if (!is_in) continue;
        for (uint channel = 0u; channel < count; ++channel) {
            for (uint line = 0u; line < WIDE_X * WIDE; ++line) {
                uint x = at.x + line / WIDE - REACH_X;
                uint z = at.z + line % WIDE - REACH;
                if (x >= layer.n_x || z >= layer.n_z) continue;
                uint from_cell = x * layer.n_y * layer.n_z + z;
                float values[LEARNED_RUN + 2u];
                // One branch for all lanes.
                if (from + channel < layer.inputs) {
                    uint base = (from + channel) * cells + from_cell;
                    [[unroll]] for (uint r = 0u; r < LEARNED_RUN + 2u; ++r) values[r] = learned_in[base + rows[r]];
                } else {
                    uint base = (from + channel - layer.inputs) * cells + from_cell;
                    [[unroll]] for (uint r = 0u; r < LEARNED_RUN + 2u; ++r) values[r] = learned_more[base + rows[r]];
                }
                [[unroll]] for (uint r = 0u; r < LEARNED_RUN + 2u; ++r) values[r] = is_row[r] ? values[r] : 0.0;
                uint w = channel * taps + line * WIDE;
                if (REACH == 0u) {
                    [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) sums[r] += values[r + 1u] * pool[w];
                } else {
                    [[unroll]] for (uint j = 0u; j < 3u; ++j) {
                        vec4 tap = pool[w + j];
                        [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) sums[r] += values[r + j] * tap;
                    }
                }
            }
        }
    }
    vec4 sum = vec4(0.0);
    vec4 squares = vec4(0.0);
    [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) {
        if (is_in && at.y + r < layer.n_y) {
            sum += sums[r];
            squares += sums[r] * sums[r];
            uint cell = (at.x * layer.n_y + at.y + r) * layer.n_z + at.z;
            [[unroll]] for (uint o = 0u; o < LEARNED_RUN; ++o) {
                if (first + o < layer.outputs) {
                    float value = FINISH >= ACTIVATE ? silu(sums[r][o]) : sums[r][o];
                    if (FINISH == ADD_INPUT) value += learned_in[(first + o) * cells + cell];
                    learned_out[(first + o) * cells + cell] = value;
                }
            }
        }
    }
    if (FINISH != MOMENTS) return;
    barrier();
    pool[lane] = sum;
    pool[64u + lane] = squares;
    barrier();
    for (uint stride = 32u; stride > 0u; stride /= 2u) {
        if (lane < stride) {
            pool[lane] += pool[lane + stride];
            pool[64u + lane] += pool[64u + lane + stride];
        }
        barrier();
    }
    uint groups = (layer.n_x * runs * layer.n_z + 63u) / 64u;
    if (lane < LEARNED_RUN && first + lane < layer.outputs) {
        learned_moments[(first + lane) * groups + gl_WorkGroupID.x] = vec2(pool[0][lane], pool[64][lane]);
    }
}
