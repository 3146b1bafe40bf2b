//! The share of the pairs that one of several devices takes: every Nth. So the first pairs of a level, which early levels
//! take alone, are shared as evenly as all of them. Of a product with several other points, every Nth of these is shared.
//!
//! Voxels, levels and what is computed for each voxel are those of the whole solve on every device. Only the passes over
//! pairs see fewer of them. What they leave is added up over all devices (`solve/together.rs`).

use std::borrow::Cow;

use super::{Level, Needs, Pairs, Plan};
use crate::advice::advice;
use crate::gpu::{Buffer, Counted, Summed, room_for};
use crate::transport::Wall;
use crate::transport::kernels::{COUNT_ACTIVE, buffer};
use crate::{Error, Result};

/// The share of one of several devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// Its number among the devices.
    pub number: usize,
    /// How many devices there are.
    pub of: usize,
}

impl Share {
    /// How many of the first `count` pairs, or rows of pairs, are its own.
    fn count(self, count: usize) -> usize {
        count.saturating_sub(self.number).div_ceil(self.of)
    }
}

impl Plan {
    /// The plan of a device that takes this share of the pairs.
    ///
    /// # Errors
    /// The pairs cannot be shared, or there are too few of them.
    pub fn shared(mut self, share: Share, needs: &dyn Needs) -> Result<Plan> {
        let refused = |why: String| {
            Err(Error::options(
                format!("{} devices are to share a solve: {why}", share.of),
                advice!["name one " Device],
            ))
        };
        if self.has_spots() {
            return refused("pairs with spots are not shared, as each is a sum over its neighbours".into());
        }
        let rows = self.levels.volume[0].pairs / self.unit();
        if rows < share.of {
            let what = if self.unit() > 1 { "rows of pairs" } else { "pairs" };
            return refused(format!("the first level has {rows} {what}, fewer than there are devices"));
        }
        self.division.share = Some(share);
        self.list_again(needs);
        Ok(self)
    }

    /// Pairs that are shared as one: those of one other point of a product with several.
    fn unit(&self) -> usize {
        self.scene.row().unwrap_or(1)
    }

    /// How many of the first `pairs` are on this device.
    pub(in crate::solve) fn own(&self, pairs: usize) -> usize {
        let unit = self.unit();
        self.division.share.map_or(pairs, |share| share.count(pairs / unit) * unit)
    }

    /// The pairs of a level that this device renders.
    pub(super) fn rendered(&self, level: &Level) -> Pairs {
        if self.division.share.is_some() { self.measured(level) } else { level.rendered }
    }

    /// The wall of those of the first pairs that are on this device.
    pub(in crate::solve) fn own_wall<'w>(&self, first: &'w Wall) -> Cow<'w, Wall> {
        match self.division.share {
            Some(Share { number, of }) => Cow::Owned(first.every([number, of])),
            None => Cow::Borrowed(first),
        }
    }

    /// The wall of those pairs of a level that are on this device. `all` is the wall of all pairs.
    pub(in crate::solve) fn wall_of(&self, level: &Level, all: &Wall) -> Wall {
        let wall = all.stretch(level.first, level.pairs);
        match self.division.share {
            // The first of its own among them.
            Some(Share { number, of }) => wall.every([(number + of - level.first % of) % of, of]),
            None => wall,
        }
    }

    /// The rows of `length` values for each pair that are on this device, of those for all pairs.
    pub(in crate::solve) fn own_rows<'r>(&self, all: &'r [f32], length: usize) -> Cow<'r, [f32]> {
        let Some(Share { number, of }) = self.division.share else { return all.into() };
        let own = all.chunks(self.unit() * length).skip(number).step_by(of);
        own.collect::<Vec<_>>().concat().into()
    }

    /// Whether sums over pairs begin with what is there before: on the first of several devices only.
    pub(in crate::solve) fn begins_sums(&self) -> bool {
        self.division.share.is_none_or(|share| share.number == 0)
    }

    /// The gradient of the active voxels or points.
    pub(in crate::solve) fn gradients(&self) -> Summed {
        self.of_active(buffer::GRADIENT, 16)
    }

    /// D and lambda of the active voxels.
    pub(in crate::solve) fn bounds(&self) -> Summed {
        self.of_active(buffer::BOUNDS, 8)
    }

    /// The back-projection of a level's histograms.
    pub(in crate::solve) fn projection(&self, level: &Level) -> Summed {
        Summed { buffer: self.domain.volumes[1], bytes: level.grid.storage() as u64 * 4, counted: None }
    }

    /// The losses, after they were added up on the device.
    pub(in crate::solve) fn losses(&self) -> Summed {
        Summed { buffer: buffer::LOSS_PARTIALS, bytes: 8, counted: None }
    }

    /// A buffer with an item of so many bytes for each active voxel.
    fn of_active(&self, buffer: Buffer, bytes: u64) -> Summed {
        let counted = Counted { buffer: buffer::COUNTS, word: COUNT_ACTIVE, bytes };
        Summed { buffer, bytes: self.domain.capacity as u64 * bytes, counted: Some(counted) }
    }

    /// Bytes on the host that exchanges take at most.
    pub(super) fn exchanged_bytes(&self) -> u64 {
        let all = [
            room_for(&[self.gradients(), self.losses()]),
            room_for(&[self.bounds()]),
            room_for(&[self.projection(&self.levels.volume[0])]),
        ];
        all.into_iter().max().unwrap_or(0)
    }
}
