//! Volumes of a back-projection: the counts on the device, a projection for each filter, and the choice of
//! sharpness.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::passes::{BACKPROJECT, FILTER, PROJECTED, gather_filtered};
use crate::advice::advice;
use crate::capture::{Background, Capture};
use crate::closed_form::image::{AlbedoVolume, on_grid};
use crate::closed_form::method::{ClosedForm, Projection};
use crate::closed_form::on_host::check_host_memory;
use crate::closed_form::options::ImageOptions;
use crate::closed_form::scan::RegularScan;
use crate::closed_form::sharpness::{Ladder, even_weights, noise, weigh, with_random_signs};
use crate::closed_form::upsample;
use crate::engine::{
    Demand, OnDevice, Plan, Planned, Problem, RAW_HOST, Reconstruction, Sharpness, TimedSchedule, outline,
};
use crate::gpu::{Abilities, BufferPlan, Gpu, Place, Schedule};
use crate::transport::kernels::{buffer, constant};
use crate::transport::{Binning, Grid, Model, Rows};
use crate::{Error, Result};

/// Pixels that a voxel is wide in maps of `lateral` pixels. Voxels finer than the scan would only cost time.
pub fn pixels_per_voxel(lateral: usize) -> usize {
    1 + usize::from(lateral.is_multiple_of(2) && lateral / 2 >= FEWEST)
}

/// Lateral voxels that a grid is never coarser than.
const FEWEST: usize = 64;

/// Columns along each side that tell the noise.
const COLUMNS: usize = 16;

/// The scan that the options ask to make finer, if they do.
///
/// # Errors
/// The scan cannot be made finer: it is not regular, the wall is not flat, or the points would be empty.
pub fn to_refine(capture: &Capture, image: &ImageOptions) -> Result<Option<RegularScan>> {
    if image.upsample == 1 {
        return Ok(None);
    }
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
        min_depth: image.min_depth.min(grid.depth_range()[1]),
        binning: Binning::Linear,
        ..model
    };
    (model, rows)
}

/// The plan of a back-projection: its two passes, and a number per voxel.
///
/// # Errors
/// As [`Plan::open`] and [`Plan::finish`].
pub fn plan_of(
    model: &Model,
    grid: Grid,
    scan: [usize; 2],
    pixels_per_voxel: usize,
    device: &Abilities,
) -> Result<Plan> {
    let demand = Demand::of_one_step(pixels_per_voxel);
    let mut plan = Plan::open(model, grid, scan, demand, |_| [1; 2], device)?;
    plan.constants.insert(constant::WEIGHTED, 1);
    plan.add_passes(&[&FILTER, &BACKPROJECT]);
    let own = vec![
        (buffer::HAT_TAPS, plan.scene.bins as u64 * 4 + 4),
        (PROJECTED, plan.finest().grid.storage() as u64 * 4),
    ];
    plan.finish(model, own, false)
}

fn plan(model: &Model, capture: &Capture, grid: Grid, abilities: &Abilities) -> Result<Plan> {
    let mut plan = plan_of(model, grid, capture.resolution(), pixels_per_voxel(grid.n[0]), abilities)?;
    let voxels = plan.finest().grid.storage() as u64;
    plan.buffers.push(BufferPlan::new(RAW_HOST, voxels * 4, Place::Readback));
    Ok(plan)
}

/// Counts of a capture's pairs, less their background.
struct CorrectedCounts<'c> {
    capture: Cow<'c, Capture>,
    background: Background,
    /// What they are multiplied with; `None`: so that the largest becomes the model's peak.
    scale: Option<f64>,
}

impl CorrectedCounts<'_> {
    /// The light of a capture, on the finer scan if there is one.
    fn of<'c>(
        capture: &'c Capture,
        scan: Option<&RegularScan>,
        image: &ImageOptions,
        with_background: bool,
    ) -> CorrectedCounts<'c> {
        if let Some(scan) = scan {
            // Points between the measured ones have no background of their own: it goes first.
            let light = scan.light(Cow::Borrowed(capture), with_background);
            let fine = upsample::finer(&light, scan, image).into_owned();
            CorrectedCounts { capture: Cow::Owned(fine), background: Background::NONE, scale: None }
        } else {
            let background = Background::of(capture, with_background);
            CorrectedCounts { capture: Cow::Borrowed(capture), background, scale: None }
        }
    }
}

