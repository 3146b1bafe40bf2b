//! The schedules of cases.

use std::sync::Arc;

use glam::dvec3;

use super::device::{Needs, job, job_with, perform, read_words, write, zero_histograms};
use super::scenes::{FitNeeds, Random, both, options};
use super::steps::{ComparedSteps, compare};
use super::{CaseSolver, Compared, Doubled, Host, KernelCase};
use crate::{Sample, Way, instrument, rendered};
use thirdbounce::closed_form::hat;
use thirdbounce::closed_form::passes::gather_filtered;
use thirdbounce::engine::{Accumulation, OnDevice, Plan, Tuning};
use thirdbounce::gpu::{Buffer, Gpu, Schedule};
use thirdbounce::learned::schedule::LearnedSchedule;
use thirdbounce::learned::{LearnedScan, Network};
use thirdbounce::methods::paper;
use thirdbounce::surface::{Judged, Pixels, Placed, points_of};
use thirdbounce::transport::kernels::*;
use thirdbounce::{Result, surface};

/// Runs the schedules of a case, and compares every dispatch.
pub fn steps(case: &KernelCase, gpu: &Gpu, accumulation: Accumulation) -> Result<Vec<Compared>> {
    let job = prepared(case, gpu, accumulation)?;
    let mut steps = ComparedSteps { job, compared: vec![], allowed: case.allowed };
    match case.solver {
        CaseSolver::Paper { rooms, doubled, dark, .. } => {
            paper_steps(&mut steps, case, rooms, doubled, dark)?
        }
        CaseSolver::Surface { .. } => surface_steps(&mut steps, &both(&case.grid, 61))?,
        CaseSolver::Projection { .. } => {
            steps.run(|s, plan| gather_filtered(s, plan, plan.finest(), plan.scene.bins))?;
        }
        CaseSolver::Learned => {
            let (made, _) = learned();
            steps.run(|s, _| s.append(&mut made.commands.clone()))?;
        }
        CaseSolver::Rounding => steps.run(|s, _| {
            s.dispatch(&kernel::ROUNDING, [1, 1, 1], 64).bind(buffer::RESULT, buffer::RESIDUAL);
        })?,
    }
    Ok(steps.compared)
}

/// The job of a case, with its first state in the buffers.
pub fn prepared(case: &KernelCase, gpu: &Gpu, accumulation: Accumulation) -> Result<OnDevice> {
    let (model, grid) = (&case.model, &case.grid);
    let make = |needs: Needs<'_>| -> Result<OnDevice> {
        let mut job = job(gpu, model, grid, needs, |t| tune(case, t))?;
        if case.sizes.polished {
            Arc::make_mut(&mut job.plan).constants.insert(constant::POLISHED, 1);
        }
        Ok(job)
    };
    match case.solver {
        CaseSolver::Paper { change, doubled, .. } => make(Needs::Paper(&options(model, grid).with(|o| {
            change(o);
            o.accumulation = accumulation;
            o.domain.coarse_to_fine = !matches!(doubled, Doubled::No | Doubled::HalfRim);
            o.domain.reduce = false;
            if let Doubled::Brightest(share) = doubled {
                o.domain.room = Some(share);
            }
        }))),
        CaseSolver::Surface { points, spread, long_steps } => {
            let fit =
                FitNeeds::of(grid, points).with(|o| (o.accumulation, o.sparsity) = (accumulation, 0.05));
            let mut job = make(Needs::Fit(&fit))?;
            let pixels = both(grid, 61);
            let placed = Placed { pixels: pixels.len(), most: 60.0, explained: 2.0, left: 2.0 };
            let mut weights = surface::weights(model, job.plan.finest(), placed, &fit.options, 12, 1.0);
            weights[SURFACE_SPREAD as usize] = spread;
            for (index, value) in [
                (SURFACE_BRIGHTEST, 1.5),
                (SURFACE_ENERGY, 3.0),
                (SURFACE_COMPARED, 2.5),
                (SURFACE_PLACED, 1.0),
                (SURFACE_BEFORE, 0.5),
            ] {
                weights[index as usize] = value;
            }
            if long_steps {
                (weights[SURFACE_DEPTH_RATE as usize], weights[SURFACE_ALBEDO_RATE as usize]) = (0.25, 16.0);
            }
            write(&mut job, buffer::SURFACE_WEIGHTS, &weights)?;
            let energies = vec![2.0f32; job.plan.bytes_of(buffer::SURFACE_ENERGIES) as usize / 4];
            write(&mut job, buffer::SURFACE_ENERGIES, &energies)?;
            place(&mut job, &pixels)?;
            write(&mut job, buffer::COUNTS, &[0u32; COUNTS as usize])?;
            zero_histograms(&mut job)?;
            Ok(job)
        }
        CaseSolver::Projection { sigma, odd } => {
            let mut job = make(Needs::Projection)?;
            let mut taps = hat(sigma, model.bins);
            taps[0] *= if odd { -1.0 } else { 1.0 };
            write(&mut job, buffer::HAT_TAPS, &taps)?;
            Ok(job)
        }
        CaseSolver::Learned => {
            let (made, content) = learned();
            let mut job = job_with(gpu, model, grid, Needs::Projection, &made.buffers, |_| {})?;
            write(&mut job, buffer::LEARNED_WEIGHTS, &made.weights)?;
            content.iter().try_for_each(|(to, values)| write(&mut job, *to, values))?;
            Ok(job)
        }
        CaseSolver::Rounding => make(Needs::Projection),
    }
}

