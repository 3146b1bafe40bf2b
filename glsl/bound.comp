// Bounds of the operator at every active voxel, by the same gather as a gradient, without the surface's cosines.
//   WHAT = 0: D = sum over pairs of kernel * residual, where the residual is the weighted rendering of the
//             whole domain at unit albedo. As all kernels are nonnegative, diag(D) majorises the normal
//             operator (De Pierro 1995): 1 / D is a safe step for each voxel on its own.
//   WHAT = 1: lambda = kappa * standard deviation that photon noise gives this voxel's gradient: the residual
//             holds the weighted variances, and the kernel enters squared.
// One lane or several own an active voxel (slices.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "grid.glsl"
#include "transport.glsl"
layout(constant_id = 10) const uint SPLIT = 1u;
layout(constant_id = 11) const uint WHAT = 0u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 5) buffer Bounds { vec2 bounds[]; };

#include "seats.glsl"
#include "gather.glsl"
#include "faults.glsl"

float sum = 0.0;

void meet(Arm a, Arm b, vec2 r) {
    float most = bound_of(a, b);
    sum += WHAT == 0u ? r.x * most : r.x * most * most;
}

void main() {
    Seat seat = seat_of(counts[COUNT_ACTIVE]);
    uint slot = seat.slot;
    bool owned = slot < counts[COUNT_ACTIVE];
    if (owned) gather(sample_points[slot].xyz, seat.slice, seat.slices);
    sum = together(seat, vec4(sum, 0.0, 0.0, 0.0)).x;
    if (seat.slice != 0u || !owned) return;
    // Split dispatches add up; the last one takes the square root.
    if ((push.flags & BACKWARD_CONTINUE) != 0u) sum += bounds[slot][WHAT];
    if ((push.flags & BACKWARD_FINISH) != 0u) sum = WHAT == 0u ? sum / sample_points[slot].w : scene.noise_factor * sqrt(sum);
    watch(finite(sum), FAULT_BOUND);
    bounds[slot][WHAT] = sum;
}
