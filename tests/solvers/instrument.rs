//! What an instrument does to a capture as a whole: smooth, small, and explained away by a surface. Every fault is either undone or named,
//! or the verdict falls.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::Instant;

use fixtures::captures::changed;
use fixtures::device::*;
use glam::{DVec3, dvec2, dvec3};
use rand::SeedableRng;
use rand_distr::{Binomial, Distribution};
use rand_pcg::Pcg64;
use thirdbounce::capture::{Capture, read, write};
use thirdbounce::maps::Truth;
use thirdbounce::measure::metrics;
use thirdbounce::transport::Reflectance;
use thirdbounce::{Gpu, Grade, Settings, Verdict, prepare, reconstruct};
use thirdbounce_simulate::{Dark, Layout, RenderOptions, Scene, simulate, truth};

/// Pixels of the maps.
const LATERAL: usize = 64;
/// A capture that loses no more of the proper one's IoU is as good.
pub const ALIKE: f64 = 0.06;

/// A figure of 200 photons, whole counts.
fn figure(seed: u64) -> (Scene, RenderOptions) {
    let scene =
        Scene { photons: Some(200.0), dark: Dark::Counts(1.0), seed, ..Scene::named("figure").unwrap() };
    (scene, RenderOptions::default())
}

/// A Lambertian sphere with radiometric values.
fn sphere(seed: u64) -> (Scene, RenderOptions) {
    let scene = Scene {
        reflectance: Reflectance::Lambertian,
        bin_width: 0.003,
        seed,
        ..Scene::named("sphere").unwrap()
    };
    (scene, RenderOptions { noise: 0.005, seed, ..RenderOptions::default() })
}

/// A scene, what is done to its capture, and a word of the cause that may be named in place of a good picture.
struct Fault {
    name: &'static str,
    of: fn(u64) -> (Scene, RenderOptions),
    done: fn(&Capture, u64) -> Capture,
    words: &'static [&'static str],
}

/// Where a point is on the wall of a metre, from -1 to 1.
pub fn on_wall(point: DVec3) -> [f64; 2] {
    [2.0 * point.x, 2.0 * point.y]
}

/// Points moved on the wall, by their pair.
pub fn placed_by(c: &Capture, of: impl Fn(usize, [f64; 2]) -> [f64; 2]) -> Capture {
    let moved = |(pair, point): (usize, &mut DVec3)| {
        let [x, y] = of(pair, on_wall(*point));
        *point = dvec3(0.5 * x, 0.5 * y, point.z);
    };
    changed(c, |c| {
        [&mut c.laser, &mut c.sensor].into_iter().for_each(|all| all.iter_mut().enumerate().for_each(moved))
    })
}

pub fn placed(c: &Capture, of: fn([f64; 2]) -> [f64; 2]) -> Capture {
    placed_by(c, |_, point| of(point))
}

/// A share of a count: of whole counts each photon by chance.
fn part(count: f32, share: f64, is_whole: bool, random: &mut Pcg64) -> f32 {
    match is_whole {
        true => Binomial::new(count as u64, share).unwrap().sample(random) as f32,
        false => count * share as f32,
    }
}

/// Counts times a gain of every pair, at most 1: photons are lost by chance.
pub fn weighed(c: &Capture, seed: u64, gain: impl Fn(usize) -> f64) -> Capture {
    let gains: Vec<f64> = (0..c.pair_count()).map(gain).collect();
    let most = gains.iter().fold(0.0f64, |a, b| a.max(*b));
    let mut random = Pcg64::seed_from_u64(seed);
    changed(c, |c| {
        for (row, gain) in c.histograms.chunks_exact_mut(c.bins).zip(&gains) {
            row.iter_mut().for_each(|v| *v = part(*v, gain / most, c.integer_counts, &mut random));
        }
    })
}