/// The learned start of random pairs, in a box whose far end light does not reach, and the content of its buffers.
fn learned() -> (LearnedSchedule, [(Buffer, Vec<f32>); 3]) {
    let mut random = Random::new(71);
    let mut end = || dvec3(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-0.02, 0.02));
    // More than are staged at once, with one at which both ends are one point.
    let mut pairs: Vec<_> = (0..70).map(|_| [end(), end()]).collect();
    pairs[3][1] = pairs[3][0];
    let counts: Vec<f32> = (0..pairs.len() * 90).map(|_| random.uniform(0.0, 4.0).powi(3) as f32).collect();
    let scan = LearnedScan { pairs, counts: &counts, bins: [0.3, 0.04], pitch: 0.125 };
    (LearnedSchedule::new(&Network::trained(), [8, 8, 16], Some(scan.sizes()), 1), scan.content())
}

fn tune(case: &KernelCase, t: &mut Tuning) {
    if let Some(window) = case.sizes.window {
        (t.window, t.window_span) = (window, u32::MAX);
        // Below the loop limit even if every voxel moves the window, and still several chunks. Few enough lanes for the shared
        // memory of most devices.
        (t.chunk, t.forward_fill, t.lanes) = (192, u32::MAX, t.lanes.min(32));
    }
    if let Some([voxels, slices, fill]) = case.sizes.gather {
        (t.voxels, t.slices, t.fill) = (voxels, slices, fill);
    }
    if let Some(lanes) = case.sizes.shared {
        [t.row_lanes, t.pixel_lanes] = lanes;
    }
}

/// Writes the pixels of a surface.
pub fn place(job: &mut OnDevice, pixels: &Pixels) -> Result<()> {
    let [x, y, _] = job.plan.finest().grid.n;
    write(job, buffer::PIXELS, &pixels.columns)?;
    write(job, buffer::PIXEL_OF, &pixels.places(x * y))?;
    let heights: Vec<[f32; 2]> = pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, *a]).collect();
    write(job, buffer::HEIGHTS, &heights)
}

/// Makes the measurement of a surface: close to its rendering.
pub fn measure(job: &mut OnDevice, count: usize) -> Result<()> {
    perform(job, &Schedule::of(|s| surface::points(s, job.plan.finest(), count)))?;
    let points = count * points_of(&job.plan);
    let mut read = |buffer| -> Result<Vec<[f64; 4]>> {
        let words = read_words(job, buffer)?;
        Ok(words.as_chunks::<4>().0.iter().map(|v| v.map(|w| f64::from(f32::from_bits(w)))).collect())
    };
    let (p, n) = (read(buffer::SAMPLE_POINTS)?, read(buffer::SAMPLE_NORMALS)?);
    let (model, grid) = (&job.model, &job.plan.finest().grid);
    let samples: Vec<Sample> = (0..points).map(|i| Sample::at(model, &p, &n, i)).collect();
    let shown = instrument(model, &rendered(model, grid, &samples), Way::Spread);
    let scale = f64::from(model.scene(grid).render_scale);
    let level = shown.iter().fold(0.0f64, |a, b| a.max(*b)) * scale;
    let mut random = Random::new(63);
    let mut draw = |r: &f64| (r * scale * random.uniform(0.5, 1.4) + level * random.uniform(0.0, 0.1)) as f32;
    let measured: Vec<f32> = shown.iter().map(&mut draw).collect();
    write(job, buffer::MEASURED, &measured)
}

