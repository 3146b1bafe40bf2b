//! A learned start: a small network looks at filtered back-projections of a capture and says where surface is, and how deep.
//!
//! It was trained on simulated scenes alone, crowded and noisy ones. All lengths are in walls, so units do not matter: its box is one
//! wall wide and reaches from [`NEAR`] to 1.6 walls. It knows the light of rooms and of noise, which a fit explains by surfaces.

use std::borrow::Cow;

use glam::{DVec3, dvec3};
use rayon::prelude::*;

use crate::capture::{Capture, PairKind};
use crate::gpu::{DeviceKind, Gpu};
use crate::maps::Maps;
use crate::transport::Grid;
use crate::{Kind, Result};

mod bands;
mod conclusion;
mod device;
mod expectation;
mod graph;
mod network;
mod project;
mod rows;
pub mod schedule;
mod sizes;
mod tensor;

pub(super) use bands::Bands;
pub use conclusion::{Conclusion, PIXELS, promised_iou};
use device::answer_on;
pub use device::{LearnedScan, logits_on};
pub(super) use expectation::expected_iou;
use network::Answer;
pub use network::Network;
use project::{Pair, project};
pub(super) use rows::BandRows;
use sizes::*;
pub use sizes::{BANDS, DEEP, NEAR, SIDE};
use tensor::Tensor;

/// Pairs that it looks at, at most; and at least, as it has seen no scan coarser than 8 × 8 points.
pub const MOST_PAIRS: usize = 1024;
pub const LEAST_PAIRS: usize = 49;

/// Probabilities above which pixels are the first surface of a fit, and of a fit whose support stays.
pub const SURE: f32 = 0.3;
pub const POSSIBLE: f32 = 0.2;

/// Probability of a surface that the network does not see, but held-out pairs show.
const SHOWN: f32 = 0.8;

/// Pixels that are no surface to speak of.
const STRAY: usize = 16;

/// The widest box, walls.
pub const WIDEST: f64 = 1.5;

/// Voxels on each side of the most probable one that give its depth.
const AROUND: usize = 2;

/// What the network says of a capture.
#[derive(Debug, Clone)]
pub struct LearnedStart {
    /// Probability of surface, [x][y] of 2 [`SIDE`] pixels.
    mask: Vec<f32>,
    /// Depth, metres, [x][y] of [`SIDE`] pixels.
    depth: Vec<f32>,
    /// x and y of the box's near corner and its width, metres.
    corner: [f64; 2],
    wall: f64,
}

impl LearnedStart {
    /// Looks at a capture, which has counts: with kernels, or on the host where these are slower or do not fit. `None`: too few
    /// pairs. `extent`: x0, x1, y0, y1 of the maps, metres, if they may reach beyond the wall. `memory` is a budget in bytes.
    ///
    /// # Errors
    /// Pairs cannot be chosen, or the device fails.
    pub fn of(
        gpu: &Gpu,
        capture: &Capture,
        extent: Option<[f64; 4]>,
        memory: Option<u64>,
    ) -> Result<Option<LearnedStart>> {
        if matches!(gpu.info.kind, DeviceKind::Host | DeviceKind::Cpu) {
            return LearnedStart::on_host(capture, extent);
        }
        match LearnedStart::on_device(gpu, capture, extent, memory) {
            Err(e) if e.kind == Kind::Memory => LearnedStart::on_host(capture, extent),
            seen => seen,
        }
    }

    /// As [`LearnedStart::of`], on the host.
    ///
    /// # Errors
    /// Pairs cannot be chosen.
    pub fn on_host(capture: &Capture, extent: Option<[f64; 4]>) -> Result<Option<LearnedStart>> {
        let Some(capture) = looked_at(capture)? else { return Ok(None) };
        let wall = BoxOfWall::of(&capture, extent);
        let Answer { depth, mask } = answer(&Network::trained(), wall.bands(&capture), kind(&capture));
        let voxels = depth.chunks(DEEP).map(index).collect();
        Ok(Some(wall.start(voxels, mask)))
    }

