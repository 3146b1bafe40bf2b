//! The shape of a wall from the points' own returns.

use std::path::Path;

use fixtures::captures::{assert_error, place};
use fixtures::command::{fail, succeed};
use glam::DVec3;
use tag_fixtures::tags::{Writer, write};
use thirdbounce::Kind;
use thirdbounce::capture::{Flip, Turn, read};
use thirdbounce_tags::{Asked, Division, Scan, Zero, histogram};

const TICK: f64 = 4e-12;
const LIGHT: f64 = 299_792_458.0;
const SIDE: usize = 24;
const DEVICE: DVec3 = DVec3::new(0.3, -0.2, 1.4);
/// Laser pulses of a point, of which one in four gives a photon.
const PULSES: i64 = 2000;

/// The place where the beam of a point meets a wall with a bump, and a dent beside it; half of the wall is flat.
fn met(given: DVec3) -> DVec3 {
    let u = (given - DEVICE).normalize();
    let hill = |p: DVec3, x: f64, y: f64| (-60.0 * ((p.x - x).powi(2) + (p.y - y).powi(2))).exp();
    let depth = |p: DVec3| 0.06 * hill(p, 0.2, 0.15) - 0.04 * hill(p, -0.2, -0.2);
    let mut s = given.distance(DEVICE);
    for _ in 0..50 {
        let p = DEVICE + u * s;
        s += (depth(p) - p.z) / u.z;
    }
    DEVICE + u * s
}

/// The file of a scan of that wall: jitter of 60 ps, a delay of electronics, some dark counts.
fn measure(scan: &Scan, to: &Path) {
    let mut state = 77u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    let mut writer = Writer::new(0x0001_0307);
    for (at, given) in scan.laser.iter().enumerate() {
        let begin = at as i64 * PULSES;
        writer.marker(1, begin);
        let path = 2.0 * met(*given).distance(DEVICE) + 2.2;
        for sync in (begin..begin + PULSES).step_by(4) {
            let gauss = (-2.0 * random().ln()).sqrt() * (std::f64::consts::TAU * random()).cos();
            let delay = match random() < 0.05 {
                true => random() * 40e-9,
                false => path / LIGHT + gauss * 60e-12 / 2.3548,
            };
            writer.photon(1, sync, (delay / TICK) as u32);
        }
    }
    write(to, writer.file(TICK, 1e-7, &[]));
}

#[test]
fn a_bumped_wall_is_seen_by_its_own_returns() {
    let (folder, path) = place("wall.ptu");
    let scan = Scan::grid([SIDE, SIDE], 1.0, false).unwrap();
    measure(&scan, &path);
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = |more: &[&str], out: &str| {
        let [tags, out] = [at("wall.ptu"), at(out)];
        let scan = ["--scan", "24x24", "--wall", "1m", "--pixels", "1", "--until", "40ns", "--out", &out];
        succeed(&[&["histogram", &tags], &scan[..], more].concat());
        read(Path::new(&out)).unwrap()
    };
    let picture = at("check.png");
    let flat = run(&[], "flat.npz");
    let shaped = run(&["--seen-from", "30cm,-0.2,1.4m"], "shaped.npz");
    let both = run(&["--seen-from", "0.3,-0.2,1.4,30cm,-20cm,140cm", "--png", &picture], "both.npz");
    assert_eq!((&shaped.laser, &shaped.histograms), (&both.laser, &both.histograms));
    assert!(flat.laser.iter().all(|p| p.z.abs() < 1e-12) && shaped.scan == [SIDE, SIDE]);
    assert_eq!(shaped.histograms, flat.histograms, "path 0 is at the wall, wherever the wall is");
    let (mut worst, mut squares, mut depth) = (0.0f64, 0.0, [f64::INFINITY, f64::NEG_INFINITY]);
    for (found, given) in shaped.laser.iter().zip(&flat.laser) {
        let off = found.distance(met(*given));
        worst = worst.max(off);
        squares += off * off;
        depth = [depth[0].min(found.z), depth[1].max(found.z)];
    }
    let rms = (squares / (SIDE * SIDE) as f64).sqrt();
    println!("wall points are off by {:.2} mm RMS, {:.2} mm at most", 1e3 * rms, 1e3 * worst);
    assert!(rms < 6e-4 && worst < 2e-3, "{rms} {worst}");
    assert!((depth[0] + 0.04).abs() < 4e-3 && (depth[1] - 0.06).abs() < 4e-3, "{depth:?}");
    // The picture has a third map.
    let png = std::fs::read(&picture).unwrap();
    assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 1660);
    if let Some(keep) = std::env::var_os("THIRDBOUNCE_KEEP") {
        std::fs::copy(&picture, Path::new(&keep).join("wall.png")).unwrap();
    }
    // A turned scan turns its shape.
    let asked = Asked {
        division: Some(Division::Pixels { marker: 1, frame: None }),
        until: Some(40e-9),
        seen_from: Some([DEVICE; 2]),
        ..Asked::default()
    };
    let turn = Turn::of(Some(Flip::X), Some(90)).unwrap();
    let turned = histogram(&path, &scan, &Asked { turn, ..asked.clone() }).unwrap();
    assert!(
        turned.shaped && turned.notes.iter().any(|n| n.contains("their own returns")),
        "{:?}",
        turned.notes
    );
    let back = histogram(&path, &scan, &asked).unwrap().capture.turned(turn);
    assert_eq!(turned.capture.laser, back.laser);
    assert_eq!(turned.capture.histograms, back.histograms);
    let delay = Asked { zero: Zero::At(1e-8), ..asked.clone() };
    assert_error(histogram(&path, &scan, &delay), Kind::Options, &["shape of the wall"]);
    let behind = Asked { seen_from: Some([DEVICE, -DEVICE]), ..asked.clone() };
    assert_error(histogram(&path, &scan, &behind), Kind::Options, &["behind the wall", "hidden scene"]);
    let nowhere = Asked { seen_from: Some([DVec3::NAN; 2]), ..asked };
    assert_error(histogram(&path, &scan, &nowhere), Kind::Options, &["stand at"]);
    let [tags, out] = [at("wall.ptu"), at("no.npz")];
    let scan = ["histogram", &tags, "--scan", "24x24", "--wall", "1m", "--pixels", "1", "--out", &out];
    for (wrong, words) in [("1,2", "--seen-from"), ("1,2,x", "--seen-from"), ("galvo", "--seen-from")] {
        fail(&[&scan[..], &["--seen-from", wrong]].concat(), 1, words);
    }
}
