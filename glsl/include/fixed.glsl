// Exponent of the scale of fixed-point accumulation. The scale is a power of two: `count` contributions of at most
// peak_albedo * kernel_bound each cannot overflow 63 bits in any bin. Bit-identical on host and device.

int fixed_exponent(float peak_albedo, float kernel_bound, uint count) {
    int e_peak, e_bound;
    frexp(peak_albedo, e_peak);
    frexp(kernel_bound, e_bound);
    int e_count = count == 0u ? 0 : findMSB(count) + 1;
    // Beyond 120 the scale or its inverse would leave fp32.
    return clamp(61 - e_peak - e_bound - e_count, -120, 120);
}
