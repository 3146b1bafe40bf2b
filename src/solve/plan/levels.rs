//! The levels of a solve: from a coarse grid and a part of the pairs to the finest and all of them.

use crate::gpu::Buffer;
use crate::transport::kernels::buffer;
use crate::transport::{Geometry, Grid, Model};

/// One step of the coarse-to-fine sequence: a lateral resolution, how many pairs are used on it, and how wide their bins
/// are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The volume at this resolution.
    pub grid: Grid,
    /// How many pairs are used: the first ones.
    pub pairs: usize,
    /// Bins of a histogram.
    pub bins: usize,
    /// Metres of path.
    pub bin_width: f64,
    /// Buffer that holds the measurement in these bins.
    pub measured: Buffer,
    /// Buffer that holds the pulse's taps for these bins.
    pub taps: Buffer,
    /// Buffer that holds the wall points of these pairs.
    pub wall: Buffer,
    /// Buffer that holds its constants.
    pub scene: Buffer,
    /// Buffer that says which bricks can reach a bin.
    pub reachable: Buffer,
}

/// Constants of levels on the maps' pixels, where these are no voxels.
const SURFACE_SCENE: Buffer = Buffer::named("surface_scene");

/// Points side by side that are enough for a grid of as many or twice as many lateral voxels.
pub const AMPLE: usize = 32;

/// Other points of a product that are enough at first.
const ROWS: usize = 16;

/// The measurement in the wider bins of the volume, where it has such.
pub const SUMMED: Buffer = buffer::MEASURED.at(0);
/// The pulse's taps for these bins.
const SUMMED_TAPS: Buffer = buffer::PULSE_TAPS.at(0);

/// How many bins of `model` a volume with voxels as deep as those of `grid` needs no finer than as one. A path to a
/// surface and back changes by twice its depth, so voxels are two bins of path deep where bins are not summed.
pub(super) fn sum_of(model: &Model, grid: &Grid) -> usize {
    ((grid.pitch.z / model.bin_width + 1e-6) as usize).clamp(1, model.bins)
}

/// The levels of the volume. They double from the scan's resolution, or from more where the final one is no power of
/// two of it. Where pairs are spread, they double from [`AMPLE`] if the scan has more, with a part of the pairs; at
/// the end this part grows fourfold until it is all.
///
/// `summed` is the model in the volume's own bins, if these are wider than those of `model`.
pub(super) fn of_volume(
    model: &Model,
    summed: Option<&Model>,
    finest: Grid,
    scan: [usize; 2],
    coarse_to_fine: bool,
) -> Vec<Level> {
    let side = scan[0].max(scan[1]);
    let least = if model.is_spread { side.min(AMPLE) } else { side };
    let mut factor = 1;
    while coarse_to_fine && finest.n[0].is_multiple_of(factor * 2) && finest.n[0] / (factor * 2) >= least {
        factor *= 2;
    }
    let grids = (0..=factor.ilog2()).map(|i| finest.coarser(factor >> i));
    let mut steps: Vec<(Grid, usize)> =
        grids.map(|grid| (grid, part(model, share(model, grid.n[0])))).collect();
    let mut rest = share(model, finest.n[0]);
    while rest > 1 {
        rest /= 4;
        let pairs = part(model, rest);
        if steps.last().is_some_and(|last| last.1 < pairs) {
            steps.push((finest, pairs));
        }
    }
    let level = |(i, (grid, pairs)): (u8, (Grid, usize))| Level {
        grid,
        pairs,
        bins: summed.unwrap_or(model).bins,
        bin_width: summed.unwrap_or(model).bin_width,
        measured: if summed.is_some() { SUMMED } else { buffer::MEASURED },
        taps: if summed.is_some() { SUMMED_TAPS } else { buffer::PULSE_TAPS },
        wall: if pairs == model.pairs() { buffer::WALL } else { buffer::WALL.at(i) },
        scene: buffer::SCENE.at(i),
        reachable: buffer::REACHABLE.at(i),
    };
    // Lateral voxels and pairs are 32-bit numbers: there are fewer than 64 levels.
    (0..).zip(steps).map(level).collect()
}

/// The levels on the maps' pixels, with as many pairs as the finest of `levels` have.
pub(super) fn of_pixels(model: &Model, levels: &[Level], maps: Grid) -> Vec<Level> {
    let Some(finest) = levels.last().map(|l| l.grid) else { return vec![] };
    let of_finest = levels.iter().filter(|l| l.grid == finest);
    if finest == maps && levels.iter().all(|l| l.bins == model.bins) {
        return of_finest.copied().collect();
    }
    let level = |(i, l): (u8, &Level)| Level {
        grid: maps,
        bins: model.bins,
        bin_width: model.bin_width,
        measured: buffer::MEASURED,
        taps: buffer::PULSE_TAPS,
        scene: SURFACE_SCENE.at(i),
        ..*l
    };
    (0..).zip(of_finest).map(level).collect()
}

/// The share of the pairs, 1 in 4 or 16 or ..., that a grid of `lateral` voxels is solved with at first: half as many
/// points side by side as voxels, but at least [`AMPLE`].
fn share(model: &Model, lateral: usize) -> usize {
    let wanted = AMPLE.max(lateral / 2).pow(2);
    let mut share = 1;
    while model.is_spread && model.pairs() / (4 * share) >= wanted {
        share *= 4;
    }
    share
}

/// How many pairs 1 in `share` are. Of a product: whole rows, of at least [`ROWS`] other points.
fn part(model: &Model, share: usize) -> usize {
    let rows = model.wall.others.len();
    if model.wall.geometry != Geometry::Product || rows == 1 {
        return model.pairs().div_ceil(share);
    }
    rows.div_ceil(share).max(ROWS.min(rows)) * model.wall.scanned.len()
}
