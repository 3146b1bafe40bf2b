//! Back-projection on the device, of any pairs and any wall: every voxel sums the histograms of all pairs at its path,
//! times the inverse falloff and the cosine toward the wall (the kernel `backproject`).
//!
//! - `bp`: the sums themselves (Velten, Willwacher, Gupta, Veeraraghavan, Bawendi, Raskar: *Recovering three-dimensional
//!   shape around a corner using ultrafast time-of-flight imaging*, Nature Communications 2012).
//! - `fbp`: filtered by a Laplacian as there, or by a Laplacian of Gaussian (Laurenzis and Velten 2014): of the volume,
//!   or of the histograms along their paths.
//! - `phasor-bp`: histograms filtered by the cosine and the sine of a virtual pulse, each projected; the image is the
//!   strength of both (Liu and others, Nature 2019). This is the phasor field without a transform.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::image::{Volume, on_grid};
use super::options::ImageOptions;
use super::sharpness::{Ladder, noise, tossed};
use super::{NoPasses, RegularScan, in_one_step, upsample};
use crate::capture::{Background, Capture};
use crate::gpu::{Abilities, Buffer, BufferPlan, Constant, Gpu, Place, Schedule};
use crate::solve::option::{Options, options, words};
use crate::solve::plan::{Demand, LeftOut, Level, Needs, RAW_HOST};
use crate::solve::prepared::Planned;
use crate::solve::vector::passes::{BACKPROJECT, FILTER};
use crate::solve::vector::{gather_filtered, hat};
use crate::solve::{
    Beside, Common, OnDevice, Part, Pass, Plan, Prepared, Reconstruction, RunsOn, SMOOTH, Sharpness, Solver,
    outline, upload,
};
use crate::transport::kernels::{buffer, constant};
use crate::transport::{Binning, Gradient, Grid, Model, Rows, Sampling};
use crate::{Error, Result};

/// What is filtered, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// The volume, by a Laplacian.
    Laplacian,
    /// The volume, by the Laplacian of a Gaussian.
    Log,
    /// The histograms, by the second derivative of a Gaussian along the path.
    Path,
}

words!(Filter);

options! {
    /// Options of the back-projection.
    pub struct BpOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
    }
}

options! {
    /// Options of the filtered back-projection.
    pub struct FbpOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Filtered back-projection" {
            /// What is filtered: the volume by a Laplacian or by the Laplacian of a Gaussian (log), or the histograms by
            /// the second derivative of a Gaussian along the path (path)
            filter: Filter = Filter::Path, Range::Words(&["laplacian", "log", "path"]);
            /// Standard deviation of the filter's Gaussian, in distances of scan points [default: 0.5; for photon counts, chosen
            /// by their noise, at least 0.5]
            filter_width: Option<f64> = None, Range::Positive;
        }
    }
}

options! {
    /// Options of the phasor field by back-projection.
    pub struct PhasorBpOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Phasor field" {
            /// Wavelength of the virtual wave, as a path, in distances of scan points [default: 3; for photon counts, chosen
            /// by their noise, at least 3]
            wavelength: Option<f64> = None, Range::Positive;
            /// Wavelengths that the virtual pulse is long
            cycles: f64 = 5.0, Range::Positive;
        }
    }
}

/// Wavelengths of the back-projected phasor field to choose from, in distances of scan points.
const BP_WAVELENGTHS: Ladder = Ladder { setting: "wavelength", values: &[3.0, 4.0, 6.0, 8.0, 12.0] };

/// Widths of the filter to choose from.
const WIDTHS: Ladder = Ladder { setting: "filter_width", values: &[0.5, 0.7, 1.0, 1.4, 2.0, 2.8] };

/// A method that back-projects on the device.
pub(super) trait Projection: Options + Clone + Send + Sync + 'static {
    /// As that of [`super::HostMethod`].
    const MASK_SHARE: f64;

    fn image(&self) -> &ImageOptions;

    /// As [`Solver::detail`].
    fn detail(&self) -> Option<f64> {
        None
    }

    /// As that of [`super::HostMethod`].
    fn ladder(&self) -> Option<Ladder> {
        None
    }

    /// As that of [`super::HostMethod`].
    #[must_use]
    fn at(&self, _sharpness: f64) -> Self {
        self.clone()
    }

    /// The filters, one for each projection: words of `filter.comp`. `bin` and `step` are the width of a bin and the
    /// distance of scan points, metres.
    fn filters(&self, bins: usize, bin: f64, step: f64) -> Vec<Vec<f32>>;

    /// What it makes of the projections, `[(x * n[1] + y) * n[2] + z]` each.
    fn join(&self, projected: Vec<Vec<f32>>, grid: &Grid, step: f64) -> Vec<f32>;
}

