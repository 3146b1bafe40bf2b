use rayon::prelude::*;

use super::shared::*;
use super::{Call, Cells, Real};

/// What `surface_judge` decided, for the state of every pixel: its albedo is scaled, it is kept, or the kept one is put back.
pub fn surface_keep<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: heights v2, kept v2, moments v4, weights f);
    let count = call.push.last as usize;
    let states = heights[..count].par_iter_mut().with_min_len(1 << 12).zip(&mut kept[..count]);
    if call.push.flags & KEEP_TWICE != 0 {
        states.for_each(|(height, _)| height[1] = height[1] * F::of(2.0));
        return;
    }
    match weights[SURFACE_ACTION as usize].wide() as u32 {
        ACTION_SCALE => {
            let times = weights[SURFACE_TIMES as usize];
            states.for_each(|(height, kept)| {
                height[1] = height[1] * times;
                *kept = *height;
            });
        }
        ACTION_KEEP => states.for_each(|(height, kept)| *kept = *height),
        ACTION_RESTORE => {
            states.for_each(|(height, kept)| *height = *kept);
            moments[..count].fill([F::zero(); 4]);
        }
        _ => {}
    }
}
