//! Closed-form methods against known physics: points come back at their places, and scans that break an assumption are
//! refused.

use std::ops::ControlFlow;

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Reconstruction, Sharpness, Watch};
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Maps;
use thirdbounce::methods::{Method, SolverOptions};
use thirdbounce::options::{Preset, SceneTraits};
use thirdbounce::transport::{Grid, Volume};
use thirdbounce_simulate::{Dark, photon_noise};

/// Points of the scan along x and y, and the wall's side.
const SCAN: usize = 24;
const WALL: f64 = 1.0;
const BINS: usize = 230;
const BIN: f64 = 0.01;
/// Bins begin late.
const START: f64 = 0.403;

const ALL: [&str; 7] = ["lct", "dlct", "fk", "phasor", "phasor-bp", "fbp", "bp"];
const ANY_PAIRS: [&str; 3] = ["phasor-bp", "fbp", "bp"];

/// A wall that is not about the origin.
fn wall() -> Vec<DVec3> {
    let at = |i: usize| (i as f64 + 0.5) / SCAN as f64 * WALL - 0.42;
    (0..SCAN * SCAN).map(|i| dvec3(at(i / SCAN), at(i % SCAN), 0.02)).collect()
}

/// Light of small targets: each path is shared by the two bins whose centres bracket it.
fn light(laser: Vec<DVec3>, sensor: Vec<DVec3>, targets: &[DVec3]) -> Capture {
    let mut counts = vec![0.0f32; sensor.len() * BINS];
    for (row, (l, s)) in counts.chunks_mut(BINS).zip(laser.iter().zip(&sensor)) {
        for target in targets {
            let arms = [l.distance(*target), s.distance(*target)];
            let at = (arms[0] + arms[1] - START) / BIN - 0.5;
            let (low, share) = (at as usize, at.fract());
            let value = 1.0 / (arms[0] * arms[1]).powi(2);
            row[low] += (value * (1.0 - share)) as f32;
            row[low + 1] += (value * share) as f32;
        }
    }
    let mut capture = Capture::new([SCAN, SCAN], laser, sensor, BINS, BIN, counts);
    capture.t_start = START;
    capture.check().unwrap();
    capture
}

fn options(name: &str, lateral: usize, capture: &Capture) -> SolverOptions {
    SolverOptions::defaults_for(name, &SceneTraits::of(capture)).unwrap().with_lateral(lateral)
}

fn maps(gpu: &Gpu, name: &str, capture: &Capture, volume: Volume, lateral: usize) -> Maps {
    solved(gpu, name, capture, volume, lateral).maps
}

fn solved(gpu: &Gpu, name: &str, capture: &Capture, volume: Volume, lateral: usize) -> Reconstruction {
    let grid = Grid::new(volume, lateral, BIN / 2.0).unwrap();
    solved_with(gpu, &options(name, lateral, capture), capture, grid)
}

fn solved_with(gpu: &Gpu, options: &SolverOptions, capture: &Capture, grid: Grid) -> Reconstruction {
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    options.solve(gpu, &Problem::new(capture, grid), &mut watch).unwrap()
}

/// Where the light of the maps is: the centroid of what is above half of the brightest pixel.
fn place(maps: &Maps) -> DVec3 {
    let half = 0.5 * maps.albedo.iter().copied().fold(0.0, f32::max);
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for (i, albedo) in maps.albedo.iter().enumerate().filter(|(_, albedo)| **albedo > half) {
        let [x, y] = maps.centre(i / maps.ny, i % maps.ny);
        let above = f64::from(albedo - half);
        sum += above * dvec3(x, y, f64::from(maps.depth[i]));
        weight += above;
    }
    sum / weight
}

