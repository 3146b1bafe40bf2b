use rayon::prelude::*;

use super::sampling::random3;
use super::shared::*;
use super::{Call, Cells, Real};

/// The first volume: albedo uniform in [0, span), normals zero.
pub fn initialise_raw<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, active_voxels u, raw v4);
    let span = F::from32(f32::from_bits(call.constant("ALBEDO_SPAN", 1f32.to_bits())));
    let touched = counts[COUNT_TOUCHED as usize] as usize;
    let all = raw[..touched].par_iter_mut().zip(&active_voxels[..touched]).with_min_len(4096);
    all.for_each(|(raw, index)| {
        let [uniform, ..] = random3::<F>(*index, 0, 0, call.paper.seed);
        *raw = [span * uniform, F::zero(), F::zero(), F::zero()];
    });
}
