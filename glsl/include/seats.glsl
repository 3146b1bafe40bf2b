// Lanes of a gathering workgroup: sample of each lane, and the sum over the lanes that share one. Needs grid.glsl.
#include "slices.glsl"
layout(local_size_x_id = 30, local_size_y_id = 31) in;

shared vec4 parts[VOXELS * SLICES];

struct Seat {
    uint slot;   // of the sample
    uint own;    // index of the sample in its workgroup
    uint slice;  // share of the pairs of this lane
    uint slices; // number of shares
    uint wide;   // samples per workgroup
};

Seat seat_of(uint samples) {
    uint slices = slices_of(samples);
    uint wide = samples_of_group(slices);
    uint lane = gl_LocalInvocationIndex;
    return Seat(group_index() * wide + lane % wide, lane % wide, lane / wide, slices, wide);
}

// Sum over the lanes that share a sample, returned to the first of them. All lanes of the workgroup participate.
vec4 together(Seat seat, vec4 sum) {
    parts[gl_LocalInvocationIndex] = sum;
    barrier();
    if (seat.slice == 0u) {
        for (uint i = 1u; i < seat.slices; ++i) sum += parts[i * seat.wide + seat.own];
    }
    return sum;
}
