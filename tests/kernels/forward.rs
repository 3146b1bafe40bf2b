//! The surface's rendering and weighted residual on every accumulation path against the float64 twins, on random input in
//! poisoned buffers.

use fixtures::device::surfaces::*;
use fixtures::device::*;
use thirdbounce::Kind;
use thirdbounce::capture::PulseTaps;
use thirdbounce::gpu::{Abilities, DeviceKind, Limits, Schedule};
use thirdbounce::solve::{Accumulation, Plan, Sizes, surface};
use thirdbounce::transport::kernels::{ARGUMENTS_FORWARD, buffer};
use thirdbounce::transport::twin::{self, Twin, Way};
use thirdbounce::transport::{Geometry, Grid, HighPass, Model, Reflectance};

/// What the instrument does, in both directions.
const INSTRUMENT: &[&str] = &["spot", "spot_more", "pulse", "pulse_back", "spot_back"];

/// Forward and residual of `model` from random samples on one accumulation path, through private columns of `window`
/// bins if that is not zero.
fn check_forward(model: &Model, grid: &Grid, accumulation: Accumulation, window: u32, texels: bool) {
    let gpu = gpu();
    let mut model = model.clone();
    let mut random = Random::new(6);
    let samples = away_from_edges(&Twin { model: &model, grid }, &samples(&model, grid, 0.5, 4));
    assert!(samples.len() > 500, "{}", samples.len());
    let accumulated = twin::forward(&Twin { model: &model, grid }, &samples);
    assert!(accumulated.iter().any(|v| *v != 0.0));
    // The measurement is close to the rendering.
    let render = f64::from(model.scene(grid).render_scale);
    let sharp = Twin { model: &model, grid };
    let shown = twin::pulse(&sharp, &twin::spot(&sharp, &accumulated, Way::Spread), Way::Spread);
    model.measured = shown.iter().map(|a| (a * render * random.uniform(0.5, 1.5)) as f32).collect();
    let twin = Twin { model: &model, grid };
    let (want, loss) = twin::residual_weighted(&twin, &accumulated);
    let peak = samples.iter().fold(0.0, |a, s| s.albedo.max(a));
    let o = Fit::of(grid, 1).with(|o| o.accumulation = accumulation);
    let mut job = job_tuned(&gpu, &model, grid, &o, |t| {
        (t.window, t.window_span) = (window, u32::MAX);
        t.texels &= texels;
        // Below the loop limit even if every voxel moves the window, and still several chunks.
        t.chunk = if window > 0 { 192 } else { t.chunk };
        // As on a GPU with columns: chunks become shorter where the device has room, and workgroups sum their losses.
        (t.forward_fill, t.group_losses) = (if window > 0 { u32::MAX } else { 0 }, window == 64);
    });
    write_samples(&mut job, &samples);
    set_counts(&mut job, samples.len(), peak);
    zero_histograms(&mut job);
    if window > 0 {
        let arguments: Vec<[u32; 3]> = read(&mut job, buffer::ARGUMENTS, ARGUMENTS_FORWARD as usize + 1);
        assert_eq!(arguments[ARGUMENTS_FORWARD as usize][1], samples.len().div_ceil(96) as u32, "halved");
    }
    let s = Schedule::of(|s| surface::iteration(s, &job.plan, job.plan.finest(), 1, [0, 0, 1]));
    run(&mut job, s, &[&["forward", "residual", "residual_rows"], INSTRUMENT].concat());
    let residual = job.plan.residual();
    let what = format!(
        "{:?} {:?} curved {} pulse {} spots {} high-pass {:?} {accumulation:?} window {window} texels {texels}",
        model.wall.geometry,
        model.reflectance,
        model.wall.normals.is_some(),
        model.pulse.is_some(),
        model.rendered.is_some(),
        model.high_pass
    );
    let spots = model.rendered.is_some();
    assert_eq!(residual == buffer::SPREAD, model.pulse.is_some() && !spots);
    assert_eq!(residual == buffer::RESIDUAL, model.pulse.is_none() && !spots);
    assert!(read_padding(&mut job, residual).iter().all(|w| *w == 0), "{what}");
    let got: Vec<f64> = read_rows::<f32>(&mut job, residual).into_iter().map(f64::from).collect();
    let e = error(got, want.iter().copied());
    assert!(e < 3e-5, "{what}: {e}");
    let partials = match model.high_pass {
        Some(_) => model.pairs(),
        None if window == 64 => grouped_losses(&model),
        None => losses(&model),
    };
    let partials: Vec<[f32; 2]> = read(&mut job, buffer::LOSS_PARTIALS, partials);
    for k in 0..2 {
        let sum: f64 = partials.iter().map(|p| f64::from(p[k])).sum();
        assert!((sum / model.measured.len() as f64 / loss[k] - 1.0).abs() < 1e-4, "{what}: {k}");
    }
    let bytes = job.plan.bytes_of(buffer::HISTOGRAMS) as usize;
    if spots {
        // A fill of the schedule clears them, which stands between the passes above.
        return assert_valid(&gpu);
    }
    assert!(read::<u8>(&mut job, buffer::HISTOGRAMS, bytes).iter().all(|b| *b == 0));
    assert_valid(&gpu);
}

