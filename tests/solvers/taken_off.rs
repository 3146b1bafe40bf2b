//! Captures whose background others took off: negative counts, and noise without the counts that it came with. Captures
//! whose pile-up is taken out.

use std::ops::ControlFlow;

use fixtures::captures::changed;
use fixtures::device::*;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Poisson};
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, Watch, background, variances};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::judge::preset_for;
use thirdbounce::maps::Truth;
use thirdbounce::measure::{Metrics, metrics};
use thirdbounce::methods::SolverOptions;
use thirdbounce::options::{Preset, SceneTraits};
use thirdbounce::transport::Grid;
use thirdbounce::{Settings, reconstruct};
use thirdbounce_simulate::{Dark, RenderOptions, Scene, simulate, truth};

const LATERAL: usize = 32;
const DARK: f64 = 6.0;

/// A figure as whole counts, the same with the dark counts taken off, and its truth.
fn captures() -> ([Capture; 2], Truth) {
    let scene = Scene {
        scan: 16,
        bin_width: 0.015,
        photons: Some(200.0),
        dark: Dark::Counts(DARK),
        ..Scene::named("figure").unwrap()
    };
    let counts = simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture;
    let taken_off = changed(&counts, |c| {
        c.histograms.iter_mut().for_each(|v| *v -= DARK as f32);
        c.integer_counts = false;
    });
    ([counts, taken_off], truth(&scene, LATERAL).unwrap())
}

fn solved(gpu: &Gpu, solver: &str, capture: &Capture, truth: &Truth) -> Metrics {
    solved_with(gpu, &options_of(solver, capture), capture, truth)
}

fn options_of(solver: &str, capture: &Capture) -> SolverOptions {
    let suit = SceneTraits { preset: preset_for(capture), ..SceneTraits::of(capture) };
    let mut options = SolverOptions::defaults_for(solver, &suit).unwrap();
    match &mut options {
        SolverOptions::Paper(o) => (o.iterations, o.domain.double_every) = (20, 10),
        SolverOptions::Surface(o) => (o.iterations, o.min_depth) = (40, 0.2),
        _ => {}
    }
    options.with_lateral(LATERAL).with_accumulation(Accumulation::Repeatable)
}

fn solved_with(gpu: &Gpu, options: &SolverOptions, capture: &Capture, truth: &Truth) -> Metrics {
    let done = reconstructed(gpu, options, capture);
    assert!(done.trace.iter().all(|p| p.loss.is_finite()));
    metrics(&done.maps, truth, 0.3).unwrap()
}

fn reconstructed(gpu: &Gpu, options: &SolverOptions, capture: &Capture) -> Reconstruction {
    let grid = Grid::new(options.default_volume(capture).unwrap(), LATERAL, capture.bin_width).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    options.solve(gpu, &Problem::new(capture, grid), &mut watch).unwrap()
}

/// Points of the wall that stand in different light: half of a picture is lost if all pairs have one background.
#[test]
fn every_pair_may_have_a_background_of_its_own() {
    let gpu = host();
    let ([even, uneven, scaled], truth) = backgrounds();
    let [even, uneven, scaled] = [even, uneven, scaled].map(|c| {
        let m = solved(&gpu, "surface", &c, &truth);
        (m.best_iou.unwrap(), m.at_best.unwrap().depth_mae.unwrap())
    });
    assert!(uneven.0 > even.0 - 0.08 && uneven.1 < 1.5 * even.1, "{even:?} {uneven:?}");
    assert!(scaled.0 < even.0 - 0.1, "{even:?} {scaled:?}: the test cannot fail");
    assert_valid(&gpu);
}

