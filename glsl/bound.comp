// Bounds of the operator at every active voxel, by the same gather as a gradient, without the surface's cosines.
//   WHAT = 0: D = sum over pairs of kernel * residual, where the residual is the weighted rendering of the
//             whole domain at unit albedo. As all kernels are nonnegative, diag(D) majorises the normal
//             operator (De Pierro 1995): 1 / D is a safe step for each voxel on its own.
//   WHAT = 1: lambda = kappa * standard deviation that photon noise gives this voxel's gradient: the residual
//             holds the weighted variances, and the kernel enters squared.
// One invocation owns one active voxel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 10) const uint SPLIT = 1u;
layout(constant_id = 11) const uint WHAT = 0u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 5) buffer Bounds { vec2 bounds[]; };

#include "gather.glsl"
#include "faults.glsl"

float sum = 0.0;

void meet(Arm a, Arm b, vec2 r) {
    float most = bound_of(a, b);
    sum += WHAT == 0u ? r.x * most : r.x * most * most;
}

void main() {
    uint slot = group_index() * WORKGROUP + gl_LocalInvocationID.x;
    if (slot >= counts[COUNT_ACTIVE]) return;
    vec3 x = sample_points[slot].xyz;
    gather(x, 0u, 1u);
    // Split dispatches add up; the last one takes the square root.
    if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += bounds[slot][WHAT];
    if ((push.flags & BACKWARD_FINISH) != 0u) sum = WHAT == 0u ? sum / sample_points[slot].w : scene.noise_factor * sqrt(sum);
    watch(finite(sum), FAULT_BOUND);
    bounds[slot][WHAT] = sum;
}