#[test]
pub fn forward_and_weighted_residual_on_every_accumulation_path() {
    let (base, grid) = (scene(5, 64, 3), grid());
    let product = variant(&base, Geometry::Product, Reflectance::Lambertian, true, 7);
    for model in [&base, &product] {
        for accumulation in accumulations(&gpu()) {
            check_forward(model, &grid, accumulation, 0, true);
            if accumulation == Accumulation::Owned {
                check_forward(model, &grid, accumulation, 0, false);
            } else {
                check_forward(model, &grid, accumulation, 16, true);
                check_forward(model, &grid, accumulation, 64, true);
            }
        }
    }
}

/// A high-pass on every accumulation path: odd and even numbers of bins, with and without a pulse, through spots, lengths
/// from less than a bin to more than a histogram.
#[test]
pub fn forward_and_high_pass_residual_on_every_accumulation_path() {
    let grid = grid();
    let lengths =
        [(5, 64, 0.08, 0.1), (5, 61, 0.4, 0.1), (3, 7, 0.05, 0.0), (5, 64, 1e-3, 0.3), (5, 64, 90.0, 0.1)];
    for (i, (side, bins, length, floor)) in lengths.into_iter().enumerate() {
        let base = scene(side, bins, 3);
        let filtered = Model { high_pass: Some(HighPass { length, floor }), ..base };
        let pulsed = Model {
            pulse: Some(PulseTaps { before: 1, weights: vec![0.25, 0.5, 0.25] }),
            ..variant(&filtered, Geometry::Product, Reflectance::Lambertian, true, 7)
        };
        let of_first = |a: &Accumulation| i == 0 || *a == Accumulation::Owned;
        for accumulation in accumulations(&gpu()).into_iter().filter(of_first) {
            for model in [&filtered, &pulsed] {
                check_forward(model, &grid, accumulation, 0, true);
            }
        }
    }
}