/// A finer scan has pairs between the measured ones.
#[test]
fn closed_forms_take_the_background_of_each_pair_off() {
    let gpu = host();
    let ([even, uneven, scaled], truth) = backgrounds();
    for (solver, upsample) in [("lct", 1), ("lct", 2), ("bp", 2)] {
        let iou = |capture: &Capture| {
            let mut options = SolverOptions::defaults_for(solver, &SceneTraits::of(capture)).unwrap();
            match &mut options {
                SolverOptions::Lct(o) => o.image.upsample = upsample,
                SolverOptions::Bp(o) => o.image.upsample = upsample,
                _ => unreachable!("{solver}"),
            }
            let done = reconstructed(&gpu, &options.with_lateral(LATERAL), capture);
            metrics(&done.maps, &truth, 0.3).unwrap().best_iou.unwrap()
        };
        let [even, uneven, scaled] = [&even, &uneven, &scaled].map(iou);
        println!("{solver} {upsample}: {even:.3} {uneven:.3} {scaled:.3}");
        assert!(uneven > even - 0.05, "{solver} {upsample}: {even} {uneven}");
        // A sum over all pairs makes backgrounds even by itself.
        let suffers = scaled < even - 0.08;
        assert!(suffers || solver == "bp", "{solver} {upsample}: {even} {scaled}: the test cannot fail");
    }
    assert_valid(&gpu);
}

/// The figure over 60 counts in every bin; over as many in the mean, different from pair to pair; and the same without that knowledge
/// that it is photons, so that one background is taken off.
fn backgrounds() -> ([Capture; 3], Truth) {
    let ([even, _], truth) = captures();
    let mut random = rand_pcg::Pcg64::seed_from_u64(8);
    let levels: Vec<f64> = (0..even.pair_count()).map(|_| random.random_range(1.0..120.0)).collect();
    // As much light in the mean, up to 120 counts in a bin.
    let with = |of_pair: &dyn Fn(usize) -> f64| {
        let mut random = random.clone();
        changed(&even, |c| {
            for (i, v) in c.histograms.iter_mut().enumerate() {
                *v += Poisson::new(of_pair(i / even.bins)).unwrap().sample(&mut random) as f32;
            }
        })
    };
    let [even, uneven] = [with(&|_| 60.0), with(&|pair| levels[pair])];
    assert!(even.background().range().is_none() && uneven.background().range().is_some());
    let scaled = changed(&uneven, |c| c.integer_counts = false);
    assert_eq!(scaled.background().range(), None);
    ([even, uneven, scaled], truth)
}

#[test]
#[ignore = "long: make soak"]
fn results_are_no_worse_than_with_the_background() {
    let gpu = host();
    let ([counts, taken_off], truth) = captures();
    assert!(taken_off.check().is_ok() && preset_for(&taken_off) == Preset::Captured);
    // The paper's solver has no background of its own: it explains dark counts by its noise term, and starts anew here.
    for (solver, most) in [("surface", 0.12), ("paper", 0.25)] {
        let [with, without] = [&counts, &taken_off].map(|c| {
            let mut options = options_of(solver, c);
            // As a run finds it for such counts.
            if let SolverOptions::Surface(o) = &mut options {
                (o.high_pass, o.high_pass_floor) = (Some(0.1), 0.3);
            }
            let m = solved_with(&gpu, &options, c, &truth);
            let best = m.at_best.unwrap();
            [m.best_iou.unwrap(), best.depth_mae.unwrap(), best.normal_error_deg.unwrap()]
        });
        assert!(with[0] > 0.6, "{solver}: {with:?}");
        let times = [0, 1, 2].map(|k| without[k] / with[k]);
        let no_worse = times[0] > 1.0 - most && times[1] < 1.0 + most && times[2] < 1.0 + most;
        assert!(no_worse, "{solver}: {with:?}, {without:?}");
    }
    assert_valid(&gpu);
}

