// One interface, accumulate(index, value), to three accumulation paths, selected by a macro ACCUMULATE_*:
//
//   FLOAT    native fp32 atomic add.
//   FIXED    64-bit integer atomic add of a scaled value: bit-identical in any order.
//   OWNED    plain add: the dispatch assigns each histogram to one invocation.

#if defined(ACCUMULATE_FLOAT)
layout(std430, set = 0, binding = 4) buffer Histograms { float histograms[]; };
void accumulate(uint index, float value) { atomicAdd(histograms[index], value); }

#elif defined(ACCUMULATE_OWNED)
layout(std430, set = 0, binding = 4) buffer Histograms { float histograms[]; };
void accumulate(uint index, float value) { histograms[index] += value; }

#elif defined(ACCUMULATE_FIXED)
layout(std430, set = 0, binding = 4) buffer Histograms { int64_t histograms[]; };
void accumulate(uint index, float value) {
    if (value != 0.0) atomicAdd(histograms[index], int64_t(value * fixed_scale));
}
#endif

// Where an fp32 sum over a bin would lose small addends, RUNS first sums consecutive voxels
// of the same cell: two levels of sums, each of a few thousand addends at most.
layout(constant_id = 16) const uint RUNS = 0u;
const uint LONGEST_RUN = 256u;

struct Run {
    uint cell;   // cell of the run, or first cell of its window (window.glsl); 0 while empty
    vec2 values; // sums of the cell and, with SPLIT, of the next cell
    uint missed; // contributions outside the window since it last moved
};
const Run NO_RUN = Run(0u, vec2(0.0), 0u);

// Shares of a value for its cell and, with SPLIT, for the next cell.
vec2 parts_of(Place place, float value) {
    if (SPLIT == 0u) return vec2(value, 0.0);
    float second = value * place.share;
    return vec2(value - second, second);
}

// Adds to cells of a row. A lane that owns the row may add to the padding without a test. Atomic variants skip the
// padding, where all lanes would collide at one address.
void add_parts(uint row, uint cell, vec2 parts) {
#if !defined(ACCUMULATE_OWNED)
    if (in_bins(cell))
#endif
    {
        accumulate(row + cell, parts.x);
        if (SPLIT != 0u) accumulate(row + cell + 1u, parts.y);
    }
}

// Adds a run's sums to histogram `row` and empties the run.
void flush(uint row, inout Run run) {
    // Two tests: RUNS is a constant of the pipeline, so the first costs nothing.
    if (RUNS != 0u) {
        if (run.cell == NO_RUN.cell) return;
        add_parts(row, run.cell, run.values);
        run.values = vec2(0.0);
    }
}

// Adds a value at its place to histogram `row`: to one bin, or shared between two with SPLIT. Needs place.glsl.
void accumulate_at(uint row, Place place, float value, inout Run run) {
    if (RUNS != 0u) {
        if (place.cell != run.cell) flush(row, run);
        run.cell = place.cell;
        run.values += parts_of(place, value);
    } else {
        add_parts(row, place.cell, parts_of(place, value));
    }
}
