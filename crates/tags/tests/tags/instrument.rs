//! A simulated instrument from end to end: a known scene, photons with jitter, dark counts, legs and pile-up in a file of time tags, then
//! the commands `histogram` and `reconstruct`. The result is nearly as good as that of the exact histograms.

use std::path::Path;

use fixtures::captures::changed;
use fixtures::command::{fail, succeed};
use glam::DVec3;
use serde_json::Value;
use tag_fixtures::tags::{Writer, write};
use thirdbounce::capture::{Pulse, read, write as write_capture};
use thirdbounce::export::npz::write_truth;
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

const TICK: f64 = 4e-12;
const PERIOD: f64 = 1e-7;
const LIGHT: f64 = 299_792_458.0;
/// Points per side, and laser pulses of a point.
const SIDE: usize = 16;
const PULSES: i64 = 250_000;
/// Photons of a laser pulse that are detected on average, of the scene and of direct light, of the point with the most light;
/// and dark counts.
const MEAN: [f64; 3] = [0.06, 0.02, 0.002];
/// Full width at half maximum of the jitter, seconds.
const JITTER: f64 = 60e-12;

struct Random(u64);

impl Random {
    fn below_one(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * self.below_one().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.below_one()).cos()
    }
}

/// The instrument's file of a sharp capture. The detector records the first photon of a laser pulse; the points are measured
/// in a snake, marker 1 begins each, marker 2 ends a row, and the scanner takes some time to the next.
fn measure(sharp: &thirdbounce::capture::Capture, to: &Path) {
    let device = DVec3::new(0.3, -0.2, -1.4);
    let brightest =
        sharp.histograms.chunks_exact(sharp.bins).map(|h| h.iter().sum::<f32>()).fold(0.0, f32::max);
    let mut random = Random(99);
    let mut writer = Writer::new(0x0001_0307);
    let mut begin = 1234;
    for row in 0..SIDE {
        for k in 0..SIDE {
            let column = if row % 2 == 1 { SIDE - 1 - k } else { k };
            let pair = column * SIDE + row;
            let wall = sharp.laser[pair];
            let leg = 2.0 * wall.distance(device) + 0.9;
            let histogram = &sharp.histograms[pair * sharp.bins..(pair + 1) * sharp.bins];
            // Expected photons of a laser pulse by delay: direct light, the scene, and dark counts everywhere.
            let mut sums = vec![0.0, MEAN[1] / (1.0 + wall.length_squared())];
            for count in histogram {
                sums.push(sums[sums.len() - 1] + MEAN[0] * f64::from(count / brightest));
            }
            let lit = sums[sums.len() - 1];
            let some = -(-(lit + MEAN[2])).exp_m1();
            writer.marker(1, begin);
            let mut sync = begin;
            loop {
                // Laser pulses until the next that gives a photon.
                sync += ((random.below_one().ln() / (1.0 - some).ln()) as i64) + 1;
                if sync >= begin + PULSES {
                    break;
                }
                // The first photon comes when its share of the expected ones has passed (Coates 1968). Dark counts are in no order.
                let share = -(1.0 - random.below_one() * some).ln();
                let seconds = if share >= lit {
                    random.below_one() * 0.6 * PERIOD
                } else {
                    let bin = sums.partition_point(|sum| *sum <= share) - 1;
                    let within = random.below_one();
                    let path = if bin == 0 {
                        0.0
                    } else {
                        sharp.t_start + (bin as f64 - 1.0 + within) * sharp.bin_width
                    };
                    (leg + path) / LIGHT + random.gaussian() * JITTER / 2.3548
                };
                writer.photon(1, sync, (seconds / TICK) as u32);
            }
            begin += PULSES;
        }
        writer.marker(2, begin);
        begin += PULSES / 3;
    }
    write(to, writer.file(TICK, PERIOD, &[]));
}

