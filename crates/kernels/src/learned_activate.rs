use super::learned::silu;
use super::{Call, Cells, Real};

/// Scaled channels, activated, or with the other channels of the input.
pub fn learned_activate<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: scales v2, from f, with f, to f);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let mode = call.constant("MODE", 0);
    for i in 0..layer.outputs as usize * cells {
        let (channel, cell) = (i / cells, i % cells);
        to[i] = F::of(if let Some(beyond) = channel.checked_sub(layer.inputs as usize) {
            let is_depth = channel + 1 == layer.outputs as usize;
            let [_, _, z] = call.learned_cell(cell);
            let depth = 2.0 * z as f64 / f64::from(layer.n_z - 1) - 1.0;
            if is_depth { depth } else { f64::from(u8::from(beyond == layer.more as usize)) }
        } else {
            let [scale, offset] = scales[channel].map(F::wide);
            let value = from[i].wide() * scale + offset;
            match mode {
                0 => silu(value),
                1 => silu(value + with[i].wide()),
                _ => value.clamp(-60.0, 60.0),
            }
        });
    }
}
