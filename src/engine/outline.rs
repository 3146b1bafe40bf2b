//! A solve as its schedules: what runs before the first iteration, in one, and between them, before anything is allocated.
//!
//! Nothing here is written by hand. The schedules are those that the driver submits, and what a dispatch reads and
//! writes is what `build.rs` found in its compiled module.

use std::fmt;
use std::ops::Range;

use super::plan::Plan;
use crate::Result;
use crate::engine::drive::Steps;
use crate::engine::plan::Level;
use crate::gpu::{Buffer, BufferPlan, Command, KernelCode, Schedule, Size, View, barriers};
use crate::transport::kernels::buffer;

/// A schedule of a solve, and when it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedSchedule {
    /// What it belongs to: "volume" or "surface".
    pub of: &'static str,
    /// When it runs.
    pub when: When,
    /// Lateral voxels or pixels of the level that it leads to.
    pub lateral: usize,
    /// Pairs of that level.
    pub pairs: usize,
    /// Barriers between its commands.
    pub barriers: usize,
    /// Its commands in order.
    pub steps: Vec<Step>,
}

/// When a part runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum When {
    /// Before the first iteration.
    Start,
    /// In each of these iterations (from 1): first and last.
    Iterations(usize, usize),
    /// After each of these numbers of iterations.
    After(Vec<usize>),
    /// After the last iteration: the maps.
    End,
}

/// A command as people read it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// The pass, `fill` or `copy`.
    pub name: String,
    /// Workgroups or bytes of each command.
    pub sizes: Vec<String>,
    /// Buffers, by the names that the plan allocates. Those that a module names but this plan does not use are left out.
    pub reads: Vec<Buffer>,
    /// Buffers that it writes, named in the same way.
    pub writes: Vec<Buffer>,
}

/// The parts of one run of the driver over `iterations`. A schedule that repeats is one part, with all its times.
pub(crate) fn of(
    what: &'static str,
    plan: &Plan,
    steps: &Steps<'_>,
    iterations: Range<usize>,
) -> Vec<TimedSchedule> {
    let part = |when, level: &Level, schedule: &Schedule| TimedSchedule {
        of: what,
        when,
        lateral: level.grid.n[0],
        pairs: level.pairs,
        barriers: barriers_of(plan, schedule),
        steps: steps_of(plan, schedule),
    };
    let mut level = 0;
    let start = Schedule::of(|s| (steps.start)(s, plan));
    let mut all = vec![part(When::Start, &steps.levels[0], &start)];
    let mut due: Vec<TimedSchedule> = vec![];
    for i in iterations.clone() {
        let here = steps.levels[level];
        let run = Schedule::of(|s| (steps.iteration)(s, plan, &here, i));
        let one = part(When::Iterations(i + 1, i + 1), &here, &run);
        match all.last_mut() {
            Some(TimedSchedule { when: When::Iterations(_, last), lateral, pairs, steps, .. })
                if (*lateral, *pairs, &*steps) == (one.lateral, one.pairs, &one.steps) =>
            {
                *last = i + 1;
            }
            _ => all.push(one),
        }
        if i + 1 == iterations.end {
            break;
        }
        let change = Schedule::of(|s| (steps.due)(s, plan, &mut level, i + 1));
        if change.commands.is_empty() {
            continue;
        }
        let one = part(When::After(vec![i + 1]), &steps.levels[level], &change);
        let same =
            |p: &&mut TimedSchedule| (p.lateral, p.pairs, &p.steps) == (one.lateral, one.pairs, &one.steps);
        match due.iter_mut().find(same) {
            Some(TimedSchedule { when: When::After(times), .. }) => times.push(i + 1),
            _ => due.push(one),
        }
    }
    let last = &steps.levels[level];
    all.extend(due);
    let end = Schedule::of(|s| match steps.has_maps {
        true => (steps.extract)(s, last),
        false => (steps.last)(s, plan, iterations.end),
    });
    all.push(part(When::End, last, &end));
    all
}

/// The part of a method that has one schedule and no iterations.
pub(crate) fn of_start(
    what: &'static str,
    plan: &Plan,
    level: &Level,
    schedule: &Schedule,
) -> Vec<TimedSchedule> {
    let steps = steps_of(plan, schedule);
    vec![TimedSchedule {
        of: what,
        when: When::Start,
        lateral: level.grid.n[0],
        pairs: level.pairs,
        barriers: barriers_of(plan, schedule),
        steps,
    }]
}

/// Every schedule of one run of the driver over `iterations`, in their order.
///
/// # Errors
/// Those of `take`.
pub(crate) fn each(
    plan: &Plan,
    steps: &Steps<'_>,
    iterations: Range<usize>,
    take: &mut dyn FnMut(&Schedule) -> Result<()>,
) -> Result<()> {
    let mut level = 0;
    take(&Schedule::of(|s| (steps.start)(s, plan)))?;
    for i in iterations.clone() {
        take(&Schedule::of(|s| (steps.iteration)(s, plan, &steps.levels[level], i)))?;
        take(&Schedule::of(|s| (steps.due)(s, plan, &mut level, i + 1)))?;
    }
    take(&Schedule::of(|s| (steps.last)(s, plan, iterations.end)))?;
    steps.levels.iter().try_for_each(|level| take(&Schedule::of(|s| (steps.extract)(s, level))))
}

