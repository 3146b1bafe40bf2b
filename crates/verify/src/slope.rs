//! The gradient of the reference against finite differences of their objective.

use super::device::zero_histograms;
use super::scenes::{Random, both};
use super::solvers::{measure, prepared, scatter};
use super::steps::ComparedSteps;
use super::{CaseSolver, Compared, Host, KernelCase};
use thirdbounce::engine::{Accumulation, OnDevice};
use thirdbounce::gpu::{Buffer, Gpu, Schedule};
use thirdbounce::methods::paper;
use thirdbounce::transport::kernels::*;
use thirdbounce::{Result, surface};
use thirdbounce_kernels::Cells;

/// What varies, and where its gradient is found.
struct VariedState {
    state: Buffer,
    /// Numbers of an element of the state, those of them that vary, and the step of each.
    parts: usize,
    steps: &'static [f64],
    /// The first moments after one step of Adam from rest: gradients times `share`. Numbers of an element, and the place of
    /// the first one.
    moments: (Buffer, usize, usize),
    share: f64,
}

/// How many variables are tried.
const TRIED: usize = 60;

/// Compares derivatives by random variables with central differences. Where those of two steps disagree there is a kink (of
/// ELU, of a cosine, at the edge of a bin), and no derivative.
pub fn slope(case: &KernelCase, gpu: &Gpu, accumulation: Accumulation) -> Result<Vec<Compared>> {
    let mut steps =
        ComparedSteps { job: prepared(case, gpu, accumulation)?, compared: vec![], allowed: case.allowed };
    let block =
        steps.job.plan.blocks.last().map(|(_, bytes)| bytemuck::pod_read_unaligned::<PaperData>(bytes));
    let paper = block.unwrap_or_default();
    let share = 1.0 - f64::from(paper.beta1);
    let is_surface = matches!(case.solver, CaseSolver::Surface { .. });
    let raw = (buffer::MOMENT_FIRST, 4, 0);
    let mut all = vec![VariedState { state: buffer::RAW, parts: 4, steps: &[1e-5; 4], moments: raw, share }];
    let noise = (buffer::NOISE_STATE, 3, 1);
    if paper.noise_span > 0.0 {
        all.push(VariedState { state: buffer::NOISE_STATE, parts: 3, steps: &[1e-4], moments: noise, share });
    }
    let mut s = Schedule::default();
    if is_surface {
        let moments = (buffer::HEIGHT_MOMENTS, 4, 0);
        all =
            vec![VariedState { state: buffer::HEIGHTS, parts: 2, steps: &[1e-6, 1e-3], moments, share: 0.1 }];
        let (plan, count) = (steps.job.plan.clone(), both(&case.grid, 61).len());
        let CaseSolver::Surface { points, .. } = case.solver else { return Ok(vec![]) };
        steps.run(|s, plan| surface::start_of(s, plan, plan.finest(), count, points))?;
        measure(&mut steps.job, count)?;
        surface::iteration(&mut s, &plan, plan.finest(), count, [0, 0, 12]);
    } else {
        scatter(&mut steps, false, false)?;
        let plan = steps.job.plan.clone();
        for moments in [buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
            s.fill(moments, plan.bytes_of(moments), 0);
        }
        paper::iteration(&mut s, &plan, plan.finest(), 0, 1);
    }
    zero_histograms(&mut steps.job)?;
    // Partial sums of the surface are those of its prior.
    let l1 = if is_surface { 1.0 } else { f64::from(paper.l1_scale) };
    let job = &mut steps.job;
    all.iter().map(|v| compared(job, &s, v, l1, case.allowed)).collect()
}

fn compared(job: &mut OnDevice, s: &Schedule, v: &VariedState, l1: f64, allowed: f64) -> Result<Compared> {
    const AFTER: [&str; 6] =
        ["noise", "backward", "update", "surface_gather", "surface_pull", "surface_step"];
    let mut host = Host::default();
    let start = host.get(job, v.state)?.clone().f().to_vec();
    if v.state == buffer::NOISE_STATE {
        let rest: Vec<f64> = start.as_chunks::<3>().0.iter().flat_map(|w| [w[0], 0.0, 0.0]).collect();
        *host.get(job, v.state)? = Cells::Floats(rest);
    }
    host.run(job, s)?;
    let (moments, size, first) = v.moments;
    let gradient: Vec<f64> = host.get(job, moments)?.f().iter().map(|m| m / v.share).collect();
    let sums =
        Schedule { commands: s.commands.iter().filter(|c| !AFTER.contains(&c.name())).cloned().collect() };
    let elements = job.model.elements as f64;
    let mut before = Host::before(job, &sums)?;
    // What no dispatch writes counts nothing.
    for partials in [buffer::LOSS_PARTIALS, buffer::L1_PARTIALS] {
        before.get(job, partials)?.f().fill(0.0);
    }
    let mut objective = |index: usize, step: f64| -> Result<f64> {
        let mut host = before.clone();
        host.get(job, v.state)?.f()[index] += step;
        host.run(job, &sums)?;
        let loss: f64 = host.get(job, buffer::LOSS_PARTIALS)?.v2().iter().map(|l| l[0]).sum();
        Ok(loss / elements + l1 * host.get(job, buffer::L1_PARTIALS)?.f().iter().sum::<f64>())
    };
    let mut random = Random::new(99);
    let (mut worst, mut tried, mut skipped) = (0.0f64, 0, 0);
    // State beyond the pixels or the touched voxels is no number.
    let count = start.iter().position(|v| v.is_nan()).unwrap_or(start.len()) / v.parts;
    for _ in 0..20 * TRIED {
        if tried == TRIED || skipped == TRIED / 2 {
            break;
        }
        let (element, part) = (random.draw() as usize % count, random.draw() as usize % v.steps.len());
        let of = |element: usize| gradient[size * element + first + part];
        if of(element) == 0.0 {
            continue;
        }
        let largest = (0..count).map(|e| of(e).abs()).fold(0.0, f64::max);
        let (index, step) = (v.parts * element + part, v.steps[part]);
        let mut central = |step: f64| -> Result<f64> {
            Ok((objective(index, step)? - objective(index, -step)?) / (2.0 * step))
        };
        let (wide, narrow) = (central(step)?, central(0.5 * step)?);
        if (wide - narrow).abs() > allowed * largest {
            skipped += 1;
            continue;
        }
        worst = worst.max((wide - of(element)).abs() / largest);
        tried += 1;
    }
    let error = if tried == TRIED { worst } else { f64::INFINITY };
    Ok(Compared { module: "gradient", buffer: v.state, error, allowed, bits: 0 })
}
