//! Faults that are the mirror of no law: what is silently wrong by the default. Soak: writes benches/results/unmirrored.tsv.

use std::f64::consts::TAU;
use std::fmt::Write;

use fixtures::captures::changed;
use fixtures::device::*;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use thirdbounce::Grade;
use thirdbounce::capture::{Capture, METRES_PER_PICOSECOND};
use thirdbounce_simulate::{Dark, RenderOptions, Scene, simulate, truth};

use crate::instrument::{ALIKE, delayed, echoed, line, on_wall, placed, placed_by, solved, weighed};

/// A fault of a capture; the seed is of its photons.
type Fault = (&'static str, fn(&Capture, u64) -> Capture);

/// The share of a scan that is done at a pair.
fn done(c: &Capture, pair: usize) -> f64 {
    pair as f64 / c.pair_count() as f64
}

/// Photons late or early by chance: up to 3 cm of path at the end of the scan (standard deviation).
fn jittery(c: &Capture, seed: u64) -> Capture {
    let mut random = Pcg64::seed_from_u64(seed);
    changed(c, |to| {
        to.histograms.fill(0.0);
        for pair in 0..c.pair_count() {
            let by = Normal::new(0.0, 0.03 * done(c, pair) / c.bin_width).unwrap();
            for (bin, photons) in c.histogram(pair).iter().enumerate() {
                for _ in 0..*photons as usize {
                    let at = bin as f64 + by.sample(&mut random).round();
                    if (0.0..c.bins as f64).contains(&at) {
                        to.histograms[pair * c.bins + at as usize] += 1.0;
                    }
                }
            }
        }
    })
}

/// A clock whose every second bin is wider: a photon of the bin before it in five is counted there.
fn uneven(c: &Capture, seed: u64) -> Capture {
    let mut random = Pcg64::seed_from_u64(seed);
    changed(c, |to| {
        for pair in to.histograms.chunks_mut(c.bins) {
            for bins in pair.chunks_exact_mut(2) {
                let moved = (0..bins[0] as usize).filter(|_| random.random_bool(0.2)).count() as f32;
                bins[0] -= moved;
                bins[1] += moved;
            }
        }
    })
}

const FAULTS: [Fault; 12] = [
    ("a screw with a periodic error of 1.5 cm", |c, _| {
        placed(c, |[x, y]| [x + 0.015 * (TAU * x / 0.3).sin(), y + 0.015 * (TAU * y / 0.3).sin()])
    }),
    ("a mount that vibrates", |c, _| {
        placed_by(c, |pair, [x, y]| [x + 0.04 * (TAU * pair as f64 / 7.3).sin(), y])
    }),
    ("a laser that warms up", |c, s| weighed(c, s, |p| 1.0 - 0.6 * (-6.0 * done(c, p)).exp())),
    ("every second bin wider by a fifth of the one before", uneven),
    ("time zero by temperature", |c, s| {
        delayed(c, s, |p| 200.0 * METRES_PER_PICOSECOND * (1.0 - (-4.0 * done(c, p)).exp()))
    }),
    ("jitter that grows along the scan", jittery),
    ("one bad column", |c, s| weighed(c, s, |p| if line(c, p)[0] == c.scan[0] / 3 { 0.05 } else { 1.0 })),
    ("backlash: every second row half a point aside", |c, _| {
        let half = 1.0 / c.scan[0] as f64;
        placed_by(c, |pair, [x, y]| [x + if pair % c.scan[1] % 2 == 1 { half } else { -half }, y])
    }),
    ("a wall that bulges by 5 cm", |c, s| {
        delayed(c, s, |p| {
            let [x, y] = on_wall(c.laser[p]);
            0.1 * (1.0 - 0.5 * (x * x + y * y))
        })
    }),
    ("timing that follows the mains", |c, s| {
        delayed(c, s, |p| 60.0 * METRES_PER_PICOSECOND * (TAU * p as f64 / 23.7).sin())
    }),
    ("afterpulses", |c, s| echoed(c, s, &[(0.15, 0.35), (0.07, 0.7)])),
    ("light that flickers", |c, s| weighed(c, s, |p| 1.0 + 0.35 * (TAU * p as f64 / 11.1).sin())),
];

/// Seeds: `THIRDBOUNCE_SEED`, of noise.
#[test]
#[ignore = "ten minutes: make soak"]
fn faults_that_no_law_mirrors_are_rarely_silent() {
    let gpu = host();
    let seed: u64 = std::env::var("THIRDBOUNCE_SEED").map_or(9417, |seed| seed.parse().expect("a number"));
    let mut table =
        "fault\tscene\tIoU of the proper capture\tIoU\tverdict\tsilent\tfirst reason\n".to_owned();
    let (mut rows, mut silent) = (0, 0);
    for name in ["figure", "letter-R", "torus"] {
        let scene =
            Scene { photons: Some(200.0), dark: Dark::Counts(1.0), seed, ..Scene::named(name).unwrap() };
        let truth = truth(&scene, 128).unwrap();
        let proper = simulate(&scene, &RenderOptions::default()).unwrap().capture;
        let (before, _) = solved(&gpu, &proper, &truth);
        for (fault, of) in FAULTS {
            let (after, verdict) = solved(&gpu, &of(&proper, seed + 1), &truth);
            let is_silent = verdict.grade == Grade::Good && after < before - ALIKE;
            let cut: String = verdict.reasons.first().map_or("", |r| r).chars().take(150).collect();
            let row =
                format!("{fault}\t{name}\t{before:.3}\t{after:.3}\t{:?}\t{is_silent}\t{cut}", verdict.grade);
            println!("{row}");
            writeln!(table, "{row}").unwrap();
            (rows, silent) = (rows + 1, silent + usize::from(is_silent));
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/results/unmirrored.tsv");
    std::fs::write(path, table).unwrap();
    // A wall that bulges and time zero by temperature leave no more light than a proper capture does.
    assert!(silent * 6 <= rows, "{silent} of {rows}");
}