#[test]
fn results_are_as_without_pile_up_where_the_laser_pulses_are_known() {
    let gpu = host();
    let scene = |pile_up| Scene {
        scan: 16,
        bin_width: 0.015,
        photons: Some(1000.0),
        dark: Dark::Counts(DARK),
        pile_up,
        ..Scene::named("figure").unwrap()
    };
    let [all, first] = [None, Some(0.5)].map(|pile_up| {
        simulate(&scene(pile_up), &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture
    });
    assert!(all.cycles.is_none() && first.cycles.is_some());
    let mut out = first.clone();
    assert!(out.take_pile_up_out().unwrap().is_some());
    assert!(out.integer_counts && preset_for(&out) == Preset::Captured);
    let total = |c: &Capture| c.histograms.iter().map(|v| f64::from(*v)).sum::<f64>();
    let [lost, kept] = [&first, &out].map(|c| total(c) / total(&all));
    assert!(lost < 0.95 && (kept - 1.0).abs() < 0.005, "{lost} {kept}");
    let truth = truth(&scene(None), LATERAL).unwrap();
    let [without, with] = [&all, &out].map(|c| {
        let m = solved(&gpu, "surface", c, &truth);
        let best = m.at_best.unwrap();
        [1.0 - m.best_iou.unwrap(), best.depth_mae.unwrap(), best.normal_error_deg.unwrap()]
    });
    assert!(without[0] < 0.3, "{without:?}");
    assert!((0..3).all(|k| with[k] < 1.1 * without[k]), "{without:?}, {with:?}");
    assert_valid(&gpu);
}

#[test]
fn the_noise_that_is_left_is_told_from_that_of_the_light() {
    let ([counts, taken_off], _) = captures();
    let [light, empty] = variances(&counts, background(&counts));
    assert!(light == 1.0 && (empty / DARK - 1.0).abs() < 0.1, "{empty}");
    assert!(background(&taken_off).abs() < 0.1 * DARK.sqrt());
    let [light, empty] = variances(&taken_off, background(&taken_off));
    assert!((empty / DARK - 1.0).abs() < 0.1, "{empty}");
    // The figure's edges count as noise, too.
    assert!((0.8..1.5).contains(&light), "{light}");
    // In other units than counts.
    let scaled = changed(&taken_off, |c| c.histograms.iter_mut().for_each(|v| *v *= 0.01));
    let [scaled_light, scaled_empty] = variances(&scaled, background(&scaled));
    assert!(
        (scaled_light / light / 0.01 - 1.0).abs() < 1e-3 && (scaled_empty / empty / 1e-4 - 1.0).abs() < 1e-3
    );
}

/// A cover glass: a third of the counts are in the same three bins of every pair.
#[test]
fn a_peak_that_all_pairs_share_is_subtracted_and_named() {
    let gpu = Gpu::open(&GpuOptions::default()).expect("a device");
    let scene = Scene { scan: 16, bin_width: 0.01, photons: Some(1000.0), ..Scene::named("figure").unwrap() };
    let proper = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let truth = truth(&scene, LATERAL).unwrap();
    let of = |capture: &Capture, calibrate: &str| {
        let texts = [("lateral", "32"), ("deterministic", "true"), ("calibrate", calibrate)];
        let settings = Settings::from_texts(texts).unwrap();
        let result = reconstruct(&gpu, capture, &settings).unwrap();
        let verdict = result.verdict.expect("a verdict");
        let is_told = verdict.reasons.iter().any(|reason| reason.contains("the same peak in every pair"));
        (metrics(&result.maps, &truth, None).unwrap().iou.expect("an IoU"), is_told)
    };
    let (iou, is_told) = of(&proper, "auto");
    assert!(!is_told, "a proper capture");
    let mut random = rand_pcg::Pcg64::seed_from_u64(4);
    let middle = (1.4 / proper.bin_width) as usize;
    let light = proper.histograms.iter().map(|v| f64::from(*v)).sum::<f64>() / proper.pair_count() as f64;
    let behind_glass = changed(&proper, |c| {
        for row in c.histograms.chunks_exact_mut(c.bins) {
            for (bin, counts) in [(middle - 1, 0.1 * light), (middle, 0.3 * light), (middle + 1, 0.1 * light)]
            {
                let more: f64 = Poisson::new(counts).unwrap().sample(&mut random);
                row[bin] += more as f32;
            }
        }
    });
    let (found, is_told) = of(&behind_glass, "auto");
    let (without, _) = of(&behind_glass, "none");
    assert!(is_told && found > iou - 0.1 && found > without + 0.2, "{found} of {iou}, {without}");
}