impl Projection for BpOptions {
    const MASK_SHARE: f64 = 1.0;

    fn image(&self) -> &ImageOptions {
        &self.image
    }

    fn filters(&self, _bins: usize, _bin: f64, _step: f64) -> Vec<Vec<f32>> {
        vec![vec![0.0, 1.0]]
    }

    fn join(&self, projected: Vec<Vec<f32>>, _grid: &Grid, _step: f64) -> Vec<f32> {
        projected.into_iter().flatten().collect()
    }
}

impl Projection for FbpOptions {
    const MASK_SHARE: f64 = 0.66;

    fn image(&self) -> &ImageOptions {
        &self.image
    }

    // A standard deviation of the filter. Peaks that are sampled coarser have no place between voxels.
    fn detail(&self) -> Option<f64> {
        (self.filter == Filter::Path).then_some(0.5 * self.width())
    }

    fn ladder(&self) -> Option<Ladder> {
        (self.filter_width.is_none() && self.filter != Filter::Laplacian).then_some(WIDTHS)
    }

    fn at(&self, sharpness: f64) -> Self {
        self.clone().with(|o| o.filter_width = Some(sharpness))
    }

    fn filters(&self, bins: usize, bin: f64, step: f64) -> Vec<Vec<f32>> {
        match self.filter {
            Filter::Path => vec![hat(self.width() * step / bin, bins)],
            _ => vec![vec![0.0, 1.0]],
        }
    }

    fn join(&self, projected: Vec<Vec<f32>>, grid: &Grid, step: f64) -> Vec<f32> {
        let mut all: Vec<f32> = projected.into_iter().flatten().collect();
        if self.filter == Filter::Log {
            let sigma = grid.pitch.to_array().map(|pitch| self.width() * step / pitch);
            (0..3).for_each(|axis| smooth(&mut all, grid.n, axis, sigma[axis]));
        }
        if self.filter == Filter::Path { all } else { laplacian(&all, grid) }
    }
}

impl FbpOptions {
    /// Standard deviation of the filter's Gaussian, in distances of scan points.
    fn width(&self) -> f64 {
        self.filter_width.unwrap_or(WIDTHS.values[0])
    }
}

impl Projection for PhasorBpOptions {
    const MASK_SHARE: f64 = 0.70;

    fn image(&self) -> &ImageOptions {
        &self.image
    }

    fn ladder(&self) -> Option<Ladder> {
        self.wavelength.is_none().then_some(BP_WAVELENGTHS)
    }

    fn at(&self, sharpness: f64) -> Self {
        self.clone().with(|o| o.wavelength = Some(sharpness))
    }

    fn filters(&self, bins: usize, bin: f64, step: f64) -> Vec<Vec<f32>> {
        let wavelength = self.wavelength.unwrap_or(BP_WAVELENGTHS.values[0]);
        super::phasor::pulse(wavelength * step / bin, self.cycles, bins).into()
    }

    fn join(&self, projected: Vec<Vec<f32>>, _grid: &Grid, _step: f64) -> Vec<f32> {
        let parts = projected[0].par_iter().zip(&projected[1]);
        parts.map(|(cos, sin)| cos.hypot(*sin)).collect()
    }
}

/// The negative Laplacian of a volume, per square metre. Beyond the volume lie the values of its faces.
fn laplacian(volume: &[f32], grid: &Grid) -> Vec<f32> {
    let [nx, ny, nz] = grid.n;
    let weight = grid.pitch.to_array().map(|pitch| (1.0 / (pitch * pitch)) as f32);
    let strides = [ny * nz, nz, 1];
    let of = |i: usize| {
        let at = [i / (ny * nz), i / nz % ny, i % nz];
        let bend = |axis: usize| {
            let low = if at[axis] > 0 { volume[i - strides[axis]] } else { volume[i] };
            let high = if at[axis] + 1 < [nx, ny, nz][axis] { volume[i + strides[axis]] } else { volume[i] };
            weight[axis] * (2.0 * volume[i] - low - high)
        };
        bend(0) + bend(1) + bend(2)
    };
    (0..volume.len()).into_par_iter().map(of).collect()
}

