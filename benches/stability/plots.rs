//! The plots of docs/stability.md.

use std::path::Path;

use rand::SeedableRng;
use rand_distr::{Distribution, Poisson};
use thirdbounce::export::plot::Plot;
use thirdbounce::export::png;
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::{Accumulation, paper};
use thirdbounce::transport::twin;
use thirdbounce::transport::{Binning, Geometry, Reflectance};

use crate::tables::LARGEST;
use fixtures::device::{options, set_counts, write_samples, zero_histograms};
use fixtures::extreme::{Case, cases, passes, passes_of, plain_kernels, read_histograms, solve};

type Curve = (String, Vec<[f64; 2]>);

fn plot(folder: &Path, name: &str, title: &str, [x, y]: [&str; 2], curves: Vec<Curve>) -> String {
    let mark = Some((format!("target {LARGEST:.0e}"), LARGEST));
    for (what, points) in &curves {
        println!("{name}, {what}: {points:?}");
    }
    let plot =
        Plot { title: title.into(), x: x.into(), y: y.into(), logarithmic: [true, true], curves, mark };
    png::write(&folder.join(format!("{name}.png")), &plot.figure().picture()).expect("a plot is written");
    format!("![{title}](stability/{name}.png)\n")
}

pub fn all(gpu: &Gpu, folder: &Path) -> String {
    let parts =
        [dynamic_range(gpu, folder), photons(gpu, folder), bin_width(gpu, folder), iterations(gpu, folder)];
    format!("## Plots\n\n{}", parts.join("\n"))
}

fn dynamic_range(gpu: &Gpu, folder: &Path) -> String {
    let mut curves: Vec<Curve> =
        ["forward, worst histogram", "gradient", "10 iterations, vectors", "10 iterations, dim vectors"]
            .map(|n| (n.into(), vec![]))
            .into();
    for power in 0..=8 {
        let case = cases::retroreflector(10f64.powi(power));
        let p = passes(gpu, &case, Accumulation::Auto);
        let got = solve::on_device(gpu, &case, Accumulation::Auto, 10);
        let want = solve::by_twin(&case, &got.points, 10, false);
        let errors = [
            p.forward.histogram,
            p.gradient,
            solve::state_apart(&got, &want)[0],
            solve::dim_apart(&got, &want),
        ];
        curves.iter_mut().zip(errors).for_each(|(c, e)| c.1.push([10f64.powi(power), e]));
    }
    let axes = ["brightest over other surfaces", "relative error against float64"];
    plot(folder, "dynamic-range", "Error against dynamic range", axes, curves)
}

/// The case with photon counts for histograms, with a mean of `peak` in the brightest bin.
fn counted(case: &Case, peak: f64) -> Case {
    let mut case = case.clone();
    let mut random = rand_pcg::Pcg64::seed_from_u64(1);
    for v in &mut case.model.measured {
        let mean = f64::from(*v) * peak / 10.0;
        let drawn = if mean > 0.0 { Poisson::new(mean).expect("a mean").sample(&mut random) } else { 0.0 };
        *v = (drawn * 10.0 / peak) as f32;
    }
    case.model.variance = [10.0 / peak, 0.0];
    case
}

fn photons(gpu: &Gpu, folder: &Path) -> String {
    let mut curves: Vec<Curve> =
        ["10 iterations, vectors", "60 iterations, vectors", "60 iterations, objective"]
            .map(|n| (n.into(), vec![]))
            .into();
    for peak in [0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5] {
        let case = counted(&cases::plain(), peak);
        let apart = [10, 60].map(|n| {
            let got = solve::on_device(gpu, &case, Accumulation::Auto, n);
            solve::state_apart(&got, &solve::by_twin(&case, &got.points, n, false))
        });
        let errors = [apart[0][0], apart[1][0], apart[1][1]];
        curves.iter_mut().zip(errors).for_each(|(c, e)| c.1.push([peak, e]));
    }
    let axes = ["photons in the brightest bin", "relative error against float64"];
    plot(folder, "photons", "Error against photon count", axes, curves)
}

/// The share of all light that is in another bin than in the twin, with nearest binning.
fn misplaced(gpu: &Gpu, case: &Case, plain: bool) -> f64 {
    let mut case = case.clone();
    case.model.binning = Binning::Nearest;
    let samples = case.samples(&case.at);
    let want = twin::forward(&case.twin(), &samples);
    let mut job = fixtures::device::job(gpu, &case.model, &case.grid, &options(&case.model, &case.grid));
    if plain {
        plain_kernels(&mut job);
    }
    write_samples(&mut job, &samples);
    set_counts(&mut job, samples.len(), 1.0);
    zero_histograms(&mut job);
    let mut s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
    s.commands.retain(|c| c.name() == "forward");
    job.executor.run(&s).expect("a pass runs");
    let got = read_histograms(&mut job);
    let off: f64 = got.iter().zip(&want).map(|(g, w)| (g - w).abs()).sum();
    0.5 * off / want.iter().sum::<f64>()
}

fn bin_width(gpu: &Gpu, folder: &Path) -> String {
    let names = [
        "linear split: forward, before",
        "linear split: forward",
        "linear split: gradient, before",
        "linear split: gradient",
        "rounding: share of light in another bin, before",
        "rounding: share of light in another bin",
    ];
    let mut curves: Vec<Curve> = names.map(|n| (n.into(), vec![])).into();
    for bins in [300.0, 600.0, 1e3, 3e3, 1e4, 3e4, 1e5] {
        let case = cases::narrow(bins);
        let now = passes(gpu, &case, Accumulation::Auto);
        let mut job = case.job(gpu, Accumulation::Auto);
        plain_kernels(&mut job);
        let before = passes_of(&mut job, &case);
        let errors = [
            before.forward.largest,
            now.forward.largest,
            before.gradient,
            now.gradient,
            misplaced(gpu, &case, true),
            misplaced(gpu, &case, false),
        ];
        curves.iter_mut().zip(errors).for_each(|(c, e)| c.1.push([bins, e]));
    }
    let axes = ["bins of the longest path", "relative error against float64"];
    plot(folder, "bin-width", "Error against bin width", axes, curves)
}

fn iterations(gpu: &Gpu, folder: &Path) -> String {
    let mut curves: Vec<Curve> = vec![];
    for case in [cases::plain(), cases::near_far(Geometry::Confocal, Reflectance::Cosine, false)] {
        let [mut vectors, mut objectives] = [vec![], vec![]];
        for n in [1usize, 2, 5, 10, 20, 50, 100, 200] {
            let got = solve::on_device(gpu, &case, Accumulation::Auto, n);
            let [v, objective] = solve::state_apart(&got, &solve::by_twin(&case, &got.points, n, false));
            vectors.push([n as f64, v]);
            objectives.push([n as f64, objective]);
        }
        curves.push((format!("{}: vectors", case.name), vectors));
        curves.push((format!("{}: objective", case.name), objectives));
    }
    let axes = ["iterations", "relative error against float64"];
    plot(folder, "iterations", "Error against iterations", axes, curves)
}
