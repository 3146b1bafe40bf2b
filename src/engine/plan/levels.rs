//! The levels of a solve: from a coarse grid to the finest.

use super::demand::Demand;
use super::level::{Level, LevelPairs};
use super::spots::Spots;
use crate::engine::plan::spots;
use crate::gpu::Buffer;
use crate::transport::kernels::buffer;
use crate::transport::{BRICK_VOXELS, Geometry, Grid, Model};

/// The levels of one solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    /// The coarse-to-fine sequence of the volume.
    pub volume: Vec<Level>,
    /// The last level, if its lateral cells are the pixels of a surface; `None` without a surface.
    pub pixels: Option<Level>,
    /// The pairs of a surface in batches, which iterations take in turns; none if each takes all.
    pub batches: Vec<Level>,
    /// The pairs that no fit takes; `None` without any.
    pub held_out: Option<Level>,
    /// What is rendered; `None` where laser and sensor see points.
    pub spots: Option<Spots>,
    /// The grid whose lateral cells are the maps' pixels.
    pub maps: Grid,
    /// Whether each brick can reach a bin, by level of the volume.
    pub reachable: Vec<Vec<bool>>,
    /// A sample may be so near to a wall point that the pair gives nothing.
    pub touching: bool,
}

impl Levels {
    /// The levels of `model`, with the given scan points along x and y, on `grid`, whose lateral cells are the maps' pixels.
    pub(crate) fn of(model: &Model, grid: Grid, scan: [usize; 2], demand: &Demand) -> Levels {
        let finest = grid.coarser(demand.pixels_per_voxel);
        let mut volume = sequence(model, finest, scan, demand.coarse_to_fine);
        let spots = spots::cover(model, &mut volume);
        let reachable = |l: &Level| match demand.general {
            true => vec![true; l.grid.storage() / BRICK_VOXELS],
            false => model.reachable_bricks(&l.grid),
        };
        let pixels = volume.last().copied().filter(|_| demand.iterations[1] > 0);
        Levels {
            batches: in_batches(model, pixels.as_ref()),
            held_out: held_out(model, pixels.as_ref()),
            maps: finest,
            reachable: volume.iter().map(reachable).collect(),
            touching: demand.general || volume.iter().any(|l| model.touches(&l.grid)),
            volume,
            pixels,
            spots,
        }
    }
}

/// Measured histograms, wall points and constants of a batch of pairs.
const BATCH_MEASURED: Buffer = Buffer::named("batch_measured");
const BATCH_WALL: Buffer = Buffer::named("batch_wall");
const BATCH_SCENE: Buffer = Buffer::named("batch_scene");

/// The same of the pairs that are held out.
const HELD_MEASURED: Buffer = Buffer::named("held_measured");
const HELD_WALL: Buffer = Buffer::named("held_wall");
const HELD_SCENE: Buffer = Buffer::named("held_scene");

/// Lateral pixels of coarse maps.
pub const AMPLE: usize = 32;

/// The levels that end with `finest`. Lateral resolutions double from the scan's, or from more where the final one is no power
/// of two of it.
fn sequence(model: &Model, finest: Grid, scan: [usize; 2], coarse_to_fine: bool) -> Vec<Level> {
    let mut wide = 1;
    while coarse_to_fine
        && finest.n[0].is_multiple_of(wide * 2)
        && finest.n[0] / (wide * 2) >= scan[0].max(scan[1])
    {
        wide *= 2;
    }
    // Lateral voxels are 32-bit numbers.
    let level = |(i, factor): (u16, u32)| {
        let scene = buffer::SCENE.at(i);
        Level {
            grid: finest.coarser(wide >> factor),
            first: 0,
            pairs: model.fitted(),
            measured: buffer::MEASURED,
            wall: buffer::WALL,
            scene,
            rendered: own_pairs(model, model.fitted(), buffer::WALL, scene),
            reachable: buffer::REACHABLE.at(i),
        }
    };
    (0..).zip(0..=wide.ilog2()).map(level).collect()
}

/// Pairs of a batch of a surface's pairs, and of the smallest one.
const BATCH: usize = 256;
const LEAST_BATCH: usize = 225;

/// Batches of the pairs of `level`, in order. As pairs are spread over the wall, so are those of a batch. A few pairs at the end
/// are in none.
fn in_batches(model: &Model, level: Option<&Level>) -> Vec<Level> {
    let fitted = model.fitted();
    let batches = (fitted / LEAST_BATCH).min((fitted / BATCH).max(2)).max(1);
    let pairs = fitted / batches;
    // The rows of a product with several other points are not cut, nor are sums over spots.
    let rows = model.wall.geometry == Geometry::Product && model.wall.others.len() > 1;
    let cuts = !rows && model.rendered.is_none();
    let Some(level) = level.filter(|_| model.is_spread && cuts && batches > 1) else {
        return vec![];
    };
    let batch = |i: u16| {
        let (wall, scene) = (BATCH_WALL.at(i), BATCH_SCENE.at(i));
        let rendered = own_pairs(model, pairs, wall, scene);
        let (first, measured) = (usize::from(i) * pairs, BATCH_MEASURED.at(i));
        Level { first, pairs, measured, wall, scene, rendered, ..*level }
    };
    (0..batches as u16).map(batch).collect()
}

/// The pairs of a model that are held out.
fn held_out(model: &Model, level: Option<&Level>) -> Option<Level> {
    let (count, level) = (model.held_out, level.filter(|_| model.held_out > 0)?);
    let rendered = own_pairs(model, count, HELD_WALL, HELD_SCENE);
    let (measured, wall, scene) = (HELD_MEASURED, HELD_WALL, HELD_SCENE);
    Some(Level { first: model.fitted(), pairs: count, measured, wall, scene, rendered, ..*level })
}

/// The first `pairs` of a model, with these buffers.
fn own_pairs(model: &Model, pairs: usize, wall: Buffer, scene: Buffer) -> LevelPairs {
    let [scanned, others] =
        model.wall.geometry.counts(pairs, model.wall.scanned.len(), model.wall.others.len());
    LevelPairs { count: pairs, scanned, others, wall, scene }
}
