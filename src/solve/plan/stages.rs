//! The stages of a solve: from a coarse grid and a part of the pairs to the finest and all of them.

use super::{Level, SCENES, SURFACE_SCENES, WALL};
use crate::transport::{Geometry, Grid, Model};
use crate::{Error, Result};

/// Points side by side that are ample for a grid of as many or twice as many lateral voxels.
pub const AMPLE: usize = 32;

/// Other points of a product that are ample at first.
const ROWS: usize = 16;

/// By doubling from the scan's resolution (or more, where the final one is no power of two of it). Where pairs are
/// spread, from [`AMPLE`] if the scan has more, and with a part of the pairs that ends by growing fourfold until it is all.
pub(super) fn stages(
    model: &Model,
    finest: Grid,
    scan: [usize; 2],
    coarse_to_fine: bool,
) -> Result<Vec<Level>> {
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
    if steps.len() > SCENES.len() {
        return Err(Error::options(
            format!(
                "{} levels from a scan of {} x {} to {} lateral voxels",
                steps.len(),
                scan[0],
                scan[1],
                finest.n[0]
            ),
            "use a smaller --lateral, or --no-coarse-to-fine",
        ));
    }
    let level = |((grid, pairs), [scene, reachable, own]): ((Grid, usize), [&'static str; 3])| Level {
        grid,
        pairs,
        wall: if pairs == model.pairs() { WALL } else { own },
        scene,
        reachable,
    };
    Ok(steps.into_iter().zip(SCENES).map(level).collect())
}

/// The surface's: with as many pairs as the finest of `levels` have, on a grid with the maps' pixels.
pub(super) fn surface(levels: &[Level], maps: Grid) -> Vec<Level> {
    let Some(finest) = levels.last().map(|l| l.grid) else { return vec![] };
    let of_finest = levels.iter().filter(|l| l.grid == finest);
    if finest == maps {
        return of_finest.copied().collect();
    }
    of_finest.zip(SURFACE_SCENES).map(|(l, scene)| Level { grid: maps, scene, ..*l }).collect()
}

/// The share of the pairs, 1 in 4 or 16 or ..., that a grid of so many lateral voxels is solved with at first: half as
/// many points side by side as voxels, but at least [`AMPLE`].
fn share(model: &Model, lateral: usize) -> usize {
    let wanted = AMPLE.max(lateral / 2).pow(2);
    let mut share = 1;
    while model.is_spread && model.pairs() / (4 * share) >= wanted {
        share *= 4;
    }
    share
}

/// How many pairs one in so many are. Of a product whole rows, of at least [`ROWS`] other points.
fn part(model: &Model, share: usize) -> usize {
    let rows = model.wall.others.len();
    if model.wall.geometry != Geometry::Product || rows == 1 {
        return model.pairs().div_ceil(share);
    }
    rows.div_ceil(share).max(ROWS.min(rows)) * model.wall.scanned.len()
}
