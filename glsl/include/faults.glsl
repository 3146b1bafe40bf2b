// Detects values that are not finite. A kernel sets its bit in the faults when it is about to write one. finish.comp
// copies the bits to the iteration's row of the trace, which the host reads anyway. Needs the buffer counts.
// Tests bits instead of calling isnan(): a driver may assume that no NaN exists.

bool finite(float v) { return (floatBitsToUint(v) & 0x7f800000u) != 0x7f800000u; }

void watch(bool good, uint fault) {
    if (!good) atomicOr(counts[COUNT_FAULTS], fault);
}