/// Gives the paper's solver a random part of its domain, with random variables. A bright middle is left by reductions.
/// `half_rim`: there is room for half of the rim.
pub fn scatter(steps: &mut ComparedSteps, dark: bool, half_rim: bool) -> Result<()> {
    steps.run(|s, plan| paper::initialise(s, plan, &plan.levels.volume[0]))?;
    let job = &mut steps.job;
    let mut random = Random::new(4);
    let mut mask = read_words(job, buffer::MASK)?;
    let words = job.plan.levels.volume[0].grid.storage() / 32;
    mask[..words]
        .iter_mut()
        .for_each(|word| *word &= random.draw() & random.draw() | random.draw() & random.draw());
    write(job, buffer::MASK, &mask[..words])?;
    if half_rim {
        let active: u32 = mask[..words].iter().map(|word| word.count_ones()).sum();
        let domain = &mut Arc::make_mut(&mut job.plan).domain;
        domain.touched_capacity = (active as usize + job.model.wall.pairs()).min(domain.touched_capacity);
        job.upload()?;
    }
    steps.run(|s, plan| paper::compact(s, plan, &plan.levels.volume[0]))?;
    let job = &mut steps.job;
    let grid = job.plan.levels.volume[0].grid;
    let (list, counts) = (read_words(job, buffer::ACTIVE_VOXELS)?, read_words(job, buffer::COUNTS)?);
    let touched = &list[..counts[COUNT_TOUCHED as usize] as usize];
    let raw = |i: &u32| -> [f32; 4] {
        let c = grid.voxel(*i as usize).map(|c| c as f64);
        let middle = grid.n.map(|n| n as f64 / 2.0);
        let off: f64 = (0..3).map(|a| (c[a] - middle[a]).powi(2)).sum();
        let light = if i.is_multiple_of(9) { 0.5 } else { -0.5 - f64::from(i % 7) / 8.0 };
        let albedo = if dark { light } else { 5.0 * (-0.2 * off).exp() + random.uniform(-1.5, 1.5) };
        [albedo as f32, 0.0, 0.0, 0.0].map(|v| if v == 0.0 { random.uniform(-1.5, 1.5) as f32 } else { v })
    };
    let raw: Vec<[f32; 4]> = touched.iter().map(raw).collect();
    write(job, buffer::RAW, &raw)?;
    move_on(job)?;
    let noise: Vec<[f32; 3]> = (0..job.plan.bytes_of(buffer::NOISE_STATE) / 12)
        .map(|_| {
            [random.uniform(-3.0, 3.0), random.uniform(-1e-5, 1e-5), random.uniform(1e-11, 1e-10)]
                .map(|v| v as f32)
        })
        .collect();
    write(job, buffer::NOISE_STATE, &noise)?;
    zero_histograms(job)
}

/// Gives all voxels moments as after some steps: the first step from rest is as long for a rounding error as for a gradient.
fn move_on(job: &mut OnDevice) -> Result<()> {
    let mut random = Random::new(5);
    for (buffer, low, high) in [(buffer::MOMENT_FIRST, -1e-3, 1e-3), (buffer::MOMENT_SECOND, 1e-7, 1e-6)] {
        let count = job.plan.bytes_of(buffer) / 4;
        let all: Vec<f32> = (0..count).map(|_| random.uniform(low, high) as f32).collect();
        write(job, buffer, &all)?;
    }
    Ok(())
}

fn paper_steps(
    steps: &mut ComparedSteps,
    case: &KernelCase,
    rooms: &[Option<f64>],
    doubled: Doubled,
    dark: bool,
) -> Result<()> {
    scatter(steps, dark, doubled == Doubled::HalfRim)?;
    if !dark {
        steps.run(|s, plan| paper::iteration(s, plan, &plan.levels.volume[0], 5, 3))?;
    }
    let keep = options(&case.model, &case.grid).domain.keep_above;
    for room in rooms {
        let active = read_words(&mut steps.job, buffer::COUNTS)?[COUNT_ACTIVE as usize];
        steps.run(|s, plan| {
            let mut plan = plan.clone();
            plan.domain.capacity =
                room.map_or(plan.domain.capacity, |share| (share * f64::from(active)) as usize);
            paper::reduce(s, &plan, &plan.levels.volume[0], keep);
        })?;
    }
    if steps.job.plan.levels.volume.len() > 1 {
        let o = options(&case.model, &case.grid).with(|o| o.domain.reduce = false);
        steps.run(|s, plan| paper::due(s, plan, &o, &mut 0, o.domain.double_every))?;
        move_on(&mut steps.job)?;
    }
    steps.run(|s, plan| paper::iteration(s, plan, plan.finest(), 6, 4))?;
    steps.run(|s, plan| paper::extract(s, plan.finest()))
}

