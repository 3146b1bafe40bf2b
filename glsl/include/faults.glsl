// The watch for values that are not finite. Kernels that write what others read set their bit where one is; finish.comp
// leaves the bits in the iteration's row of the trace, which the host reads anyway. Needs the buffer counts.
// By bits, not isnan(): a driver may take for granted that there are none.

bool finite(float v) { return (floatBitsToUint(v) & 0x7f800000u) != 0x7f800000u; }

void watch(bool good, uint fault) {
    if (!good) atomicOr(counts[COUNT_FAULTS], fault);
}
