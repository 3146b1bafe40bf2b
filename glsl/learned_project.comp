// Back-projection of the five bands into the box of the network, and sums of their squares. One invocation owns LEARNED_RUN
// voxels, a workgroup apart along z; points of 64 pairs at a time are staged in shared memory. layer: inputs = pairs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "learned_block.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) readonly buffer LearnedScan { float learned_scan[]; };
layout(std430, set = 0, binding = 2) readonly buffer LearnedPairs { vec4 learned_pairs[]; };
layout(std430, set = 0, binding = 3) readonly buffer LearnedBands { vec4 learned_bands[]; };
layout(std430, set = 0, binding = 4) readonly buffer LearnedBroad { float learned_broad[]; };
layout(std430, set = 0, binding = 5) writeonly buffer LearnedOut { float learned_out[]; };
layout(std430, set = 0, binding = 6) writeonly buffer LearnedMoments { vec2 learned_moments[]; };
#include "learned.glsl"

shared vec4 points[128]; // laser and sensor of each pair
shared vec4 squares[64];
shared float broad_squares[64];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint cells = cell_count();
    uint first = gl_WorkGroupID.x * 64u * LEARNED_RUN + lane;
    float pitch = learned_scan[SCAN_PITCH];
    float per_step = 1.0 / learned_scan[SCAN_STEP];
    vec3 at[LEARNED_RUN];
    vec4 sums[LEARNED_RUN];
    float broad[LEARNED_RUN];
    [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) {
        at[r] = (vec3(cell_at(first + 64u * r)) + 0.5) * pitch + vec3(-0.5, -0.5, learned_scan[SCAN_NEAR]);
        sums[r] = vec4(0.0);
        broad[r] = 0.0;
    }
    for (uint from = 0u; from < layer.inputs; from += 64u) {
        uint count = min(64u, layer.inputs - from);
        barrier();
        for (uint i = lane; i < 2u * count; i += 64u) points[i] = learned_pairs[2u * from + i];
        barrier();
        for (uint p = 0u; p < count; ++p) {
            vec3 laser = points[2u * p].xyz;
            vec3 sensor = points[2u * p + 1u].xyz;
            uint row = (from + p) * LEARNED_SAMPLES;
            [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) {
                float path = (distance(at[r], laser) + distance(at[r], sensor)) * per_step;
                // Beyond the last sample there is nothing.
                if (path < float(LEARNED_SAMPLES - 1u)) {
                    uint i = row + uint(path);
                    float share = fract(path);
                    sums[r] += mix(learned_bands[i], learned_bands[i + 1u], share);
                    broad[r] += mix(learned_broad[i], learned_broad[i + 1u], share);
                }
            }
        }
    }
    vec4 own = vec4(0.0);
    float broad_own = 0.0;
    [[unroll]] for (uint r = 0u; r < LEARNED_RUN; ++r) {
        uint cell = first + 64u * r;
        if (cell < cells) {
            [[unroll]] for (uint band = 0u; band < 4u; ++band) learned_out[band * cells + cell] = sums[r][band];
            learned_out[4u * cells + cell] = broad[r];
            own += sums[r] * sums[r];
            broad_own += broad[r] * broad[r];
        }
    }
    squares[lane] = own;
    broad_squares[lane] = broad_own;
    barrier();
    for (uint stride = 32u; stride > 0u; stride /= 2u) {
        if (lane < stride) {
            squares[lane] += squares[lane + stride];
            broad_squares[lane] += broad_squares[lane + stride];
        }
        barrier();
    }
    uint groups = (cells + 64u * LEARNED_RUN - 1u) / (64u * LEARNED_RUN);
    if (lane < LEARNED_BANDS) {
        float sum = lane < 4u ? squares[0][lane] : broad_squares[0];
        learned_moments[lane * groups + gl_WorkGroupID.x] = vec2(0.0, sum);
    }
}
