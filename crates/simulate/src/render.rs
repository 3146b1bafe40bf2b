//! Renders transient histograms by area sampling with true visibility.

use super::elements::{SurfaceElement, elements};
use super::offsets::Offsets;
use super::visibility::Surfaces;
use super::{Dark, EmptyRoom, Exposure, Pairs, Reflectance, Scene, coarse, pile_up};
use crate::capture::{Capture, GainLaw};
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Accuracy of a rendering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderOptions {
    /// Target noise: RMS error over RMS value of the histogram bins, e.g. 0.01.
    pub noise: f64,
    /// Largest number of surface samples; each is seen from every pair.
    pub max_samples: usize,
    /// Seed of the samples; the photon noise has its own, [`Scene::seed`].
    pub seed: u64,
    /// `Some(n)`: a coarse rendering, for many scenes. One draw of about `max_samples` samples, without a measure of its noise, which is
    /// then NaN. Shadows are traced to n × n points of the wall, at least 2 × 2, and interpolated between them; a fixed laser or
    /// sensor point is traced, too. Scenes with spots are refused.
    pub coarse: Option<usize>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        RenderOptions { noise: 0.01, max_samples: 1 << 20, seed: 0, coarse: None }
    }
}

/// Progress of a rendering: its samples grow until few pairs have the target noise, then all pairs are rendered. If their noise is
/// above the target, they are rendered again with more samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RenderProgress {
    /// Surface samples.
    pub samples: usize,
    /// Pairs that are rendered with these samples.
    pub done: usize,
    /// All pairs.
    pub of: usize,
}

/// A rendered capture and its noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// The capture.
    pub capture: Capture,
    /// Achieved noise: RMS error over RMS value, from the difference of two independent halves of the samples,
    /// without photon noise.
    pub noise: f64,
    /// Surface samples used, both halves together.
    pub samples: usize,
    /// The exposure that drew the counts, if they are photons.
    pub exposure: Option<Exposure>,
    /// True if `noise` is within the target, false if `max_samples` was reached first.
    pub converged: bool,
}

/// Renders the scene's scan, convolves it with the impulse response, and applies the gains of a laser near the wall, pile-up and photon
/// noise, if configured.
///
/// # Errors
/// Those of [`render`], [`pile_up`] and [`photon_noise`](super::photon_noise), and a scene that sends no light to the wall.
pub fn simulate(scene: &Scene, options: &RenderOptions) -> Result<Rendering> {
    simulate_watched(scene, options, &|_| {})
}

/// As [`simulate`]; `hear` is called with the progress of the rendering, by several threads.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_watched(
    scene: &Scene,
    options: &RenderOptions,
    hear: &(dyn Fn(RenderProgress) + Sync),
) -> Result<Rendering> {
    simulate_exposed(scene, None, options, hear)
}

/// As [`simulate_watched`], in this exposure, as of another scene of the same instrument; `None`: that of [`Scene::photons`].
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_exposed(
    scene: &Scene,
    exposure: Option<Exposure>,
    options: &RenderOptions,
    hear: &(dyn Fn(RenderProgress) + Sync),
) -> Result<Rendering> {
    let mut rendering = lit(scene, options, hear)?;
    if let Some(photons) = scene.photons {
        let own = || Exposure::of(&rendering.capture, photons, scene.dark, scene.pile_up);
        let exposure = exposure.map_or_else(own, Ok)?;
        rendering.capture = exposure.draw(&rendering.capture, scene.seed);
        rendering.exposure = Some(exposure);
    } else if let Some(mean) = scene.pile_up {
        pile_up(&mut rendering.capture, mean)?;
    }
    Ok(rendering)
}