/// Counts late by metres of path of every pair, to whole bins: a photon takes one of the two bins by chance.
pub fn delayed(c: &Capture, seed: u64, delay: impl Fn(usize) -> f64) -> Capture {
    let mut random = Pcg64::seed_from_u64(seed);
    changed(c, |c| {
        let bins = c.bins;
        for (pair, row) in c.histograms.chunks_exact_mut(bins).enumerate() {
            let by = delay(pair) / c.bin_width;
            let from = row.to_vec();
            row.fill(0.0);
            for (bin, v) in from.into_iter().enumerate() {
                let at = bin as f64 + by;
                let low = at.floor();
                let share = at - low;
                let up = part(v, share, c.integer_counts, &mut random);
                for (to, v) in [(low, v - up), (low + 1.0, up)] {
                    if (0.0..bins as f64).contains(&to) {
                        row[to as usize] += v;
                    }
                }
            }
        }
    })
}

/// Histograms with echoes: shares of the light that come later by some metres.
pub fn echoed(c: &Capture, seed: u64, echoes: &[(f64, f64)]) -> Capture {
    let all: f64 = 1.0 + echoes.iter().map(|(share, _)| share).sum::<f64>();
    let mut sum = changed(c, |c| c.histograms.fill(0.0));
    for (k, (share, later)) in [(1.0, 0.0)].into_iter().chain(echoes.iter().copied()).enumerate() {
        let mut random = Pcg64::seed_from_u64(seed + k as u64);
        let one = changed(c, |c| {
            c.histograms.iter_mut().for_each(|v| *v = part(*v, share / all, c.integer_counts, &mut random));
        });
        let late = delayed(&one, seed + 50, |_| later);
        sum.histograms.iter_mut().zip(late.histograms).for_each(|(v, w)| *v += w);
    }
    sum
}

/// Points as if the wall had this size, per cent of the true one.
fn wall<const PERCENT: u32>(c: &Capture, _: u64) -> Capture {
    placed(c, |p| p.map(|v| f64::from(PERCENT) / 100.0 * v))
}

const fn wrong_wall(
    name: &'static str,
    of: fn(u64) -> (Scene, RenderOptions),
    done: fn(&Capture, u64) -> Capture,
) -> Fault {
    Fault { name, of, done, words: &["wall is", "wall's size"] }
}

fn falls(device: DVec3) -> impl Fn(DVec3) -> f64 {
    move |point| device.z / (device - point).length().powi(3)
}

/// Of a pair, its column and row.
pub fn line(c: &Capture, pair: usize) -> [usize; 2] {
    [pair / c.scan[1], pair % c.scan[1]]
}

fn rolled(c: &Capture) -> Capture {
    changed(c, |c| {
        let bins = c.bins;
        c.histograms.chunks_exact_mut(bins).for_each(|row| row.rotate_left(bins / 3));
    })
}

/// The figure's capture, whose second half of the columns sees it `by` metres away.
fn half_moved(c: &Capture, seed: u64, by: DVec3) -> Capture {
    let (mut scene, options) = figure(seed);
    scene.objects.iter_mut().for_each(|object| object.mesh = object.mesh.clone().translated(by));
    let there = simulate(&Scene { bins: Some(c.bins), scan: c.scan[0], ..scene }, &options).unwrap().capture;
    changed(c, |to| {
        let from = c.pair_count() / 2 * c.bins;
        to.histograms[from..].copy_from_slice(&there.histograms[from..]);
    })
}

