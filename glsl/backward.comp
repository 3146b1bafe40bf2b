// Gradient of the paper's solver, by gathering. A lane owns one active voxel and iterates over the pairs, reading the
// one or two bins that the voxel reaches in each: no atomics, sums in registers. Neighbouring lanes own neighbours in
// brick order and read neighbouring bins of a histogram. With few voxels several lanes share one (slices.glsl).
// Writes dLoss / d(raw variables at the sample point): the chain rule through ELU, tanh and normalize is applied
// here, the adjoint of the interpolation in update.comp. Several dispatches over pairs continue their sums: a lane
// that owns its voxel alone adds in the order of one dispatch, to the same bits. Lambertian sums are completed at the end
// of each, hence added.
// EXACT = 0 omits the falloff from the gradient, as the paper does: the exact gradient of the objective weighted by
// the falloff.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#include "shared.glsl"
#include "paper_block.glsl"
#include "grid.glsl"
#include "surface.glsl"
#include "transport.glsl"
layout(constant_id = 12) const uint SPLIT = 1u;
layout(constant_id = 13) const uint EXACT = 0u;
layout(std430, set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(std430, set = 0, binding = 2) readonly buffer SamplePoints { vec4 sample_points[]; };
layout(std430, set = 0, binding = 6) readonly buffer SampleNormals { vec4 sample_normals[]; };
layout(std430, set = 0, binding = 5) buffer Gradient { vec4 gradient[]; };

#include "seats.glsl"
#include "slope.glsl"
#include "faults.glsl"

void main() {
    Seat seat = seat_of(counts[COUNT_ACTIVE]);
    uint slot = seat.slot;
    bool owned = slot < counts[COUNT_ACTIVE];
    vec4 s = owned ? sample_points[slot] : vec4(0.0);
    vec4 n = owned && NORMALS ? sample_normals[slot] : vec4(0.0, 0.0, -1.0, 1.0);
    bool more = (push.flags & BACKWARD_CONTINUE) != 0u && owned && seat.slice == 0u;
    vec4 before = more ? gradient[slot] : vec4(0.0);
    if (REFLECTANCE != LAMBERTIAN) {
        if (NORMALS) aside = before.yzw;
        else along = before.x;
    }
    vec4 sum = together(seat, owned ? gather_slope(s.xyz, n.xyz, seat.slice, seat.slices) : vec4(0.0));
    if (seat.slice != 0u || !owned) return;
    if (REFLECTANCE == LAMBERTIAN) sum += before;
    if ((push.flags & BACKWARD_FINISH) != 0u) {
        float albedo = s.w;
        vec4 g = vec4(sum.x + paper.l1_scale * sign(albedo), sum.yzw * albedo);
        sum = through_surface(g, albedo, n.xyz, n.w);
        watch(finite(sum.x + sum.y + sum.z + sum.w), FAULT_BACKWARD);
    }
    gradient[slot] = sum;
}