/// A Gaussian of `sigma` voxels along an axis, in place. Beyond the volume lie the values of its faces.
fn smooth(volume: &mut Vec<f32>, n: [usize; 3], axis: usize, sigma: f64) {
    let reach = (3.0 * sigma).ceil() as isize;
    let taps: Vec<f32> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32).collect();
    let sum: f32 = taps.iter().sum();
    let stride: usize = n[axis + 1..].iter().product();
    let of = |i: usize| {
        let at = (i / stride % n[axis]) as isize;
        let place = |k: isize| (at + k).clamp(0, n[axis] as isize - 1);
        let value = |k: isize| volume[(i as isize + (place(k) - at) * stride as isize) as usize];
        (-reach..=reach).zip(&taps).map(|(k, tap)| tap * value(k)).sum::<f32>() / sum
    };
    *volume = (0..volume.len()).into_par_iter().map(of).collect();
}

/// Pixels that a voxel is wide in maps of `lateral` pixels. Voxels finer than the scan would only cost time.
fn pixels_per_voxel(lateral: usize) -> usize {
    1 + usize::from(lateral.is_multiple_of(2) && lateral / 2 >= FEWEST)
}

/// Lateral voxels that a grid is never coarser than.
const FEWEST: usize = 64;

/// Columns along each side that tell the noise.
const COLUMNS: usize = 16;

/// What a back-projection needs of a plan: the two passes, and a number per voxel.
struct Passes {
    pixels_per_voxel: usize,
}

impl Needs for Passes {
    fn demand(&self) -> Demand {
        Demand { pixels_per_voxel: self.pixels_per_voxel, ..NoPasses.demand() }
    }

    fn capacities(&self, levels: &[Level]) -> [usize; 2] {
        NoPasses.capacities(levels)
    }

    fn constants(&self, _plan: &Plan) -> Vec<(Constant, u32)> {
        vec![(constant::WEIGHTED, 1)]
    }

    fn passes(&self) -> Vec<&'static Pass> {
        vec![&FILTER, &BACKPROJECT]
    }

    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)> {
        vec![(buffer::HAT_TAPS, plan.bins as u64 * 4 + 4)]
    }

    fn left_out(&self, _plan: &Plan, _out: &mut LeftOut) {}
}

/// The scan that the options ask to make finer, if they do.
///
/// # Errors
/// The scan cannot be made finer: it is not regular, the wall is not flat, or the points would be empty.
fn to_refine(capture: &Capture, image: &ImageOptions, name: &str) -> Result<Option<RegularScan>> {
    if image.upsample == 1 {
        return Ok(None);
    }
    upsample::check_sum(image, name)?;
    let scan =
        RegularScan::with_one_spot(capture, "a scan with points between the measured ones").map_err(|e| {
            Error::input(e.what, "leave the upsampling out: the method takes the pairs as they are")
        })?;
    Ok(Some(scan))
}

/// The pairs of a capture, on the finer scan if there is one.
fn pairs_on(scan: Option<&RegularScan>, capture: &Capture, image: &ImageOptions) -> Capture {
    let outline = capture.outline();
    scan.map(|scan| upsample::finer(&outline, scan, image).into_owned()).unwrap_or(outline)
}

/// The capture as kernels see it, without counts: all bins, laser and sensor as points, paths sharp.
fn outline_of(capture: &Capture, grid: &Grid, image: &ImageOptions) -> (Model, Rows) {
    let (model, rows) = Model::outline(capture, image.reflectance, 1.0, false);
    let model = Model {
        rendered: None,
        pulse: None,
        pulse_shape: None,
        min_depth: image.min_depth.min(grid.depth_range()[1]),
        sampling: Sampling::Fixed,
        binning: Binning::Linear,
        gradient: Gradient::Exact,
        ..model
    };
    (model, rows)
}

fn plan(model: &Model, capture: &Capture, grid: Grid, abilities: &Abilities) -> Result<Plan> {
    let needs = Passes { pixels_per_voxel: pixels_per_voxel(grid.n[0]) };
    let mut plan = Plan::new(model, grid, capture.resolution(), &needs, abilities, false)?;
    plan.passes.retain(|pass| [&FILTER, &BACKPROJECT].contains(pass));
    // What only rendering and the reduction of a domain need.
    plan.buffers.retain(|b| ![buffer::HISTOGRAMS, SMOOTH].contains(&b.buffer));
    let voxels = plan.finest().grid.storage() as u64;
    plan.buffers.push(BufferPlan::new(RAW_HOST, voxels * 4, Place::Readback));
    plan.left_out.clear();
    Ok(plan)
}

