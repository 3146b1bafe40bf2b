//! How many voxels there is room for, and what their changes are worked out in.

use super::{Level, Plan, Wanted};
use crate::transport::Sampling;

/// Voxels that there is room for, active and touched ones: all of a small grid's, a share of the last one's, and of the
/// first one's half, or all where the paper's solver begins with all. A first back-projection leaves a tenth of the first
/// grid, surfaces a hundredth of the last, reductions of a wide Gaussian up to a tenth of one before the last; of more the
/// brightest are kept.
pub(super) fn capacities(levels: &[Level], options: &Wanted) -> [usize; 2] {
    const SMALL: usize = 1 << 18;
    let [first, last] = [levels.first(), levels.last()].map(|l| l.map_or(0, |l| l.grid.storage()));
    if options.vectors {
        let active = match options.room {
            Some(share) => ((share * last as f64).ceil() as usize).clamp(1, last),
            None => SMALL.max(first / 2).max(last / 16).min(last),
        };
        return [active; 2];
    }
    let active = match options.room {
        Some(share) => ((share * last as f64).ceil() as usize).clamp(first, last),
        None if !options.reduces => last,
        // From a half on, all of it dense takes no more memory.
        None => Some(SMALL.max(first).max(last / 10)).filter(|most| *most < last / 2).unwrap_or(last),
    };
    [active, if options.sampling == Sampling::Continuous { with_rim(active, last) } else { active }]
}

/// Voxels touched where so many of `all` may be active: their neighbours, too, which are a third as many or less.
pub(super) fn with_rim(active: usize, all: usize) -> usize {
    (active + active / 2).min(all)
}

impl Plan {
    /// Two buffers for a number per voxel while the domain changes: the smoothed volume, and what it comes from. The
    /// first has room for four numbers of every touched voxel, too.
    pub fn volumes(&self) -> [&'static str; 2] {
        if self.aliases_volumes() { ["gradient", "sample_points"] } else { ["smooth", "smooth_spare"] }
    }

    /// Whether they are buffers of the paper's solver in which nothing lives between iterations.
    pub(super) fn aliases_volumes(&self) -> bool {
        let large = self.capacity >= self.touched_capacity.max(self.finest().grid.storage() / 4);
        !self.vectors && large
    }
}
