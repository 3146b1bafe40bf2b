// Counts as a caller's buffer has them, in words. The block `Source` is declared here, at binding 1.

layout(std430, set = 0, binding = 1) readonly buffer Source { uint source[]; };

// What a pass is told of rows of counts, in one word: their format, how many neighbouring counts are one bin, and the counts
// of a row.
struct Row { uint format; uint sum; uint counts; };
Row row_of(uint word) { return Row(word & 3u, (word >> 2) & 0x3fffu, word >> 16); }

// Count number i, in a format of COUNTS_*.
float count_of(uint i, uint format) {
    if (format == COUNTS_F32) return uintBitsToFloat(source[i]);
    if (format == COUNTS_U32) return float(source[i]);
    return float((source[i >> 1] >> (16u * (i & 1u))) & 0xffffu);
}

// A bin of a row; counts beyond the row's end are missing from the last bin.
float bin_of(uint row, uint bin, Row rows) {
    uint end = min((bin + 1u) * rows.sum, rows.counts);
    float sum = 0.0;
    for (uint i = bin * rows.sum; i < end; ++i) sum += count_of(row * rows.counts + i, rows.format);
    return sum;
}
