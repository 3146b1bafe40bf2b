// What a column of voxels says: means of its features over the distribution of depths, their maxima, the largest logit and the
// logarithm of the sum of exponentials; and the most probable voxel with its fraction, from two neighbours on each side. One
// workgroup owns a column, an invocation a feature. layer: inputs = features.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "learned_block.glsl"
layout(local_size_x = 32) in;
layout(std430, set = 0, binding = 1) readonly buffer LearnedIn { float learned_in[]; };
layout(std430, set = 0, binding = 2) readonly buffer LearnedMore { float learned_more[]; }; // logits
layout(std430, set = 0, binding = 3) writeonly buffer LearnedOut { float learned_out[]; };
layout(std430, set = 0, binding = 4) writeonly buffer LearnedDepth { float learned_depth[]; };
#include "learned.glsl"

const uint AROUND = 2u;

void main() {
    uint column = gl_WorkGroupID.x;
    uint columns = layer.n_x * layer.n_y;
    uint lane = gl_LocalInvocationID.x;
    uint row = column * layer.n_z;
    uint top = 0u;
    for (uint z = 1u; z < layer.n_z; ++z) top = learned_more[row + z] > learned_more[row + top] ? z : top;
    float most = learned_more[row + top];
    float all = 0.0;
    for (uint z = 0u; z < layer.n_z; ++z) all += exp(learned_more[row + z] - most);
    for (uint f = lane; f < layer.inputs; f += 32u) {
        uint at = f * cell_count() + row;
        float mean = 0.0;
        float largest = learned_in[at];
        for (uint z = 0u; z < layer.n_z; ++z) {
            float value = learned_in[at + z];
            mean += exp(learned_more[row + z] - most) * value;
            largest = max(largest, value);
        }
        learned_out[f * columns + column] = mean / all;
        learned_out[(layer.inputs + f) * columns + column] = largest;
    }
    if (lane != 0u) return;
    learned_out[2u * layer.inputs * columns + column] = most;
    learned_out[(2u * layer.inputs + 1u) * columns + column] = most + log(all);
    float near = 0.0;
    float sum = 0.0;
    for (uint z = max(top, AROUND) - AROUND; z <= min(top + AROUND, layer.n_z - 1u); ++z) {
        float p = exp(learned_more[row + z] - most);
        near += p;
        sum += p * float(z);
    }
    learned_depth[column] = sum / near;
}
