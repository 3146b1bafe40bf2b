use super::learned::half;
use super::{Call, Cells, Real};

/// A convolution of 2 x 2 x 2 cells to one, or its transpose.
pub fn learned_resize<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: weights u, from f, to f);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let (inputs, outputs) = (layer.inputs as usize, layer.outputs as usize);
    let is_transposed = call.is("TRANSPOSED");
    let weight = |i: usize| half(weights, layer.weights as usize + i);
    let [ny, nz] = [layer.n_y, layer.n_z].map(|n| 2 * n as usize);
    for o in 0..outputs {
        let bias = weight(8 * inputs * outputs + o);
        for cell in 0..cells {
            let [x, y, z] = call.learned_cell(cell);
            let fine = |t: usize| ((2 * x + t / 4) * ny + 2 * y + t / 2 % 2) * nz + 2 * z + t % 2;
            if is_transposed {
                for t in 0..8 {
                    let of = |i: usize| weight(8 * (i * outputs + o) + t) * from[i * cells + cell].wide();
                    to[o * 8 * cells + fine(t)] = F::of(bias + (0..inputs).map(of).sum::<f64>());
                }
            } else {
                let of = |k: usize| weight(8 * o * inputs + k) * from[k / 8 * 8 * cells + fine(k % 8)].wide();
                to[o * cells + cell] = F::of(bias + (0..8 * inputs).map(of).sum::<f64>());
            }
        }
    }
}
