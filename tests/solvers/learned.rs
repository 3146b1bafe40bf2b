//! The learned start: the network against PyTorch, and what solves make of it.

use fixtures::device::*;
use glam::dvec3;
use thirdbounce::Kind;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Solver, default_volume};
use thirdbounce::gpu::{Command, Place};
use thirdbounce::learned::schedule::LearnedSchedule;
use thirdbounce::learned::{LearnedStart, Network, logits, logits_on};
use thirdbounce::maps::Maps;
use thirdbounce::surface::{Begin, SurfaceOptions};
use thirdbounce::transport::{Grid, Reflectance};

/// Bands of a tilted plate and some haze, [band][x][y][z].
fn bands() -> Vec<f32> {
    (0..5 * 64 * 64 * 96i64)
        .map(|i| {
            let [z, y, x, b] =
                [i % 96, i / 96 % 64, i / (96 * 64) % 64, i / (96 * 64 * 64)].map(|v| v as f64);
            let off = z - (40.0 + 0.25 * x);
            let is_inside = (x - 32.0).abs() < 16.0 && (y - 30.0).abs() < 12.0;
            let plate = if is_inside { 6.0 / (1.0 + off * off) } else { 0.0 };
            let haze = ((i.wrapping_mul(2_654_435_761)) % 1000) as f64 / 5000.0 - 0.1;
            (plate * (1.0 - 0.3 * b) + haze) as f32
        })
        .collect()
}

/// Expected values are those of PyTorch 2.9 with the same weights in float32; `learn/export.py` prints them.
#[test]
fn the_network_has_the_logits_of_pytorch() {
    compare_with_pytorch(|of| logits(None, &bands(), of));
}

/// Every kernel is compared with its reference in `kernels`; this is all of them in their order.
#[test]
#[ignore = "kernels are slow on a CPU: make soak"]
fn the_kernels_have_the_logits_of_pytorch() {
    let gpu = gpu();
    compare_with_pytorch(|of| logits_on(&gpu, &bands(), of).expect("the kernels run"));
}

fn compare_with_pytorch(logits: impl Fn(usize) -> [Vec<f32>; 2]) {
    type Expected = (usize, [(usize, usize, f32); 6], [(usize, usize, usize, f32); 3], usize);
    let each: [Expected; 2] = [
        (
            0,
            [
                (0, 0, -8.2855),
                (5, 100, -10.8977),
                (64, 60, 3.1086),
                (90, 70, 5.1800),
                (100, 64, -9.6110),
                (127, 127, -9.6430),
            ],
            [(17, 19, 43, 7.4856), (40, 25, 49, 6.4618), (47, 41, 51, 3.0691)],
            2587,
        ),
        (
            2,
            [
                (0, 0, -7.9864),
                (5, 100, -10.6989),
                (64, 60, 2.7886),
                (90, 70, 4.6147),
                (100, 64, -8.7099),
                (127, 127, -9.4859),
            ],
            [(17, 19, 43, 6.1834), (40, 25, 50, 6.1329), (47, 41, 51, 2.3646)],
            2561,
        ),
    ];
    for (kind, mask_at, depth_at, surface) in &each {
        let [depth, mask] = logits(*kind);
        for (x, y, expected) in mask_at {
            let found = mask[128 * x + y];
            assert!((found - expected).abs() < 2e-3, "mask of {kind} at {x}, {y}: {found}, {expected}");
        }
        for (x, y, deepest, expected) in depth_at {
            let column = &depth[(64 * x + y) * 96..][..96];
            let top = (0..96).max_by(|a, b| column[*a].total_cmp(&column[*b])).unwrap();
            assert_eq!(top, *deepest, "depth of {kind} at {x}, {y}");
            assert!((column[top] - expected).abs() < 2e-3, "depth of {kind} at {x}, {y}: {}", column[top]);
        }
        let found = mask.iter().filter(|v| **v > 0.0).count();
        assert!(found.abs_diff(*surface) <= 2, "{found} pixels of surface, {surface}");
    }
}

/// A square plate that faces the wall, of points, in a confocal scan; all lengths times `unit`.
fn plate(points: usize, unit: f64, side: f64) -> Capture {
    plate_of(points, unit, side, |_| 1.0)
}

