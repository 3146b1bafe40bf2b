// Private columns: a lane's contributions are added to the histograms directly, or first to a column of WINDOW bins
// in shared memory, exclusive to the lane. Neighbouring voxels reach neighbouring bins, so a column receives many
// additions before it is added to its histogram, once per touched bin: at the end, and when PATIENCE contributions
// missed the window, the last of which moves it. The others are added to the histogram directly, so a scattered
// domain costs little more than without windows. The host disables windows where a brick of voxels is wider than one.
// No barrier is needed, and the chunk is not limited. Columns are interleaved, so lanes hit different banks. In fixed
// point, too, a column's sum belongs to one lane and has one order. A window is a second level of sums and replaces
// runs. Needs SPLIT, COLUMNS and accumulate.glsl.

layout(constant_id = 25) const uint WINDOW = 0u; // bins per column; 0 for none

shared float columns[WINDOW == 0u ? 1u : WINDOW * COLUMNS];

void clear_column(uint column) {
    for (uint i = 0u; i < WINDOW; ++i) columns[i * COLUMNS + column] = 0.0;
}

// Adds a column to histogram `row` and empties the column.
void flush_column(uint column, uint row, Run run) {
    if (run.cell == NO_RUN.cell) return;
    for (uint i = 0u; i < WINDOW; ++i) {
        float value = columns[i * COLUMNS + column];
        if (value == 0.0) continue;
        columns[i * COLUMNS + column] = 0.0;
        // A window may extend beyond its row.
        if (run.cell + i - (ORIGIN + PADDING) < scene.bins) accumulate(row + run.cell + i, value);
    }
}

// Adds a value at its place to histogram `row`. `column` and `run` belong to that histogram.
void deposit(uint column, uint row, Place place, float value, inout Run run) {
    // Two tests: WINDOW is a constant of the pipeline, so the first costs nothing.
    if (WINDOW == 0u) {
        accumulate_at(row, place, value, run);
        return;
    }
    if ((push.flags & FORWARD_DIRECT) != 0u) {
        accumulate_at(row, place, value, run);
        return;
    }
    if (!in_bins(place.cell)) return;
    vec2 parts = parts_of(place, value);
    if (place.cell - run.cell >= WINDOW - SPLIT) {
        if (run.cell != NO_RUN.cell && ++run.missed < PATIENCE) {
            add_parts(row, place.cell, parts);
            return;
        }
        flush_column(column, row, run);
        run.cell = place.cell - WINDOW / 2u;
        run.missed = 0u;
    }
    uint at = (place.cell - run.cell) * COLUMNS + column;
    columns[at] += parts.x;
    if (SPLIT != 0u) columns[at + COLUMNS] += parts.y;
}

// Adds the remaining content of the column or the run to histogram `row`.
void finish_run(uint column, uint row, inout Run run) {
    if (WINDOW != 0u) flush_column(column, row, run);
    else flush(row, run);
}
