//! The table of cases.

use glam::dvec3;

use super::scenes::*;
use super::{CaseSizes, CaseSolver, Doubled, How, KernelCase, Paths};
use thirdbounce::capture::PulseTaps;
use thirdbounce::engine::Accumulation::{Fixed, Float, Owned};
use thirdbounce::methods::{Decay, NoiseTerm, PaperOptions};
use thirdbounce::transport::{Binning, Geometry, Gradient, Grid, HighPass, Model, Reflectance, Sampling};

/// A case of a solver, on one accumulation path.
fn case(name: &'static str, model: Model, grid: Grid, solver: CaseSolver) -> KernelCase {
    let (how, paths, sizes) = (How::Steps, Paths::Only(&[Owned]), CaseSizes::default());
    KernelCase { name, model, grid, solver, how, paths, sizes, allowed: 3e-5, checks_devices: false }
}

/// The paper's solver with its options of tests, or changed ones.
const fn with(change: fn(&mut PaperOptions)) -> CaseSolver {
    CaseSolver::Paper { change, rooms: &[None], doubled: Doubled::No, dark: false }
}

const SAME: fn(&mut PaperOptions) = |_| ();
const SURFACE: CaseSolver = CaseSolver::Surface { points: 4, spread: 1.25, long_steps: false };
const PROJECTION: CaseSolver = CaseSolver::Projection { sigma: 2.5, odd: false };
const ONLY_FIXED: Paths = Paths::Only(&[Owned, Fixed]);

/// Sizes of gathers: lanes that share a sample, more or less of them as samples fill the device.
const GATHERS: [[u32; 3]; 6] =
    [[32, 4, u32::MAX], [8, 8, u32::MAX], [1, 64, u32::MAX], [64, 2, u32::MAX], [8, 32, 2500], [8, 32, 1]];

/// All cases.
pub fn cases() -> Vec<KernelCase> {
    [paper(), surface(), instruments(), projection(), pairs(), whole(), slopes()].concat()
}

fn paper() -> Vec<KernelCase> {
    let base = model(5, 64, 3);
    let nearest = Model { binning: Binning::Nearest, ..base.clone() };
    let of = |name, change| case(name, base.clone(), grid(), with(change));
    let then = |name, change, rooms, doubled, dark| KernelCase {
        solver: CaseSolver::Paper { change, rooms, doubled, dark },
        ..of(name, change)
    };
    let exact: fn(&mut PaperOptions) = |o| (o.gradient, o.l1) = (Gradient::Exact, 5000.0);
    let noise: fn(&mut PaperOptions) = |o| o.noise.term = NoiseTerm::Bin;
    let rooms = &[Some(1.1), Some(0.5), Some(0.1), Some(0.01)];
    let mut all = vec![
        KernelCase { paths: Paths::All, checks_devices: true, ..of("paper", SAME) },
        KernelCase { paths: Paths::All, model: nearest.clone(), ..of("paper, nearest bins", SAME) },
        of("paper, voxel centres", |o| o.sampling = Sampling::Fixed),
        of("paper, falling rate", |o| (o.learning_rate_decay, o.iterations) = (Decay::Cosine, 9)),
        of("paper, exact gradient", exact),
        KernelCase { model: nearest, ..of("paper, exact gradient, nearest bins", exact) },
        KernelCase { paths: ONLY_FIXED, ..of("paper, noise of bins", noise) },
        KernelCase {
            paths: ONLY_FIXED,
            ..of("paper, noise of histograms", |o| o.noise.term = NoiseTerm::Histogram)
        },
        then("paper, rooms", SAME, rooms, Doubled::No, false),
        then("paper, dark", SAME, &[Some(1.0), Some(0.99)], Doubled::No, true),
        then("paper, half a rim", SAME, &[], Doubled::HalfRim, false),
        then("paper, doubled", SAME, &[], Doubled::All, false),
        then("paper, doubled after a reduction", noise, &[None], Doubled::All, false),
        then("paper, doubled in part", SAME, &[], Doubled::Brightest(0.25), false),
    ];
    let pulsed = Model { pulse: Some(tail()), ..base.clone() };
    all.push(KernelCase { model: pulsed, paths: ONLY_FIXED, ..of("paper, noise and pulse", noise) });
    all.extend([16, 64].map(|window| KernelCase {
        sizes: CaseSizes { window: Some(window), ..CaseSizes::default() },
        paths: Paths::Shared,
        ..of("paper, columns", SAME)
    }));
    all.extend(GATHERS.map(|gather| KernelCase {
        sizes: CaseSizes { gather: Some(gather), ..CaseSizes::default() },
        ..of("paper, sizes of gathers", SAME)
    }));
    all
}

