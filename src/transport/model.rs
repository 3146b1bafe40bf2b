//! The model of a capture: what kernels and their twins need to know of it.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernels::{PADDING, SceneData};
use super::{Geometry, Grid, HighPass, Reflectance, Rendered, Rows, Spot, Wall};
use crate::capture::rows::is_small;
use crate::capture::scan::unit_of;
use crate::capture::{Background, Capture, PulseTaps};

/// How a contribution is added to the bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Binning {
    /// All to the bin that contains its path (the paper).
    Nearest,
    /// Shared linearly by the two bins whose centres bracket its path.
    Linear,
}

/// Where the sample of a voxel lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// A new point within half a voxel of the centre every iteration, interpolated (the paper).
    Continuous,
    /// The voxel's centre (the paper's ablation).
    Fixed,
}

/// Which gradient the backward kernel gathers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// Without the distance falloff (the paper): the gradient of the objective weighted by the falloff.
    Published,
    /// The gradient of the objective itself.
    Exact,
}

/// A capture, scaled, and the physics of its light. Nothing depends on the lateral resolution or on how a solver minimises.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Points of the relay wall, and how they make pairs.
    pub wall: Wall,
    /// The pairs that light is rendered for where laser or sensor see more than points; `None`: the wall's own.
    pub rendered: Option<Rendered>,
    /// The wall as the points were given, where a correction moved them: pairs keep their order.
    pub given: Option<Wall>,
    /// True if the first n pairs are spread over the wall for every n ([`Model::spread`]).
    pub is_spread: bool,
    /// Pairs of the capture that are not used.
    pub unused: usize,
    /// The last pairs, which are held out: no fit takes them ([`Model::hold_out`]).
    pub held_out: usize,
    /// Where kernels have their origin in x and y, metres: the wall's centre if the wall is far from 0, as coordinates of a survey are,
    /// which single precision does not resolve.
    pub centre: DVec3,
    /// How hidden surfaces reflect light.
    pub reflectance: Reflectance,
    /// Gated bins of a histogram.
    pub bins: usize,
    /// Width of a bin, metres of path.
    pub bin_width: f64,
    /// Leading edge of bin 0, metres of path.
    pub t_start: f64,
    /// Measured histograms after scaling, `[pair * bins + bin]`.
    pub measured: Vec<f32>,
    /// Number of bins of all pairs over which the loss is a mean: those of the capture, even if some are left out.
    pub elements: usize,
    /// How the instrument spreads a path over bins; `None` treats paths as sharp.
    pub pulse: Option<PulseTaps>,
    /// Reduces what changes slowly along time, in the surface's objective.
    pub high_pass: Option<HighPass>,
    /// The measurement's peak after scaling.
    pub peak: f64,
    /// Counts per unit of `measured`.
    pub counts_per_unit: f64,
    /// Length that scales distances in the falloff, metres: a quarter of the longest gated path.
    pub reference: f64,
    /// Voxels nearer than this to the wall plane z = 0 are never active, metres.
    pub min_depth: f64,
    /// How a contribution is added to the bins.
    pub binning: Binning,
    /// Photon variance per measured value, and variance of an empty bin.
    pub variance: [f64; 2],
}

/// The paper's constant. The renderer multiplies by it and by (lateral pitch)², in units of [`unit_of_areas`].
const RENDER_FACTOR: f64 = 2.0;

/// Unit of length for areas, metres. Albedo and step lengths are then the same as for a volume of one metre.
fn unit_of_areas(grid: &Grid) -> f64 {
    unit_of((grid.pitch.x * grid.n[0] as f64).max(grid.pitch.y * grid.n[1] as f64))
}

/// Number of cells of `pairs` histograms of `bins` bins, with the padding before each and after the last.
pub fn cells(pairs: usize, bins: usize) -> usize {
    pairs * (bins + PADDING as usize) + PADDING as usize
}

/// Walls farther from 0 than this many times their width have an origin of their own.
const FAR: f64 = 16.0;

/// See [`Model::centre`].
fn centre_of(capture: &Capture) -> DVec3 {
    let points = || capture.laser.iter().chain(&capture.sensor);
    let (low, high) =
        points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let (middle, size) = (0.5 * (low + high), (high - low).truncate().max_element());
    let is_far = size > 0.0 && middle.truncate().abs().max_element() > FAR * size;
    if is_far { middle.with_z(0.0) } else { DVec3::ZERO }
}

