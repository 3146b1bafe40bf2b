//! The tables of docs/stability.md.

use std::time::Instant;

use thirdbounce::gpu::Gpu;
use thirdbounce::solve::Accumulation;
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Geometry, Reflectance};

use crate::stiffness::{condition, iterations_to};
use fixtures::device::vectors::run_iteration;
use fixtures::device::{accumulations, set_counts, write_samples};
use fixtures::extreme::{Case, Passes, cases, passes, passes_of, plain_kernels, solve};

/// Targets: error over the largest value, and over the largest value of each histogram.
pub const LARGEST: f64 = 1e-4;
const HISTOGRAM: f64 = 1e-3;

/// The larger of two sets of errors, one by one.
fn worse(a: Passes, b: Passes) -> Passes {
    let mut all = a;
    all.forward.largest = a.forward.largest.max(b.forward.largest);
    all.forward.histogram = a.forward.histogram.max(b.forward.histogram);
    all.gradient = a.gradient.max(b.gradient);
    all
}

fn held(p: &Passes) -> bool {
    p.forward.largest < LARGEST && p.forward.histogram < HISTOGRAM && p.gradient < LARGEST
}

fn figures(p: &Passes) -> String {
    format!("{:.0e} / {:.0e} / {:.0e}", p.forward.largest, p.forward.histogram, p.gradient)
}

/// Worst errors over the accumulation paths, with the scene's kernels and with those of ordinary scenes.
fn both(gpu: &Gpu, case: &Case) -> [Passes; 2] {
    let [mut now, mut before] = [Passes::default(); 2];
    for a in accumulations(gpu) {
        now = worse(now, passes(gpu, case, a));
        let mut job = case.job(gpu, a);
        if job.plan.scene.fine || job.plan.division.runs {
            plain_kernels(&mut job);
            before = worse(before, passes_of(&mut job, case));
        }
    }
    [now, before]
}

pub fn cases(gpu: &Gpu) -> String {
    let mut out = String::from(
        "## Cases\n\n\
         *Passes*: worst relative error over all accumulation paths. Forward, over the largest value / forward, over the \
         largest value of each histogram / gradient. *Ordinary kernels*: the same with the kernels of ordinary scenes, \
         if the scene has special ones. *Iterations*: error of vectors over the longest / of the objective over the first \
         one / of vectors shorter than a hundredth of the longest, over the longest of those.\n\n\
         | case | voxels | passes | ordinary kernels | on target | 10 iterations | 60 iterations |\n|---|--:|---|---|---|---|---|\n",
    );
    for case in cases::all() {
        let [now, before] = both(gpu, &case);
        let runs = [10, 60].map(|n| {
            let got = solve::on_device(gpu, &case, Accumulation::Owned, n);
            let want = solve::by_twin(&case, &got.points, n, false);
            let [v, objective] = solve::state_apart(&got, &want);
            format!("{v:.0e} / {objective:.0e} / {:.0e}", solve::dim_apart(&got, &want))
        });
        let before = if before == Passes::default() { "–".into() } else { figures(&before) };
        let row = [
            case.name.clone(),
            case.active.len().to_string(),
            figures(&now),
            before,
            if held(&now) { "yes" } else { "**no**" }.into(),
            runs[0].clone(),
            runs[1].clone(),
        ];
        println!("{}", row.join(" | "));
        out += &format!("| {} |\n", row.join(" | "));
    }
    out
}

pub fn crowded(gpu: &Gpu) -> String {
    let mut out = String::from(
        "| equal additions to a bin | passes | ordinary kernels | on target |\n|--:|---|---|---|\n",
    );
    for (lateral, deep) in [(16, 64), (32, 64), (64, 64), (100, 100)] {
        let [now, before] = both(gpu, &cases::crowded(lateral, deep));
        let before = if before == Passes::default() { "–".into() } else { figures(&before) };
        let row = [
            (lateral * lateral * deep).to_string(),
            figures(&now),
            before,
            if held(&now) { "yes" } else { "**no**" }.into(),
        ];
        println!("{}", row.join(" | "));
        out += &format!("| {} |\n", row.join(" | "));
    }
    out
}

/// Most iterations of a stiff scene.
const MOST: usize = 400;

