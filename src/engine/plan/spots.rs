//! The pairs that light is rendered for where laser and sensor see more than points.

use super::level::{Level, LevelPairs};
use crate::gpu::Buffer;
use crate::transport::{Model, Rendered, SpotTaps};

/// Points that cover the spots of a level's pairs.
pub(crate) const WALL: Buffer = Buffer::named("rendered_wall");
/// Constants of a level with the numbers of rendered pairs.
const SCENE: Buffer = Buffer::named("rendered_scene");
/// Histograms on either side of the spot: sums of rendered ones, then residuals of rendered pairs.
pub const SEEN: Buffer = Buffer::named("seen");
/// Histograms between two stages.
pub const BETWEEN: Buffer = Buffer::named("between");

/// The rendered pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Spots {
    /// What is rendered.
    pub rendered: Rendered,
    /// The stages of the adjoint.
    pub back: Vec<SpotTaps>,
}

impl Spots {
    /// The word of [`Spots::words`] where the table of `stage` begins, which must be one of its own.
    pub fn word_of(&self, stage: &SpotTaps) -> usize {
        let tables = self.rendered.stages.iter().chain(&self.back);
        tables.take_while(|table| !std::ptr::eq(*table, stage)).map(SpotTaps::len_of_words).sum()
    }

    /// The tables of all stages, then those of the adjoint, as kernels read them.
    pub fn words(&self) -> Vec<u32> {
        self.rendered.stages.iter().chain(&self.back).flat_map(SpotTaps::words).collect()
    }
}

/// Has the levels render for the pairs that cover their spots. Returns what they render; `None` where spots are points.
pub(crate) fn cover(model: &Model, levels: &mut [Level]) -> Option<Spots> {
    let rendered = model.rendered.clone()?;
    let wall = &rendered.wall;
    let [count, scanned, others] = [wall.pairs(), wall.scanned.len(), wall.others.len()];
    for (i, level) in (0..).zip(levels) {
        level.rendered = LevelPairs { count, scanned, others, wall: WALL, scene: SCENE.at(i) };
    }
    Some(Spots { back: rendered.back(), rendered })
}
