//! What several test files share.
#![allow(dead_code)]

use std::path::PathBuf;

use glam::DVec3;
use thirdbounce::capture::Capture;
use thirdbounce::{Kind, Result};

/// A confocal scan of X x Y points 0.1 m apart; counts of (pair, bin) by a function.
pub fn capture(scan: [usize; 2], bins: usize, count: impl Fn(usize, usize) -> f32) -> Capture {
    let points: Vec<DVec3> = (0..scan[0])
        .flat_map(|ix| (0..scan[1]).map(move |iy| DVec3::new(0.1 * ix as f64, 0.1 * iy as f64 - 1.0, 0.0)))
        .collect();
    Capture {
        name: "made".into(),
        scan,
        laser: points.clone(),
        sensor: points,
        laser_normal: None,
        sensor_normal: None,
        bins,
        bin_width: 0.01,
        t_start: 0.5,
        histograms: (0..scan[0] * scan[1])
            .flat_map(|p| (0..bins).map(move |b| (p, b)))
            .map(|(p, b)| count(p, b))
            .collect(),
        integer_counts: true,
        pulse: None,
    }
}

pub fn ramp() -> Capture {
    capture([3, 2], 5, |p, b| (10 * p + b) as f32)
}

/// The error's text; it must be of `kind` and hold all of `words`.
pub fn assert_error<T: std::fmt::Debug>(result: Result<T>, kind: Kind, words: &[&str]) {
    let error = result.expect_err("an error");
    let text = error.to_string();
    assert_eq!(error.kind, kind, "{text}");
    for word in words {
        assert!(text.contains(word), "{text:?} does not mention {word:?}");
    }
    assert!(!error.mend.is_empty());
}

/// A folder that goes away, and a path in it.
pub fn place(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

/// The folder of real captures, if THIRDBOUNCE_DATA names one.
pub fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from).filter(|f| f.is_dir());
    if folder.is_none() {
        println!("skipped: THIRDBOUNCE_DATA names no folder of captures");
    }
    folder
}
