//! Time zero from one small target: simulated captures that are shifted by a known amount.

use fixtures::captures::{assert_error, assert_no_target, capture};
use fixtures::command::{fail, succeed};
use glam::dvec3;
use thirdbounce::Kind;
use thirdbounce::capture::calibrate::time_zero;
use thirdbounce::capture::{Capture, read, write};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};

/// The capture of a square of 3 cm, 0.5 m before a wall of 1 m, off its middle, matt and one-sided; with `photons` in
/// the strongest bin and a few dark counts, or without noise for 0.
fn target(photons: f64) -> Capture {
    let mut c = capture([16, 16], 400, |_, _| 0.0);
    (c.t_start, c.bin_width, c.integer_counts) = (0.0, 0.006, photons > 0.0);
    for p in 0..256 {
        let wall = dvec3((p / 16) as f64 / 15.0 - 0.5, (p % 16) as f64 / 15.0 - 0.5, 0.0);
        (c.laser[p], c.sensor[p]) = (wall, wall);
        for k in 0..36 {
            let at = dvec3(0.085 + 0.006 * (k / 6) as f64, 0.035 + 0.006 * (k % 6) as f64, 0.5);
            let (to, r) = (at - wall, at.distance(wall));
            let bin = (2.0 * r / c.bin_width) as usize;
            c.histograms[p * c.bins + bin] += ((to.z / r).powi(2) / r.powi(4)) as f32;
        }
    }
    if photons > 0.0 {
        let most = c.histograms.iter().fold(0.0f32, |a, b| a.max(*b));
        let mut state = 12345u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for count in &mut c.histograms {
            // Poisson by waiting times, and a dark count in every tenth bin.
            let mean = photons * f64::from(*count / most) + 0.1;
            let (mut n, mut left) = (0, mean + uniform().max(1e-12).ln());
            while left > 0.0 {
                (n, left) = (n + 1, left + uniform().max(1e-12).ln());
            }
            *count = n as f32;
        }
    }
    c
}

#[test]
fn known_shifts_are_found_to_a_fraction_of_a_bin() {
    for noise in [0.0, 1000.0] {
        let c = target(noise);
        for bins in [-23.0, -5.5, 0.0, 1.0, 7.25, 30.0] {
            let mut shifted = c.clone();
            shifted.t_start += bins * c.bin_width;
            let found = time_zero(&shifted, 40).unwrap();
            let off = found.shift / c.bin_width + bins;
            assert!(off.abs() < 1.0, "{noise:?}: {bins} bins are found with {off} off");
            let error = found.error / c.bin_width;
            assert!(
                error > 0.0 && error < 0.5 && off.abs() < 5.0 * error + 0.5,
                "{off} off, reported {error}"
            );
            assert!(found.target.distance(dvec3(0.1, 0.05, 0.5)) < 0.01, "{}", found.target);
            // The curve has its minimum there.
            let least = found.curve.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
            assert!((least[0] - found.shift).abs() <= c.bin_width);
        }
    }
}

#[test]
fn what_is_no_target_is_refused() {
    let c = target(0.0);
    let mut far = c.clone();
    far.t_start += 60.0 * c.bin_width;
    assert_error(time_zero(&far, 40), Kind::Input, &["end of the range", "larger reach"]);
    assert!(time_zero(&far, 80).is_ok());
    assert_error(time_zero(&c, 0), Kind::Options, &["reach of 0"]);
    let mut apart = c.clone();
    apart.laser.fill(glam::DVec3::ZERO);
    assert_error(time_zero(&apart, 40), Kind::Input, &["confocal"]);
    // Peaks in random order.
    let mut mixed = c.clone();
    for (p, h) in mixed.histograms.chunks_exact_mut(c.bins).enumerate() {
        h.fill(0.0);
        h[(p * p * 31 + 7 * p) % c.bins] = 5.0;
    }
    assert_error(time_zero(&mixed, 40), Kind::Input, &["target"]);
}

#[test]
fn a_wide_scene_leaves_time_zero_undetermined() {
    for name in ["figure", "letter-z", "spheres", "torus"] {
        let scene = Scene { scan: 10, ..Scene::named(name).unwrap() };
        let options = RenderOptions { noise: 0.2, ..RenderOptions::default() };
        assert_no_target(&simulate(&scene, &options).unwrap().capture, name);
    }
    // From a narrow wall even a point does not determine time zero.
    let mut narrow = target(0.0);
    for (p, h) in narrow.histograms.chunks_exact_mut(400).enumerate() {
        let at = 0.02 * dvec3((p / 16) as f64 / 15.0 - 0.5, (p % 16) as f64 / 15.0 - 0.5, 0.0);
        (narrow.laser[p], narrow.sensor[p]) = (at, at);
        h.fill(0.0);
        h[(2.0 * at.distance(dvec3(0.1, 0.05, 0.5)) / 0.006) as usize] = 9.0;
    }
    assert_error(time_zero(&narrow, 40), Kind::Input, &["undetermined"]);
}

#[test]
fn the_command_writes_a_capture_put_right() {
    let folder = tempfile::tempdir().unwrap();
    let mut c = target(0.0);
    c.t_start += 4.0 * c.bin_width;
    let at = |name: &str| folder.path().join(name).display().to_string();
    write(&c, std::path::Path::new(&at("late.npz"))).unwrap();
    let text = succeed(&["calibrate", &at("late.npz"), "--out", &at("right.npz"), "--png", &at("curve.png")]);
    assert!(text.contains("residual (m)") && text.contains("shift ") && text.contains("target"), "{text}");
    assert!(text.lines().count() > 81, "a line per shift");
    let right = read(std::path::Path::new(&at("right.npz"))).unwrap();
    assert!((right.t_start - (c.t_start - 4.0 * c.bin_width)).abs() < c.bin_width, "{}", right.t_start);
    assert!(right.histograms == c.histograms);
    assert!(std::fs::metadata(at("curve.png")).unwrap().len() > 1000);
    fail(&["calibrate", &at("late.npz"), "--out", &at("no.npz"), "--reach", "2"], 1, "end of the range");
    assert!(!std::path::Path::new(&at("no.npz")).exists());
}
