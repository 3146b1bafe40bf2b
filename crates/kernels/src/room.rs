use super::shared::*;
use super::{Call, Cells, Real};

/// The least smoothed value such that at most `push.first` voxels are as large; 0 if all voxels above the threshold fit.
/// The highest level always stays.
pub fn room<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: levels u, counts u);
    let mut counted = 0;
    let fits = |n: &&u32| {
        counted += **n;
        counted <= call.push.first
    };
    let kept = levels[..LEVELS as usize].iter().rev().take_while(fits).count().max(1) as u32;
    let [peak, above] = [counts[COUNT_PEAK_SMOOTH as usize], call.push.flags].map(f32::from_bits);
    let key = peak.to_bits() >> LEVEL_SHIFT;
    let whole = kept == LEVELS || kept - 1 > key;
    let least = if whole { 0 } else { (key - (kept - 1)) << LEVEL_SHIFT };
    let fits = F::from32(f32::from_bits(least)) <= F::from32(above) * F::from32(peak);
    counts[COUNT_LEAST_SMOOTH as usize] = if fits { 0 } else { least };
}
