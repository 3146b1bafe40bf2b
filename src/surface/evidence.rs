//! What is known of every pixel after a fit, as channels for the network that has the last word (`learn/README.md`), and what follows
//! from that.
//!
//! Light that a fit leaves is the best witness of what it lacks: where surface is missing, light is left; where there is too much of
//! it, light is missing. So the measurement and its residual are back-projected onto the fitted depth, in the bands of the start.

use rayon::prelude::*;

use super::fit::{Fit, Quality, Residuals};
use super::support;
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::engine::Evidence;
use crate::learned::{self, BANDS, BandRows, Bands, BoxOfWall, Conclusion, LearnedStart, SIDE, kind};
use crate::maps::Maps;

/// Pairs that are back-projected, at most.
const PAIRS: usize = 256;
/// Pixels from this probability on are looked at, and those around them within this reach; so are those of the fit.
const POSSIBLE: f32 = 0.01;
const AROUND: isize = 2;
/// Pixels of a task.
const TOGETHER: usize = 64;
/// Where no depth is known, channels have this one, walls.
const NO_DEPTH: f32 = 0.0;

/// Two of three errors of a Laplace law are below this multiple of its scale.
const BOUND: f32 = 1.139;

/// A fit, and what it began with.
pub(super) struct Known<'k> {
    pub capture: &'k Capture,
    pub layers: &'k [Maps],
    /// The maps of the layers.
    pub maps: &'k Maps,
    pub seen: &'k LearnedStart,
    /// A light-cone transform: the brightest surface of every column.
    pub light: Option<&'k Maps>,
    pub quality: Quality,
    /// The support is that of the start.
    pub is_closed: bool,
}