/// A grid with its buffers.
struct Projector(Planned);

impl Projector {
    fn made(&mut self) -> Result<&mut OnDevice> {
        self.0.made()
    }

    /// Gives the device counts. Returns what they were multiplied with.
    fn take(&mut self, rows: &Rows, light: &CorrectedCounts<'_>) -> Result<f64> {
        let job = self.made()?;
        match light.scale {
            Some(scale) => job.model.take_times(rows, &light.capture, &light.background, scale),
            None => job.model.take(rows, &light.capture, &light.background),
        }
        job.queue_counts()?;
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
            job.add(buffer::HAT_TAPS, bytemuck::cast_slice(filter))?;
            job.run(|s, plan| {
                gather_filtered(s, plan, &level, filter.len());
                s.copy(PROJECTED, RAW_HOST, grid.storage() as u64 * 4);
            })?;
            let stored: Vec<f32> = job.executor.read(RAW_HOST, ..grid.storage());
            let voxel = |i: usize| stored[grid.index([i / (ny * nz), i / nz % ny, i % nz])];
            projected.push((0..grid.voxels()).into_par_iter().map(voxel).collect());
        }
        Ok(projected)
    }

    /// What the method makes of the counts that the device has, at the voxels of the grid that comes with it.
    fn image<M>(
        &mut self,
        options: &M,
        method: &Projection<M>,
        bin_width: f64,
        step: f64,
    ) -> Result<(Grid, Vec<f32>)> {
        let (grid, bins) = (self.0.plan().finest().grid, self.0.plan().scene.bins);
        let projected = self.projections(&(method.filters)(options, bins, bin_width, step))?;
        Ok((grid, (method.join)(options, projected, &grid, step)))
    }
}

/// A back-projection for captures of one scan.
pub struct Projecting {
    all: Projector,
    /// A few columns, for the choice of sharpness; `None` where the options tell it.
    columns: Option<(Ladder, Projector)>,
    rows: Rows,
    /// The scan that is made finer, if one is.
    scan: Option<RegularScan>,
    grid: Grid,
    is_start: bool,
}

impl Projecting {
    /// Chooses the sharpness by the noise of a few columns, if the options leave it open; and the weights of depths, if there are.
    fn sharpness<M: ClosedForm>(
        &mut self,
        options: &M,
        method: &Projection<M>,
        capture: &Capture,
        light: &CorrectedCounts<'_>,
        step: f64,
    ) -> Result<(Option<Sharpness>, Option<Vec<f32>>)> {
        let (ladder, columns) = match &mut self.columns {
            Some((ladder, columns)) if capture.integer_counts => (*ladder, columns),
            open => return Ok((open.as_ref().map(|(ladder, _)| ladder.sharpest()), None)),
        };
        let tossed = with_random_signs(capture);
        let mut dark = CorrectedCounts::of(&tossed, self.scan.as_ref(), options.image(), false);
        let (chosen, weights) = ladder.choose(|value| {
            let options = options.with_sharpness(value);
            dark.scale = Some(columns.take(&self.rows, light)?);
            let (grid, mut light) = columns.image(&options, method, capture.bin_width, step)?;
            columns.take(&self.rows, &dark)?;
            let (_, mut dark) = columns.image(&options, method, capture.bin_width, step)?;
            let weights = self.is_start.then(|| even_weights(&light, &dark, grid.n[2]));
            if let Some(weights) = &weights {
                [&mut light, &mut dark].into_iter().for_each(|volume| weigh(volume, weights));
            }
            Ok((noise(&light, &dark, grid.n[2], M::MASK_SHARE), weights))
        })?;
        Ok((Some(chosen), weights))
    }
}

/// A few columns of a grid, with all its depths.
fn columns_of(grid: &Grid) -> Grid {
    let wide = [0, 1].map(|a| grid.n[a] as f64 / grid.n[a].min(COLUMNS) as f64);
    let pitch = grid.pitch * DVec3::new(wide[0], wide[1], 1.0);
    let corner = grid.origin - 0.5 * grid.pitch;
    let n = [grid.n[0].min(COLUMNS), grid.n[1].min(COLUMNS), grid.n[2]];
    Grid { n, origin: corner + 0.5 * pitch, pitch }
}

