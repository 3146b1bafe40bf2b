// Lanes that share a pixel. A workgroup owns WORKGROUP pixels, along x, with PIXEL_LANES lanes each, along y: the few
// pixels of a surface leave most lanes without work, and a lane that reads all surroundings of a pixel waits for
// each load. Every lane takes some of the surroundings; the first one of a pixel adds their sums in a fixed order.
layout(constant_id = 37) const uint PIXEL_LANES = 1u;
layout(local_size_x = 64, local_size_y_id = 37) in;

shared vec4 lane_sums[PIXEL_LANES == 1u ? 1u : WORKGROUP * PIXEL_LANES];

// Sum over the lanes of a pixel, for the first of them. All lanes of the workgroup participate.
vec4 over_lanes(vec4 sum) {
    if (PIXEL_LANES == 1u) return sum;
    lane_sums[gl_LocalInvocationIndex] = sum;
    barrier();
    if (gl_LocalInvocationID.y != 0u) return sum;
    for (uint k = 1u; k < PIXEL_LANES; ++k) sum += lane_sums[k * WORKGROUP + gl_LocalInvocationID.x];
    return sum;
}