impl Model {
    /// A capture scaled to the given peak, with the paper's binning. `general`: see [`Wall::of`]. A capture
    /// without counts gives a model without measured values, which is enough for a plan.
    pub fn new(capture: &Capture, reflectance: Reflectance, peak: f64, general: bool) -> Model {
        let (mut model, rows) = Model::outline(capture, reflectance, peak, general);
        if !capture.histograms.is_empty() {
            model.take(&rows, capture, &Background::NONE);
        }
        model
    }

    /// The same model without measured values, and the rows that they are taken by. Of the counts, only the mean path is
    /// used, if the capture has spots and counts ([`Spot::of`]).
    pub fn outline(capture: &Capture, reflectance: Reflectance, peak: f64, general: bool) -> (Model, Rows) {
        let (wall, pair_of) = Wall::of(capture, reflectance, general);
        let spot = Spot::of(capture, wall.geometry, capture.laser_scans());
        let model = Model {
            elements: wall.pairs() * capture.bins,
            rendered: spot.map(|spot| Rendered::of(&wall, spot)),
            given: capture.given.as_deref().map(|[laser, sensor]| {
                let [laser, sensor] = [laser, sensor].map(Clone::clone);
                Wall::of(
                    &capture.outline().with(|c| (c.laser, c.sensor) = (laser, sensor)),
                    reflectance,
                    general,
                )
                .0
            }),
            wall,
            is_spread: false,
            unused: 0,
            held_out: 0,
            centre: centre_of(capture),
            reflectance,
            bins: capture.bins,
            bin_width: capture.bin_width,
            t_start: capture.t_start,
            measured: vec![],
            // A capture's check refuses a pulse without taps.
            pulse: match &capture.pulse {
                Some(pulse) => pulse.taps(capture.bin_width).ok(),
                None => general.then(PulseTaps::identity),
            },
            high_pass: None,
            peak,
            counts_per_unit: 1.0,
            reference: 0.25 * (capture.t_start + capture.bins as f64 * capture.bin_width),
            min_depth: 0.2,
            binning: Binning::Nearest,
            variance: [0.0; 2],
        };
        (model, Rows::of(pair_of, capture.bins))
    }

    /// Takes the counts of `capture`: scaled so that the largest of all becomes the peak, less `background`.
    pub fn take(&mut self, rows: &Rows, capture: &Capture, background: &Background) {
        let most = |counts: &[f32]| counts.iter().copied().fold(0.0f32, f32::max);
        let largest = match is_small(&capture.histograms) {
            true => most(&capture.histograms),
            false => capture.histograms.par_chunks(1 << 14).map(most).reduce(|| 0.0, f32::max),
        };
        self.take_times(rows, capture, background, self.peak / f64::from(largest));
    }

    /// As [`Model::take`], times `scale`.
    pub fn take_times(&mut self, rows: &Rows, capture: &Capture, background: &Background, scale: f64) {
        self.counts_per_unit = 1.0 / scale;
        rows.fill(&mut self.measured, capture, scale, background);
    }

    /// The wall that light is rendered for.
    pub fn rendered_wall(&self) -> &Wall {
        self.rendered.as_ref().map_or(&self.wall, |r| &r.wall)
    }

    /// Number of laser-sensor pairs.
    pub fn pairs(&self) -> usize {
        self.wall.pairs()
    }

    /// Number of pairs that fits take, the first ones.
    pub fn fitted(&self) -> usize {
        self.pairs() - self.held_out
    }

    /// Cells from one histogram to the next on the device: its bins, and the padding before them
    /// (`glsl/include/place.glsl`).
    pub fn stride(&self) -> usize {
        self.bins + PADDING as usize
    }

    /// Number of bins of `pairs` pairs, counted as in `elements`.
    pub fn elements_of(&self, pairs: usize) -> usize {
        self.elements * pairs / self.pairs().max(1)
    }

    /// Number of cells of all histograms.
    pub fn cells(&self) -> usize {
        cells(self.pairs(), self.bins)
    }

    /// The bins among all cells of histograms or residuals, `[pair * bins + bin]`.
    pub fn bins_of<T: Copy>(&self, cells: &[T]) -> Vec<T> {
        let padding = PADDING as usize;
        // The padding behind the last histogram is shorter than one.
        cells.chunks_exact(self.stride()).flat_map(|row| &row[padding..]).copied().collect()
    }

    /// Factor and addend from a path (for confocal pairs: half of it) to its place in a row, as a share of its cells.
    fn place(&self) -> [f64; 2] {
        let stride = self.stride() as f64;
        let arms = if self.wall.geometry == Geometry::Confocal { 2.0 } else { 1.0 };
        let start = f64::from(PADDING - 1) - self.t_start / self.bin_width;
        let shift = match self.binning {
            Binning::Linear => -0.5 / stride,
            // A path on an edge belongs to the bin that begins there, though fp32 may round it a little lower.
            Binning::Nearest => 2f64.powi(-22),
        };
        [arms / self.bin_width / stride, start / stride + shift]
    }