/// Counts of a capture's pairs, less their background.
struct Light<'c> {
    capture: Cow<'c, Capture>,
    background: Background,
    /// What they are multiplied with; `None`: so that the largest becomes the model's peak.
    scale: Option<f64>,
}

/// A grid with its buffers.
struct Projector(Planned);

impl Projector {
    fn made(&mut self) -> Result<&mut OnDevice> {
        self.0.made(|_| Ok(()))
    }

    /// Gives the device counts. Returns what they were multiplied with.
    fn take(&mut self, rows: &Rows, light: &Light<'_>) -> Result<f64> {
        let job = self.made()?;
        match light.scale {
            Some(scale) => job.model.take_times(rows, &light.capture, &light.background, scale),
            None => job.model.take(rows, &light.capture, &light.background),
        }
        job.upload_counts()?;
        Ok(1.0 / job.model.counts_per_unit)
    }

    /// A projection of the counts that the device has for each filter, `[(x * n[1] + y) * n[2] + z]`.
    fn projections(&mut self, filters: &[Vec<f32>]) -> Result<Vec<Vec<f32>>> {
        let job = self.made()?;
        let level = *job.plan.finest();
        let grid = level.grid;
        let [_, ny, nz] = grid.n;
        let mut projected = vec![];
        for filter in filters {
            upload(&mut job.executor, buffer::HAT_TAPS, bytemuck::cast_slice(filter))?;
            job.executor.run_once(|s| {
                gather_filtered(s, &job.plan, &level, true);
                s.copy(job.plan.volumes[1], RAW_HOST, grid.storage() as u64 * 4);
            })?;
            let stored: Vec<f32> = job.executor.read(RAW_HOST, ..grid.storage());
            let voxel = |i: usize| stored[grid.index([i / (ny * nz), i / nz % ny, i % nz])];
            projected.push((0..grid.voxels()).into_par_iter().map(voxel).collect());
        }
        Ok(projected)
    }

    /// What the method makes of the counts that the device has, at the voxels of the grid that comes with it.
    fn image<M: Projection>(&mut self, options: &M, bin_width: f64, step: f64) -> Result<(Grid, Vec<f32>)> {
        let (grid, bins) = (self.0.plan().finest().grid, self.0.plan().bins);
        let projected = self.projections(&options.filters(bins, bin_width, step))?;
        Ok((grid, options.join(projected, &grid, step)))
    }
}

/// A back-projection that is prepared for a scan.
pub(super) struct Projecting<M> {
    options: M,
    all: Projector,
    /// A few columns, for the choice of sharpness; `None` where the options tell it.
    columns: Option<(Ladder, Projector)>,
    rows: Rows,
    /// The scan that is made finer, if one is.
    scan: Option<RegularScan>,
    grid: Grid,
    with_volume: bool,
}

impl<M: Projection> Projecting<M> {
    /// Makes kernels and buffers, unless they are there.
    pub fn make(&mut self, capture: &Capture) -> Result<()> {
        if let Some((_, columns)) = self.columns.as_mut().filter(|_| capture.integer_counts) {
            columns.made()?;
        }
        self.all.made().map(|_| ())
    }

    fn light<'c>(&self, capture: &'c Capture, with_background: bool) -> Light<'c> {
        if let Some(scan) = &self.scan {
            // Points between the measured ones have no background of their own: it goes first.
            let light = scan.light(capture, with_background);
            let fine = upsample::finer(&light, scan, self.options.image()).into_owned();
            Light { capture: Cow::Owned(fine), background: Background::NONE, scale: None }
        } else {
            let background = Background::of(capture, with_background);
            Light { capture: Cow::Borrowed(capture), background, scale: None }
        }
    }

    /// Chooses the sharpness by the noise of a few columns, if the options leave it open.
    fn sharpness(&mut self, capture: &Capture, light: &Light<'_>, step: f64) -> Result<Option<Sharpness>> {
        let Some((ladder, _)) = self.columns else { return Ok(None) };
        if !capture.integer_counts {
            return Ok(Some(ladder.sharpest()));
        }
        let tossed = tossed(capture);
        let mut dark = self.light(&tossed, false);
        let Some((_, columns)) = &mut self.columns else { return Ok(None) };
        let chosen = ladder.choose(|value| {
            let options = self.options.at(value);
            dark.scale = Some(columns.take(&self.rows, light)?);
            let (grid, light) = columns.image(&options, capture.bin_width, step)?;
            columns.take(&self.rows, &dark)?;
            let (_, dark) = columns.image(&options, capture.bin_width, step)?;
            Ok((noise(&light, &dark, grid.n[2], M::MASK_SHARE), ()))
        })?;
        Ok(Some(chosen.0))
    }

    /// The volume of a capture, and how sharp it is.
    fn volume(&mut self, capture: &Capture, step: f64) -> Result<(Volume, Option<Sharpness>)> {
        let light = self.light(capture, self.options.image().background);
        let sharpness = self.sharpness(capture, &light, step)?;
        self.all.take(&self.rows, &light)?;
        let options = sharpness.map_or_else(|| self.options.clone(), |chosen| self.options.at(chosen.value));
        let (grid, albedo) = self.all.image(&options, capture.bin_width, step)?;
        let lattice = RegularScan::of_columns(&grid);
        Ok((Volume { albedo: on_grid(&lattice, &albedo, &self.grid), normal: None }, sharpness))
    }
}