/// The commands of a schedule. Neighbours that differ only in their sizes are one step.
fn steps_of(plan: &Plan, schedule: &Schedule) -> Vec<Step> {
    let mut all: Vec<Step> = vec![];
    for one in schedule.commands.iter().filter_map(|c| step(plan, c)) {
        match all.last_mut() {
            Some(s) if (&s.name, &s.reads, &s.writes) == (&one.name, &one.reads, &one.writes) => {
                s.sizes.extend(one.sizes);
            }
            _ => all.push(one),
        }
    }
    all
}

fn barriers_of(plan: &Plan, schedule: &Schedule) -> usize {
    let pass = |kernel| plan.passes.iter().find(|p| p.kernel == kernel);
    barriers(&schedule.commands, |kernel| pass(kernel).map_or(&[], |p| (p.code)(plan).bindings))
}

/// A command with what it reads and writes; `None` for a stage.
fn step(plan: &Plan, command: &Command) -> Option<Step> {
    let step =
        |size: String, reads, writes| Step { name: command.name().into(), sizes: vec![size], reads, writes };
    Some(match command {
        Command::Dispatch { kernel, size, bind, .. } => {
            let pass = plan.passes.iter().find(|p| p.kernel == *kernel)?;
            let code: &KernelCode = (pass.code)(plan);
            let buffer = |block: Buffer| bind.buffer_of(block);
            // Every pass reads the constants of the scene.
            let bound =
                || code.bindings.iter().filter(|b| b.view != View::Uniform && b.block != buffer::SCENE);
            let used = |b: &Buffer| plan.bytes_of(*b) > BufferPlan::LEAST;
            let mut reads: Vec<_> =
                bound().filter(|b| b.reads).map(|b| buffer(b.block)).filter(used).collect();
            let size = match size {
                Size::Groups([x, 1, 1]) => format!("{x} groups"),
                Size::Groups([x, y, z]) => format!("{x} x {y} x {z} groups"),
                Size::Indirect(from, offset, _) => {
                    reads.push(*from);
                    format!("{from} {}", offset / 12)
                }
            };
            step(size, reads, bound().filter(|b| b.writes).map(|b| buffer(b.block)).filter(used).collect())
        }
        Command::Copy { from, to, bytes, .. } => step(amount(*bytes), vec![*from], vec![*to]),
        Command::Fill { buffer, bytes, .. } => step(amount(*bytes), vec![], vec![*buffer]),
        Command::Stage(_) => return None,
    })
}

/// Bytes as text in B, kB or MB.
fn amount(bytes: u64) -> String {
    match bytes {
        0..10_000 => format!("{bytes} B"),
        10_000..10_000_000 => format!("{} kB", bytes / 1000),
        _ => format!("{} MB", bytes / 1_000_000),
    }
}

impl Step {
    /// The sizes as one text: the first and the last of several.
    fn size(&self) -> String {
        match &self.sizes[..] {
            [one] => one.clone(),
            [first, .., last] if first == last => format!("{first}, {} times", self.sizes.len()),
            [first, .., last] => format!("{first} to {}", last.split(' ').next_back().unwrap_or(last)),
            [] => String::new(),
        }
    }
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            When::Start => f.write_str("before the first iteration"),
            When::Iterations(first, last) if first == last => write!(f, "iteration {first}"),
            When::Iterations(first, last) => write!(f, "iterations {first} to {last}"),
            When::After(times) if times.len() > 4 => {
                let (first, second, last) = (times[0], times[1], times[times.len() - 1]);
                write!(f, "after {first}, {second}, ..., {last} iterations ({} times)", times.len())
            }
            When::After(times) => {
                let times: Vec<_> = times.iter().map(|t| t.to_string()).collect();
                write!(f, "after {} iterations", times.join(", "))
            }
            When::End => f.write_str("after the last iteration"),
        }
    }
}

/// One line for each command.
impl fmt::Display for TimedSchedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TimedSchedule { of, when, lateral, pairs, barriers, steps } = self;
        writeln!(
            f,
            "{of}, {when} ({lateral} x {lateral}, {pairs} pairs): {} commands, {barriers} barriers",
            steps.iter().map(|s| s.sizes.len()).sum::<usize>()
        )?;
        let names = |all: &[Buffer]| all.iter().map(|b| b.to_string()).collect::<Vec<_>>().join(" ");
        let reads: Vec<_> = steps.iter().map(|s| names(&s.reads)).collect();
        let width = reads.iter().map(String::len).max().unwrap_or(0).min(76);
        for (step, reads) in steps.iter().zip(reads) {
            let line =
                format!("  {:<23} {:<18} {reads:<width$} -> {}", step.name, step.size(), names(&step.writes));
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}