/// A plate whose albedo depends on x, from -1/2 to 1/2.
fn plate_of(points: usize, unit: f64, side: f64, albedo: impl Fn(f64) -> f64) -> Capture {
    let at = |i: usize, n: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * unit;
    let wall: Vec<_> =
        (0..points * points).map(|i| dvec3(at(i / points, points), at(i % points, points), 0.0)).collect();
    let (bins, width) = (320, 0.008 * unit);
    let mut counts = vec![0.0f32; bins * wall.len()];
    for (row, l) in counts.chunks_mut(bins).zip(&wall) {
        for i in 0..40 * 40 {
            let x = dvec3(side * at(i / 40, 40), side * at(i % 40, 40), 0.6 * unit);
            let r = l.distance(x);
            let bright = albedo(at(i / 40, 40) / unit);
            row[(2.0 * r / width) as usize] += (bright * x.z.powi(4) / r.powi(8) * unit.powi(4)) as f32;
        }
    }
    let mut capture = Capture::new([points, points], wall.clone(), wall, bins, width, counts);
    capture.name = "plate".into();
    capture
}

fn grid(capture: &Capture) -> Grid {
    Grid::new(default_volume(capture, 0.1).unwrap(), 64, capture.bin_width).unwrap()
}

#[test]
fn a_plate_is_seen_where_it_is_in_any_unit_of_length() {
    let of = |unit: f64| {
        let capture = plate(16, unit, 0.4);
        let seen = LearnedStart::on_host(&capture, None).unwrap().unwrap();
        (seen.expected_iou(), seen.maps(&grid(&capture), 0.5))
    };
    let (expected, maps) = of(1.0);
    let inside = |pixel: usize| {
        let [x, y] = maps.centre(pixel / maps.ny, pixel % maps.ny);
        x.abs().max(y.abs()) < 0.2
    };
    let (mut both, mut either) = (0, 0);
    for (pixel, is_surface) in maps.mask.iter().enumerate() {
        both += usize::from(*is_surface && inside(pixel));
        either += usize::from(*is_surface || inside(pixel));
        assert!(!is_surface || (maps.depth[pixel] - 0.6).abs() < 0.02, "{}", maps.depth[pixel]);
    }
    let iou = both as f64 / either as f64;
    assert!(iou > 0.75 && expected > 0.75, "IoU {iou}, expected {expected}");
    // A wall of 7.3 m looks the same.
    let (_, large) = of(7.3);
    assert_eq!(maps.mask, large.mask);
    for (a, b) in maps.depth.iter().zip(&large.depth).filter(|(a, _)| a.is_finite()) {
        assert!((7.3 * a - b).abs() < 1e-3 * b, "{a} {b}");
    }
}

#[test]
#[ignore = "half a minute on a CPU: make soak"]
fn kernels_see_what_the_host_sees() {
    let gpu = gpu();
    let width = 2.0;
    let capture = plate(15, width, 0.4);
    let host = LearnedStart::on_host(&capture, None).unwrap().unwrap();
    let device = LearnedStart::on_device(&gpu, &capture, None, None).unwrap().unwrap();
    assert_valid(&gpu);
    let all = Maps::empty([128; 2], grid(&capture).extent());
    let [a, b] = [&host, &device].map(|seen| seen.probabilities(&all));
    let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("probabilities differ by {off}");
    assert!(off < 2e-3, "probabilities differ by {off}");
    assert!(a.iter().filter(|p| **p > 0.5).count() > 1000, "a plate is seen");
    let [a, b] = [&host, &device].map(|seen| seen.maps(&grid(&capture), 0.1));
    let pairs = a.depth.iter().zip(&b.depth).filter(|(a, b)| a.is_finite() && b.is_finite());
    let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) * 64.0 / width as f32;
    println!("depths differ by {off} voxels");
    assert!(off < 1e-2, "depths differ by {off} voxels");
}

#[test]
fn kernels_need_little_memory_and_what_does_not_fit_is_an_error() {
    let made = LearnedSchedule::new(&Network::trained(), [64, 64, 96], Some([1024, 512]), 0);
    let on_device = made.buffers.iter().filter(|b| b.place == Place::Device);
    let bytes: u64 = on_device.map(|b| b.bytes).sum();
    let dispatches = made.commands.commands.iter().filter(|c| matches!(c, Command::Dispatch { .. })).count();
    println!("{bytes} bytes, {dispatches} dispatches");
    assert!(bytes < 64 << 20, "{bytes} bytes");
    // Upon this the host is asked.
    let error = LearnedStart::on_device(&gpu(), &plate(16, 1.0, 0.4), None, Some(1 << 20)).unwrap_err();
    assert_eq!(error.kind, Kind::Memory, "{error}");
}

