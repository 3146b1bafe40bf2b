// Sums over a workgroup of WORKGROUP lanes in a fixed order, for reproducible bits.

shared vec3 sums[WORKGROUP];

vec3 sum_over_group(vec3 value) {
    uint lane = gl_LocalInvocationID.x;
    sums[lane] = value;
    barrier();
    for (uint stride = WORKGROUP / 2u; stride > 0u; stride >>= 1) {
        if (lane < stride) sums[lane] += sums[lane + stride];
        barrier();
    }
    return sums[0];
}
