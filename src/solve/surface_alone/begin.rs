//! What the surface begins with: depths and albedos of a closed-form method, or a plane.

use std::ops::ControlFlow;

use super::options::{Begin, SurfaceAloneOptions};
use crate::capture::{Background, Capture};
use crate::maps::{Maps, percentile};
use crate::solve::closed_form::{FbpOptions, LctOptions};
use crate::solve::{Beside, Prepared, Progress, Solver, TracePoint, Watch};
use crate::transport::Grid;
use crate::{Error, Result};

/// Pixels of the surface have this share of the albedo above which the closed-form method sees a surface: rims are dim, and
/// what is no surface becomes dark.
const SUPPORT: f64 = 0.5;

/// A pair whose strongest bin has less than this share of the strongest of all pairs tells no first return.
const LIT: f32 = 0.1;

/// Light has come back when a bin has this share of the pair's strongest one.
const RISEN: f32 = 0.5;

/// The plane lies at this percentile of the depths that the pairs' first returns tell. The nearest pair tells the true one:
/// others see the object from the side. The smallest is one of noise.
const NEAREST: f64 = 10.0;

impl SurfaceAloneOptions {
    /// The closed-form method that the surface begins with; `None`: it begins with a plane.
    ///
    /// # Errors
    /// `Kind::Input`: the capture breaks an assumption of the method that was asked for.
    pub(super) fn first_method(&self, capture: &Capture) -> Result<Option<Box<dyn Solver>>> {
        let lct = LctOptions::default().with(|o| {
            o.lateral = self.lateral;
            o.snr = self.snr;
            o.image.reflectance = self.reflectance;
            o.image.min_depth = self.min_depth;
            o.image.background = self.background;
        });
        let takes = lct.takes(capture);
        Ok(match self.begin {
            Begin::Plane => None,
            Begin::Lct => {
                takes.map_err(|e| {
                    Error::input(
                        e.what,
                        "let the surface begin with fbp, with a plane, or with what the capture allows (auto)",
                    )
                })?;
                Some(Box::new(lct))
            }
            Begin::Auto if takes.is_ok() => Some(Box::new(lct)),
            Begin::Auto | Begin::Fbp => Some(Box::new(FbpOptions::default().with(|o| {
                o.lateral = self.lateral;
                o.image = lct.image;
            }))),
        })
    }
}

/// The surface of a closed-form method, with the brightest albedo 1. Pixels that are none have no depth. `watch` may cancel;
/// it hears of no iteration.
///
/// # Errors
/// Those of the method.
pub(super) fn of_method(
    method: &mut dyn Prepared,
    capture: &Capture,
    iterations: usize,
    watch: &mut Watch<'_>,
) -> Result<Maps> {
    let mut ask = |progress: &Progress| -> ControlFlow<()> {
        let point = TracePoint { iteration: 0, ..progress.point };
        (watch.hear)(&Progress { doing: progress.doing, point, iterations, remaining: None, maps: None })
    };
    let mut asking = Watch { hear: &mut ask, maps_every: None, maps_at: &[] };
    let mut maps = method.solve(capture, Beside::from(&mut asking))?.maps;
    let least = SUPPORT * maps.mask_fraction.unwrap_or(Maps::MASK_FRACTION);
    let there = Maps::mask_of(&maps.albedo, least);
    let most = maps.albedo.iter().copied().fold(0.0, f32::max);
    for (i, there) in there.into_iter().enumerate() {
        if there && maps.depth[i].is_finite() {
            maps.albedo[i] /= most;
        } else {
            (maps.albedo[i], maps.depth[i], maps.normal[i]) = (0.0, f32::NAN, [f32::NAN; 3]);
        }
    }
    Ok(maps)
}