#[test]
fn points_come_back_at_their_places() {
    let gpu = host();
    // A third of the distance of scan points, and of half a bin.
    let [across, along] = [WALL / SCAN as f64 / 3.0, BIN / 2.0 / 3.0];
    let mut off = vec![];
    for target in [dvec3(0.1131, -0.0723, 0.557), dvec3(-0.2214, 0.3017, 0.8132), dvec3(0.08, 0.08, 0.4308)] {
        let near = dvec3(0.18, 0.18, 0.12);
        let volume = Volume { min: target - near, max: target + near };
        let one_laser = vec![dvec3(0.31, -0.11, 0.02); SCAN * SCAN];
        let confocal = ALL.iter().map(|name| (*name, light(wall(), wall(), &[target]), 1.0));
        // One laser point: half of the aperture, and half of the precision.
        let more = ["phasor"].iter().chain(&ANY_PAIRS);
        let more = more.map(|name| (*name, light(one_laser.clone(), wall(), &[target]), 2.0));
        for (name, capture, times) in confocal.chain(more) {
            let found = place(&maps(&gpu, name, &capture, volume, 45)) - target;
            // A virtual wave is as deep as it is long, a back-projection as the scan is coarse.
            let deep = match name {
                "lct" | "fk" => along,
                _ => 3.0 * along,
            };
            println!(
                "{name} {times} {target}: {:.2} {:.2} {:.2} mm",
                1e3 * found.x,
                1e3 * found.y,
                1e3 * found.z
            );
            if !(found.x.abs().max(found.y.abs()) < times * across && found.z.abs() < times * deep) {
                off.push(format!("{name}, {times}, {target}: {found}"));
            }
        }
    }
    assert!(off.is_empty(), "{off:#?}");
    assert_valid(&gpu);
}

#[test]
fn places_without_a_pair_are_filled() {
    let gpu = host();
    let target = dvec3(0.1131, -0.0723, 0.557);
    let near = dvec3(0.18, 0.18, 0.12);
    let volume = Volume { min: target - near, max: target + near };
    let whole = light(wall(), wall(), &[target]);
    let holes = whole.subset(SCAN * SCAN - 20, 3).unwrap();
    for name in ["lct", "dlct", "fk", "phasor"] {
        let [(at, filled), (at_of_holes, filled_of_holes)] = [&whole, &holes].map(|capture| {
            let done = solved(&gpu, name, capture, volume, 45);
            (place(&done.maps), done.filled)
        });
        assert_eq!([filled, filled_of_holes], [0, 20], "{name}");
        let off = at_of_holes.distance(at);
        assert!(off < 0.1 * WALL / SCAN as f64, "{name}: {:.2} mm", 1e3 * off);
    }
    assert_valid(&gpu);
}

#[test]
#[ignore = "long: make soak"]
fn images_are_as_sharp_as_noise_lets_them_be() {
    let gpu = host();
    // A plate over a background, and what its light makes of a picture: [shares of the mask that are plate, of the plate
    // that are mask].
    let (middle, half) = (dvec3(0.08, 0.06, 0.6), 0.15);
    let at = |i: usize| (i as f64 / 15.0 - 1.0) * half;
    let targets: Vec<DVec3> = (0..31 * 31).map(|i| middle + dvec3(at(i / 31), at(i % 31), 0.0)).collect();
    let exact = light(wall(), wall(), &targets);
    let volume = Volume { min: middle - dvec3(0.48, 0.48, 0.3), max: middle + dvec3(0.48, 0.48, 0.4) };
    let right = |maps: &Maps| {
        let is_plate = |i: usize| {
            let [x, y] = maps.centre(i / maps.ny, i % maps.ny);
            (x - middle.x).abs() < half && (y - middle.y).abs() < half
        };
        let near = |i: &usize| (f64::from(maps.depth[*i]) - middle.z).abs() < 0.05;
        let found: Vec<usize> = (0..maps.mask.len()).filter(|i| maps.mask[*i]).collect();
        let hits = found.iter().filter(|i| near(i) && is_plate(**i)).count() as f64;
        let all = (0..maps.mask.len()).filter(|i| is_plate(*i)).count() as f64;
        [hits / found.len() as f64, hits / all]
    };
    let solve = |name: &str, capture: &Capture, chosen: Option<Sharpness>| {
        let grid = Grid::new(volume, 48, BIN).unwrap();
        let suit = SceneTraits { preset: Preset::Captured, ..SceneTraits::of(capture) };
        let mut method = Method::named(name).unwrap();
        method.set_text("lateral", "48").unwrap();
        if let Some(chosen) = chosen {
            method.set_text(chosen.setting, &chosen.value.to_string()).unwrap();
        }
        let options = method.options(&suit);
        solved_with(&gpu, &options, capture, grid)
    };
    let bright = photon_noise(&exact, 2000.0, Dark::Counts(0.0), None, 1).unwrap();
    // Photons of the strongest bin, over dark counts.
    for (name, photons, counts) in [
        ("lct", 120.0, 40.0),
        ("dlct", 120.0, 40.0),
        ("phasor", 4.0, 1.0),
        ("phasor-bp", 40.0, 2.0),
        ("fbp", 40.0, 10.0),
    ] {
        let dark = photon_noise(&exact, photons, Dark::Counts(counts), None, 1).unwrap();
        // Values that are no photon counts have no noise that is known.
        let of_exact = solve(name, &exact, None).sharpness.unwrap();
        assert_eq!((of_exact.value, of_exact.noise), (of_exact.sharpest, None), "{name}");
        let of_bright = solve(name, &bright, None).sharpness.unwrap();
        assert_eq!(of_bright.value, of_bright.sharpest, "{name}: {of_bright:?}");

        let done = solve(name, &dark, None);
        let chosen = done.sharpness.unwrap();
        let sharpest = solve(name, &dark, Some(of_bright));
        let [soft, sharp] = [&done.maps, &sharpest.maps].map(right);
        assert!(soft[0] > 0.6 && soft[1] > 0.6, "{name}: {chosen:?}, {soft:?}");
        assert!(sharpest.sharpness.is_none() && chosen.value != chosen.sharpest, "{name}: {chosen:?}");
        assert!(soft[0] > 1.5 * sharp[0], "{name}: {soft:?}, sharpest {sharp:?}");
        // The reported value gives the same image.
        assert_eq!(solve(name, &dark, Some(chosen)).maps.albedo, done.maps.albedo, "{name}");
    }
    assert_valid(&gpu);
}

