// Where a lane's contributions go: straight to the histograms, or first to columns of WINDOW bins in shared memory that
// nobody else touches. Neighbouring voxels are seen at neighbouring bins, so a column takes many additions before it is
// added to its histogram, once per touched bin: when a contribution falls beside it, which moves it there, and at the
// end. No barrier and no bound of the chunk are needed, and no voxel can be too far off: a scattered domain only moves
// windows more often. Columns lie side by side, so lanes meet no bank twice. In fixed point, too, a column's own sum is
// of one lane and in one order. Needs SPLIT, COLUMNS and accumulate.glsl.

layout(constant_id = 24) const uint WINDOW = 0u; // bins of a column; 0 for none

shared float columns[WINDOW == 0u ? 1u : WINDOW * COLUMNS];

// No bin: the first contribution moves the window.
const int NO_WINDOW = -0x40000000;

void clear_column(uint column) {
    for (uint i = 0u; i < WINDOW; ++i) columns[i * COLUMNS + column] = 0.0;
}

// Adds a column that stands at `base` to histogram `row`, and leaves it empty.
void flush_column(uint column, int base, uint row) {
    for (uint i = 0u; i < WINDOW; ++i) {
        float value = columns[i * COLUMNS + column];
        if (value == 0.0) continue;
        columns[i * COLUMNS + column] = 0.0;
        int bin = base + int(i);
        if (bin >= 0 && bin < int(scene.bins)) accumulate(row + uint(bin), value);
    }
}

// Adds a value at a position in bins to histogram `row`, whose column it is: to its bin, or shared by the two around it.
void deposit(uint column, inout int base, uint row, float position, float value) {
    if (WINDOW == 0u) {
        accumulate_at(row, position, value);
        return;
    }
    float centre = SPLIT == 0u ? position : position - 0.5;
    float low = floor(centre);
    int bin = int(low);
    int last = SPLIT == 0u ? bin : bin + 1;
    if (last < 0 || bin >= int(scene.bins)) return;
    if (bin < base || last >= base + int(WINDOW)) {
        if (base != NO_WINDOW) flush_column(column, base, row);
        base = bin - int(WINDOW / 2u);
    }
    uint at = uint(bin - base) * COLUMNS + column;
    if (SPLIT == 0u) {
        columns[at] += value;
        return;
    }
    float share = centre - low;
    columns[at] += value * (1.0 - share);
    columns[at + COLUMNS] += value * share;
}
