// accumulated(): sum of a cell as written by the forward kernels, before the render scale. ZERO: the empty sum. Needs
// the buffers counts and histograms.
#ifdef ACCUMULATE_FIXED
#include "fixed.glsl"
float accumulated(uint index) {
    uvec2 v = histograms[index];
    bool negative = (v.y & 0x80000000u) != 0u;
    if (negative) {
        v = uvec2(~v.x + 1u, ~v.y);
        if (v.x == 0u) v.y += 1u;
    }
    int e = fixed_exponent(uintBitsToFloat(counts[COUNT_PEAK_ALBEDO]), scene.kernel_bound, counts[COUNT_ACTIVE]);
    float magnitude = ldexp(float(v.y) * 4294967296.0 + float(v.x), -e);
    return negative ? -magnitude : magnitude;
}
#define ZERO uvec2(0u)
#else
float accumulated(uint index) { return histograms[index]; }
#define ZERO 0.0
#endif