impl Projecting<BpOptions> {
    /// The sums of a capture at the voxels of the grid that they are computed at, which comes with them.
    ///
    /// # Errors
    /// The device fails.
    pub fn sums(&mut self, capture: &Capture) -> Result<(Grid, Vec<f32>)> {
        let light = self.light(capture, self.options.image.background);
        self.all.take(&self.rows, &light)?;
        self.all.image(&self.options, capture.bin_width, 0.0)
    }

    /// The same of tossed counts, which have the scale of the capture's: noise alone.
    ///
    /// # Errors
    /// The device fails.
    pub fn sums_of_noise(&mut self, capture: &Capture) -> Result<Vec<f32>> {
        let scale = 1.0 / self.all.made()?.model.counts_per_unit;
        let tossed = tossed(capture);
        let dark = Light { scale: Some(scale), ..self.light(&tossed, false) };
        self.all.take(&self.rows, &dark)?;
        Ok(self.all.image(&self.options, capture.bin_width, 0.0)?.1)
    }
}

/// A back-projection that is prepared for a scan.
///
/// # Errors
/// Options out of range, or a scan that cannot be made finer.
pub(super) fn projecting(
    options: &BpOptions,
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    memory: Option<u64>,
) -> Result<Projecting<BpOptions>> {
    prepared(options, BpOptions::NAME, gpu, capture, grid, memory, false)
}

/// A projection that is prepared for a scan.
fn prepared<M: Projection>(
    options: &M,
    name: &str,
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    memory: Option<u64>,
    with_volume: bool,
) -> Result<Projecting<M>> {
    let scan = to_refine(capture, options.image(), name)?;
    let fine = pairs_on(scan.as_ref(), capture, options.image());
    let (model, rows) = outline_of(&fine, &grid, options.image());
    let planned = |grid: Grid, memory: Option<u64>| {
        let plan = plan(&model, &fine, grid, &gpu.abilities())?;
        Ok(Projector(Planned::new(gpu, model.clone(), plan, memory)))
    };
    let columns = match options.ladder() {
        Some(ladder) => Some((ladder, planned(columns_of(&grid), memory)?)),
        None => None,
    };
    let taken = columns.as_ref().map_or(0, |(_, columns)| columns.0.plan().bytes().values().sum());
    let all = planned(grid, memory.map(|memory| memory.saturating_sub(taken)))?;
    Ok(Projecting { options: options.clone(), all, columns, rows, scan, grid, with_volume })
}

/// A few columns of a grid, with all its depths.
fn columns_of(grid: &Grid) -> Grid {
    let wide = [0, 1].map(|a| grid.n[a] as f64 / grid.n[a].min(COLUMNS) as f64);
    let pitch = grid.pitch * DVec3::new(wide[0], wide[1], 1.0);
    let corner = grid.origin - 0.5 * grid.pitch;
    let n = [grid.n[0].min(COLUMNS), grid.n[1].min(COLUMNS), grid.n[2]];
    Grid { n, origin: corner + 0.5 * pitch, pitch }
}

impl<M: Projection> Prepared for Projecting<M> {
    fn plan(&self) -> &Arc<Plan> {
        self.all.0.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        for projector in self.columns.as_mut().map(|(_, columns)| columns).into_iter().chain([&mut self.all])
        {
            let job = projector.made()?;
            job.executor
                .reserve(&Schedule::of(|s| gather_filtered(s, &job.plan, job.plan.finest(), true)))?;
        }
        Ok(())
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        // Kernels and buffers are made before the time begins.
        self.make(capture)?;
        let (plan, grid, with_volume) = (self.all.0.plan().clone(), self.grid, self.with_volume);
        let step = capture.spacing().unwrap_or(grid.pitch.x);
        let mut done = in_one_step(&plan, &grid, [step, M::MASK_SHARE], with_volume, beside, || {
            self.volume(capture, step)
        })?;
        done.filled = self.scan.as_ref().map_or(0, |scan| scan.gaps.len());
        let executor = &mut self.all.made()?.executor;
        done.device_bytes = executor.arena().bytes();
        done.kernels = executor.take_times().into_iter().collect();
        Ok(done)
    }
}

