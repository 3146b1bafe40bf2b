// One axis of the separable Gaussian over the volume. One invocation owns one voxel and reads its 2 RADIUS + 1
// neighbours along AXIS, zero outside the grid. The first pass, along x, reads active voxels from the solver's state;
// the last, along z, records the maximum, so smoothing takes three passes and no copies. The first also resets the
// accumulators of the later ones and of levels.comp. As in the published code, the raw albedo before ELU is smoothed:
// empty voxels around a surface are far below zero and remove the haze beside it. Not with a noise term: if its
// minimum exceeds the noise in empty bins, all empty voxels fall below zero and remove the surface as well. ELU
// bounds them at -1.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "paper_block.glsl"
#include "grid.glsl"
#include "largest.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint AXIS = 0u;
layout(std430, set = 0, binding = 1) readonly buffer Taps { float taps[]; }; // [0] = radius, then weights 0..radius
layout(std430, set = 0, binding = 2) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 3) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 4) readonly buffer Source { float source[]; };
layout(std430, set = 0, binding = 5) writeonly buffer Target { float smoothed[]; };
layout(std430, set = 0, binding = 7) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 6) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 8) writeonly buffer Levels { uint levels[]; };

#include "slots.glsl"
#include "surface.glsl"

float value_at(uvec3 c) {
    uint index = voxel_index(c);
    if (AXIS != 0u) return source[index];
    uint slot = slot_of(index);
    if (slot == NOWHERE) return 0.0;
    return paper.noise_base + paper.noise_span > 0.0 ? elu(raw[slot].x) : raw[slot].x;
}

void main() {
    uint index = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (AXIS == 0u) {
        if (index < LEVELS) levels[index] = 0u;
        if (index == 0u) {
            counts[COUNT_PEAK_SMOOTH] = 0u;
            counts[COUNT_LEAST_SMOOTH] = 0u;
        }
    }
    float sum = 0.0;
    if (index < brick_count() * 512u) {
        uvec3 c = voxel_at(index);
        if (in_grid(c)) {
            int radius = int(taps[0]);
            int here = int(c[AXIS]);
            int last = int(grid_size()[AXIS]) - 1;
            for (int i = max(here - radius, 0); i <= min(here + radius, last); ++i) {
                uvec3 n = c;
                n[AXIS] = uint(i);
                sum += taps[1 + abs(i - here)] * value_at(n);
            }
        }
        smoothed[index] = sum;
    }
    if (AXIS != 2u) return;
    uint peak = largest_of_group(vec2(max(sum, 0.0), 0.0)).x;
    if (gl_LocalInvocationID.x == 0u) atomicMax(counts[COUNT_PEAK_SMOOTH], peak);
}