    /// As [`LearnedStart::of`], with kernels.
    ///
    /// # Errors
    /// Pairs cannot be chosen, or the device or its memory fails.
    pub fn on_device(
        gpu: &Gpu,
        capture: &Capture,
        extent: Option<[f64; 4]>,
        memory: Option<u64>,
    ) -> Result<Option<LearnedStart>> {
        let Some(capture) = looked_at(capture)? else { return Ok(None) };
        let wall = BoxOfWall::of(&capture, extent);
        let scan = LearnedScan {
            pairs: (0..capture.pair_count()).map(|pair| wall.ends(&capture, pair)).collect(),
            counts: &capture.histograms,
            bins: wall.bins(&capture),
            pitch: PITCH,
        };
        let [voxels, mask] = answer_on(gpu, &scan, kind(&capture), memory)?;
        Ok(Some(wall.start(voxels, mask)))
    }

    /// The share of the union of its mask and the true one that both have, as it expects.
    pub fn expected_iou(&self) -> f64 {
        let is_surface: Vec<bool> = self.mask.iter().map(|p| *p > 0.5).collect();
        promised_iou(&is_surface, &self.mask)
    }

    /// How far from the middle of its box surface reaches, in halves of its width; all but the [`STRAY`] outermost pixels.
    pub fn reach(&self) -> f64 {
        let from_middle = |i: usize| ((i as f64 + 0.5) / SIDE as f64 - 1.0).abs();
        let pixels = self.mask.iter().enumerate().filter(|(_, p)| **p > SURE);
        let mut all: Vec<f64> =
            pixels.map(|(i, _)| from_middle(i / (2 * SIDE)).max(from_middle(i % (2 * SIDE)))).collect();
        all.sort_by(|a, b| b.total_cmp(a));
        all.get(STRAY).copied().unwrap_or(0.0)
    }

    /// The surface on the pixels of a grid, with albedo 1: all pixels of at least a probability.
    pub fn maps(&self, grid: &Grid, least: f32) -> Maps {
        let [near, far] = grid.depth_range().map(|z| z as f32);
        self.surface(Maps::empty([grid.n[0], grid.n[1]], grid.extent()), |p, z| {
            p > least && (near..=far).contains(&z)
        })
    }

    /// The surface on the pixels of other maps, at any depth.
    pub fn maps_like(&self, maps: &Maps) -> Maps {
        self.surface(Maps::empty([maps.nx, maps.ny], maps.extent), |p, _| p > 0.5)
    }

    fn surface(&self, mut maps: Maps, is_surface: impl Fn(f32, f32) -> bool) -> Maps {
        for pixel in 0..maps.depth.len() {
            let at = maps.centre(pixel / maps.ny, pixel % maps.ny);
            let Some((_, depth)) = self.at(at).filter(|(p, z)| is_surface(*p, *z)) else { continue };
            (maps.albedo[pixel], maps.depth[pixel], maps.normal[pixel]) = (1.0, depth, [0.0, 0.0, -1.0]);
            maps.mask[pixel] = true;
        }
        maps
    }

    /// This, with the surface of `fitted` where the network is not sure of one: what held-out pairs showed.
    pub fn joined(&self, fitted: &Maps) -> LearnedStart {
        let mut joined = self.clone();
        let of = |x: usize, y: usize, n: usize| {
            let at = [x, y].map(|i| (i as f64 + 0.5) / n as f64 * self.wall);
            let pixel = fitted.pixel_at(self.corner[0] + at[0], self.corner[1] + at[1])?;
            Some(fitted.depth[pixel]).filter(|z| z.is_finite())
        };
        for x in 0..2 * SIDE {
            for y in 0..2 * SIDE {
                let pixel = x * 2 * SIDE + y;
                if self.mask[pixel] <= SURE && of(x, y, 2 * SIDE).is_some() {
                    joined.mask[pixel] = SHOWN;
                }
            }
        }
        for column in 0..SIDE * SIDE {
            let [x, y] = [column / SIDE, column % SIDE];
            let is_sure = |i: usize| self.mask[(2 * x + i / 2) * 2 * SIDE + 2 * y + i % 2] > SURE;
            if let Some(depth) = of(x, y, SIDE).filter(|_| !(0..4).any(is_sure)) {
                joined.depth[column] = depth;
            }
        }
        joined
    }

    /// Probability of surface at the pixels of maps; 0 beside the box.
    pub fn probabilities(&self, maps: &Maps) -> Vec<f32> {
        let of =
            |pixel: usize| self.at(maps.centre(pixel / maps.ny, pixel % maps.ny)).map_or(0.0, |(p, _)| p);
        (0..maps.depth.len()).map(of).collect()
    }

