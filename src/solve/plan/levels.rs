//! The levels of a solve: from a coarse grid, wide bins and a part of the pairs to the finest and all of them.

use super::{Demand, Level, Pairs, Spots, spots};
use crate::gpu::Buffer;
use crate::transport::kernels::buffer;
use crate::transport::{BRICK_VOXELS, Geometry, Grid, Model};

/// The levels of one solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    /// The coarse-to-fine sequence of the volume.
    pub volume: Vec<Level>,
    /// The level on the maps' pixels, for what follows the volume; `None` if nothing does.
    pub pixels: Option<Level>,
    /// Its pairs in batches, which iterations take in turns; none if each takes all.
    pub batches: Vec<Level>,
    /// What is rendered for every number of pairs; none where laser and sensor see points.
    pub spots: Vec<Spots>,
    /// The grid whose lateral cells are the maps' pixels.
    pub maps: Grid,
    /// Whether each brick can reach a bin, by level of the volume.
    pub reachable: Vec<Vec<bool>>,
    /// A sample may be so near to a wall point that the pair gives nothing.
    pub touching: bool,
}

impl Levels {
    /// The levels of `model`, scanned in so many points along x and y, on `grid`, whose lateral cells are the maps' pixels.
    pub(super) fn of(model: &Model, grid: Grid, scan: [usize; 2], demand: &Demand) -> Levels {
        let mut volume = Sequence::of(model, grid, scan, demand).levels();
        let mut pixels = of_pixels(model, &volume, grid).filter(|_| demand.iterations[1] > 0);
        let spots = spots::cover(model, &mut volume, pixels.as_mut_slice());
        let reachable = |l: &Level| match demand.general {
            true => vec![true; l.grid.storage() / BRICK_VOXELS],
            false => model.reachable_bricks(&l.grid),
        };
        Levels {
            batches: in_batches(model, pixels.as_ref()),
            maps: pixels.as_ref().or(volume.last()).map_or(grid, |l| l.grid),
            reachable: volume.iter().map(reachable).collect(),
            touching: demand.general || volume.iter().chain(&pixels).any(|l| model.touches(&l.grid)),
            volume,
            pixels,
            spots,
        }
    }

    /// The same levels for the `model` of as many other pairs: only what is rendered for their spots differs.
    pub(super) fn cover(&mut self, model: &Model) {
        self.spots = spots::cover(model, &mut self.volume, self.pixels.as_mut_slice());
    }

    /// The levels of the volume, then that on the maps' pixels if it is no level of the volume.
    pub fn all(&self) -> impl Iterator<Item = &Level> {
        self.volume.iter().chain(self.pixels.iter().filter(|l| !self.volume.contains(l)))
    }

    /// The levels of the volume whose bins no level before has, and that are wider than the model's.
    pub fn summed(&self) -> impl Iterator<Item = &Level> {
        let first =
            |l: &Level| self.volume.iter().find(|o| o.sum == l.sum).is_some_and(|o| o.scene == l.scene);
        self.volume.iter().filter(move |l| l.sum > 1 && first(l))
    }
}

/// Pairs for a volume of so many lateral voxels, where one of up to twice [`AMPLE`] needs `pairs`: in proportion to its
/// area.
pub fn pairs_for(lateral: usize, pairs: usize) -> usize {
    pairs.saturating_mul((lateral / (2 * AMPLE)).max(1).pow(2))
}

/// Constants of levels on the maps' pixels, where these are no voxels.
const SURFACE_SCENE: Buffer = Buffer::named("surface_scene");

/// Measured histograms, wall points and constants of a batch of pairs.
const BATCH_MEASURED: Buffer = Buffer::named("batch_measured");
const BATCH_WALL: Buffer = Buffer::named("batch_wall");
const BATCH_SCENE: Buffer = Buffer::named("batch_scene");

/// Lateral voxels of the coarsest grid, if the scan has more points side by side and pairs are spread.
pub const AMPLE: usize = 32;

/// Pairs that the iterations before the last use, of those that the last ones need.
pub fn first_of(pairs: usize) -> usize {
    pairs.div_ceil(4)
}

/// How many bins of `model` a volume with voxels as deep as those of `grid` needs no finer than as one. A path to a
/// surface and back changes by twice its depth, so voxels are two bins of path deep where bins are not summed.
pub fn sum_of(model: &Model, grid: &Grid) -> usize {
    ((grid.pitch.z / model.bin_width + 1e-6) as usize).clamp(1, model.bins)
}

/// Voxels are made deeper on coarse grids up to this share of their width. Deeper ones save nothing: surfaces stay thick
/// in them, and leave more voxels for the finest grid (benches/studies/captures.md).
const OF_WIDTH: f64 = 0.25;

/// What the levels of a volume come from.
struct Sequence<'m> {
    /// The capture.
    model: &'m Model,
    /// The last grid.
    finest: Grid,
    /// Points of the scan along x and y.
    scan: [usize; 2],
    /// Begin with a coarser grid.
    coarse_to_fine: bool,
    /// Coarser grids have deeper voxels, too, and all levels bins as wide as the voxels justify. The grid may be refined
    /// so often.
    refined: Option<usize>,
    /// [`Demand::pairs`].
    pairs: usize,
}