impl Known<'_> {
    /// The channels; `None` if the present surface of the fit shows nothing.
    ///
    /// # Errors
    /// The device fails.
    pub fn evidence(&self, fit: &mut Fit) -> Result<Option<Evidence>> {
        let Known { capture, layers, maps, seen, .. } = *self;
        let Some(residuals) = fit.residuals(PAIRS)? else { return Ok(None) };
        let wall = BoxOfWall::of(capture, Some(maps.extent));
        let [base, width] = [wall.centre.z, wall.wall];
        let walls = |z: f32| if z.is_finite() { ((f64::from(z) - base) / width) as f32 } else { NO_DEPTH };
        let count = maps.depth.len();
        let centre = |pixel: usize| maps.centre(pixel / maps.ny, pixel % maps.ny);
        let at: Vec<Option<(f32, f32)>> = (0..count).map(|p| seen.at(centre(p))).collect();
        let light = self.light.map(|light| light.finer((maps.nx / light.nx).max(1)));
        let present: Vec<bool> = maps.depth.iter().map(|z| z.is_finite()).collect();
        let depth: Vec<f32> = (0..count)
            .map(|p| match (present[p], at[p], &light) {
                (true, ..) => walls(maps.depth[p]),
                (_, Some((_, z)), _) => walls(z),
                (.., Some(light)) => walls(light.depth[p]),
                _ => NO_DEPTH,
            })
            .collect();
        let near: Vec<bool> = (0..count)
            .into_par_iter()
            .map(|pixel| {
                let is_near = |p: usize| present[p] || at[p].is_some_and(|(q, _)| q > POSSIBLE);
                is_near(pixel) || support::around(maps, pixel, AROUND).any(|(other, _)| is_near(other))
            })
            .collect();
        let looked: Vec<usize> = (0..count).filter(|p| near[*p] && depth[*p] > NO_DEPTH).collect();
        let bands = projected(&residuals, capture, &wall, maps, &looked, &depth);
        let typical = support::typical_albedo(layers).unwrap_or(1.0);
        let smooth = support::smoothed(maps, typical);
        let white = light.as_ref().map_or(1.0, |light| Maps::white(&light.albedo).max(f32::MIN_POSITIVE));
        let mut channels: Vec<Vec<f32>> = vec![];
        let mut add = |of: &(dyn Fn(usize) -> f32 + Sync)| channels.push((0..count).map(of).collect());
        let flag = |is: bool| f32::from(u8::from(is));
        let side = SIDE as f32;
        let slope = |p: usize, k: usize| match maps.normal[p] {
            n if n[2] < -0.05 => (-n[k] / n[2]).clamp(-2.0, 2.0),
            _ => 0.0,
        };
        let off = |z: f32, p: usize| ((z - depth[p]) * side).clamp(-6.0, 6.0) / 3.0;
        add(&|p| at[p].map_or(0.0, |(q, _)| logit(q) / 4.0));
        add(&|p| flag(at[p].is_some()));
        add(&|p| at[p].map_or(0.0, |(_, z)| off(walls(z), p)));
        add(&|p| flag(present[p]));
        add(&|p| (maps.albedo[p] / typical).clamp(0.0, 3.0));
        add(&|p| (layers[0].albedo[p] / typical).clamp(0.0, 3.0));
        add(&|p| (smooth[p] / typical).clamp(0.0, 3.0));
        add(&|p| slope(p, 0));
        add(&|p| slope(p, 1));
        add(&|p| layers.get(1).map_or(0.0, |layer| flag(layer.depth[p].is_finite())));
        add(&|p| maps.behind.as_ref().map_or(0.0, |behind| flag(behind.depth[p].is_finite())));
        add(&|p| light.as_ref().map_or(0.0, |light| (light.albedo[p] / white).clamp(0.0, 2.0)));
        let lit = |light: &Maps, p: usize| {
            if light.depth[p].is_finite() { off(walls(light.depth[p]), p) } else { 0.0 }
        };
        add(&|p| light.as_ref().map_or(0.0, |light| lit(light, p)));
        let [three, five, nine] = [1, 2, 4].map(|reach| box_mean(&depth, [maps.nx, maps.ny], reach));
        add(&|p| 2.0 * depth[p] - 1.0);
        add(&|p| ((depth[p] - five[p]) * side).clamp(-4.0, 4.0));
        add(&|p| ((three[p] - nine[p]) * side).clamp(-4.0, 4.0));
        add(&|p| flag(near[p]));
        add(&|p| flag(maps.mask[p]));
        // Of the measurement and of the residual, which are zero where nothing was looked at.
        let mut of_pixel = vec![[0.0f32; 2 * BANDS]; count];
        looked.iter().zip(&bands).for_each(|(p, values)| of_pixel[*p] = *values);
        let cells = near.iter().filter(|n| **n).count().max(1) as f32;
        let root = |k: usize| (bands.iter().map(|v| v[k] * v[k]).sum::<f32>() / cells).sqrt();
        let roots: Vec<f32> = (0..2 * BANDS).map(root).collect();
        let mut shares = [0.0f32; BANDS];
        for k in 0..BANDS {
            let scale = 1.0 / roots[k].max(1e-20);
            shares[k] = roots[k + BANDS] * scale + 1e-6;
            add(&|p| (of_pixel[p][k] * scale).asinh() / 1.2);
            add(&|p| (5.0 * of_pixel[p][k + BANDS] * scale).asinh());
            add(&|p| (of_pixel[p][k + BANDS] * scale / shares[k]).asinh() / 1.2);
        }
        let numbers = self.numbers(width, f64::from(support::flatness(layers, typical)), shares);
        numbers.into_iter().for_each(|v| channels.push(vec![v as f32; count]));
        channels.par_iter_mut().for_each(|of| of.iter_mut().for_each(|v| *v = v.clamp(-8.0, 8.0)));
        let mask = maps.mask.clone();
        Ok(Some(Evidence { channels, depth, mask, expected_iou: 0.0, wall: [base, width] }))
    }

    /// What is the same for all pixels, for a wall of this width; `shares`: root mean square of the residual's bands over those of the
    /// measurement.
    fn numbers(&self, width: f64, flatness: f64, shares: [f32; BANDS]) -> Vec<f64> {
        let Known { capture, quality, .. } = *self;
        let ten = |v: f64| v.max(1e-4).log10();
        let of_box = |v: f64| (v / width * SIDE as f64).min(4.0);
        let kind = kind(capture);
        let of_capture = [
            ten(capture.pair_count() as f64) - 2.5,
            quality.noise_share(),
            0.5 * ten(quality.left_share()) + 1.0,
            0.5 * ten(quality.model_error()) + 1.0,
            of_box(capture.bin_width),
            of_box(capture.pulse.as_ref().map_or(0.0, Pulse::fwhm)),
            f64::from(u8::from(self.is_closed)),
            flatness,
            f64::from(u8::from(self.light.is_some())),
        ];
        let kinds = (0..3).map(|of| f64::from(u8::from(of == kind)));
        kinds.chain(of_capture).chain(shares.map(|share| 0.5 * ten(f64::from(share)) + 0.5)).collect()
    }
}