/// As [`simulate_watched`], and the capture of the room alone ([`Scene::emptied`]), with the exposure of the scene and noise of its own.
///
/// # Errors
/// Those of [`simulate`]; a scene without room and dark counts; pile-up without photons; `how` out of range.
pub fn simulate_empty(
    scene: &Scene,
    how: &EmptyRoom,
    options: &RenderOptions,
    hear: &(dyn Fn(RenderProgress) + Sync),
) -> Result<(Rendering, Capture)> {
    how.check()?;
    let mut rendering = lit(scene, options, hear)?;
    let exposure =
        scene.photons.map(|photons| Exposure::of(&rendering.capture, photons, scene.dark, scene.pile_up));
    let exposure = exposure.transpose()?;
    if scene.pile_up.is_some() && exposure.is_none() {
        return Err(Error::options(
            "pile-up of an empty room needs counts",
            "set the photons expected in the strongest bin too",
        ));
    }
    let mut room = rendering.capture.clone();
    match scene.room.min(scene.objects.len()) {
        0 if scene.dark == Dark::Counts(0.0) => {
            return Err(Error::options(
                format!("{} has no room: nothing is left of it without the object", scene.name),
                "give the scene a room, or dark counts",
            ));
        }
        0 => room.histograms.fill(0.0),
        _ => room = lit(&scene.emptied(), options, hear)?.capture,
    }
    room = how.measured(room, exposure, scene.seed);
    if let Some(exposure) = exposure {
        rendering.capture = exposure.draw(&rendering.capture, scene.seed);
        rendering.exposure = Some(exposure);
    }
    Ok((rendering, room))
}

/// The light of a scene as the instrument sees it, without noise of photons.
fn lit(scene: &Scene, options: &RenderOptions, hear: &(dyn Fn(RenderProgress) + Sync)) -> Result<Rendering> {
    scene.check()?;
    let mut rendering = render_watched(scene, &scene.pairs(), options, hear)?;
    if rendering.capture.histograms.iter().all(|v| *v == 0.0) {
        return Err(Error::input(
            format!("no light of {} comes back to the wall within the bins", scene.name),
            "let surfaces face the wall: the side that faces are wound to reflects, and the +z side of a mesh file \
             is turned to the wall; or give more bins",
        ));
    }
    if let Some(pulse) = &scene.pulse {
        let capture = &mut rendering.capture;
        pulse.taps_of_bins(capture.bin_width)?.spread(&mut capture.histograms, capture.bins);
        capture.pulse = Some(pulse.clone());
    }
    if scene.device.is_some() {
        rendering.capture.devices = [scene.device; 2];
        rendering.capture.apply_gains(GainLaw::Laser)?;
    }
    let [laser, sensor] = scene.spots.map(|width| Some(width).filter(|w| *w > 0.0));
    (rendering.capture.laser_spot, rendering.capture.sensor_spot) = (laser, sensor);
    Ok(rendering)
}

/// Renders the scene's scan without photon noise; see [`render_pairs`].
///
/// # Errors
/// A scene refused by [`Scene::check`], or options out of range.
pub fn render(scene: &Scene, options: &RenderOptions) -> Result<Rendering> {
    scene.check()?;
    render_pairs(scene, &scene.pairs(), options)
}

/// Renders the histograms of any pairs of wall points. The scene's wall and scan are used for the number of bins only.
///
/// A surface element with albedo ρ, normal n and area A adds ρ·A·g / (r_l² r_s²) at path r_l + r_s, if it is visible
/// from both wall points (without [`Scene::occlusion`]: if it faces both):
///
/// | reflectance | g |
/// |---|---|
/// | [`Reflectance::Cosine`] | max(0, n·ω) toward the scanned side (see [`Capture::scanned_points`]) |
/// | [`Reflectance::Lambertian`] | max(0, n·ω_l) max(0, n·ω_s) max(0, -m_l·ω_l) max(0, -m_s·ω_s), m the wall's normals
/// | | [`Reflectance::Retroreflective`] | 1, with 1 / (r_l r_s) in place of 1 / (r_l² r_s²) |
/// | [`Reflectance::Isotropic`] | 1 |
///
/// Surfaces are one-sided and opaque. Each element's light is spread over the path lengths between its corners. Light
/// outside the bins is dropped.
///
/// With [`Scene::spots`] every element is seen from other points of both spots, and the mean over all is the spots' light.
///
/// The number of samples is doubled until the noise is within `options.noise` or `options.max_samples` is reached. The
/// result depends on the seed, not on the number of threads.
///
/// # Errors
/// A scene that [`Scene::check`] refuses, pairs that [`Pairs::check`] refuses, or options out of range.
pub fn render_pairs(scene: &Scene, pairs: &Pairs, options: &RenderOptions) -> Result<Rendering> {
    render_watched(scene, pairs, options, &|_| {})
}

