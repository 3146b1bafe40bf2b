// The lanes of a workgroup that gathers: which sample each works for, and the sum over the lanes that share one. Needs
// grid.glsl.
#include "slices.glsl"
layout(local_size_x_id = 30, local_size_y_id = 31) in;

shared vec4 parts[VOXELS * SLICES];

struct Seat {
    uint slot;   // of the sample
    uint own;    // number of the sample in its workgroup
    uint slice;  // the share of the pairs that the lane takes
    uint slices; // of how many
    uint wide;   // samples of a workgroup
};

Seat seat_of(uint samples) {
    // On a CPU one lane has a sample, and compilers see that.
    if (SLICES == 1u) return Seat(group_index() * VOXELS + gl_LocalInvocationID.x, gl_LocalInvocationID.x, 0u, 1u, VOXELS);
    uint slices = slices_of(samples);
    uint wide = samples_of_group(slices);
    uint lane = gl_LocalInvocationIndex;
    return Seat(group_index() * wide + lane % wide, lane % wide, lane / wide, slices, wide);
}

// The sum over the lanes that share a sample, for the first of them. All lanes of the workgroup take part.
vec4 together(Seat seat, vec4 sum) {
    if (SLICES == 1u) return sum;
    parts[gl_LocalInvocationIndex] = sum;
    barrier();
    if (seat.slice == 0u) {
        for (uint i = 1u; i < seat.slices; ++i) sum += parts[i * seat.wide + seat.own];
    }
    return sum;
}
