// Cells of path lengths. Needs SPLIT, transport.glsl and the extension GL_EXT_spirv_intrinsics. Every row of
// histograms or residuals begins with PADDING cells that belong to no bin, and PADDING cells follow the last row.
// Rows are `stride` cells apart. A position is clamped between a row's first padding cell and the next row's, so
// kernels need no range test: residuals are zero in the padding, and sums there are never read.
//
// A position is counted in cells: integers are the centres of bins with SPLIT, and their edges without. Adding 2^23 -
// 1/2 rounds a position down to an integer in the low bits of the float, without floor or conversion, which GPUs
// execute at a quarter of the rate or less. An integer position may be rounded to the previous one with a share of
// one. The other bits of the float are constant: row_of() subtracts them as ORIGIN.
//
// A NaN path is mapped to a row's first padding cell. GLSL's clamp() may pass it on, and its bits would become an
// arbitrary address: bounded() is SPIR-V's NClamp, which returns the lower bound, at the same cost on GPUs.
//
// In fp32 a path of n bins has an uncertainty of about n * 2^-24 bins. With FINE a path is counted in grains, a power
// of two of metres. Bins per grain and bins before the gate are split so that multiples and differences of their
// integer parts are exact, and only a rest of a grain or two is rounded.

struct Place {
    uint cell;   // cell of the path, plus ORIGIN; with SPLIT the first of the two whose centres bracket the path
    float share; // with SPLIT: share of the second cell
};

spirv_instruction(set = "GLSL.std.450", id = 81) float bounded(float value, float least, float most); // NClamp

const float WHOLE = 8388608.0;   // 2^23: floats from here upward are integers
const uint ORIGIN = 0x4affffffu; // bits of the largest float below WHOLE

// First cell of a pair's row, minus ORIGIN: add a place's cell to it.
uint row_of(uint pair) { return pair * scene.stride - ORIGIN; }

// True if a value at this cell adds to a bin.
bool in_bins(uint cell) { return cell - (ORIGIN + PADDING - SPLIT) < scene.bins + SPLIT; }

// Constants of the scene, loaded once per invocation. Compilers cannot know that a kernel's writes do not alias the
// scene, and would reload it for every pair.
float place_scale;
float place_offset;
float row_cells;

// Loads the scene constants of arms and places. Must precede the first of them.
void read_scene() {
    reference = scene.reference;
    place_scale = scene.place_scale;
    place_offset = scene.place_offset;
    row_cells = float(scene.stride);
}

Place place_of(float distance, float rest) {
    if (FINE == 0u) {
        // place_offset includes gate, half bin and padding. GPUs clamp to [0, 1] for free in the preceding
        // instruction.
        float part = bounded(distance * place_scale + place_offset, 0.0, 1.0);
        // `precise`: the compiler must not simplify these two.
        precise float whole = fma(part, row_cells, WHOLE - 0.5);
        precise float share = fma(part, row_cells, WHOLE - whole);
        return Place(floatBitsToUint(whole), share);
    }
    precise float coarse = distance * scene.bins_per_grain - scene.start_bins;
    float grains = floor(coarse);
    precise float within = distance * scene.bins_per_grain_rest + (rest * scene.fine_bins_per_grain - scene.start_bins_rest);
    float position = (coarse - grains) + within;
    float low = floor(position);
    float cell = bounded(grains + low + float(PADDING - 1u), 0.0, float(scene.stride));
    return Place(floatBitsToUint(cell + WHOLE), position - low);
}

// Place of a pair's two arms. For confocal pairs the host's place_scale doubles the one distance.
Place place_of(Arm a, Arm b) {
    if (GEOMETRY == CONFOCAL && FINE == 0u) return place_of(a.distance, 0.0);
    return place_of(a.distance + b.distance, a.rest + b.rest);
}