fn render_watched(
    scene: &Scene,
    pairs: &Pairs,
    options: &RenderOptions,
    hear: &(dyn Fn(RenderProgress) + Sync),
) -> Result<Rendering> {
    scene.check()?;
    pairs.check()?;
    check(options)?;
    if let Some(nodes) = options.coarse {
        return rendered_coarsely(scene, pairs, options, nodes);
    }
    let renderer = Renderer {
        scene,
        pairs,
        surfaces: Surfaces::new(scene),
        bins: scene.bin_count(),
        confocal: pairs.is_confocal() && scene.spots == [0.0; 2],
        offsets: Offsets::of(scene.spots),
        sensor_scans: pairs.sensor_scans(),
    };
    let count = pairs.laser.len();
    // A few pairs determine the number of samples; then all pairs must meet the target.
    let few: Vec<usize> = (0..count).step_by(count.div_ceil(PILOT_PAIRS)).collect();
    let all: Vec<usize> = (0..count).collect();
    let mut wanted = FIRST_SAMPLES.min(options.max_samples / 8).max(1);
    let mut halves = renderer.halves(wanted, options.seed);
    let mut pilot = true;
    loop {
        let samples = halves[0].len() + halves[1].len();
        let which = if pilot { &few } else { &all };
        let (done, of) = (AtomicUsize::new(0), which.len());
        let (noise, histograms) = renderer.render(&halves, which, &|| {
            let done = done.fetch_add(1, Relaxed) + 1;
            if !pilot {
                hear(RenderProgress { samples, done, of });
            }
        });
        let good = noise <= if pilot { PILOT_MARGIN * options.noise } else { options.noise };
        if !good {
            let next = renderer.halves(2 * wanted, options.seed);
            if next[0].len() + next[1].len() <= options.max_samples {
                (wanted, halves) = (2 * wanted, next);
                continue;
            }
        }
        if pilot {
            pilot = false;
            continue;
        }
        let capture = capture(scene, pairs, histograms);
        return Ok(Rendering { capture, noise, samples, exposure: None, converged: good });
    }
}

fn rendered_coarsely(
    scene: &Scene,
    pairs: &Pairs,
    options: &RenderOptions,
    nodes: usize,
) -> Result<Rendering> {
    if nodes < 2 || scene.spots != [0.0; 2] {
        return Err(Error::options(
            format!(
                "a coarse rendering with {nodes} x {nodes} points of shadows and spots of {:?} m",
                scene.spots
            ),
            "give at least 2 x 2 points, and no spots",
        ));
    }
    // The scene is cut into up to three times as many elements.
    let elements = elements(scene, options.max_samples.div_ceil(2), half_seed(options.seed, 1));
    let histograms = coarse::histograms(scene, pairs, &elements, nodes, scene.bin_count());
    let capture = capture(scene, pairs, histograms);
    Ok(Rendering { capture, noise: f64::NAN, samples: elements.len(), exposure: None, converged: true })
}

fn capture(scene: &Scene, pairs: &Pairs, histograms: Vec<f32>) -> Capture {
    pairs.capture(scene.bin_count(), scene.bin_width, histograms).with(|c| {
        c.name = scene.name.clone();
        c.t_start = scene.t_start;
    })
}

/// The seed of a half of the samples.
fn half_seed(seed: u64, half: u64) -> u64 {
    seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(half)
}

const PILOT_PAIRS: usize = 48;
const PILOT_MARGIN: f64 = 0.95;
const FIRST_SAMPLES: usize = 512;

