// Maxima of a workgroup, so that one lane updates memory for all and avoids contention on one address. Values below
// zero are ignored, so floats have the order of their bits.

shared uint largest[2];

uvec2 largest_of_group(vec2 values) {
    uint lane = gl_LocalInvocationID.x;
    if (lane < 2u) largest[lane] = 0u;
    barrier();
    atomicMax(largest[0], floatBitsToUint(max(values.x, 0.0)));
    atomicMax(largest[1], floatBitsToUint(max(values.y, 0.0)));
    barrier();
    return uvec2(largest[0], largest[1]);
}