const FAULTS: &[Fault] = &[
    Fault {
        name: "device at (-0.5, 0, 0.25)",
        of: sphere,
        done: |c, s| weighed(c, s, |p| falls(dvec3(-0.5, 0.0, 0.25))(c.laser[p])),
        words: &["weakens"],
    },
    Fault {
        name: "device at (-1.5, 0, 1.5)",
        of: sphere,
        done: |c, s| weighed(c, s, |p| falls(dvec3(-1.5, 0.0, 1.5))(c.laser[p])),
        words: &["weakens"],
    },
    Fault {
        name: "device at (-0.5, 0, 0.25), figure",
        of: figure,
        done: |c, s| weighed(c, s, |p| falls(dvec3(-0.5, 0.0, 0.25))(c.laser[p])),
        words: &["weakens"],
    },
    Fault {
        name: "pincushion",
        of: figure,
        done: |c, _| placed(c, |[x, y]| [x, y].map(|v| v / (1.0 + 0.15 * (x * x + y * y)))),
        words: &["mirrors"],
    },
    Fault {
        name: "keystone",
        of: figure,
        done: |c, _| placed(c, |[x, y]| [x / (1.0 + 0.2 * y), y]),
        words: &["keystone"],
    },
    Fault {
        name: "shear",
        of: figure,
        done: |c, _| placed(c, |[x, y]| [x - 0.2 * y, y]),
        words: &["sheared"],
    },
    Fault {
        name: "narrow",
        of: figure,
        done: |c, _| placed(c, |[x, y]| [0.85 * x, y]),
        words: &["wide along x"],
    },
    Fault {
        name: "bins x 0.9",
        of: figure,
        done: |c, _| changed(c, |c| c.bin_width *= 0.9),
        words: &["bins are", "bin width"],
    },
    Fault {
        name: "bins x 1.1",
        of: figure,
        done: |c, _| changed(c, |c| c.bin_width *= 1.1),
        words: &["bins are", "bin width"],
    },
    wrong_wall("wall x 0.9", figure, wall::<90>),
    wrong_wall("wall x 1.1", figure, wall::<110>),
    wrong_wall("wall x 1.25", figure, wall::<125>),
    wrong_wall("wall x 1.1, sphere", sphere, wall::<110>),
    Fault {
        name: "lean of 20 cm",
        of: figure,
        done: |c, s| delayed(c, s, |p| 0.1 * (1.0 + on_wall(c.laser[p])[0])),
        words: &["leans"],
    },
    Fault {
        name: "legs as one constant",
        of: figure,
        done: |c, s| {
            delayed(c, s, |p| {
                let leg = |at: DVec3| 2.0 * ((dvec3(0.0, 0.0, 1.0) - at).length() - 1.0);
                leg(c.laser[p])
            })
        },
        words: &["leans", "legs", "mirrors"],
    },
    Fault {
        name: "time walk",
        of: figure,
        done: |c, s| {
            let light: Vec<f64> = (0..c.pair_count())
                .map(|p| c.histograms[p * c.bins..][..c.bins].iter().sum::<f32>().into())
                .collect();
            let mean = light.iter().sum::<f64>() / light.len() as f64;
            delayed(c, s, |p| -0.06 * (light[p] / mean).ln())
        },
        words: &["walk"],
    },
    Fault {
        name: "time zero -10 cm",
        of: figure,
        done: |c, _| changed(c, |c| c.t_start -= 0.1),
        words: &["time zero"],
    },
    Fault {
        name: "time zero +10 cm",
        of: figure,
        done: |c, _| changed(c, |c| c.t_start += 0.1),
        words: &["time zero"],
    },
    Fault {
        name: "time zero +30 cm",
        of: figure,
        done: |c, _| changed(c, |c| c.t_start += 0.3),
        words: &["time zero"],
    },
    Fault {
        name: "one laser point as confocal",
        of: |seed| {
            let (scene, o) = figure(seed);
            (Scene { layout: Layout::OneLaser { point: dvec2(0.0, 0.0) }, ..scene }, o)
        },
        done: |c, _| changed(c, |c| c.laser = c.sensor.clone()),
        words: &["the laser stayed"],
    },
    Fault {
        name: "two peaks",
        of: figure,
        done: |c, s| echoed(c, s, &[(0.6, 0.06)]),
        words: &["impulse response", "pulse"],
    },
    Fault {
        name: "pre-pulse",
        of: figure,
        done: |c, s| echoed(c, s, &[(0.3, -0.12)]),
        words: &["impulse response", "pulse"],
    },
    Fault {
        name: "ringing",
        of: figure,
        done: |c, s| echoed(c, s, &[(0.4, 0.05), (0.2, 0.1), (0.1, 0.15)]),
        words: &["impulse response", "pulse"],
    },
    Fault {
        name: "half of the rows with other power",
        of: figure,
        done: |c, s| weighed(c, s, |p| if line(c, p)[1] < 16 { 1.0 } else { 0.6 }),
        words: &["power"],
    },
    Fault {
        name: "moved by 8 cm",
        of: figure,
        done: |c, s| half_moved(c, s, dvec3(0.05, -0.05, 0.04)),
        words: &["moved"],
    },
    Fault {
        name: "moved by 20 cm",
        of: figure,
        done: |c, s| half_moved(c, s, dvec3(-0.2, 0.02, 0.02)),
        words: &["moved"],
    },
    Fault {
        name: "rows copied",
        of: figure,
        done: |c, _| {
            changed(c, |to| {
                for pair in 0..c.pair_count() {
                    let [x, y] = line(c, pair);
                    let from = x * c.scan[1] + y / 2 * 2;
                    to.histograms[pair * c.bins..][..c.bins]
                        .copy_from_slice(&c.histograms[from * c.bins..][..c.bins]);
                }
            })
        },
        words: &["copied", "repeated", "equal"],
    },
    Fault {
        name: "record rolled",
        of: figure,
        done: |c, _| rolled(c),
        words: &["early", "begin", "rolled", "earlier"],
    },
];