/// A card that has no more than Vulkan promises gets narrower columns where a product's arms lie beside them.
#[test]
fn columns_fit_into_the_shared_memory_that_every_device_has() {
    let (base, grid) = (scene(5, 64, 3), grid());
    let product = variant(&base, Geometry::Product, Reflectance::Lambertian, true, 7);
    let mut card = Abilities { kind: DeviceKind::Discrete, ..gpu().abilities() };
    card.limits = Limits { shared_memory: 16_384, workgroup_invocations: 128, ..card.limits };
    let tuning = |model: &Model, sizes: &str, card: &Abilities| {
        let sizes = if sizes.is_empty() { Sizes::default() } else { sizes.parse().expect("sizes") };
        let o = Fit::of(&grid, 1).with(|o| (o.accumulation, o.sizes) = (Accumulation::Cas, sizes));
        Plan::new(model, grid, [5, 5], &o, card, false).map(|plan| plan.division.tuning)
    };
    let window = |model, sizes| tuning(model, sizes, &card).expect("it fits").window;
    assert_eq!([window(&base, ""), window(&base, "lanes=128")], [64, 32]);
    assert_eq!([window(&product, ""), window(&product, "lanes=32")], [28, 32]);
    for (model, sizes) in [(&base, "window=65"), (&product, "window=29"), (&base, "lanes=129")] {
        let error = tuning(model, sizes, &card).expect_err("asked for more than there is");
        assert!(error.what.contains(sizes) && error.kind == Kind::Options, "{error}");
    }
    // Gathers have as many lanes as the device allows.
    let fitted = tuning(&base, "", &card).expect("it fits");
    assert_eq!(fitted.voxels * fitted.slices, 128);
    // What has more keeps the usual columns; what has hardly any adds straight to the histograms.
    for (shared_memory, want) in [(18 << 10, 32), (3 << 10, 0)] {
        let other = Abilities { limits: Limits { shared_memory, ..card.limits }, ..card };
        assert_eq!(tuning(&product, "", &other).expect("it fits").window, want);
    }
    for accumulation in [Accumulation::Fixed32, Accumulation::Cas] {
        check_forward(&product, &grid, accumulation, window(&product, ""), true);
    }
}

/// Pulses on every accumulation path: with a tail, before or behind the path, as long as the histogram, and one that
/// changes nothing.
#[test]
pub fn forward_and_weighted_residual_through_a_pulse() {
    let (base, grid) = (scene(5, 61, 3), grid());
    let long = PulseTaps { before: 30, weights: (0..70).map(|i| f64::from(i % 7 + 1) / 280.0).collect() };
    let early = PulseTaps { before: 5, weights: vec![0.5, 0.3, 0.2, 0.0, 0.0, 0.0] };
    let late = PulseTaps { before: 0, weights: vec![0.0, 0.0, 0.0, 0.6, 0.4] };
    for accumulation in accumulations(&gpu()) {
        let model = Model { pulse: Some(tail()), ..base.clone() };
        check_forward(&model, &grid, accumulation, 0, true);
    }
    for pulse in [long, early, late, PulseTaps::identity()] {
        let model = Model { pulse: Some(pulse), ..base.clone() };
        check_forward(&model, &grid, Accumulation::Owned, 0, true);
        check_forward(&model, &grid, Accumulation::Fixed, 0, true);
    }
}

#[test]
fn forward_and_weighted_residual_of_every_model_pair_and_wall() {
    let (base, grid) = (scene(5, 64, 3), grid());
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&base, geometry, reflectance, curved, 7);
        for accumulation in [Accumulation::Owned, Accumulation::Fixed] {
            check_forward(&model, &grid, accumulation, 0, true);
        }
    }
}

/// Spots on every accumulation path and for every kind of pairs, with and without a pulse: on a lattice, which is summed
/// along x, then along y; at points that form none; in a product, at both sides.
#[test]
pub fn forward_and_weighted_residual_through_spots() {
    let (base, grid) = (scene(5, 61, 3), grid());
    for accumulation in accumulations(&gpu()) {
        for pulse in [None, Some(tail())] {
            let model = Model { pulse, ..spotted(&base, [0.1, 0.0]) };
            assert_eq!(model.rendered.as_ref().unwrap().stages.len(), 2);
            check_forward(&model, &grid, accumulation, 0, true);
        }
    }
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        let sharp = variant(&scene(3, 64, 3), geometry, Reflectance::Lambertian, true, 7);
        let model = spotted(&sharp, spots_for(geometry));
        for accumulation in [Accumulation::Owned, Accumulation::Fixed] {
            check_forward(&model, &grid, accumulation, 0, true);
        }
    }
}