/// Errors of depth and normals of a capture's reconstruction.
fn figures(folder: &Path, capture: &str, out: &str, gate: &[&str]) -> [f64; 2] {
    let at = |name: &str| folder.join(name).display().to_string();
    let options =
        ["--lateral", "64", "--model", "cosine", "--pulse", "60ps", "--begin", "lct", "--no-preview", "-q"];
    let mut arguments = vec!["reconstruct".to_string(), at(capture), "--out".into(), at(out)];
    arguments.extend(["--truth".to_string(), at("truth.npz")]);
    arguments.extend(options.iter().chain(gate).map(|option| option.to_string()));
    succeed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.join(out).join("report.json")).unwrap()).unwrap();
    let best = &report["metrics"]["at_best"];
    ["depth_mae", "normal_error_deg"]
        .map(|key| best[key].as_f64().unwrap_or_else(|| panic!("{key} in {report:#}")))
}

#[test]
fn a_scene_comes_out_of_time_tags_as_of_exact_histograms() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let scene = Scene { scan: SIDE, bin_width: 0.006, ..Scene::named("figure").unwrap() };
    let options = RenderOptions { noise: 0.05, ..RenderOptions::default() };
    let sharp = simulate(&scene, &options).unwrap().capture;
    let pulse = Pulse::gaussian(JITTER * LIGHT).unwrap();
    let exact = simulate(&Scene { pulse: Some(pulse), ..scene.clone() }, &options).unwrap().capture;
    let exact = changed(&exact, |c| c.pulse = None);
    write_capture(&exact, &folder.path().join("exact.npz")).unwrap();
    write_truth(&folder.path().join("truth.npz"), &truth(&scene, 64).unwrap()).unwrap();
    measure(&sharp, &folder.path().join("scan.ptu"));
    let reported = succeed(&[
        "histogram",
        &at("scan.ptu"),
        "--scan",
        "16x16",
        "--snake",
        "--wall",
        &format!("{}cm", 100.0 * (sharp.laser[255].x - sharp.laser[0].x)),
        "--pixels",
        "1",
        "--bin-width",
        "20ps",
        "--out",
        &at("tags.npz"),
        "--png",
        &at("check.png"),
    ]);
    for words in
        ["generic", "channel   1", "points    250000 ", "direct    ", "16 x 16 = 256 pairs, confocal"]
    {
        assert!(reported.contains(words), "{words} is not in\n{reported}");
    }
    assert!(std::fs::metadata(at("check.png")).unwrap().len() > 5000);
    let made = read(&folder.path().join("tags.npz")).unwrap();
    assert!(made.integer_counts && made.cycles.is_some_and(|n| (n / PULSES as f64 - 1.0).abs() < 1e-6));
    for (ours, wanted) in made.laser.iter().zip(&sharp.laser) {
        assert!(ours.distance(*wanted) < 1e-9);
    }
    if let Some(keep) = std::env::var_os("THIRDBOUNCE_KEEP") {
        for name in ["scan.ptu", "check.png", "tags.npz", "exact.npz", "truth.npz"] {
            std::fs::copy(folder.path().join(name), Path::new(&keep).join(name)).unwrap();
        }
    }
    let gate = ["--gate", "0.4:3.2"];
    let wanted = figures(folder.path(), "exact.npz", "exact", &gate);
    for (found, how) in [
        (figures(folder.path(), "tags.npz", "tags", &gate), "with the same gate"),
        // Direct light is in the capture, which says where.
        (figures(folder.path(), "tags.npz", "ungated", &[]), "without a gate"),
    ] {
        println!("depth and normals: exact {wanted:?}, tags {how} {found:?}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(*found < 1.15 * wanted, "{how}: {found} and {wanted}");
        }
    }
    // Without the scan's size, without points, with a wrong unit.
    let scan = at("scan.ptu");
    fail(
        &["histogram", &scan, "--scan", "16x16", "--pixels", "1", "--out", &at("no.npz")],
        1,
        "how large the scan is",
    );
    fail(
        &["histogram", &scan, "--scan", "8x8", "--wall", "1m", "--out", &at("no.npz")],
        1,
        "which photons belong",
    );
    fail(&["histogram", &scan, "--scan", "8x8", "--wall", "1h", "--out", &at("no.npz")], 2, "give a length");
    assert!(!Path::new(&at("no.npz")).exists());
}
