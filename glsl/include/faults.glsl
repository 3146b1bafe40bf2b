// Detection of non-finite values. A kernel sets its fault bit when it is about to write one. finish.comp copies the
// bits to the iteration's row of the trace. Needs the buffer counts. Tests bits instead of calling isnan(), as a
// driver may assume the absence of NaN.

bool finite(float v) { return (floatBitsToUint(v) & 0x7f800000u) != 0x7f800000u; }

void watch(bool good, uint fault) {
    if (!good) atomicOr(counts[COUNT_FAULTS], fault);
}