#[test]
fn the_columns_that_tell_noise_count_as_memory() {
    let gpu = host();
    let capture =
        photon_noise(&light(wall(), wall(), &[dvec3(0.1, 0.0, 0.6)]), 100.0, Dark::Counts(0.0), None, 1);
    let (capture, grid) = (
        capture.unwrap(),
        Grid::new(Volume { min: dvec3(-0.4, -0.4, 0.3), max: dvec3(0.6, 0.6, 1.0) }, 48, BIN).unwrap(),
    );
    let mut options = options("fbp", 48, &capture);
    let plan = options.plan(&Problem::new(&capture, grid), &gpu.abilities()).unwrap();
    let memory: u64 = plan.bytes().values().sum();
    let prepare = |options: &SolverOptions| {
        options.prepare(&gpu, &Problem { memory: Some(memory), ..Problem::new(&capture, grid) }).map(|_| ())
    };
    let refused = prepare(&options).unwrap_err();
    assert_eq!(refused.kind, Kind::Memory);
    assert!(refused.what.contains(&format!("there are {} MiB", memory >> 20)), "{refused}");
    // A width that is given needs no columns.
    let SolverOptions::Fbp(fbp) = &mut options else { unreachable!() };
    fbp.filter_width = Some(0.5);
    prepare(&options).unwrap();
}

#[test]
fn scans_that_break_an_assumption_are_refused() {
    let gpu = host();
    let target = [dvec3(0.0, 0.1, 0.6)];
    let refusal = |name: &str, capture: &Capture| {
        let grid = Grid::new(options(name, 16, capture).default_volume(capture).unwrap(), 16, 0.02).unwrap();
        let error = options(name, 16, capture).prepare(&gpu, &Problem::new(capture, grid)).err();
        error.map(|e| {
            assert_eq!(e.kind, Kind::Input, "{e}");
            assert!(e.hint.to_string().contains("fbp"), "{e}");
            e.what
        })
    };
    let bump = |p: &DVec3| *p + dvec3(0.0, 0.0, 0.1 * (-20.0 * (p.x * p.x + p.y * p.y)).exp());
    let curved: Vec<DVec3> = wall().iter().map(bump).collect();
    let curved = light(curved.clone(), curved, &target);
    let uneven: Vec<DVec3> = wall().iter().map(|p| dvec3(p.x + 0.3 * p.x * p.x, p.y, p.z)).collect();
    let uneven = light(uneven.clone(), uneven, &target);
    let spot = light(vec![dvec3(0.1, 0.0, 0.02); SCAN * SCAN], wall(), &target);
    let holes = light(wall(), wall(), &target).subset(SCAN * SCAN - 36, 3).unwrap();
    for name in ["lct", "dlct", "fk", "phasor"] {
        let says = |capture: &Capture, what: &str| {
            let said = refusal(name, capture).unwrap_or_else(|| panic!("{name} takes it: {what}"));
            assert!(said.contains(what), "{name}: {said}");
        };
        says(&curved, "flat wall");
        says(&uneven, "equally spaced");
        says(&holes, "36 places of 24 × 24 have none");
        if name != "phasor" {
            says(&spot, "confocal");
        }
    }
    assert_eq!(refusal("phasor", &spot), None);
    for name in ANY_PAIRS {
        for capture in [&curved, &uneven, &holes, &spot] {
            assert_eq!(refusal(name, capture), None, "{name}");
        }
    }
}