/// IoU and verdict of a capture by the default, as a file: with what readers repair, and with its automatic gate.
pub fn solved(gpu: &Gpu, capture: &Capture, truth: &Truth) -> (f64, Verdict) {
    solved_with(gpu, capture, truth, "auto")
}

/// The same with this value of `calibrate`: none, auto or a file.
fn solved_with(gpu: &Gpu, capture: &Capture, truth: &Truth, calibrate: &str) -> (f64, Verdict) {
    let lateral = LATERAL.to_string();
    let texts = [("lateral", &*lateral), ("deterministic", "true"), ("calibrate", calibrate)];
    let settings = Settings::from_texts(texts).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("capture.npz");
    write(capture, &file).unwrap();
    let prepared = read(&file).and_then(|capture| prepare(capture, &settings));
    match prepared.and_then(|capture| reconstruct(gpu, &capture, &settings)) {
        Ok(result) => {
            let iou = metrics(&result.maps, truth, 0.3).ok().and_then(|m| m.iou).unwrap_or(0.0);
            (iou, result.verdict.map_or(Verdict::GOOD, |v| (*v).clone()))
        }
        Err(e) => {
            let mut verdict = Verdict::GOOD;
            verdict.add(Grade::Poor, format!("refused: {e}"));
            (0.0, verdict)
        }
    }
}

/// A row of the table: the fault, IoU of the proper capture and of this one, grade, the reason that names it (or the first one).
struct Row {
    name: &'static str,
    iou: [f64; 2],
    /// Seconds over those of the proper capture.
    times: f64,
    verdict: Verdict,
    is_named: bool,
}

impl Row {
    fn of(gpu: &Gpu, fault: &Fault, seed: u64) -> Row {
        let (scene, options) = (fault.of)(seed);
        let truth = truth(&scene, 128).unwrap();
        let proper = simulate(&scene, &options).unwrap().capture;
        let faulty = (fault.done)(&proper, seed + 1);
        let clock = Instant::now();
        let (before, verdict) = solved(gpu, &proper, &truth);
        let of_proper = clock.elapsed().as_secs_f64();
        // A proper capture has no cause and no doubt.
        assert!(
            !verdict.reasons.iter().any(|r| r.contains("once it is undone") || r.contains("perhaps")),
            "{}: {verdict}",
            fault.name
        );
        let clock = Instant::now();
        let (after, verdict) = solved(gpu, &faulty, &truth);
        let times = clock.elapsed().as_secs_f64() / of_proper;
        let names = |reason: &String| fault.words.iter().any(|word| reason.contains(word));
        let is_named = verdict.grade > Grade::Good && verdict.reasons.iter().any(names);
        Row { name: fault.name, iou: [before, after], times, verdict, is_named }
    }

    /// As good as the proper capture.
    fn holds(&self) -> bool {
        self.iou[1] > self.iou[0] - ALIKE
    }

    fn line(&self) -> String {
        let Row { name, iou: [before, after], times, verdict, is_named } = self;
        let cut: String = verdict.reasons.first().map_or("", |r| r).chars().take(150).collect();
        format!(
            "{name}\t{before:.3}\t{after:.3}\t{times:.1}\t{:?}\t{is_named}\t{}\t{cut}",
            verdict.grade,
            self.holds()
        )
    }
}

