// Sums over the WORKGROUP lanes of a workgroup that have y = 0, in a fixed order, for reproducible bits.

shared vec3 sums[WORKGROUP];

vec3 sum_over_group(vec3 value) {
    uint lane = gl_LocalInvocationID.x;
    bool is_own = gl_LocalInvocationID.y == 0u;
    if (is_own) sums[lane] = value;
    barrier();
    for (uint stride = WORKGROUP / 2u; stride > 0u; stride >>= 1) {
        if (is_own && lane < stride) sums[lane] += sums[lane + stride];
        barrier();
    }
    return sums[0];
}
