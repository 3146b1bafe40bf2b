use super::shared::half;
use super::{Call, Cells};
use thirdbounce::transport::kernels::constant;

/// A convolution of 2 x 2 x 2 cells to one, or its transpose.
pub fn learned_resize(call: &Call, b: &mut [Cells]) {
    bind!(b: weights u, from f, to f);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let (inputs, outputs) = (layer.inputs as usize, layer.outputs as usize);
    let is_transposed = call.constant(constant::TRANSPOSED, 0) != 0;
    let weight = |i: usize| half(weights, layer.weights as usize + i);
    let [ny, nz] = [layer.n_y, layer.n_z].map(|n| 2 * n as usize);
    for o in 0..outputs {
        let bias = weight(8 * inputs * outputs + o);
        for cell in 0..cells {
            let [x, y, z] = call.learned_cell(cell);
            let fine = |t: usize| ((2 * x + t / 4) * ny + 2 * y + t / 2 % 2) * nz + 2 * z + t % 2;
            if is_transposed {
                for t in 0..8 {
                    let of = |i: usize| weight(8 * (i * outputs + o) + t) * from[i * cells + cell];
                    to[o * 8 * cells + fine(t)] = bias + (0..inputs).map(of).sum::<f64>();
                }
            } else {
                let of = |k: usize| weight(8 * o * inputs + k) * from[k / 8 * 8 * cells + fine(k % 8)];
                to[o * cells + cell] = bias + (0..8 * inputs).map(of).sum::<f64>();
            }
        }
    }
}