/// Writes what every back-projection is to the rest of the engine.
macro_rules! projection {
    ($options:ident, $name:literal) => {
        impl $options {
            /// Its name on the command line.
            pub const NAME: &'static str = $name;
        }

        impl Solver for $options {
            fn common(&self) -> Common {
                Common {
                    runs_on: RunsOn::Device,
                    pixels_per_voxel: pixels_per_voxel(self.lateral),
                    ..super::common(self.lateral, &self.image)
                }
            }

            fn check(&self) -> Result<()> {
                self.check_ranges()?;
                upsample::check_sum(&self.image, $name)
            }

            fn takes(&self, capture: &Capture) -> Result<()> {
                to_refine(capture, &self.image, $name).map(|_| ())
            }

            fn detail(&self) -> Option<f64> {
                Projection::detail(self)
            }

            fn plan(
                &self,
                capture: &Capture,
                grid: Grid,
                abilities: &Abilities,
                _with_volume: bool,
            ) -> Result<Plan> {
                let scan = to_refine(capture, &self.image, $name)?;
                let fine = pairs_on(scan.as_ref(), capture, &self.image);
                plan(&outline_of(&fine, &grid, &self.image).0, &fine, grid, abilities)
            }

            fn outline(&self, plan: &Plan) -> Vec<Part> {
                outline::of_start(
                    "volume",
                    plan,
                    plan.finest(),
                    &Schedule::of(|s| gather_filtered(s, plan, plan.finest(), true)),
                )
            }

            fn prepare(
                &self,
                gpu: &Gpu,
                capture: &Capture,
                grid: Grid,
                memory: Option<u64>,
                with_volume: bool,
            ) -> Result<Box<dyn Prepared>> {
                self.check()?;
                Ok(Box::new(prepared(self, $name, gpu, capture, grid, memory, with_volume)?))
            }
        }
    };
}

projection!(BpOptions, "bp");
projection!(FbpOptions, "fbp");
projection!(PhasorBpOptions, "phasor-bp");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume as Box;
    use glam::dvec3;

    fn grid() -> Grid {
        Grid::new(Box { min: dvec3(0.0, 0.0, 0.4), max: dvec3(0.6, 0.9, 1.3) }, 6, 0.05).unwrap()
    }

    fn volume(of: impl Fn(DVec3) -> f64) -> Vec<f32> {
        let (grid, [_, ny, nz]) = (grid(), grid().n);
        let at = |i: usize| dvec3((i / (ny * nz)) as f64, (i / nz % ny) as f64, (i % nz) as f64);
        (0..grid.voxels()).map(|i| of(grid.position(at(i))) as f32).collect()
    }

    #[test]
    fn the_laplacian_of_a_square_is_two_along_each_axis() {
        let grid = grid();
        let [_, ny, nz] = grid.n;
        let all = laplacian(&volume(|p| p.x * p.x + 2.0 * p.y * p.y - 4.0 * p.z * p.z), &grid);
        for (i, value) in all.iter().enumerate() {
            let at = [i / (ny * nz), i / nz % ny, i % nz];
            if (0..3).all(|a| at[a] > 0 && at[a] + 1 < grid.n[a]) {
                assert!((value - 2.0).abs() < 0.01, "{value}");
            }
        }
    }

    #[test]
    fn a_gaussian_keeps_planes_and_blurs_along_its_axis_only() {
        let n = grid().n;
        let mut plane = volume(|p| p.x + p.y);
        let before = plane.clone();
        smooth(&mut plane, n, 2, 1.5);
        assert!(plane.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-5));
        let mut point = vec![0.0; plane.len()];
        let middle = (3 * n[1] + 3) * n[2] + 8;
        point[middle] = 1.0;
        smooth(&mut point, n, 2, 1.0);
        assert!((point.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((point[middle + 1] / point[middle] - (-0.5f32).exp()).abs() < 1e-5);
        assert_eq!(point[middle + n[2]], 0.0);
    }
}