fn check(options: &RenderOptions) -> Result<()> {
    if !(options.noise.is_finite() && options.noise > 0.0) {
        return Err(Error::options(
            format!("the wanted noise is {}", options.noise),
            "give a noise above 0, such as 0.01 for 1 %",
        ));
    }
    if options.max_samples == 0 {
        return Err(Error::options("no surface samples are allowed", "allow at least some thousand samples"));
    }
    Ok(())
}

struct Renderer<'a> {
    scene: &'a Scene,
    pairs: &'a Pairs,
    surfaces: Surfaces,
    bins: usize,
    /// Whether laser and sensor point coincide.
    confocal: bool,
    offsets: Option<Offsets>,
    sensor_scans: bool,
}

impl Renderer<'_> {
    /// Two independent sample sets, one with a finer subdivision, so that their difference includes the subdivision
    /// error.
    fn halves(&self, count: usize, seed: u64) -> [Vec<SurfaceElement>; 2] {
        [(count, 1), (2 * count, 2)].map(|(count, half)| elements(self.scene, count, half_seed(seed, half)))
    }

    /// Histograms `[pair * bins + bin]` of the given pairs, the mean of both halves, and their noise.
    fn render(
        &self,
        halves: &[Vec<SurfaceElement>; 2],
        which: &[usize],
        rendered: &(dyn Fn() + Sync),
    ) -> (f64, Vec<f32>) {
        let bins = self.bins;
        let mut histograms = vec![0f32; which.len() * bins];
        let sums: Vec<[f64; 2]> = histograms
            .par_chunks_mut(bins)
            .zip(which)
            .map(|(histogram, &pair)| {
                let [a, b] = [0, 1].map(|half| self.histogram(&halves[half], pair));
                let mut sums = [0.0; 2];
                for (bin, (a, b)) in a.iter().zip(&b).enumerate() {
                    let mean = 0.5 * (a + b);
                    histogram[bin] = mean as f32;
                    sums[0] += (0.5 * (a - b)).powi(2);
                    sums[1] += mean * mean;
                }
                rendered();
                sums
            })
            .collect();
        let [error, value] = sums.iter().fold([0.0; 2], |[e, v], s| [e + s[0], v + s[1]]);
        (if value > 0.0 { (error / value).sqrt() } else { 0.0 }, histograms)
    }

    fn histogram(&self, elements: &[SurfaceElement], pair: usize) -> Vec<f64> {
        let mut histogram = vec![0.0; self.bins];
        let (laser, sensor) = (self.pairs.laser[pair], self.pairs.sensor[pair]);
        let normal = |normals: &Option<Vec<DVec3>>| normals.as_ref().map_or(DVec3::Z, |n| n[pair]);
        let wall = [normal(&self.pairs.laser_normal), normal(&self.pairs.sensor_normal)];
        let (width, start) = (self.scene.bin_width, self.scene.t_start);
        for (i, e) in elements.iter().enumerate() {
            let ([laser, sensor], wall) = match &self.offsets {
                None => ([laser, sensor], wall),
                Some(offsets) => self.beside([laser, sensor], wall, offsets.at(pair, i)),
            };
            let (to_l, to_s) = (laser - e.point, sensor - e.point);
            if to_l.dot(e.facing) <= 0.0 || to_s.dot(e.facing) <= 0.0 {
                continue;
            }
            let value = e.weight * self.transport(e.normal, to_l, to_s, wall);
            // The condition is also false for NaN, that is for an element on a wall point.
            if !(value > 0.0 && value.is_finite()) {
                continue;
            }
            let path = |p: DVec3| {
                let r = p.distance(laser);
                (r + if self.confocal { r } else { p.distance(sensor) } - start) / width
            };
            // Path length is convex, so the mean of the corners' paths is too long. Shift to the mean over the
            // triangle: three quarters of the centre's path and a quarter of the corners' mean.
            let corners = e.corners.map(path);
            let centre = path((e.corners[0] + e.corners[1] + e.corners[2]) / 3.0);
            let shift = 0.75 * (centre - (corners[0] + corners[1] + corners[2]) / 3.0);
            let path = corners.map(|c| c + shift);
            let (from, to) = (path[0].min(path[1]).min(path[2]), path[0].max(path[1]).max(path[2]));
            if to < 0.0 || from >= self.bins as f64 {
                continue;
            }
            let seen = |from: DVec3| self.surfaces.visible(e.point, e.facing, e.object, from);
            if !self.scene.occlusion || seen(laser) && (self.confocal || seen(sensor)) {
                deposit(&mut histogram, path, value);
            }
        }
        histogram
    }

    /// Wall points offset from a pair's two, with the wall's normals there.
    fn beside(&self, points: [DVec3; 2], normals: [DVec3; 2], aside: [DVec2; 2]) -> ([DVec3; 2], [DVec3; 2]) {
        let (shape, side) = (self.scene.wall_shape, self.scene.wall);
        let moved: [(DVec3, DVec3); 2] = std::array::from_fn(|k| {
            let (p, to) = (points[k], points[k].truncate() + aside[k]);
            let rise = shape.point(to.x, to.y, side).z - shape.point(p.x, p.y, side).z;
            (to.extend(p.z + rise), shape.normal(to.x, to.y, side).unwrap_or(normals[k]))
        });
        (moved.map(|m| m.0), moved.map(|m| m.1))
    }

    /// g / (r_l² r_s²), or g / (r_l r_s) for retroreflective surfaces. `to_l` and `to_s` point from the surface to
    /// the laser and the sensor point.
    fn transport(&self, n: DVec3, to_l: DVec3, to_s: DVec3, wall: [DVec3; 2]) -> f64 {
        let (l2, s2) = (to_l.length_squared(), to_s.length_squared());
        let falloff = 1.0 / (l2 * s2);
        match self.scene.reflectance {
            Reflectance::Cosine if self.sensor_scans => n.dot(to_s).max(0.0) / s2.sqrt() * falloff,
            Reflectance::Cosine => n.dot(to_l).max(0.0) / l2.sqrt() * falloff,
            Reflectance::Lambertian => {
                let surface = n.dot(to_l).max(0.0) * n.dot(to_s).max(0.0);
                let relay = (-wall[0].dot(to_l)).max(0.0) * (-wall[1].dot(to_s)).max(0.0);
                surface * relay * falloff * falloff
            }
            Reflectance::Retroreflective => falloff.sqrt(),
            Reflectance::Isotropic => falloff,
        }
    }
}