fn surface() -> Vec<KernelCase> {
    let base = model(5, 64, 3);
    let product = variant(&base, Geometry::Product, Reflectance::Lambertian, true, 7);
    let of = |name, model: &Model| case(name, model.clone(), oblong(), SURFACE);
    let mut all = vec![];
    for (name, model) in [("surface", &base), ("surface, product", &product)] {
        all.push(KernelCase { paths: Paths::All, checks_devices: true, ..of(name, model) });
        all.extend([16, 28, 64].map(|window| KernelCase {
            sizes: CaseSizes { window: Some(window), ..CaseSizes::default() },
            paths: Paths::Shared,
            ..of(name, model)
        }));
        all.extend(GATHERS.map(|gather| KernelCase {
            sizes: CaseSizes {
                gather: Some(gather),
                polished: gather[2] == u32::MAX,
                ..CaseSizes::default()
            },
            ..of(name, model)
        }));
    }
    for (points, spread, long_steps) in [(1, 1.25, false), (4, 0.0, true), (4, 1.5, true), (1, 6.0, true)] {
        let solver = CaseSolver::Surface { points, spread, long_steps };
        for shared in [None, Some([0, 1])] {
            let sizes = CaseSizes { shared, ..CaseSizes::default() };
            all.push(KernelCase { solver, sizes, ..of("surface, steps", &base) });
        }
    }
    // Paths with enough bins for places in parts.
    all.extend([Geometry::Confocal, Geometry::TwoPoints, Geometry::Product].map(|geometry| {
        let long = variant(&model(5, 4096, 9), geometry, Reflectance::Cosine, false, 23);
        KernelCase { allowed: 1e-4, ..of("surface, long paths", &long) }
    }));
    all
}

/// What an instrument does to paths, and the high-pass.
fn instruments() -> Vec<KernelCase> {
    let base = model(5, 61, 3);
    let of = |name, model: Model| case(name, model, oblong(), SURFACE);
    let pulsed = |pulse| Model { pulse: Some(pulse), ..base.clone() };
    let mut all =
        vec![KernelCase { paths: Paths::All, checks_devices: true, ..of("surface, pulse", pulsed(tail())) }];
    // As long as a histogram, before the path, behind it, and one that changes nothing.
    let long = PulseTaps { before: 30, weights: (0..70).map(|i| f64::from(i % 7 + 1) / 280.0).collect() };
    let early = PulseTaps { before: 5, weights: vec![0.5, 0.3, 0.2, 0.0, 0.0, 0.0] };
    let late = PulseTaps { before: 0, weights: vec![0.0, 0.0, 0.0, 0.6, 0.4] };
    for pulse in [long, early, late, PulseTaps::identity()] {
        all.push(KernelCase { paths: ONLY_FIXED, ..of("surface, pulses", pulsed(pulse)) });
    }
    // On a lattice, at points that form none, at both sides.
    let spots = |model: &Model| spotted(model, spots_for(model.wall.geometry));
    let lattice = of("surface, spots", spots(&base));
    all.push(KernelCase { paths: Paths::All, checks_devices: true, ..lattice });
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        let model = variant(&base, geometry, Reflectance::Lambertian, geometry == Geometry::Product, 7);
        for pulse in [None, Some(tail())] {
            let model = spots(&Model { pulse, ..model.clone() });
            all.push(KernelCase { paths: ONLY_FIXED, ..of("surface, spots of pairs", model) });
        }
    }
    // Odd and even numbers of bins, lengths from less than a bin to more than a histogram.
    for (i, (side, bins, length, floor)) in
        [(5, 64, 0.08, 0.1), (5, 61, 0.4, 0.1), (3, 7, 0.05, 0.0), (5, 64, 1e-3, 0.3), (5, 64, 90.0, 0.1)]
            .into_iter()
            .enumerate()
    {
        let filtered = Model { high_pass: Some(HighPass { length, floor }), ..model(side, bins, 3) };
        let symmetric = PulseTaps { before: 1, weights: vec![0.25, 0.5, 0.25] };
        let product = variant(&filtered, Geometry::Product, Reflectance::Lambertian, true, 7);
        let spotted = spots(&filtered);
        let paths = if i == 0 { Paths::All } else { Paths::Only(&[Owned]) };
        // A row of an invocation, of a workgroup with lanes to spare, and of one with long runs.
        for model in [filtered, Model { pulse: Some(symmetric), ..product }, spotted] {
            for shared in [Some([0, 1]), Some([32, 8]), Some([4, 2])] {
                let sizes = CaseSizes { shared, ..CaseSizes::default() };
                let checks_devices = i == 0;
                all.push(KernelCase {
                    paths,
                    sizes,
                    checks_devices,
                    ..of("surface, high-pass", model.clone())
                });
            }
        }
    }
    all
}

fn projection() -> Vec<KernelCase> {
    let mut base = model(4, 50, 19);
    // A subtracted background leaves negative values.
    base.measured.iter_mut().for_each(|m| *m -= 2.0);
    let of = |sigma, odd| case("projection", base.clone(), grid(), CaseSolver::Projection { sigma, odd });
    let sizes = |gather| CaseSizes { gather: Some(gather), ..CaseSizes::default() };
    let mut all = vec![
        KernelCase { checks_devices: true, ..of(2.5, false) },
        KernelCase { checks_devices: true, ..case("learned", base.clone(), grid(), CaseSolver::Learned) },
        KernelCase { checks_devices: true, ..case("rounding", base.clone(), grid(), CaseSolver::Rounding) },
        of(0.2, false),
        of(40.0, false),
        of(2.5, true),
    ];
    all.extend(GATHERS.map(|gather| KernelCase { sizes: sizes(gather), ..of(2.5, false) }));
    all
}

