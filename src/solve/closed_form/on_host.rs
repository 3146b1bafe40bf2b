//! Methods that run on the host: what each defines, their plan and their run.

use std::sync::Arc;

use super::image::AlbedoVolume;
use super::one_step::{NoPasses, in_one_step};
use super::options::ImageOptions;
use super::sharpness::{Ladder, even_weights, noise, weigh, with, with_random_signs};
use super::{RegularScan, upsample};
use crate::advice::{Advice, Remedy, advice};
use crate::capture::Capture;
use crate::gpu::{Abilities, Buffer, BufferPlan, Gpu, Place};
use crate::solve::option::Options;
use crate::solve::{Plan, Prepared, Problem, Reconstruction, Watch};
use crate::transport::{Grid, Model};
use crate::{Error, Result};

/// A method that runs on the host.
pub trait HostMethod: Options + Clone + Send + Sync + 'static {
    /// What the options of all closed-form methods have.
    fn image(&self) -> &ImageOptions;

    /// Its share of [`super::image::level_over_haze`], fitted on simulated scenes (benches/NOTES.md).
    const MASK_SHARE: f64;

    /// The scan of a capture.
    ///
    /// # Errors
    /// `Kind::Input`: the capture breaks an assumption of the method.
    fn scan(&self, capture: &Capture) -> Result<RegularScan>;

    /// Names and bytes of the arrays that it holds at the same time, at most.
    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)>;

    /// The parameter of the sharpness and its candidates; `None` if the options give it.
    fn ladder(&self) -> Option<Ladder> {
        None
    }

    /// The setting of the ladder.
    fn sharpness(&mut self) -> Option<&mut Option<f64>> {
        None
    }

    /// The volume at the voxels of `grid`. Counts are without background. A sharpness that the options leave open is the
    /// first of the ladder.
    fn volume(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> AlbedoVolume;
}

/// The volume at the voxels of a grid.
pub(super) const VOLUME: Buffer = Buffer::named("volume");
/// The measured histograms, less their background.
pub(super) const COUNTS: Buffer = Buffer::named("counts");
/// The same with points between the measured ones.
const FINER: Buffer = Buffer::named("finer_counts");
/// Counts with a sign for every photon, and their volume.
const TOSSED: Buffer = Buffer::named("tossed_counts_and_volume");

/// Writes what every host method is to the rest of the engine.
macro_rules! host_method {
    ($options:ident, $name:literal) => {
        impl $options {
            /// Its name on the command line.
            pub const NAME: &'static str = $name;
        }

        impl $crate::solve::Solver for $options {
            fn common(&self) -> $crate::solve::Common {
                $crate::solve::closed_form::one_step::common(self.lateral, self.image())
            }

            fn check(&self) -> $crate::Result<()> {
                $crate::solve::option::Options::check_ranges(self)
            }

            fn takes(&self, capture: &$crate::capture::Capture) -> $crate::Result<()> {
                self.scan(capture).map(|_| ())
            }

            fn plan(
                &self,
                problem: &$crate::solve::Problem<'_>,
                abilities: &$crate::gpu::Abilities,
            ) -> $crate::Result<$crate::solve::Plan> {
                $crate::solve::closed_form::on_host::plan(self, problem, abilities)
            }

            fn outline(&self, _plan: &$crate::solve::Plan) -> Vec<$crate::solve::TimedSchedule> {
                vec![]
            }

            fn prepare(
                &self,
                gpu: &$crate::gpu::Gpu,
                problem: &$crate::solve::Problem<'_>,
            ) -> $crate::Result<Box<dyn $crate::solve::Prepared>> {
                $crate::solve::closed_form::on_host::prepare(self, gpu, problem, false)
            }
        }
    };
}

pub(super) use host_method;

