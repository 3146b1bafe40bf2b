// Counts as a caller's buffer has them, in words. The block `Source` is declared here, at binding 1.

layout(std430, set = 0, binding = 1) readonly buffer Source { uint source[]; };

// Count number i, in a format of COUNTS_*.
float count_of(uint i, uint format) {
    if (format == COUNTS_F32) return uintBitsToFloat(source[i]);
    if (format == COUNTS_U32) return float(source[i]);
    return float((source[i >> 1] >> (16u * (i & 1u))) & 0xffffu);
}
