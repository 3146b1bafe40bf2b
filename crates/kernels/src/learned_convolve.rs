use super::learned::{half, silu};
use super::shared::*;
use super::{Call, Cells, Real};

/// Sums over neighbours and channels, whose weights are in the order of the kernel; moments of the cells of workgroups, or an
/// activation.
pub fn learned_convolve<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: weights u, first f, second f, out f, moments v2);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let n = [layer.n_x, layer.n_y, layer.n_z].map(|n| n as usize);
    let reach = call.constant("REACH", 1) as usize;
    let reach = [call.constant("REACH_X", 1) as usize, reach, reach];
    let finish = call.constant("FINISH", 0);
    let [wx, wy, wz] = reach.map(|r| 2 * r + 1);
    let (inputs, outputs) = ((layer.inputs + layer.more) as usize, layer.outputs as usize);
    let run = LEARNED_RUN as usize;
    let weight = |i: usize| half(weights, layer.weights as usize + i);
    let value = |channel: usize, cell: usize| match channel.checked_sub(layer.inputs as usize) {
        None => first[channel * cells + cell].wide(),
        Some(channel) => second[channel * cells + cell].wide(),
    };
    let runs = n[1].div_ceil(run);
    let groups = (n[0] * runs * n[2]).div_ceil(64);
    if finish == 1 {
        moments[..outputs * groups].fill([F::zero(); 2]);
    }
    for o in 0..outputs {
        let own = o / run * run * inputs * wx * wy * wz;
        for cell in 0..cells {
            let at = call.learned_cell(cell);
            let mut sum = weight(outputs.div_ceil(run) * run * inputs * wx * wy * wz + o);
            for tap in 0..wx * wy * wz {
                let by = [tap / (wz * wy), tap % wy, tap / wy % wz];
                let near: [usize; 3] = std::array::from_fn(|k| (at[k] + by[k]).wrapping_sub(reach[k]));
                if (0..3).any(|k| near[k] >= n[k]) {
                    continue;
                }
                let from = (near[0] * n[1] + near[1]) * n[2] + near[2];
                let of = |i: usize| weight(own + (i * wx * wy * wz + tap) * run + o % run) * value(i, from);
                sum += (0..inputs).map(of).sum::<f64>();
            }
            out[o * cells + cell] = F::of(match finish {
                2 => silu(sum),
                3 => silu(sum) + first[o * cells + cell].wide(),
                _ => sum,
            });
            if finish == 1 {
                let of = &mut moments[o * groups + ((at[0] * runs + at[1] / run) * n[2] + at[2]) / 64];
                *of = [of[0] + F::of(sum), of[1] + F::of(sum * sum)];
            }
        }
    }
}