/// A fault of the table on 16 x 16 points: its cause is named and undone.
#[test]
fn a_laser_that_stays_is_found() {
    let gpu = host();
    let scene = Scene {
        scan: 16,
        layout: Layout::OneLaser { point: dvec2(0.2, -0.1) },
        photons: Some(500.0),
        ..Scene::named("figure").unwrap()
    };
    let proper = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let as_confocal = changed(&proper, |c| c.laser = c.sensor.clone());
    let truth = truth(&scene, 128).unwrap();
    let [(before, good), (after, fair)] = [&proper, &as_confocal].map(|c| solved(&gpu, c, &truth));
    let found = fair.reasons.iter().find(|reason| reason.contains("the laser stayed at about"));
    assert!(
        found.is_some_and(|reason| reason.contains("undone here")) && fair.grade == Grade::Fair,
        "{fair}"
    );
    assert!(!good.reasons.iter().any(|reason| reason.contains("undone")), "{good}");
    // Places that leave as little lie tens of centimetres apart: which one is found, the last bits decide.
    let (untouched, _) = solved_with(&gpu, &as_confocal, &truth, "none");
    assert!(
        untouched < before - 4.0 * ALIKE && after > untouched + 3.0 * ALIKE,
        "{before} {untouched} {after}"
    );
}

/// Faults of the table on fewer points: each is named, and far better once it is undone.
#[test]
fn a_scene_that_moved_and_a_record_that_is_rolled_are_found() {
    let gpu = host();
    let proper = simulate(&Scene { scan: 24, ..figure(9).0 }, &RenderOptions::default()).unwrap().capture;
    let truth = truth(&figure(9).0, 128).unwrap();
    let faults = [
        (half_moved(&proper, 9, dvec3(-0.2, 0.02, 0.02)), "the scene moved during the scan"),
        (rolled(&proper), "as of a record that is rolled"),
    ];
    for (faulty, words) in faults {
        let (after, verdict) = solved(&gpu, &faulty, &truth);
        let is_undone = |reason: &String| reason.contains(words) && reason.contains("undone here");
        assert!(verdict.grade == Grade::Fair && verdict.reasons.iter().any(is_undone), "{verdict}");
        // As they are, .3 and .05.
        assert!(after > 0.6, "{words}: {after}");
    }
}

/// A gain that swings over the scan: a surface that is fitted with it hides less than half.
#[test]
fn gains_of_lines_are_undone() {
    let gpu = host();
    let (scene, options) = (Scene { scan: 24, ..figure(31).0 }, RenderOptions::default());
    let (proper, truth) = (simulate(&scene, &options).unwrap().capture, truth(&scene, 128).unwrap());
    let gain = |pair: usize| 1.0 + 0.35 * (1.7 * TAU * pair as f64 / 576.0).sin();
    let faulty = weighed(&proper, 32, gain);
    let [(before, good), (after, fair)] = [&proper, &faulty].map(|c| solved(&gpu, c, &truth));
    let is_undone = |reason: &String| {
        reason.contains("the columns have gains of their own") && reason.contains("undone here")
    };
    assert!(fair.grade == Grade::Fair && fair.reasons.iter().any(is_undone), "{fair}");
    assert!(!good.reasons.iter().any(|reason| reason.contains("gains")), "{good}");
    let (untouched, _) = solved_with(&gpu, &faulty, &truth, "none");
    assert!(untouched < before - 0.04 && after > before - 0.02, "{before} {untouched} {after}");
}