impl Sequence<'_> {
    /// The sequence that ends with the voxels of maps with the pixels of `grid`.
    fn of<'m>(model: &'m Model, grid: Grid, scan: [usize; 2], demand: &Demand) -> Sequence<'m> {
        Sequence {
            model,
            finest: grid.coarser(demand.pixels_per_voxel),
            scan,
            coarse_to_fine: demand.coarse_to_fine,
            refined: demand.refined.filter(|_| !demand.general),
            pairs: demand.pairs,
        }
    }

    /// The levels of the volume. They double from the scan's resolution, or from more where the final one is no power
    /// of two of it. Where pairs are spread, they double from [`AMPLE`] if the scan has more, with a part of the pairs;
    /// at the end there are more.
    fn levels(&self) -> Vec<Level> {
        let model = self.model;
        let first = |grid: Grid| (grid, model.enough(pairs_for(grid.n[0], first_of(self.pairs))));
        let mut steps: Vec<(Grid, usize)> = self.grids().into_iter().map(first).collect();
        if steps.last().is_some_and(|last| last.1 < model.pairs()) {
            steps.push((self.finest, model.pairs()));
        }
        let mut levels: Vec<Level> = vec![];
        // There are fewer than 64 levels: lateral voxels and pairs are 32-bit numbers.
        for (i, (grid, pairs)) in (0..).zip(steps) {
            let sum = if self.refined.is_some() { sum_of(model, &grid) } else { 1 };
            let like = |own: Buffer| match levels.iter().find(|l| l.sum == sum) {
                _ if sum == 1 => own,
                Some(same) if own == buffer::MEASURED => same.measured,
                Some(same) => same.taps,
                None => own.at(i),
            };
            let wall = if pairs == model.pairs() { buffer::WALL } else { buffer::WALL.at(i) };
            levels.push(Level {
                rendered: own_pairs(model, pairs, wall, buffer::SCENE.at(i)),
                grid,
                first: 0,
                pairs,
                sum,
                bins: (model.bins / sum).max(1),
                bin_width: model.bin_width * sum as f64,
                measured: like(buffer::MEASURED),
                taps: like(buffer::PULSE_TAPS),
                wall,
                scene: buffer::SCENE.at(i),
                reachable: buffer::REACHABLE.at(i),
            });
        }
        levels
    }

    /// The grids in order. From one to the next, voxels halve in width, in depth, or both.
    fn grids(&self) -> Vec<Grid> {
        let (finest, side) = (self.finest, self.scan[0].max(self.scan[1]));
        let least = if self.model.is_spread { side.min(AMPLE) } else { side };
        let mut wide = 1;
        while self.coarse_to_fine && finest.n[0].is_multiple_of(wide * 2) && finest.n[0] / (wide * 2) >= least
        {
            wide *= 2;
        }
        let deepest = |wide: usize| match self.refined {
            Some(_) => power_of_two(OF_WIDTH * wide as f64 * finest.pitch.x / finest.pitch.z),
            None => 1,
        };
        // From the finest to the coarsest. Wider voxels are deeper, too. Where they may be deeper still, there are grids
        // between, as many as the iterations allow.
        let between = self.refined.filter(|_| self.coarse_to_fine).unwrap_or(0);
        let mut between = between.saturating_sub(wide.ilog2() as usize);
        let mut sizes = vec![(1, 1)];
        loop {
            let (w, d) = sizes[sizes.len() - 1];
            sizes.push(if between > 0 && 2 * d <= deepest(w) {
                between -= 1;
                (w, 2 * d)
            } else if w < wide {
                (2 * w, (2 * d).min(deepest(2 * w)).max(d))
            } else {
                break;
            });
        }
        sizes.reverse();
        sizes.into_iter().map(|(wide, deep)| finest.larger(wide, deep)).collect()
    }
}

/// The largest power of two that is not above `most`; at least 1.
fn power_of_two(most: f64) -> usize {
    // A rounded ratio of two sizes may lie a little below.
    1 << (most.max(1.0) * (1.0 + 1e-6)).log2() as u32
}

/// The level on the maps' pixels, with the pairs of the last of `levels`.
fn of_pixels(model: &Model, levels: &[Level], maps: Grid) -> Option<Level> {
    let last = *levels.last()?;
    if last.grid == maps && last.sum == 1 {
        return Some(last);
    }
    Some(Level {
        grid: maps,
        sum: 1,
        bins: model.bins,
        bin_width: model.bin_width,
        measured: buffer::MEASURED,
        taps: buffer::PULSE_TAPS,
        scene: SURFACE_SCENE,
        rendered: own_pairs(model, last.pairs, last.wall, SURFACE_SCENE),
        ..last
    })
}

/// Batches of a surface's pairs.
const BATCHES: usize = 4;

/// Pairs of the smallest batch: a few of a scan may be missing.
const LEAST_BATCH: usize = 225;

/// Batches of the pairs of `level`, in order. As pairs are spread over the wall, so are those of a batch. Up to three pairs at
/// the end are in none.
fn in_batches(model: &Model, level: Option<&Level>) -> Vec<Level> {
    let batches = crate::dbg_of("BATCHES", 4.0) as usize;
    let pairs = model.pairs() / batches;
    // The rows of a product with several other points are not cut, nor are sums over spots.
    let rows = model.wall.geometry == Geometry::Product && model.wall.others.len() > 1;
    let cuts = !rows && model.rendered.is_none();
    let Some(level) = level
        .filter(|_| model.is_spread && cuts && pairs >= crate::dbg_of("LEASTB", LEAST_BATCH as f64) as usize)
    else {
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

/// The first `pairs` of a model, with these buffers.
fn own_pairs(model: &Model, pairs: usize, wall: Buffer, scene: Buffer) -> Pairs {
    let [scanned, others] =
        model.wall.geometry.counts(pairs, model.wall.scanned.len(), model.wall.others.len());
    Pairs { count: pairs, scanned, others, wall, scene }
}
