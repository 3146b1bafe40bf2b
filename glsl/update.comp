// Adjoint of the interpolation and Adam in one pass. One invocation owns one touched voxel (active or in the rim). It
// gathers from the samples of the 27 surrounding voxels and redraws their points from their counters, so there is no
// scatter and no atomics. Adam: Kingma & Ba 2015, with bias corrections from the host, counted from the last restart;
// its rate may decay as half a cosine over the whole solve.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "paper_block.glsl"
layout(constant_id = 10) const uint CONTINUOUS = 1u;
#include "grid.glsl"
#include "random.glsl"
#include "sampling.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; }; // followed by the rim
layout(std430, set = 0, binding = 3) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 8) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer Gradient { vec4 gradient[]; };
layout(std430, set = 0, binding = 5) buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 6) buffer MomentFirst { vec4 moment_first[]; };
layout(std430, set = 0, binding = 7) buffer MomentSecond { vec4 moment_second[]; };

#include "slots.glsl"
#include "faults.glsl"

const float PI = 3.14159265;

vec4 gathered(uvec3 c) {
    vec4 sum = vec4(0.0);
    ivec3 low = max(ivec3(c) - 1, ivec3(0));
    ivec3 high = min(ivec3(c) + 1, ivec3(grid_size()) - 1);
    for (int z = low.z; z <= high.z; ++z) {
        for (int y = low.y; y <= high.y; ++y) {
            for (int x = low.x; x <= high.x; ++x) {
                uvec3 neighbour = uvec3(x, y, z);
                uint index = voxel_index(neighbour);
                uint slot = slot_of(index);
                if (slot == NOWHERE) continue;
                vec3 near = max(1.0 - abs(sample_point(neighbour, index) - vec3(c)), 0.0);
                sum += near.x * near.y * near.z * gradient[slot];
            }
        }
    }
    return sum;
}

void main() {
    uint at = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (at >= counts[COUNT_TOUCHED]) return;
    vec4 g = CONTINUOUS != 0u ? gathered(voxel_at(active_voxels[at])) : gradient[at];
    vec4 m = mix(g, moment_first[at], paper.beta1);
    vec4 v = mix(g * g, moment_second[at], paper.beta2);
    vec4 m_hat = m * push.unbias_first;
    vec4 v_hat = v * push.unbias_second;
    float rate = paper.learning_rate;
    if (paper.decay_over > 0.0) rate *= 0.5 + 0.5 * cos(PI * min(float(push.iteration) / paper.decay_over, 1.0));
    vec4 next = raw[at] - rate * m_hat / (sqrt(v_hat) + paper.epsilon);
    watch(finite(next.x + next.y + next.z + next.w), FAULT_UPDATE);
    raw[at] = next;
    moment_first[at] = m;
    moment_second[at] = v;
}