/// Every kind of pairs, reflectance and wall, and more pairs than a dispatch walks.
fn pairs() -> Vec<KernelCase> {
    let mut all = vec![];
    let solvers =
        [("paper, pairs", with(SAME)), ("surface, pairs", SURFACE), ("projection, pairs", PROJECTION)];
    for (name, solver) in solvers {
        let (base, grid) = match solver {
            CaseSolver::Surface { .. } => (model(5, 64, 9), oblong()),
            _ => (model(5, 64, 9), grid()),
        };
        for (geometry, reflectance, curved) in variants() {
            let model = variant(&base, geometry, reflectance, curved, 20);
            let of = case(name, model, grid, solver);
            all.push(KernelCase {
                paths: if matches!(solver, CaseSolver::Surface { .. }) { ONLY_FIXED } else { of.paths },
                ..of
            });
        }
        for model in more_pairs_than_a_dispatch_takes() {
            // Sums of 1e5 values of both signs. The largest sum is a hundredth of the sum of magnitudes.
            all.push(KernelCase { allowed: 2e-4, ..case(name, model, coarse(), solver) });
        }
    }
    all
}

/// Twins and kernels, each by itself. Adam makes as large steps for small gradients as for large ones.
fn whole() -> Vec<KernelCase> {
    let of = |name, model, grid, solver| KernelCase {
        how: How::Whole,
        allowed: 2e-3,
        ..case(name, model, grid, solver)
    };
    let mut all =
        vec![KernelCase { paths: Paths::All, ..of("paper, whole", model(4, 60, 4), grid(), with(SAME)) }];
    for (geometry, reflectance, curved, paths, points) in [
        (Geometry::Confocal, Reflectance::Cosine, false, Paths::Only(&[Owned]), 4),
        (Geometry::TwoPoints, Reflectance::Lambertian, true, Paths::Only(&[Fixed]), 1),
        (Geometry::Product, Reflectance::Isotropic, false, Paths::Only(&[Float]), 4),
    ] {
        let model = variant(&model(5, 48, 9), geometry, reflectance, curved, 62);
        let solver = CaseSolver::Surface { points, spread: 1.25, long_steps: false };
        all.push(KernelCase { paths, ..of("surface, whole", model, oblong(), solver) });
    }
    all
}

fn slopes() -> Vec<KernelCase> {
    let few = Grid { n: [8, 8, 7], origin: dvec3(-0.4375, -0.4375, 0.3), pitch: dvec3(0.125, 0.125, 0.1) };
    let own = Grid {
        n: [6, 6, 17],
        origin: dvec3(-5.0 / 12.0, -1.0 / 3.0, 0.2),
        pitch: dvec3(1.0 / 6.0, 0.8 / 6.0, 0.05),
    };
    let of = |name, model, grid, solver| KernelCase {
        how: How::Slope,
        allowed: 1e-5,
        ..case(name, model, grid, solver)
    };
    let base = model(4, 48, 21);
    let mut all = vec![];
    let exact: fn(&mut PaperOptions) = |o| o.gradient = Gradient::Exact;
    let centres: fn(&mut PaperOptions) = |o| (o.gradient, o.sampling) = (Gradient::Exact, Sampling::Fixed);
    let noise: fn(&mut PaperOptions) = |o| {
        o.gradient = Gradient::Exact;
        (o.noise.term, o.noise.base, o.noise.span) = (NoiseTerm::Bin, 0.001, 0.002);
    };
    for change in [exact, centres] {
        for binning in [Binning::Linear, Binning::Nearest] {
            all.push(of("paper, slope", Model { binning, ..base.clone() }, few, with(change)));
        }
    }
    // Some bins are clamped.
    for pulse in [None, Some(tail())] {
        all.push(of("paper, slope with noise", Model { pulse, ..base.clone() }, few, with(noise)));
    }
    let paper = base;
    let base = model(4, 48, 51);
    for (i, (geometry, reflectance, curved)) in variants().into_iter().enumerate() {
        for pulse in [None, Some(tail())] {
            let model = Model { pulse, ..variant(&paper, geometry, reflectance, curved, 25) };
            all.push(of("paper, slope of pairs", model, few, with(exact)));
        }
        let pulse = (i % 2 == 0).then(tail);
        let high_pass = (i % 4 < 2).then_some(HighPass { length: [0.2, 0.6][i % 2], floor: 0.1 });
        let model = Model { pulse, high_pass, ..variant(&base, geometry, reflectance, curved, 60) };
        let model = if i % 3 == 0 { spotted(&model, spots_for(geometry)) } else { model };
        let solver = CaseSolver::Surface { points: [4, 1][i % 2], spread: 0.0, long_steps: false };
        all.push(KernelCase { allowed: 1e-6, ..of("surface, slope", model, own, solver) });
    }
    all
}