fn surface_steps(steps: &mut ComparedSteps, pixels: &Pixels) -> Result<()> {
    let (count, points) = (pixels.len(), points_of(&steps.job.plan));
    steps.run(|s, plan| surface::start_of(s, plan, plan.finest(), count, points))?;
    for i in 0..3 {
        steps.run(|s, plan| surface::iteration(s, plan, plan.finest(), count, [i, i, 12]))?;
    }
    judged(steps, count)?;
    let [x, y, _] = steps.job.plan.finest().grid.n;
    let of_layers = pixels.of_layers(x * y);
    (0..2).try_for_each(|layer| steps.run(|s, plan| surface::extract(s, plan.finest(), of_layers, layer)))
}

/// What a fit of `count` pixels decides on its way after three iterations: a better state, none, a rise, its end; then albedos of a
/// known and of an unknown scale.
fn judged(steps: &mut ComparedSteps, count: usize) -> Result<()> {
    let of = |first: usize, flags: u32| Judged { iterations: [first, 3], at: 3, flags };
    steps.run(|s, plan| surface::check(s, plan, plan.finest(), count, of(0, JUDGE_FIRST)))?;
    // How far the best logarithm is lowered: a better state, a little worse one, a rise, and one that is judged already.
    for (lower, first, flags) in [(-0.5, 0, 0), (0.02, 0, JUDGE_LAST), (50.0, 1, 0), (0.0, 3, JUDGE_LAST)] {
        let mut weights: Vec<f32> =
            read_words(&mut steps.job, buffer::SURFACE_WEIGHTS)?.into_iter().map(f32::from_bits).collect();
        weights[SURFACE_BEST as usize] -= lower;
        write(&mut steps.job, buffer::SURFACE_WEIGHTS, &weights)?;
        steps.run(|s, plan| surface::check(s, plan, plan.finest(), count, of(first, flags)))?;
    }
    steps.run(|s, plan| surface::place_known(s, plan, plan.finest(), count))?;
    [true, false].into_iter().try_for_each(|is_guess| {
        steps.run(|s, plan| surface::place(s, plan, [plan.finest(); 2], count, 3, is_guess))
    })
}

/// Lets the reference and the device run several iterations, each by itself, and compares what they leave.
pub fn whole(case: &KernelCase, gpu: &Gpu, accumulation: Accumulation) -> Result<Vec<Compared>> {
    const ITERATIONS: usize = 6;
    let mut job = prepared(case, gpu, accumulation)?;
    let plan: Arc<Plan> = job.plan.clone();
    let level = plan.finest();
    let mut s = Schedule::default();
    let mut left = vec![buffer::TRACE];
    if let CaseSolver::Surface { points, .. } = case.solver {
        let count = both(&case.grid, 61).len();
        perform(&mut job, &Schedule::of(|s| surface::start_of(s, &plan, level, count, points)))?;
        measure(&mut job, count)?;
        write(&mut job, buffer::COUNTS, &[0u32; COUNTS as usize])?;
        surface::start_of(&mut s, &plan, level, count, points);
        (0..ITERATIONS).for_each(|i| surface::iteration(&mut s, &plan, level, count, [i, i, 12]));
        left.extend([buffer::HEIGHTS, buffer::HEIGHT_MOMENTS]);
    } else {
        paper::initialise(&mut s, &plan, level);
        (0..ITERATIONS as u32).for_each(|i| paper::iteration(&mut s, &plan, level, i, i + 1));
    }
    let mut host = Host::default();
    host.run(&mut job, &s)?;
    perform(&mut job, &s)?;
    let mut compared = vec![];
    for buffer in left {
        let want = host.get(&mut job, buffer)?.clone();
        compared.push(compare(&mut job, "iterations", buffer, &want, case.allowed)?);
    }
    Ok(compared)
}
