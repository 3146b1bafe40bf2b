use super::shared::{half, silu};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Sums over neighbours and channels, whose weights are in the order of the kernel; moments of the cells of workgroups, or an
/// activation.
pub fn learned_convolve(call: &Call, b: &mut [Cells]) {
    bind!(b: weights u, first f, second f, out f, moments v2);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let n = [layer.n_x, layer.n_y, layer.n_z].map(|n| n as usize);
    let reach = call.constant(constant::REACH, 1) as usize;
    let reach = [call.constant(constant::REACH_X, 1) as usize, reach, reach];
    let finish = call.constant(constant::FINISH, 0);
    let [wx, wy, wz] = reach.map(|r| 2 * r + 1);
    let (inputs, outputs, run) = ((layer.inputs + layer.more) as usize, layer.outputs as usize, LEARNED_RUN as usize);
    let weight = |i: usize| half(weights, layer.weights as usize + i);
    let value = |channel: usize, cell: usize| match channel.checked_sub(layer.inputs as usize) {
        None => first[channel * cells + cell],
        Some(channel) => second[channel * cells + cell],
    };
    let runs = n[1].div_ceil(run);
    let groups = (n[0] * runs * n[2]).div_ceil(64);
    if finish == 1 {
        moments[..outputs * groups].fill([0.0; 2]);
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
            let finished = match finish {
                2 => silu(sum),
                3 => silu(sum) + first[o * cells + cell],
                _ => sum,
            };
            out[o * cells + cell] = finished;
            if finish == 1 {
                let of = &mut moments[o * groups + ((at[0] * runs + at[1] / run) * n[2] + at[2]) / 64];
                *of = [of[0] + sum, of[1] + sum * sum];
            }
        }
    }
}
