//! y-tal opens what is written in its form, and what it writes is read: check_ytal.py with y-tal (`pip install y-tal`).

use std::path::Path;
use std::process::Command;

use fixtures::captures::changed;
use glam::{DVec2, DVec3, dvec3};
use thirdbounce::capture::{Capture, read, write};
use thirdbounce_simulate::{Layout, Pairs, WallShape};

const HIDDEN: DVec3 = dvec3(0.12, -0.05, 0.6);

/// Counts of a small target, seen by these pairs of a 1 m wall.
fn target(name: &str, layout: Layout, shape: WallShape) -> Capture {
    let pairs = Pairs::new(layout, 12, 1.0, shape);
    let (bins, width) = (320, 0.01);
    let mut histograms = vec![0.0; pairs.laser.len() * bins];
    for (pair, (laser, sensor)) in pairs.laser.iter().zip(&pairs.sensor).enumerate() {
        let path = laser.distance(HIDDEN) + sensor.distance(HIDDEN);
        histograms[pair * bins + (path / width) as usize] = 40.0;
    }
    let mut made = Capture::new(pairs.scan, pairs.laser, pairs.sensor, bins, width, histograms);
    (made.laser_normal, made.sensor_normal) = (pairs.laser_normal, pairs.sensor_normal);
    (made.name, made.integer_counts) = (name.into(), true);
    made
}

pub fn ytal_opens_ours_and_we_open_its(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let [ours, theirs] = ["ours", "theirs"].map(|name| folder.path().join(name));
    for path in [&ours, &theirs] {
        std::fs::create_dir(path).unwrap();
    }
    let point = DVec2::new(0.1, 0.2);
    let captures = [
        target("confocal", Layout::Confocal, WallShape::Flat),
        target("one_laser", Layout::OneLaser { point }, WallShape::Flat),
        target("one_sensor", Layout::OneSensor { point }, WallShape::Flat),
        target("exhaustive", Layout::Exhaustive { lasers: 3 }, WallShape::Flat),
        target("bump", Layout::Exhaustive { lasers: 3 }, WallShape::Bump),
        // A name that YAML would take for something else.
        changed(&target("yes", Layout::OneLaser { point }, WallShape::Flat), |c| c.t_start = 0.02),
    ];
    for capture in &captures {
        write(capture, &ours.join(format!("{}.hdf5", capture.name))).unwrap();
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/check_ytal.py");
    let at = HIDDEN.to_array().map(|v| v.to_string());
    let output =
        Command::new(python).arg(script).args([&ours, &theirs]).args(at).output().expect("Python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    let wanted = format!("y-tal opened and wrote {} captures", captures.len());
    assert!(output.status.success() && text.contains(&wanted), "{text}{errors}");
    for capture in &captures {
        let file = format!("{}.hdf5", capture.name);
        let back = read(&theirs.join(&file)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(back, read(&ours.join(&file)).unwrap(), "{file}");
        assert!(back.histograms == capture.histograms && back.laser == capture.laser, "{file}");
    }
}
