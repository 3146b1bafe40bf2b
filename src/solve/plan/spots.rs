//! The pairs that light is rendered for where laser and sensor see more than points, at every level.

use super::{Level, Pairs, Plan};
use crate::gpu::Buffer;
use crate::transport::kernels::buffer;
use crate::transport::{Model, Rendered, SpotTaps};

/// Points that cover the spots of a level's pairs.
const WALL: Buffer = Buffer::named("rendered_wall");
/// Constants of a level with the numbers of rendered pairs.
const SCENE: Buffer = Buffer::named("rendered_scene");
/// Histograms on either side of the spot: sums of rendered ones, then residuals of rendered pairs.
pub const SEEN: Buffer = Buffer::named("seen");
/// Histograms between two stages.
pub const BETWEEN: Buffer = Buffer::named("between");

/// The rendered pairs of all levels with as many measured ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Spots {
    /// Measured pairs.
    pub pairs: usize,
    /// What is rendered for them.
    pub rendered: Rendered,
    /// The stages of the adjoint.
    pub back: Vec<SpotTaps>,
    /// Buffer that holds the tables of all stages, then those of the adjoint.
    pub taps: Buffer,
}

impl Spots {
    /// The word of [`Spots::words`] where the table of `stage` begins, which must be one of its own.
    pub fn word_of(&self, stage: &SpotTaps) -> usize {
        let tables = self.rendered.stages.iter().chain(&self.back);
        tables.take_while(|table| !std::ptr::eq(*table, stage)).map(SpotTaps::len_of_words).sum()
    }

    /// The tables as kernels read them.
    pub fn words(&self) -> Vec<u32> {
        self.rendered.stages.iter().chain(&self.back).flat_map(SpotTaps::words).collect()
    }
}

/// Has the levels render for the pairs that cover their spots. Returns what they render; nothing where spots are points.
pub(super) fn cover(model: &Model, volume: &mut [Level], pixels: &mut [Level]) -> Vec<Spots> {
    let Some(all) = &model.rendered else { return vec![] };
    let mut spots: Vec<Spots> = vec![];
    // There are fewer than 64 levels.
    for (i, level) in (0..).zip(volume.iter_mut().chain(pixels)) {
        let known = spots.iter().position(|s| s.pairs == level.pairs);
        let at = known.unwrap_or_else(|| {
            let rendered = match level.pairs == model.pairs() {
                true => all.clone(),
                false => Rendered::of(&model.wall.first(level.pairs), all.spot),
            };
            let taps = buffer::SPOT_TAPS.at(spots.len() as u16);
            spots.push(Spots { pairs: level.pairs, back: rendered.back(), rendered, taps });
            spots.len() - 1
        });
        let wall = &spots[at].rendered.wall;
        level.rendered = Pairs {
            count: wall.pairs(),
            scanned: wall.scanned.len(),
            others: wall.others.len(),
            wall: WALL.at(at as u16),
            scene: SCENE.at(i),
        };
    }
    spots
}

impl Plan {
    /// Whether laser or sensor see more than points.
    pub fn has_spots(&self) -> bool {
        !self.levels.spots.is_empty()
    }

    /// What a level renders; `None` where spots are points.
    pub fn spots_of(&self, level: &Level) -> Option<&Spots> {
        self.levels.spots.iter().find(|s| s.pairs == level.pairs)
    }

    /// The buffers that spots need.
    pub(super) fn spot_buffers(&self) -> Vec<(Buffer, u64)> {
        if self.levels.spots.is_empty() {
            return vec![];
        }
        let mut all = vec![];
        let (mut seen, mut between) = (0, 0);
        for level in self.levels.all() {
            let Some(spots) = self.spots_of(level) else { continue };
            let cells = |pairs: usize| super::cells(pairs, level.bins) as u64;
            let inner = spots.rendered.stages.iter().skip(1).map(SpotTaps::terms).max();
            seen = cells(level.pairs.max(level.rendered.count)).max(seen);
            between = inner.map_or(0, cells).max(between);
        }
        for spots in &self.levels.spots {
            let words = spots.rendered.stages.iter().chain(&spots.back).map(SpotTaps::len_of_words);
            all.push((spots.taps, words.sum::<usize>() as u64 * 4));
        }
        for (i, spots) in (0..).zip(&self.levels.spots) {
            all.push((WALL.at(i), (spots.rendered.wall.words().len() * 16) as u64));
        }
        all.extend([(SEEN, seen), (BETWEEN, between)].map(|(b, cells)| (b, cells * 4)));
        all
    }
}