    /// Probability of surface, and its depth, at a lateral position.
    pub(super) fn at(&self, position: [f64; 2]) -> Option<(f32, f32)> {
        let [x, y]: [f64; 2] = std::array::from_fn(|k| (position[k] - self.corner[k]) / self.wall);
        if ![x, y].iter().all(|u| (0.0..1.0).contains(u)) {
            return None;
        }
        let n = 2 * SIDE;
        let place = |u: f64| {
            let at = (u * n as f64 - 0.5).clamp(0.0, (n - 1) as f64);
            (at as usize, at.fract() as f32)
        };
        let ((i, a), (j, b)) = (place(x), place(y));
        let mask = |i: usize, j: usize| self.mask[i.min(n - 1) * n + j.min(n - 1)];
        let row = |i: usize| mask(i, j) * (1.0 - b) + mask(i, j + 1) * b;
        let column = |u: f64| (u * SIDE as f64) as usize;
        Some((row(i) * (1.0 - a) + row(i + 1) * a, self.depth[column(x) * SIDE + column(y)]))
    }
}

/// The pairs that the network looks at; `None`: too few.
fn looked_at(capture: &Capture) -> Result<Option<Cow<'_, Capture>>> {
    Ok(if capture.pair_count() < LEAST_PAIRS { None } else { Some(some_of(capture)?) })
}

/// At most [`MOST_PAIRS`].
fn some_of(capture: &Capture) -> Result<Cow<'_, Capture>> {
    let is_few = capture.pair_count() <= MOST_PAIRS;
    Ok(if is_few { Cow::Borrowed(capture) } else { Cow::Owned(capture.subset(MOST_PAIRS, 0)?) })
}

/// Kind of the pairs for the network: 0 confocal, 1 one laser or sensor point, 2 other.
#[doc(hidden)]
pub fn kind(capture: &Capture) -> usize {
    match capture.pair_kind() {
        PairKind::Confocal => 0,
        PairKind::OneLaser | PairKind::OneSensor => 1,
        PairKind::Exhaustive { .. } | PairKind::Irregular => 2,
    }
}

/// Bands of a capture at the voxels of the box, [band][x][y][z]: [`BANDS`] of [`SIDE`] x [`SIDE`] x [`DEEP`]. The network is trained on
/// them.
///
/// # Errors
/// Pairs cannot be chosen.
#[doc(hidden)]
pub fn input(capture: &Capture) -> Result<Vec<f32>> {
    let capture = some_of(capture)?;
    let volume = BoxOfWall::of(&capture, None).bands(&capture);
    let rows =
        (0..BANDS * SIDE * SIDE).flat_map(|i| volume.along_z(i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE));
    Ok(rows.copied().collect())
}

/// Where the network's box lies: the middle of its face, and its width, metres, which stands for that of the wall.
pub(super) struct BoxOfWall {
    pub centre: DVec3,
    pub wall: f64,
}

impl BoxOfWall {
    /// As wide as the wall; as maps of this extent that reach beyond it, up to [`WIDEST`] walls.
    pub fn of(capture: &Capture, extent: Option<[f64; 4]>) -> BoxOfWall {
        let [x0, x1, y0, y1] = capture.wall_extent();
        let points = || capture.laser.iter().chain(&capture.sensor);
        let base = points().map(|p| p.z).sum::<f64>() / points().count() as f64;
        let (centre, wall) = (dvec3(0.5 * (x0 + x1), 0.5 * (y0 + y1), base), (x1 - x0).max(y1 - y0));
        let reach = extent.map_or(0.0, |[a, b, c, d]| {
            [centre.x - a, b - centre.x, centre.y - c, d - centre.y].into_iter().fold(0.0, f64::max)
        });
        // Of what is hardly wider, as by the rounding of a file, nothing changes.
        let wider = if 2.0 * reach > 1.01 * wall { (2.0 * reach).min(WIDEST * wall) } else { wall };
        BoxOfWall { centre, wall: wider }
    }

    /// Laser and sensor point of a pair, in walls from the middle of the face.
    pub fn ends(&self, capture: &Capture, pair: usize) -> [DVec3; 2] {
        [capture.laser[pair], capture.sensor[pair]].map(|p| (p - self.centre) / self.wall)
    }