pub fn stiff() -> String {
    let mut out = format!(
        "## Stiffness\n\nCondition (largest eigenvalue over the smallest above 1e-12 of it) of the weighted normal \
         operator AᵀWA on albedos, and of D^-½ AᵀWA D^-½, where D is the bound that a voxel's step divides by; then the \
         spread of D. Iterations of the twins until the albedos are within a tenth / a hundredth of the truth: with one \
         step for all voxels (1 / largest D), and with a step per voxel; – is more than {MOST}. The error is the root of \
         the mean squared relative error over voxels, so dim and far ones count.\n\n\
         | case | voxels | condition | scaled by D | spread of D | one step | a step per voxel |\n|---|--:|--:|--:|--:|---|---|\n"
    );
    let stiff = [
        cases::plain(),
        cases::near_far(Geometry::Confocal, Reflectance::Cosine, false),
        cases::near_far(Geometry::TwoPoints, Reflectance::Cosine, false),
        cases::near_far(Geometry::Confocal, Reflectance::Retroreflective, false),
        cases::retroreflector(1e3),
        cases::retroreflector(1e6),
        cases::wall_of(1e-3),
        cases::wall_of(100.0),
    ];
    let across = cases::all().into_iter().filter(|c| c.name.contains(":1 across"));
    for case in stiff.into_iter().chain(across) {
        let c = condition(&case);
        let steps = [true, false].map(|scalar| {
            iterations_to(&case, MOST, scalar).map(|n| n.map_or("–".into(), |n| n.to_string())).join(" / ")
        });
        let row = format!(
            "| {} | {} | {:.1e} | {:.1e} | {:.1e} | {} | {} |\n",
            case.name, c.voxels, c.plain, c.scaled, c.spread, steps[0], steps[1]
        );
        print!("{row}");
        out += &row;
    }
    out
}

pub fn long(gpu: &Gpu) -> String {
    let mut out = String::from(
        "## Long runs\n\nObjective of the vector solver on the device, over its value in the first iteration.\n\n\
         | case | 10 | 100 | 1,000 | 10,000 | restarts | not finite |\n|---|--:|--:|--:|--:|--:|--:|\n",
    );
    let count = 10_000;
    for case in [cases::plain(), cases::near_far(Geometry::Confocal, Reflectance::Cosine, false)] {
        let mut job = case.long_job(gpu, Accumulation::Auto, count);
        solve::begin(&mut job, &case);
        let rows = solve::run(&mut job, 0..count);
        let float = |i: usize, k: u32| f64::from(f32::from_bits(rows[i][k as usize]));
        let objective = |i: usize| float(i, TRACE_OBJECTIVE) + float(i, TRACE_L1);
        let at = [10, 100, 1000, 10_000].map(|n| format!("{:.6}", objective(n - 1) / objective(0)));
        let faults = rows.iter().filter(|r| r[TRACE_FAULTS as usize] != 0).count();
        let row = format!(
            "| {} | {} | {} | {faults} |\n",
            case.name,
            at.join(" | "),
            float(count - 1, TRACE_RESTARTS)
        );
        print!("{row}");
        out += &row;
    }
    out
}

/// Times of the passes with the scene's kernels over those of ordinary scenes: medians of paired runs.
pub fn cost(gpu: &Gpu) -> String {
    let mut out = String::from(
        "## Cost\n\nTime of a pass with the scene's special kernels, over its time with the kernels of ordinary \
         scenes; medians of 15 pairs of runs in turns, on this device.\n\n| scene | forward | gradient |\n|---|--:|--:|\n",
    );
    let crowded = cases::crowded(64, 64);
    for (what, case) in [("exact places", cases::dense_narrow()), ("sums by runs", crowded)] {
        let samples = case.samples(&case.at);
        let mut jobs = [false, true].map(|plain| {
            let mut job = case.job(gpu, Accumulation::Auto);
            assert!(job.plan.scene.fine || job.plan.division.runs);
            if plain {
                plain_kernels(&mut job);
            }
            write_samples(&mut job, &samples);
            set_counts(&mut job, samples.len(), 1.0);
            job
        });
        let ratio = ["forward", "step"].map(|kernel| {
            let mut ratios = vec![];
            for turn in 0..16 {
                let seconds = [0, 1].map(|k| {
                    let start = Instant::now();
                    run_iteration(&mut jobs[k], 0, &[kernel]);
                    start.elapsed().as_secs_f64()
                });
                // The first turn compiles.
                if turn > 0 {
                    ratios.push(seconds[0] / seconds[1]);
                }
            }
            ratios.sort_by(f64::total_cmp);
            ratios[ratios.len() / 2]
        });
        let row = format!("| {what}: {} | {:.2} | {:.2} |\n", case.name, ratio[0], ratio[1]);
        print!("{row}");
        out += &row;
    }
    out
}