/// The plan of a host method: its arrays, and no pass.
///
/// # Errors
/// `Kind::Input`: the capture breaks an assumption of the method.
pub fn plan<M: HostMethod>(options: &M, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
    let Problem { capture, grid, .. } = *problem;
    let scan = options.scan(capture)?;
    let (model, _) = Model::outline(&capture.outline(), options.image().reflectance, 1.0, false);
    let mut plan = Plan::new(&model, grid, capture.resolution(), &NoPasses, abilities, false)?;
    let shared =
        [(COUNTS, 4 * (capture.pair_count() * capture.bins) as u64), (VOLUME, 4 * grid.voxels() as u64)];
    let fine = upsample::finer(&capture.outline(), &scan, options.image()).into_owned();
    let ladder = options.ladder().filter(|_| capture.integer_counts);
    let finest = scan.finer(options.image().upsample);
    // What is open is the sharpest. The softest needs more of some arrays, and less of others.
    let mut own = options.arrays(&fine, &finest, &grid);
    if let Some(ladder) = ladder {
        let soft = with(options, M::sharpness, ladder.softest()).arrays(&fine, &finest, &grid);
        own.iter_mut().zip(soft).for_each(|((_, most), (_, bytes))| *most = bytes.max(*most));
    }
    let tossed = ladder.map(|_| {
        let counts = 4 * (fine.pair_count() * fine.bins) as u64;
        (TOSSED, counts + 4 * grid.voxels() as u64)
    });
    let between = (options.image().upsample > 1).then(|| (FINER, 4 * (fine.pair_count() * fine.bins) as u64));
    plan.passes.clear();
    plan.left_out.clear();
    plan.buffers = shared
        .into_iter()
        .chain(between)
        .chain(tossed)
        .chain(own)
        .map(|(b, bytes)| BufferPlan::new(b, bytes, Place::Readback))
        .collect();
    Ok(plan)
}

/// Prepares a host method for captures of one scan. With `is_start` it initialises a surface: photon noise is alike at all depths.
///
/// # Errors
/// As [`plan`], and arrays that do not fit the budget or the host's memory.
pub fn prepare<M: HostMethod>(
    options: &M,
    gpu: &Gpu,
    problem: &Problem<'_>,
    is_start: bool,
) -> Result<Box<dyn Prepared>> {
    let Problem { capture, grid, memory, with_volume, .. } = *problem;
    options.check_ranges()?;
    let scan = options.scan(capture)?;
    let plan = plan(options, problem, &gpu.abilities())?;
    let asked: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
    check_host_memory(
        asked,
        gpu,
        memory,
        |smaller| advice!["choose " {smaller} ", a larger " Stride ", a narrower " Gate " or more " Memory],
    )?;
    Ok(Box::new(OnHost { options: options.clone(), scan, grid, plan: Arc::new(plan), with_volume, is_start }))
}

/// Refuses arrays of `asked` bytes that do not fit the budget or the host's memory. `fix` says what to do, with the smaller
/// job that would fit.
pub fn check_host_memory<A: Into<Advice>>(
    asked: u64,
    gpu: &Gpu,
    memory: Option<u64>,
    hint: impl FnOnce(Remedy) -> A,
) -> Result<()> {
    let available = memory.unwrap_or(u64::MAX).min(gpu.memory().free[1]);
    if asked <= available {
        return Ok(());
    }
    let smaller = Remedy::SmallerJob { asked: Some(asked), available: Some(available) };
    Err(Error::memory(
        format!("the arrays take {} MiB, and there are {} MiB", asked >> 20, available >> 20),
        hint(smaller),
    ))
}

/// A host method that is prepared for a scan.
struct OnHost<M> {
    options: M,
    scan: RegularScan,
    grid: Grid,
    plan: Arc<Plan>,
    with_volume: bool,
    is_start: bool,
}

impl<M: HostMethod> Prepared for OnHost<M> {
    fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    fn allocate(&mut self) -> Result<()> {
        Ok(())
    }

    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let OnHost { options, scan, grid, plan, with_volume, is_start } = self;
        let step = scan.step[0].min(scan.step[1]);
        let done = in_one_step(plan, grid, [step, M::MASK_SHARE], *with_volume, watch, || {
            let (image, fine) = (options.image(), scan.finer(options.image().upsample));
            let of = |capture: &Capture, with_background: bool| {
                let light = scan.light(capture, with_background);
                if image.upsample > 1 { upsample::finer(&light, scan, image).into_owned() } else { light }
            };
            let light = of(capture, image.background);
            let ladder = match options.ladder() {
                Some(ladder) if capture.integer_counts => ladder,
                open => {
                    return Ok((options.volume(&light, &fine, grid), open.map(|ladder| ladder.sharpest())));
                }
            };
            let tossed = of(&with_random_signs(capture), false);
            let (chosen, volume) = ladder.choose(|value| {
                let options = with(options, M::sharpness, value);
                let [mut light, mut tossed] =
                    [&light, &tossed].map(|counts| options.volume(counts, &fine, grid));
                if *is_start {
                    let weights = even_weights(&light.albedo, &tossed.albedo, grid.n[2]);
                    [&mut light, &mut tossed].into_iter().for_each(|v| weigh(&mut v.albedo, &weights));
                }
                let noise = noise(&light.albedo, &tossed.albedo, grid.n[2], M::MASK_SHARE);
                Ok((noise, light))
            })?;
            Ok((volume, Some(chosen)))
        })?;
        Ok(Reconstruction { filled: scan.gaps.len(), ..done })
    }
}