impl Projecting {
    /// As [`crate::engine::Solver::plan`].
    pub fn plan_for(image: &ImageOptions, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        let Problem { capture, grid, .. } = *problem;
        let scan = to_refine(capture, image)?;
        let fine = pairs_on(scan.as_ref(), capture, image);
        plan(&outline_of(&fine, &grid, image).0, &fine, grid, abilities)
    }

    /// As [`crate::engine::Solver::outline`].
    pub fn outline(plan: &Plan) -> Vec<TimedSchedule> {
        let schedule = Schedule::of(|s| gather_filtered(s, plan, plan.finest(), plan.scene.bins));
        outline::of_start("volume", plan, plan.finest(), &schedule)
    }

    /// As [`crate::engine::Solver::prepare`].
    pub fn new<M: ClosedForm>(options: &M, gpu: &Gpu, problem: &Problem<'_>) -> Result<Projecting> {
        let Problem { capture, grid, memory, is_start, .. } = *problem;
        let scan = to_refine(capture, options.image())?;
        let fine = pairs_on(scan.as_ref(), capture, options.image());
        let (model, rows) = outline_of(&fine, &grid, options.image());
        let planned = |grid: Grid| {
            let plan = plan(&model, &fine, grid, &gpu.abilities())?;
            Ok::<_, Error>(Projector(Planned::new(gpu, model.clone(), plan, memory)))
        };
        let all = planned(grid)?;
        let columns = options
            .ladder()
            .map(|ladder| Ok::<_, Error>((ladder, planned(columns_of(&grid))?)))
            .transpose()?;
        if let Some((_, columns)) = columns.as_ref().filter(|_| capture.integer_counts && memory.is_some()) {
            let asked = [&all, columns].iter().flat_map(|p| p.0.plan().bytes().into_values()).sum();
            check_host_memory(asked, gpu, memory, |smaller| advice!["choose " {smaller} " or more " Memory])?;
        }
        Ok(Projecting { all, columns, rows, scan, grid, is_start })
    }

    /// Levels, passes and buffers.
    pub fn plan(&self) -> &Arc<Plan> {
        self.all.0.plan()
    }

    /// As [`crate::engine::Prepared::allocate`].
    pub fn allocate(&mut self) -> Result<()> {
        for projector in self.columns.as_mut().map(|(_, columns)| columns).into_iter().chain([&mut self.all])
        {
            let job = projector.made()?;
            job.executor.reserve(&Schedule::of(|s| {
                gather_filtered(s, &job.plan, job.plan.finest(), job.plan.scene.bins)
            }))?;
        }
        Ok(())
    }

    /// Makes what the capture needs.
    pub fn make(&mut self, capture: &Capture) -> Result<()> {
        if let Some((_, columns)) = self.columns.as_mut().filter(|_| capture.integer_counts) {
            columns.made()?;
        }
        self.all.made().map(|_| ())
    }

    /// The distance of scan points, metres.
    pub fn step(&self, capture: &Capture) -> f64 {
        capture.spacing().unwrap_or(self.grid.pitch.x)
    }

    /// The volume of a capture, and how sharp it is.
    pub fn volume<M: ClosedForm>(
        &mut self,
        options: &M,
        method: &Projection<M>,
        capture: &Capture,
    ) -> Result<(AlbedoVolume, Option<Sharpness>)> {
        let step = self.step(capture);
        let image = options.image();
        let light = CorrectedCounts::of(capture, self.scan.as_ref(), image, image.background);
        let (sharpness, weights) = self.sharpness(options, method, capture, &light, step)?;
        self.all.take(&self.rows, &light)?;
        let options = match sharpness {
            Some(chosen) => options.with_sharpness(chosen.value),
            None => options.clone(),
        };
        let (grid, mut albedo) = self.all.image(&options, method, capture.bin_width, step)?;
        if let Some(weights) = weights {
            weigh(&mut albedo, &weights);
        }
        let lattice = RegularScan::of_columns(&grid);
        Ok((AlbedoVolume { albedo: on_grid(&lattice, &albedo, &self.grid), normal: None }, sharpness))
    }

    /// Adds what it alone knows.
    pub fn conclude(&mut self, done: &mut Reconstruction) -> Result<()> {
        done.filled = self.scan.as_ref().map_or(0, |scan| scan.gaps.len());
        let executor = &mut self.all.made()?.executor;
        done.device_bytes = executor.bytes();
        done.kernels = executor.take_times().into_iter().collect();
        Ok(())
    }
}
