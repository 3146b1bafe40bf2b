// Where a lane's contributions go: straight to the histograms, or first to columns of WINDOW bins in shared memory that
// nobody else touches. Neighbouring voxels are seen at neighbouring bins, so a column takes many additions before it is
// added to its histogram, once per touched bin: when a contribution falls beside it, which moves it there, and at the
// end. No barrier and no bound of the chunk are needed, and no voxel can be too far off: a scattered domain only moves
// windows more often. Columns lie side by side, so lanes meet no bank twice. In fixed point, too, a column's own sum is
// of one lane and in one order. A window is a second level of
// sums, too, and takes the place of runs. Needs SPLIT, COLUMNS and accumulate.glsl.

layout(constant_id = 25) const uint WINDOW = 0u; // bins of a column; 0 for none

shared float columns[WINDOW == 0u ? 1u : WINDOW * COLUMNS];

void clear_column(uint column) {
    for (uint i = 0u; i < WINDOW; ++i) columns[i * COLUMNS + column] = 0.0;
}

// Adds a column to histogram `row`, and leaves it empty.
void flush_column(uint column, uint row, Run run) {
    if (run.bin == NO_RUN.bin) return;
    for (uint i = 0u; i < WINDOW; ++i) {
        float value = columns[i * COLUMNS + column];
        if (value == 0.0) continue;
        columns[i * COLUMNS + column] = 0.0;
        add_to_bin(row, run.bin + int(i), value);
    }
}

// Adds a value at its place to histogram `row`, whose column and run these are.
void deposit(uint column, uint row, Place place, float value, inout Run run) {
    if (WINDOW == 0u) {
        accumulate_at(row, place, value, run);
        return;
    }
    int last = SPLIT == 0u ? place.bin : place.bin + 1;
    if (last < 0 || place.bin >= int(scene.bins)) return;
    if (place.bin < run.bin || last >= run.bin + int(WINDOW)) {
        flush_column(column, row, run);
        run.bin = place.bin - int(WINDOW / 2u);
    }
    uint at = uint(place.bin - run.bin) * COLUMNS + column;
    columns[at] += SPLIT == 0u ? value : value * (1.0 - place.share);
    if (SPLIT != 0u) columns[at + COLUMNS] += value * place.share;
}

// What is left at the end.
void finish_run(uint column, uint row, inout Run run) {
    if (WINDOW != 0u) flush_column(column, row, run);
    else flush(row, run);
}
