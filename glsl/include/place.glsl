// Where a path falls among the bins. Needs SPLIT and transport.glsl.
// Every row of histograms or residuals begins with PADDING cells that belong to no bin; as many follow the last row.
// `stride` cells on, the next row begins. A position is clamped to a row's cells from the first padding to the next row's,
// so no kernel asks whether a bin is there: residuals are zero in the padding, and what is added there is never read.
//
// A position lies in cells: linear ones with whole numbers at the centres of bins, nearest ones with whole numbers at
// their edges. Adding 2^23 - 1/2 rounds it down to a whole number, which then stands in the low bits of the float: no
// floor and no conversion, which GPUs do at a quarter of the rate or less. Where the position is whole itself, it may
// come out one less with a share of one. Rows of kernels begin ORIGIN earlier than they do, to make up for the other bits.
// In fp32 a path of so many bins is uncertain by some 2^-24 of them. With FINE it comes in grains, a power of two of
// metres: bins per whole grain and bins before the gate are split so that their multiples and differences are exact,
// and only what is within a grain or two is rounded.

struct Place {
    uint cell;   // the one it falls in; with SPLIT the first of the two whose centres bracket it. ORIGIN is the row's first
    float share; // with SPLIT: of the second of the two
};

const float WHOLE = 8388608.0;   // 2^23: floats from here on are whole
const uint ORIGIN = 0x4affffffu; // the bits of the largest below

// The first cell of a row, for cells of places.
uint row_of(uint pair) { return pair * scene.stride - ORIGIN; }

// Whether a bin has a part in what falls at a cell.
bool in_bins(uint cell) { return cell - (ORIGIN + PADDING - SPLIT) < scene.bins + SPLIT; }

Place place_of(float distance, float rest) {
    if (FINE == 0u) {
        // The host has folded gate, half bins and padding into the sum. GPUs clamp to 0 and 1 in the instruction before.
        float part = clamp(distance * scene.place_scale + scene.place_offset, 0.0, 1.0);
        // Not to be simplified.
        precise float whole = fma(part, float(scene.stride), WHOLE - 0.5);
        precise float share = fma(part, float(scene.stride), WHOLE - whole);
        return Place(floatBitsToUint(whole), share);
    }
    precise float coarse = distance * scene.bins_per_grain - scene.start_bins;
    float grains = floor(coarse);
    precise float within = distance * scene.bins_per_grain_rest + (rest * scene.fine_bins_per_grain - scene.start_bins_rest);
    float position = (coarse - grains) + within;
    float low = floor(position);
    float cell = clamp(grains + low + float(PADDING - 1u), 0.0, float(scene.stride));
    return Place(floatBitsToUint(cell + WHOLE), position - low);
}

// Of the two arms of a pair. One distance is twice as long by the host's factor.
Place place_of(Arm a, Arm b) {
    if (GEOMETRY == CONFOCAL && FINE == 0u) return place_of(a.distance, 0.0);
    return place_of(a.distance + b.distance, a.rest + b.rest);
}
