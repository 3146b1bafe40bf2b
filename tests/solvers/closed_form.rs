//! Closed-form methods against known physics: points come back at their places, and scans that break an assumption are
//! refused.

use std::ops::ControlFlow;

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Maps;
use thirdbounce::solve::option::Value;
use thirdbounce::solve::{SolverOptions, Suit, Watch};
use thirdbounce::transport::{Grid, Volume};

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
    let mut options = SolverOptions::suited_to(name, &Suit::of(capture)).unwrap();
    options.set("lateral", &Value::Count(lateral));
    options
}

fn maps(gpu: &Gpu, name: &str, capture: &Capture, volume: Volume, lateral: usize) -> Maps {
    let grid = Grid::new(volume, lateral, BIN / 2.0).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    options(name, lateral, capture).solve(gpu, capture, grid, None, false, &mut watch).unwrap().maps
}

/// Where the brightest point of the maps is, to a fraction of a pixel.
fn brightest(maps: &Maps) -> DVec3 {
    let at = (0..maps.albedo.len()).max_by(|a, b| maps.albedo[*a].total_cmp(&maps.albedo[*b])).unwrap();
    let value = |i: usize| f64::from(maps.albedo[i]);
    let shift = |stride: usize| {
        let [low, middle, high] = [value(at - stride), value(at), value(at + stride)];
        0.5 * (low - high) / (low - 2.0 * middle + high)
    };
    let [x, y] = maps.centre(at / maps.ny, at % maps.ny);
    let pixel = (maps.extent[1] - maps.extent[0]) / maps.nx as f64;
    dvec3(x + shift(maps.ny) * pixel, y + shift(1) * pixel, f64::from(maps.depth[at]))
}

#[test]
fn points_come_back_at_their_places() {
    let gpu = gpu();
    // A third of the distance of scan points, and of half a bin.
    let [across, along] = [WALL / SCAN as f64 / 3.0, BIN / 2.0 / 3.0];
    for target in [dvec3(0.1131, -0.0723, 0.557), dvec3(-0.2214, 0.3017, 0.8132), dvec3(0.08, 0.08, 0.4308)] {
        let near = dvec3(0.18, 0.18, 0.12);
        let volume = Volume { min: target - near, max: target + near };
        for name in ALL {
            let capture = light(wall(), wall(), &[target]);
            let found = brightest(&maps(&gpu, name, &capture, volume, 45)) - target;
            println!("{name} {target}: {:.2} {:.2} {:.2} mm", 1e3 * found.x, 1e3 * found.y, 1e3 * found.z);
            assert!(
                found.x.abs() < across && found.y.abs() < across && found.z.abs() < along,
                "{name} {target}: {found}"
            );
        }
        // One laser point.
        for name in ["phasor"].iter().chain(&ANY_PAIRS) {
            let capture = light(vec![dvec3(0.31, -0.11, 0.02); SCAN * SCAN], wall(), &[target]);
            let found = brightest(&maps(&gpu, name, &capture, volume, 45)) - target;
            println!(
                "{name}, one laser point, {target}: {:.2} {:.2} {:.2} mm",
                1e3 * found.x,
                1e3 * found.y,
                1e3 * found.z
            );
            // Half of the aperture: half of the precision.
            assert!(
                found.x.abs() < 2.0 * across && found.y.abs() < 2.0 * across && found.z.abs() < 2.0 * along,
                "{name} {target}: {found}"
            );
        }
    }
    assert_valid(&gpu);
}

#[test]
fn scans_that_break_an_assumption_are_refused() {
    let gpu = gpu();
    let target = [dvec3(0.0, 0.1, 0.6)];
    let refusal = |name: &str, capture: &Capture| {
        let grid = Grid::new(options(name, 16, capture).default_volume(capture).unwrap(), 16, 0.02).unwrap();
        let error = options(name, 16, capture).prepare(&gpu, capture, grid, None, false).err();
        error.map(|e| {
            assert_eq!(e.kind, Kind::Input, "{e}");
            assert!(e.mend.to_string().contains("fbp"), "{e}");
            e.what
        })
    };
    let bump = |p: &DVec3| *p + dvec3(0.0, 0.0, 0.1 * (-20.0 * (p.x * p.x + p.y * p.y)).exp());
    let curved: Vec<DVec3> = wall().iter().map(bump).collect();
    let curved = light(curved.clone(), curved, &target);
    let uneven: Vec<DVec3> = wall().iter().map(|p| dvec3(p.x + 0.3 * p.x * p.x, p.y, p.z)).collect();
    let uneven = light(uneven.clone(), uneven, &target);
    let spot = light(vec![dvec3(0.1, 0.0, 0.02); SCAN * SCAN], wall(), &target);
    let mut holes = light(wall(), wall(), &target);
    holes.laser.pop();
    holes.sensor.pop();
    holes.scan = [SCAN * SCAN - 1, 1];
    holes.histograms.truncate((SCAN * SCAN - 1) * BINS);
    for name in ["lct", "dlct", "fk", "phasor"] {
        let says = |capture: &Capture, what: &str| {
            let said = refusal(name, capture).unwrap_or_else(|| panic!("{name} takes it: {what}"));
            assert!(said.contains(what), "{name}: {said}");
        };
        says(&curved, "flat wall");
        says(&uneven, "equally spaced");
        says(&holes, "no full lattice");
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

#[test]
fn nothing_gives_empty_maps() {
    let gpu = gpu();
    let capture = light(wall(), wall(), &[]);
    let volume = Volume { min: dvec3(-0.4, -0.4, 0.3), max: dvec3(0.4, 0.4, 0.8) };
    for name in ALL {
        let maps = maps(&gpu, name, &capture, volume, 16);
        maps.check().unwrap();
        assert!(maps.depth.iter().all(|z| z.is_nan()) && maps.albedo.iter().all(|a| *a == 0.0), "{name}");
    }
}
