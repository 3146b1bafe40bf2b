use super::{Call, Cells};

/// Histograms as sums over the spots of the instrument, by the table from word `push.first` of `spot_taps`.
pub fn spot(call: &Call, b: &mut [Cells]) {
    bind!(b: _counts any, source f, spot_taps u, target f);
    let table = &spot_taps[call.push.first as usize..];
    let [rows, columns, inner] = [0, 1, 2].map(|i| table[i] as usize);
    let (offsets, entries) = (&table[3..], &table[3 + rows + 1..]);
    let end = thirdbounce::transport::cells(call.push.last as usize, call.scene.bins as usize);
    target[..end].fill(0.0);
    for sum in 0..call.push.last as usize {
        let (row, first) = (sum / inner % rows, sum / inner / rows * columns);
        for i in offsets[row] as usize..offsets[row + 1] as usize {
            let from = (first + entries[2 * i] as usize) * inner + sum % inner;
            let weight = f64::from(f32::from_bits(entries[2 * i + 1]));
            for bin in 0..call.scene.bins as usize {
                target[call.row(sum) + bin] += weight * source[call.row(from) + bin];
            }
        }
    }
}