/// A fit of one iteration, which begins with one albedo for all pixels, leaves light of the bright half and shows too much of the
/// dim one.
#[test]
fn light_that_a_fit_leaves_is_projected_onto_its_surface() {
    let gpu = gpu();
    let capture = plate_of(16, 1.0, 0.4, |x| if x > 0.0 { 2.0 } else { 1.0 });
    let options = SurfaceOptions::default().with(|o| {
        (o.lateral, o.iterations, o.grow) = (128, 1, false);
        (o.reflectance, o.begin) = (Reflectance::Cosine, Begin::Learned);
    });
    let solve = |lateral: usize| {
        let mut hear = |_: &thirdbounce::engine::Progress| std::ops::ControlFlow::Continue(());
        let mut watch = thirdbounce::engine::Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        let volume = default_volume(&capture, 0.1).unwrap();
        let grid = Grid::new(volume, lateral, capture.bin_width).unwrap();
        let options = options.clone().with(|o| o.lateral = lateral);
        options.solve(&gpu, &Problem::new(&capture, grid), &mut watch).unwrap()
    };
    // The network concludes on pixels as it was trained on alone.
    let other = solve(64);
    assert!(other.evidence.is_none() && other.maps.probability.is_none());
    let solved = solve(128);
    let known = solved.evidence.expect("layers");
    assert_eq!(known.channels.len(), 50);
    let (both, rules) = (solved.maps.probability.as_ref().expect("probabilities"), &known.mask);
    let off = both.iter().zip(rules).filter(|(p, rule)| (**p > 0.5) != **rule).count();
    assert!(
        rules.contains(&true) && off < rules.len() / 50,
        "{off} pixels of the network are not those of the rules"
    );
    assert!(known.channels.iter().all(|of| of.len() == 128 * 128 && of.iter().all(|v| v.abs() <= 8.0)));
    // The mean of a channel over the inner part of each half.
    let mean = |channel: usize, is_bright: bool| {
        let pixels = (0..128 * 128).filter(|p| {
            let [x, y] = solved.maps.centre(p / 128, p % 128);
            (x > 0.0) == is_bright && (0.05..0.15).contains(&x.abs()) && y.abs() < 0.15
        });
        let values: Vec<f32> = pixels.map(|p| known.channels[channel][p]).collect();
        values.iter().sum::<f32>() / values.len() as f32
    };
    let [bright, dim] = [true, false].map(|is_bright| mean(19, is_bright));
    assert!(bright > 1.0 && dim < 0.0, "left of the bright half {bright}, of the dim one {dim}");
    let [bright, dim] = [true, false].map(|is_bright| mean(18, is_bright));
    assert!(bright > dim && dim > 0.5, "measured of the bright half {bright}, of the dim one {dim}");
}

#[test]
fn the_network_is_not_asked_for_what_it_has_never_seen() {
    let gpu = gpu();
    let few = plate(6, 1.0, 0.4);
    assert!(LearnedStart::of(&gpu, &few, None, None).unwrap().is_none());
    let options = SurfaceOptions::default().with(|o| {
        (o.lateral, o.iterations, o.reflectance) = (16, 2, Reflectance::Cosine);
        o.begin = Begin::Learned;
    });
    let grid = Grid::new(default_volume(&few, 0.1).unwrap(), 16, few.bin_width).unwrap();
    let solve = |options: &SurfaceOptions| {
        let mut hear = |_: &thirdbounce::engine::Progress| std::ops::ControlFlow::Continue(());
        let mut watch = thirdbounce::engine::Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        options.solve(&gpu, &Problem::new(&few, grid), &mut watch)
    };
    let error = solve(&options).unwrap_err();
    assert!(error.kind == Kind::Input && error.what.contains("36 pairs"), "{error}");
    // Without an explicit request a closed form begins.
    let maps = solve(&options.with(|o| o.begin = Begin::Auto)).unwrap().maps;
    assert!(maps.mask.contains(&true));
}