/// Gives maps what the network says of them: mask, probability, and errors of depths. Surface that the fit has not found gets the depth
/// of the start, and the typical albedo.
pub(super) fn conclude(evidence: Evidence, maps: &mut Maps) -> Evidence {
    let [base, width] = evidence.wall;
    let voxel = width / SIDE as f64;
    let typical = support::typical_albedo(std::slice::from_ref(maps)).unwrap_or(1.0);
    let said = Conclusion::of(None, &evidence.channels);
    let (mask, alone) = said.mask(&evidence.mask);
    let expected_iou = learned::expected_iou(&evidence.channels, &mask, alone, &said.scale);
    let mut errors = vec![f32::NAN; maps.depth.len()];
    for pixel in 0..maps.depth.len() {
        let is_surface = mask[pixel] && evidence.depth[pixel] > NO_DEPTH;
        maps.mask[pixel] = is_surface;
        if is_surface && !maps.depth[pixel].is_finite() {
            (maps.albedo[pixel], maps.normal[pixel]) = (typical, [0.0, 0.0, -1.0]);
            maps.depth[pixel] = (base + f64::from(evidence.depth[pixel]) * width) as f32;
        }
        if maps.depth[pixel].is_finite() {
            errors[pixel] = BOUND * (f64::from(said.scale[pixel]) * voxel) as f32;
        }
    }
    maps.probability = Some(said.probability());
    maps.depth_error = Some(errors);
    Evidence { expected_iou, ..evidence }
}

fn logit(p: f32) -> f32 {
    let p = p.clamp(1e-4, 1.0 - 1e-4);
    (p / (1.0 - p)).ln()
}

/// Bands of the measurement, and of what is left of it, back-projected onto pixels at their depths.
fn projected(
    residuals: &Residuals,
    capture: &Capture,
    wall: &BoxOfWall,
    maps: &Maps,
    pixels: &[usize],
    depth: &[f32],
) -> Vec<[f32; 2 * BANDS]> {
    let start = residuals.path.map(|v| v / wall.wall);
    let of_bands = Bands::new();
    let rows: Vec<BandRows> = residuals
        .pairs
        .par_iter()
        .enumerate()
        .map(|(row, pair)| {
            let records = [&residuals.measured, &residuals.differences]
                .map(|all| &all[row * residuals.bins..][..residuals.bins]);
            BandRows::new(&of_bands, wall.ends(capture, *pair), records, start)
        })
        .collect();
    let place = |p: &usize| {
        let [x, y] = maps.centre(p / maps.ny, p % maps.ny);
        [((x - wall.centre.x) / wall.wall) as f32, ((y - wall.centre.y) / wall.wall) as f32, depth[*p]]
    };
    let some = |pixels: &[usize]| {
        let places: Vec<[f32; 3]> = pixels.iter().map(place).collect();
        BandRows::at(&rows, &places)
    };
    pixels.par_chunks(TOGETHER).flat_map_iter(some).collect()
}

/// Means over squares of 2 `reach` + 1 pixels, less at borders.
fn box_mean(values: &[f32], [nx, ny]: [usize; 2], reach: usize) -> Vec<f32> {
    let along = |from: &[f32], count: usize, stride: usize| -> Vec<f32> {
        let of = |i: usize| {
            let at = i / stride % count;
            let [first, last] = [at.saturating_sub(reach), (at + reach).min(count - 1)];
            let sum: f32 = (first..=last).map(|k| from[i + k * stride - at * stride]).sum();
            sum / (last - first + 1) as f32
        };
        (0..from.len()).map(of).collect()
    };
    along(&along(values, ny, 1), nx, ny)
}
