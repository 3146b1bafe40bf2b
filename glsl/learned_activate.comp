// x sigmoid(x) of scaled channels, to which others may be added before; or the channels of the input: scaled bands, kind of
// pairs, depth. One invocation owns LEARNED_RUN cells of a channel. layer: inputs = channels that are scaled, more = kind of
// pairs, outputs = channels that are written.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 40) const uint MODE = 0u; // one of the following
const uint ADD = 1u;
const uint OF_INPUT = 2u;
layout(std430, set = 0, binding = 1) readonly buffer LearnedScales { vec2 learned_scales[]; };
layout(std430, set = 0, binding = 2) readonly buffer LearnedIn { float learned_in[]; };
layout(std430, set = 0, binding = 3) readonly buffer LearnedMore { float learned_more[]; };
layout(std430, set = 0, binding = 4) writeonly buffer LearnedOut { float learned_out[]; };
#include "learned.glsl"

void main() {
    uint cells = cell_count();
    uint channel = gl_WorkGroupID.y;
    vec2 scale = learned_scales[min(channel, layer.inputs - 1u)];
    for (uint r = 0u; r < LEARNED_RUN; ++r) {
        uint cell = (gl_WorkGroupID.x * LEARNED_RUN + r) * 64u + gl_LocalInvocationID.x;
        if (cell >= cells) return;
        uint i = channel * cells + cell;
        if (channel >= layer.inputs) {
            float depth = float(cell % layer.n_z) * 2.0 / float(layer.n_z - 1u) - 1.0;
            float is_kind = channel - layer.inputs == layer.more ? 1.0 : 0.0;
            learned_out[i] = channel == layer.outputs - 1u ? depth : is_kind;
        } else {
            float value = learned_in[i] * scale.x + scale.y;
            if (MODE == ADD) value += learned_more[i];
            learned_out[i] = MODE == OF_INPUT ? clamp(value, -60.0, 60.0) : silu(value);
        }
    }
}
