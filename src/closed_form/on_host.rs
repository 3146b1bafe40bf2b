//! Methods that run on the host: what each defines, their arrays and their volumes.

use std::borrow::Cow;
use std::sync::Arc;

use super::fourier::SpareSpectra;
use super::image::AlbedoVolume;
use super::method::{ClosedForm, HostMethod};
use super::scan::RegularScan;
use super::sharpness::{even_weights, noise, weigh, with_random_signs};
use crate::advice::{Advice, Remedy, advice};
use crate::capture::Capture;
use crate::closed_form::upsample;
use crate::engine::{Demand, Plan, Problem, Sharpness};
use crate::gpu::{Abilities, Buffer, BufferPlan, Gpu, Place};
use crate::transport::{Grid, Model};
use crate::{Error, Result};

/// The volume at the voxels of a grid.
pub(super) const VOLUME: Buffer = Buffer::named("volume");
/// The measured histograms, less their background.
pub(super) const COUNTS: Buffer = Buffer::named("counts");
/// The same with points between the measured ones.
const FINER: Buffer = Buffer::named("finer_counts");
/// Counts with a sign for every photon, and their volume.
const TOSSED: Buffer = Buffer::named("tossed_counts_and_volume");

/// A host method for captures of one scan.
pub struct OnHost {
    scan: RegularScan,
    grid: Grid,
    pub(super) plan: Arc<Plan>,
    is_start: bool,
    spare: SpareSpectra,
}

impl OnHost {
    /// No level but the grid and no pass: its arrays.
    pub fn plan_for<M: ClosedForm>(
        options: &M,
        method: &HostMethod<M>,
        problem: &Problem<'_>,
        abilities: &Abilities,
    ) -> Result<Plan> {
        let Problem { capture, grid, .. } = *problem;
        let scan = (method.scan)(options, capture)?;
        let (model, _) = Model::outline(&capture.outline(), options.image().reflectance, 1.0, false);
        let demand = Demand::of_one_step(1);
        let plan = Plan::open(&model, grid, capture.resolution(), demand, |_| [1; 2], abilities)?;
        let on_host = |(buffer, bytes)| BufferPlan::new(buffer, bytes, Place::Readback);
        Ok(Plan {
            buffers: arrays(options, method, capture, &scan, &grid).into_iter().map(on_host).collect(),
            ..plan.finish(&model, vec![], false)?
        })
    }

    /// As [`crate::engine::Solver::prepare`].
    pub fn new<M: ClosedForm>(
        options: &M,
        method: &HostMethod<M>,
        gpu: &Gpu,
        problem: &Problem<'_>,
    ) -> Result<OnHost> {
        let Problem { capture, grid, memory, is_start, .. } = *problem;
        let plan = OnHost::plan_for(options, method, problem, &gpu.abilities())?;
        let asked: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
        check_host_memory(
            asked,
            gpu,
            memory,
            |smaller| advice!["choose " {smaller} ", a larger " Stride ", a narrower " Gate " or more " Memory],
        )?;
        Ok(OnHost {
            scan: (method.scan)(options, capture)?,
            grid,
            plan: Arc::new(plan),
            is_start,
            spare: SpareSpectra::default(),
        })
    }

    /// The distance of scan points, metres.
    pub fn step(&self) -> f64 {
        self.scan.step[0].min(self.scan.step[1])
    }

    /// Points of the scan that were filled in.
    pub fn filled(&self) -> usize {
        self.scan.gaps.len()
    }

    /// The volume of a capture, and how sharp it is.
    pub fn volume<M: ClosedForm>(
        &mut self,
        options: &M,
        method: &HostMethod<M>,
        capture: &Capture,
    ) -> Result<(AlbedoVolume, Option<Sharpness>)> {
        let OnHost { scan, grid, is_start, spare, .. } = self;
        let (image, fine) = (options.image(), scan.finer(options.image().upsample));
        let of = |capture: Cow<'_, Capture>, with_background: bool| {
            let light = scan.light(capture, with_background);
            if image.upsample > 1 { upsample::finer(&light, scan, image).into_owned() } else { light }
        };
        let light = of(Cow::Borrowed(capture), image.background);
        let ladder = match options.ladder() {
            Some(ladder) if capture.integer_counts => ladder,
            open => {
                let volume = (method.volume)(options, &light, &fine, grid, spare);
                return Ok((volume, open.map(|ladder| ladder.sharpest())));
            }
        };
        let tossed = of(Cow::Owned(with_random_signs(capture)), false);
        let (chosen, volume) = ladder.choose(|value| {
            let options = options.with_sharpness(value);
            let [mut light, mut tossed] =
                [&light, &tossed].map(|counts| (method.volume)(&options, counts, &fine, grid, spare));
            if *is_start {
                let weights = even_weights(&light.albedo, &tossed.albedo, grid.n[2]);
                [&mut light, &mut tossed].into_iter().for_each(|v| weigh(&mut v.albedo, &weights));
            }
            let noise = noise(&light.albedo, &tossed.albedo, grid.n[2], M::MASK_SHARE);
            Ok((noise, light))
        })?;
        Ok((volume, Some(chosen)))
    }
}

/// All arrays of a host method, with those of the counts and of the choice of sharpness.
fn arrays<M: ClosedForm>(
    options: &M,
    method: &HostMethod<M>,
    capture: &Capture,
    scan: &RegularScan,
    grid: &Grid,
) -> Vec<(Buffer, u64)> {
    let bytes = |capture: &Capture| 4 * (capture.pair_count() * capture.bins) as u64;
    let volume = 4 * grid.voxels() as u64;
    let fine = upsample::finer(&capture.outline(), scan, options.image()).into_owned();
    let ladder = options.ladder().filter(|_| capture.integer_counts);
    let finest = scan.finer(options.image().upsample);
    // What is open is the sharpest. The softest needs more of some arrays, and less of others.
    let mut own = (method.arrays)(options, &fine, &finest, grid);
    if let Some(ladder) = ladder {
        let soft = (method.arrays)(&options.with_sharpness(ladder.softest()), &fine, &finest, grid);
        own.iter_mut().zip(soft).for_each(|((_, most), (_, bytes))| *most = bytes.max(*most));
    }
    let between = (options.image().upsample > 1).then(|| (FINER, bytes(&fine)));
    let tossed = ladder.map(|_| (TOSSED, bytes(&fine) + volume));
    [(COUNTS, bytes(capture)), (VOLUME, volume)].into_iter().chain(between).chain(tossed).chain(own).collect()
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