/// A plane of albedo 1 that faces the wall, at the depth of the first returns; without any depth where no light comes back.
pub(super) fn plane(capture: &Capture, grid: &Grid, with_background: bool) -> Maps {
    let [near, far] = grid.depth_range();
    let at = depth_of_first_returns(capture, with_background).map(|z| z.clamp(near, far));
    let count = grid.n[0] * grid.n[1];
    let (albedo, normal) = if at.is_some() { (1.0, [0.0, 0.0, -1.0]) } else { (0.0, [f32::NAN; 3]) };
    Maps {
        albedo: vec![albedo; count],
        depth: vec![at.map_or(f32::NAN, |z| z as f32); count],
        normal: vec![normal; count],
        mask: vec![at.is_some(); count],
        ..Maps::empty([grid.n[0], grid.n[1]], grid.extent())
    }
}

/// The depth of the nearest surface by the first returns of all pairs, metres; `None` without light. A path belongs to the
/// point of its ellipsoid that is farthest from the wall.
fn depth_of_first_returns(capture: &Capture, with_background: bool) -> Option<f64> {
    let background = Background::of(capture, with_background);
    let rows =
        || (0..capture.pair_count()).map(|pair| (capture.histogram(pair), background.of_pair(pair) as f32));
    let strongest = |(row, level): (&[f32], f32)| row.iter().copied().fold(0.0, f32::max) - level;
    let most = rows().map(strongest).fold(0.0, f32::max);
    let depth = |((row, level), (l, s)): ((&[f32], f32), (&glam::DVec3, &glam::DVec3))| -> Option<f32> {
        let peak = Some(strongest((row, level))).filter(|peak| *peak > 0.0 && *peak >= LIT * most)?;
        let first = row.iter().position(|v| v - level >= RISEN * peak)?;
        let half = 0.5 * (capture.t_start + (first as f64 + 0.5) * capture.bin_width);
        let deep = (half * half - 0.25 * l.distance_squared(*s)).max(0.0).sqrt();
        Some((0.5 * (l.z + s.z) + deep) as f32)
    };
    let pairs = capture.laser.iter().zip(&capture.sensor);
    let all: Vec<f32> = rows().zip(pairs).filter_map(depth).collect();
    percentile(&all, NEAREST).map(f64::from)
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::*;
    use crate::transport::Volume;

    /// A scan over a point, whose pairs have these laser points; light in one bin, over a background.
    fn seen(target: DVec3, laser: impl Fn(DVec3) -> DVec3) -> Capture {
        let bins = 200;
        let sensor: Vec<DVec3> = (0..100)
            .map(|i| dvec3(f64::from(i / 10) / 9.0 - 0.5, f64::from(i % 10) / 9.0 - 0.5, 0.0))
            .collect();
        let laser: Vec<DVec3> = sensor.iter().map(|s| laser(*s)).collect();
        let mut counts = vec![2.0; bins * sensor.len()];
        for (row, (l, s)) in counts.chunks_mut(bins).zip(laser.iter().zip(&sensor)) {
            let path = l.distance(target) + s.distance(target);
            row[((path - 0.3) / 0.01) as usize] += 50.0;
        }
        let mut capture = Capture::new([10, 10], laser, sensor, bins, 0.01, counts);
        capture.t_start = 0.3;
        capture
    }

    #[test]
    fn a_plane_lies_where_the_first_light_comes_from() {
        let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 1.0) };
        let grid = Grid::new(volume, 8, 0.05).unwrap();
        let target = dvec3(0.1, -0.1, 0.7);
        let one_laser = dvec3(0.2, 0.1, 0.0);
        for capture in [seen(target, |s| s), seen(target, |_| one_laser)] {
            let maps = plane(&capture, &grid, true);
            maps.check().unwrap();
            // Pairs around see the point from the side.
            let off = f64::from(maps.depth[0]) - target.z;
            assert!((-0.02..0.05).contains(&off), "{off}");
            assert!(maps.depth.iter().all(|z| *z == maps.depth[0]));
        }
        let mut dark = seen(target, |s| s);
        dark.histograms.fill(0.0);
        assert!(plane(&dark, &grid, true).depth.iter().all(|z| z.is_nan()));
    }
}