/// Writes benches/results/instrument.tsv. `THIRDBOUNCE_SEED`: of the noise; `THIRDBOUNCE_FAULT`: words of the faults to show alone.
#[test]
#[ignore = "five to ten minutes: make soak"]
fn faults_of_the_instrument_are_undone_or_named() {
    let gpu = host();
    let seed = std::env::var("THIRDBOUNCE_SEED").map_or(7781, |seed| seed.parse().expect("a number"));
    if let Ok(words) = std::env::var("THIRDBOUNCE_FAULT") {
        let is_asked = |fault: &&Fault| words.split(',').any(|word| fault.name.contains(word));
        FAULTS.iter().filter(is_asked).for_each(|fault| println!("{}", Row::of(&gpu, fault, seed).line()));
        return;
    }
    let rows: Vec<Row> = FAULTS
        .iter()
        .map(|fault| Row::of(&gpu, fault, seed))
        .inspect(|row| println!("{}", row.line()))
        .collect();
    let mut table =
        "fault\tIoU of the proper capture\tIoU\ttimes the seconds\tverdict\tnamed\theld\tfirst reason\n"
            .to_owned();
    for row in &rows {
        writeln!(table, "{}", row.line()).unwrap();
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/results/instrument.tsv");
    std::fs::write(path, table).unwrap();
    let held = rows.iter().filter(|row| row.holds()).count();
    assert!(held >= 16, "{held} of {}", rows.len());
}

/// Writes benches/results/rig.tsv: what is undone of the capture of one scene, for captures of others by the same rig. `THIRDBOUNCE_SEED`:
/// of the noise.
#[test]
#[ignore = "ten minutes: make soak"]
fn what_is_undone_of_one_capture_serves_the_next() {
    let gpu = host();
    let seed: u64 = std::env::var("THIRDBOUNCE_SEED").map_or(9310, |seed| seed.parse().expect("a number"));
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("first");
    let settings = Settings::from_texts([("lateral", "64"), ("deterministic", "true")]).unwrap();
    let mut table =
        "fault\tcorrections\tscene\tIoU of the proper capture\tIoU\tIoU with the calibration\n".to_owned();
    let (mut rows, mut sums) = (0.0, [0.0; 3]);
    for fault in FAULTS {
        let (scene, options) = (fault.of)(seed);
        let file = folder.path().join("first.npz");
        write(&(fault.done)(&simulate(&scene, &options).unwrap().capture, seed), &file).unwrap();
        let go_on = &mut |_: &thirdbounce::engine::Progress| ControlFlow::Continue(());
        if thirdbounce::reconstruct_file(&gpu, &file, &settings, None, &out, go_on).is_err() {
            continue;
        }
        let report = std::fs::read(out.join("report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let corrections = report["settings"]["calibration_found"]["corrections"].as_array().cloned();
        let laws: Vec<String> = corrections.iter().flatten().map(|of| of["law"].to_string()).collect();
        // Motions and gains of lines are not the rig's.
        let of_capture =
            |law: &String| ["moved", "gains"].iter().any(|of| law.starts_with(&format!("\"{of}")));
        if laws.iter().all(of_capture) {
            continue;
        }
        for (at, name) in ["sphere", "letter-R", "torus"].into_iter().enumerate() {
            let scene = Scene {
                seed: seed + 1 + at as u64,
                ..Scene { objects: Scene::named(name).unwrap().objects, ..figure(0).0 }
            };
            let proper = simulate(&scene, &RenderOptions::default()).unwrap().capture;
            let truth = truth(&scene, 128).unwrap();
            let faulty = (fault.done)(&proper, seed + 9);
            let calibration = out.join("report.json").display().to_string();
            let iou = [(&proper, "auto"), (&faulty, "auto"), (&faulty, &*calibration)]
                .map(|(capture, calibrate)| solved_with(&gpu, capture, &truth, calibrate).0);
            let line = format!(
                "{}\t{}\t{name}\t{:.3}\t{:.3}\t{:.3}",
                fault.name,
                laws.join(" "),
                iou[0],
                iou[1],
                iou[2]
            );
            println!("{line}");
            writeln!(table, "{line}").unwrap();
            sums.iter_mut().zip(iou).for_each(|(sum, iou)| *sum += iou);
            rows += 1.0;
        }
    }
    let [proper, auto, with] = sums.map(|sum| sum / rows);
    println!("{rows} captures: proper {proper:.3}, with the fault {auto:.3}, with the calibration {with:.3}");
    writeln!(table, "mean\t\t\t{proper:.3}\t{auto:.3}\t{with:.3}").unwrap();
    std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/results/rig.tsv"), table).unwrap();
    assert!(with > auto + 0.05 && with > proper - 0.08, "{proper} {auto} {with}");
}