    /// Path at which the first bin begins, and width of a bin, walls.
    fn bins(&self, capture: &Capture) -> [f64; 2] {
        [capture.t_start / self.wall, capture.bin_width / self.wall]
    }

    /// Bands of all pairs at the voxels of the box, in the first of [`CHANNELS`].
    fn bands(&self, capture: &Capture) -> Tensor {
        let bands = Bands::new();
        let of_pair = |pair| {
            let [laser, sensor] = self.ends(capture, pair);
            Pair::new(laser, sensor, bands.of(capture.histogram(pair), self.bins(capture)))
        };
        let pairs: Vec<Pair> = (0..capture.pair_count()).into_par_iter().map(of_pair).collect();
        project(&pairs, CHANNELS)
    }

    /// The start of voxels by column, and of the mask's logits.
    fn start(&self, voxels: Vec<f32>, mask: Vec<f32>) -> LearnedStart {
        let BoxOfWall { centre, wall } = *self;
        let metres = |index: f32| centre.z as f32 + ((NEAR + (f64::from(index) + 0.5) * PITCH) * wall) as f32;
        LearnedStart {
            mask: mask.into_iter().map(|logit| 1.0 / (1.0 + (-logit).exp())).collect(),
            depth: voxels.into_iter().map(metres).collect(),
            corner: [centre.x - 0.5 * wall, centre.y - 0.5 * wall],
            wall,
        }
    }
}

/// The network's answer for a volume of bands: logits of depths and of the mask. The other channels say what kind of pairs they are
/// from, and how deep a voxel lies.
fn answer(network: &Network<'_>, mut input: Tensor, kind: usize) -> Answer {
    input.fill(|channel, _, _, row| match channel.checked_sub(BANDS) {
        None => {}
        Some(KINDS) => {
            let scale = 2.0 / (DEEP - 1) as f32;
            row.iter_mut().enumerate().for_each(|(z, v)| *v = z as f32 * scale - 1.0);
        }
        Some(of) => row.fill(if of == kind { 1.0 } else { 0.0 }),
    });
    network.answer(input)
}

/// As [`answer`], of bands [band][x][y][z], by a file of weights or by those of the program.
#[doc(hidden)]
pub fn logits(weights: Option<&[u8]>, bands: &[f32], kind: usize) -> [Vec<f32>; 2] {
    let mut input = Tensor::zeros(CHANNELS, [SIDE, SIDE, DEEP]);
    input.fill(|band, x, y, row| {
        if band < BANDS {
            row.copy_from_slice(&bands[((band * SIDE + x) * SIDE + y) * DEEP..][..DEEP]);
        }
    });
    let network = match weights {
        Some(file) => Network::of(file),
        None => Network::trained(),
    };
    let Answer { depth, mask } = answer(&network, input, kind);
    [depth, mask]
}

/// The most probable voxel, with its fraction.
fn index(logits: &[f32]) -> f32 {
    let top = (0..logits.len()).max_by(|a, b| logits[*a].total_cmp(&logits[*b])).expect("voxels");
    let near = top.saturating_sub(AROUND)..(top + AROUND + 1).min(logits.len());
    let [sum, all] = near.fold([0.0; 2], |[sum, all], i| {
        let p = (logits[i] - logits[top]).exp();
        [sum + p * i as f32, all + p]
    });
    sum / all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_show_is_seen_where_the_network_is_not_sure() {
        let n = 2 * SIDE;
        let mask = (0..n * n).map(|p| if p / n < n / 2 { 0.9 } else { 0.1 }).collect();
        let seen = LearnedStart { mask, depth: vec![0.5; SIDE * SIDE], corner: [-0.5; 2], wall: 1.0 };
        // A fit at y < 0.
        let mut fitted = Maps::empty([8, 8], [-0.5, 0.5, -0.5, 0.5]);
        (0..64).filter(|p| p % 8 < 4).for_each(|p| fitted.depth[p] = 0.7);
        let joined = seen.joined(&fitted);
        let at = |x: f64, y: f64| joined.at([x, y]).unwrap();
        assert_eq!(at(-0.25, -0.25), (0.9, 0.5), "the network's own");
        assert_eq!(at(0.25, -0.25), (SHOWN, 0.7));
        assert_eq!(at(0.25, 0.25), (0.1, 0.5), "neither");
    }
}
