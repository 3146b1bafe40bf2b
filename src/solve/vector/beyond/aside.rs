//! A box for a scene that is not in front of the scanned part of the wall.
//!
//! The box that is solved usually is as wide as the scan. If the volume of the box alone has much of its light at the box's
//! sides, and a wider one predicts other pairs better and has most of its light beyond, the scene itself is there, not
//! something beside it: the box must go where it is.

use rayon::prelude::*;

use super::{Fitted, INSIDE, Search, Sides, VectorOptions, Which};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::drive::Watch;
use crate::solve::vector::prepared::going_on;
use crate::transport::twin::{self, Sample, Twin};
use crate::transport::{Grid, Volume};

/// The wider box is looked at if the outermost coarse voxels of the box alone send at least this share of its light: .38 of
/// a figure mostly beside the scan, .22 of a body wider than it, .12 at most of scenes inside (benches/NOTES.md).
const AT_SIDES: f64 = 0.15;

/// The scene is elsewhere if at least this share of the wider box's light comes from beyond the box.
const ELSEWHERE: f64 = 0.5;

/// This share of the light may be left outside at every side of the new box. It is haze, or taken off later.
const OUTSIDE: f64 = 0.01;

/// Where the light of a scene comes from, if not from the usual box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aside {
    /// A box that holds nearly all of it, as deep as the usual one.
    pub volume: Volume,
    /// The share of the light that comes from beyond the usual box.
    pub beyond: f64,
    /// The shares of other pairs' squares that a wide box and the usual one leave.
    pub left: [f64; 2],
}

/// Looks where the scene is. `None` if it is in the box `inner`, which is the usual one, or if the scan has too few pairs to tell.
///
/// # Errors
/// The device fails, or the watch cancels.
pub fn aside(
    gpu: &Gpu,
    capture: &Capture,
    inner: &Grid,
    options: &VectorOptions,
    memory: Option<u64>,
    watch: &mut Watch<'_>,
) -> Result<Option<Aside>> {
    let found = Search::of(gpu, capture, inner, options, memory)
        .and_then(|search| search.map_or(Ok(None), |mut search| search.aside(capture, watch)));
    going_on(found)
}

impl Search {
    /// The box that holds the scene; `None` if the usual one does.
    fn aside(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Option<Aside>> {
        let sides = self.sides(capture)?;
        let Some(own) = self.fit(Which::Alone, &sides, watch)? else { return Ok(None) };
        let [x0, x1, y0, y1] = self.inner.extent();
        let [dx, dy] = [x1 - x0, y1 - y0].map(|width| width / INSIDE as f64);
        let at_sides =
            share(&lit(&own, &sides, &self.alone), |s| !within(s, [x0 + dx, x1 - dx, y0 + dy, y1 - dy]));
        if at_sides < AT_SIDES {
            return Ok(None);
        }
        let Some(more) = self.fit(Which::Wide, &sides, watch)? else { return Ok(None) };
        if !more.left.is_less(&own.left) {
            return Ok(None);
        }
        let lit = lit(&more, &sides, &self.wide);
        let beyond = share(&lit, |s| !within(s, [x0, x1, y0, y1]));
        let found =
            Aside { volume: around(&lit, &self.wide), beyond, left: [more.left.share(), own.left.share()] };
        Ok((beyond >= ELSEWHERE).then_some(found))
    }
}

/// A sample, and the light that all pairs get from it.
type Lit<'f> = (&'f Sample, f64);

/// The light of each sample of a coarse volume.
fn lit<'f>(fitted: &'f Fitted, sides: &Sides, grid: &Grid) -> Vec<Lit<'f>> {
    let twin = Twin { model: &sides.seen, grid };
    let of_pair =
        |s: &Sample, pair| twin::forward_pair(&twin, pair, std::slice::from_ref(s)).iter().sum::<f64>();
    let of = |s| (s, (0..sides.seen.pairs()).map(|pair| of_pair(s, pair)).sum());
    fitted.samples.par_iter().map(of).collect()
}

/// Whether a sample is in this lateral extent.
fn within(s: &Sample, [x0, x1, y0, y1]: [f64; 4]) -> bool {
    (x0..=x1).contains(&s.point.x) && (y0..=y1).contains(&s.point.y)
}

/// The share of the light that comes from these samples.
fn share(lit: &[Lit<'_>], of: impl Fn(&Sample) -> bool) -> f64 {
    let total: f64 = lit.iter().map(|l| l.1).sum();
    lit.iter().filter(|l| of(l.0)).map(|l| l.1).sum::<f64>() / total.max(f64::MIN_POSITIVE)
}

/// A square box with nearly all light, a coarse voxel wider at every side.
fn around(lit: &[Lit<'_>], grid: &Grid) -> Volume {
    let [x, y] = [0, 1].map(|axis| {
        let [low, high] = [OUTSIDE, 1.0 - OUTSIDE].map(|share| quantile(lit, axis, share));
        [low - 1.5 * grid.pitch[axis], high + 1.5 * grid.pitch[axis]]
    });
    let half = 0.5 * (x[1] - x[0]).max(y[1] - y[0]);
    let middle = [x, y].map(|[low, high]| 0.5 * (low + high));
    let [z0, z1] = grid.depth_range();
    Volume {
        min: glam::dvec3(middle[0] - half, middle[1] - half, z0),
        max: glam::dvec3(middle[0] + half, middle[1] + half, z1),
    }
}

/// The coordinate along `axis` below which this share of the light is.
fn quantile(lit: &[Lit<'_>], axis: usize, share: f64) -> f64 {
    let mut along: Vec<(f64, f64)> = lit.iter().map(|(s, light)| (s.point[axis], *light)).collect();
    along.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = share * along.iter().map(|a| a.1).sum::<f64>();
    let mut sum = 0.0;
    let reached = along.iter().find(|(_, light)| {
        sum += light;
        sum >= most
    });
    reached.or(along.last()).map_or(0.0, |a| a.0)
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::*;

    fn samples(at: impl Iterator<Item = DVec3>) -> Vec<Sample> {
        at.map(|point| Sample { point, albedo: 1.0, normal: DVec3::NEG_Z, length: 1.0 }).collect()
    }

    #[test]
    fn the_box_holds_the_light_but_for_dim_haze() {
        let volume = Volume { min: dvec3(-3.0, -3.0, 0.5), max: dvec3(3.0, 3.0, 1.5) };
        let grid = Grid::new(volume, 48, 0.0625).expect("a grid");
        // A plate of 0.5 by 1 m around (1.25, 0.5), and haze everywhere.
        let plate = (0..800).map(|i| dvec3(1.0 + 0.025 * (i % 20) as f64, 0.025 * (i / 20) as f64, 1.0));
        let haze = (0..100).map(|i| dvec3(0.06 * i as f64 - 3.0, 3.0 - 0.06 * i as f64, 1.0));
        let (plate, haze) = (samples(plate), samples(haze));
        let lit: Vec<Lit<'_>> =
            plate.iter().map(|s| (s, 1.0)).chain(haze.iter().map(|s| (s, 0.05))).collect();
        let found = around(&lit, &grid);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 0.05, "{a} {b}");
        near(found.min.x, 1.2375 - 0.675);
        near(found.max.x, 1.2375 + 0.675);
        near(found.min.y, 0.4875 - 0.675);
        near(found.max.y, 0.4875 + 0.675);
        assert_eq!((found.min.z, found.max.z), (grid.depth_range()[0], grid.depth_range()[1]));
        near(share(&lit, |s| within(s, [1.0, 1.5, 0.0, 1.0])), 800.0 / 805.0);
    }
}
