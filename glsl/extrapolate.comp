// The point y = v + beta (v - v before) at which FISTA takes its next step, written to the samples that every pair
// sees; and the roughness term there: its energy goes beside y, its gradient to where the step goes on summing. One
// invocation owns one active voxel and reads those of its six neighbours that are active. Sample points are the voxels'
// centres, set once per domain by points.comp.
//   sum over pairs of neighbours of mu |y_i - y_j|^2 / 2,  mu = min(mu_i, mu_j),
//   mu_i = roughness lambda_i^2 / (D_i peak^2)
// with peak the largest smoothed albedo: the variance of the noise over the variance of the albedo, as in a Gaussian
// prior on jumps. Few photons make neighbours hold together; without noise lambda and mu are zero. mu_i is limited
// so that it never asks for shorter steps than D does.
// Surfaces without normals are vectors along -z and write their albedo instead of y.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "reflectance.glsl"
#include "largest.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer ActiveVoxels { uint active_voxels[]; };
layout(std430, set = 0, binding = 3) readonly buffer Raw { vec4 raw[]; };
layout(std430, set = 0, binding = 4) readonly buffer Before { vec4 before[]; };
layout(std430, set = 0, binding = 5) readonly buffer Momentum { float momentum[]; };
layout(std430, set = 0, binding = 6) writeonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 7) readonly buffer Mask { uint mask[]; };
layout(std430, set = 0, binding = 8) readonly buffer Bounds { vec2 bounds[]; }; // D, lambda
layout(std430, set = 0, binding = 9) writeonly buffer Gradient { vec4 gradient[]; };
layout(std430, set = 0, binding = 11) readonly buffer Ranks { uint ranks[]; };
layout(std430, set = 0, binding = 10) writeonly buffer SamplePoints { vec4 sample_points[]; };

#include "slots.glsl"
#include "faults.glsl"

vec3 extrapolated(uint slot) {
    vec3 v = raw[slot].xyz;
    return v + momentum[MOMENTUM_BETA] * (v - before[slot].xyz);
}

// mu_i: a voxel's own weight of the roughness term.
float stiffness(uint slot) {
    vec2 bound = bounds[slot];
    float peak = uintBitsToFloat(counts[COUNT_PEAK_SMOOTH]);
    if (!(peak > 0.0 && bound.x > 0.0)) return 0.0;
    float noise = bound.y / peak;
    // 12 is the largest eigenvalue of the six neighbours' Laplacian.
    return min(scene.roughness * noise * noise / bound.x, momentum[MOMENTUM_SHARE] * bound.x / 12.0);
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint slot = group_index() * WORKGROUP + lane;
    float magnitude = 0.0;
    if (slot < counts[COUNT_ACTIVE]) {
        vec3 y = extrapolated(slot);
        float own = stiffness(slot);
        vec3 along = vec3(0.0);
        float energy = 0.0;
        if (own > 0.0) {
            ivec3 c = ivec3(voxel_at(active_voxels[slot]));
            for (uint side = 0u; side < 6u; ++side) {
                ivec3 n = c;
                n[side >> 1] += (side & 1u) == 0u ? -1 : 1;
                // Negative coordinates wrap to large ones, which are outside the grid too.
                if (!in_grid(uvec3(n))) continue;
                uint other = slot_of(voxel_index(uvec3(n)));
                if (other == NOWHERE) continue;
                vec3 jump = y - extrapolated(other);
                float mu = min(own, stiffness(other));
                along += mu * jump;
                // Half of the pair's energy; the neighbour adds the other half.
                energy += 0.25 * mu * dot(jump, jump);
            }
        }
        if (NORMALS) {
            sample_normals[slot] = vec4(y, energy);
            gradient[slot] = vec4(0.0, along);
        } else {
            sample_points[slot].w = -y.z;
            gradient[slot] = vec4(-along.z, energy, 0.0, 0.0);
        }
        magnitude = length(y);
        watch(finite(y.x + y.y + y.z + energy), FAULT_SAMPLE);
    }
    // For the fixed-point scale.
    uint peak = largest_of_group(vec2(magnitude, 0.0)).x;
    if (lane == 0u) atomicMax(counts[COUNT_PEAK_ALBEDO], peak);
}