/// Adds `value` to the bins in proportion to the area of a flat triangle over path length. `path` has the corners'
/// paths in bins. Light outside the histogram is dropped.
fn deposit(histogram: &mut [f64], mut path: [f64; 3], value: f64) {
    path.sort_by(f64::total_cmp);
    let [a, b, c] = path;
    let (first, last) = (a.floor(), c.floor());
    if first == last || c - a < 1e-9 {
        if let Some(bin) = index(first, histogram.len()) {
            histogram[bin] += value;
        }
        return;
    }
    // Share of the triangle's area with a path below t.
    let below = |t: f64| {
        if t <= a {
            0.0
        } else if t < b {
            (t - a).powi(2) / ((b - a) * (c - a))
        } else if t < c {
            1.0 - (c - t).powi(2) / ((c - b) * (c - a))
        } else {
            1.0
        }
    };
    let mut before = below(first.max(0.0));
    let (from, to) = (first.max(0.0) as usize, (last as usize).min(histogram.len() - 1));
    for (bin, slot) in histogram.iter_mut().enumerate().take(to + 1).skip(from) {
        let after = below(bin as f64 + 1.0);
        *slot += value * (after - before);
        before = after;
    }
}

fn index(bin: f64, bins: usize) -> Option<usize> {
    (bin >= 0.0 && bin < bins as f64).then_some(bin as usize)
}