    /// The power of the distance with which a confocal value falls off.
    pub fn falloff_power(&self) -> i32 {
        self.reflectance.falloff_power()
    }

    /// Weight of a bin's squared difference, the inverse of the confocal falloff at the bin's centre.
    pub fn bin_weight(&self, bin: usize) -> f64 {
        let t = self.t_start + (bin as f64 + 0.5) * self.bin_width;
        (t / (2.0 * self.reference)).max(0.0).powi(self.falloff_power())
    }

    /// First z index of `grid` that may be active.
    pub fn near_z(&self, grid: &Grid) -> usize {
        ((self.min_depth - grid.origin.z) / grid.pitch.z - 1e-6).ceil().max(0.0) as usize
    }

    /// A sample nearer to a wall point than this gives no light, metres: a quarter of the smallest voxel side.
    pub fn nearest(&self, grid: &Grid) -> f64 {
        0.25 * grid.pitch.min_element()
    }

    /// The scene that the kernels of `grid` read.
    pub fn scene(&self, grid: &Grid) -> SceneData {
        self.scene_of(grid, self.pairs())
    }

    /// The scene of kernels that render or gather the first `pairs` by these rendered ones.
    pub fn scene_of_rendered(&self, grid: &Grid, pairs: usize, rendered: &Rendered) -> SceneData {
        let [scanned, others] = [&rendered.wall.scanned, &rendered.wall.others].map(|p| p.len() as u32);
        let pairs_rendered = rendered.wall.pairs() as u32;
        SceneData { pairs: pairs_rendered, scanned, others, ..self.scene_of(grid, pairs) }
    }

    /// The scene that the kernels of `grid` read when they use the first `pairs` only.
    pub fn scene_of(&self, grid: &Grid, pairs: usize) -> SceneData {
        let bricks = grid.bricks();
        let [scanned, others] =
            self.wall.geometry.counts(pairs, self.wall.scanned.len(), self.wall.others.len());
        let elements = self.elements_of(pairs);
        // A sample lies up to half a voxel from its centre; samples nearer than `nearest` give no light.
        let near = grid.origin.z + (self.near_z(grid) as f64 - 0.5) * grid.pitch.z;
        let far_wall = self.rendered_wall().all_points().fold(f64::NEG_INFINITY, |a, w| a.max(w.z));
        let closest = (near - far_wall).max(self.nearest(grid));
        let fine = self.fine(grid);
        let place = self.place();
        SceneData {
            grid_x: grid.n[0] as u32,
            grid_y: grid.n[1] as u32,
            grid_z: grid.n[2] as u32,
            bricks_x: bricks[0] as u32,
            bricks_y: bricks[1] as u32,
            bricks_z: bricks[2] as u32,
            near_z: self.near_z(grid) as u32,
            pairs: pairs as u32,
            scanned: scanned as u32,
            others: others as u32,
            bins: self.bins as u32,
            stride: self.stride() as u32,
            capacity: grid.storage() as u32,
            touched_capacity: grid.storage() as u32,
            origin_x: (grid.origin.x - self.centre.x) as f32,
            origin_y: (grid.origin.y - self.centre.y) as f32,
            origin_z: grid.origin.z as f32,
            pitch_x: grid.pitch.x as f32,
            pitch_y: grid.pitch.y as f32,
            pitch_z: grid.pitch.z as f32,
            t_start: self.t_start as f32,
            bins_per_metre: (1.0 / self.bin_width) as f32,
            place_scale: place[0] as f32,
            place_offset: place[1] as f32,
            grain: fine.grain as f32,
            grains_per_metre: (1.0 / fine.grain) as f32,
            bins_per_grain: fine.bins_per_grain[0] as f32,
            bins_per_grain_rest: fine.bins_per_grain[1] as f32,
            fine_bins_per_grain: (fine.bins_per_grain[0] + fine.bins_per_grain[1]) as f32,
            start_bins: fine.start_bins[0] as f32,
            start_bins_rest: fine.start_bins[1] as f32,
            reference: self.reference as f32,
            nearest: self.nearest(grid) as f32,
            render_scale: (grid.pitch.x * grid.pitch.y / unit_of_areas(grid).powi(2) * RENDER_FACTOR) as f32,
            loss_scale: (1.0 / elements as f64) as f32,
            // A margin for rounding in the kernel.
            kernel_bound: (1.001 * (self.reference / closest).powi(self.falloff_power())) as f32,
        }
    }
}
