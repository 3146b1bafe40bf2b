//! Captures made smaller, written and read again: every count is kept, and warnings are reported.

use fixtures::captures::{assert_error, capture, place, ramp, total};
use glam::{DVec3, dvec3};
use thirdbounce::capture::{Capture, ReadOptions, read_given, write};
use thirdbounce::{Kind, export};

/// A confocal scan of a 1 m wall that sees one point.
fn one_point(n: usize, hidden: DVec3) -> Capture {
    let mut c = capture([n, n], 240, |_, _| 0.0);
    (c.t_start, c.bin_width) = (0.0, 0.01);
    for p in 0..n * n {
        let at = |i: usize| i as f64 / (n - 1) as f64 - 0.5;
        let wall = dvec3(at(p / n), at(p % n), 0.0);
        (c.laser[p], c.sensor[p]) = (wall, wall);
        let bin = (2.0 * wall.distance(hidden) / c.bin_width) as usize;
        c.histograms[p * c.bins + bin] = 50.0;
    }
    c
}

#[test]
fn bins_are_summed_and_none_is_lost() {
    let c = ramp();
    let two = c.binned(2).unwrap();
    assert_eq!((two.bins, two.bin_width, two.t_start), (3, 0.02, 0.5));
    assert_eq!(two.histograms[..3], [1.0, 5.0, 4.0]);
    assert_eq!(total(&two), total(&c));
    assert_eq!(c.binned(1).unwrap(), c);
    assert_eq!(c.binned(5).unwrap().bins, 1);
    for wrong in [0, 6] {
        assert_error(c.binned(wrong), Kind::Options, &["bins cannot be summed", "1 to 5"]);
    }
}

#[test]
fn neighbouring_histograms_are_summed_at_their_middle() {
    let c = capture([4, 2], 3, |p, b| (10 * p + b) as f32);
    let sum = c.summed(2).unwrap();
    assert_eq!((sum.scan, sum.pair_count()), ([2, 1], 2));
    // Pairs 0, 1, 2, 3 of ix 0 and 1.
    assert_eq!(sum.histograms[..3], [60.0, 64.0, 68.0]);
    assert!(sum.laser[0].distance(dvec3(0.05, -0.95, 0.0)) < 1e-12);
    assert_eq!((total(&sum), sum.integer_counts), (total(&c), true));
    assert_eq!(c.summed(1).unwrap(), c);
    for wrong in [0, 3] {
        assert_error(c.summed(wrong), Kind::Options, &["histograms cannot be summed", "4 x 2"]);
    }
    let mut list = c.clone();
    for (p, l) in list.laser.iter_mut().enumerate() {
        l.x += 0.01 * (p * p) as f64;
    }
    assert_error(list.summed(2), Kind::Options, &["histograms cannot be summed", "stride"]);
}

#[test]
fn the_stanford_form_comes_back() {
    let c = one_point(6, dvec3(0.1, 0.05, 0.6));
    let (_folder, path) = place("made.mat");
    let notes = write(&c, &path).unwrap();
    assert!(notes.join("").contains("wall size, 1 m, and the bin width, 0.01 m"), "{notes:?}");
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes.starts_with(b"MATLAB 7.3 MAT-file") && bytes[124..128] == *b"\x00\x02IM");
    let given = ReadOptions::default().with_wall(1.0).with_bin_width(0.01);
    let back = read_given(&path, &given).unwrap().capture;
    assert_eq!((back.scan, back.bins, back.integer_counts), (c.scan, c.bins, true));
    assert!(back.histograms == c.histograms);
    for (a, b) in back.laser.iter().zip(&c.laser) {
        assert!(a.distance(*b) < 1e-12);
    }
    let mut late = c.clone();
    late.t_start = 0.1;
    assert_error(write(&late, &path), Kind::Options, &["Stanford", "0.1 m", ".npz"]);
    let mut apart = c.clone();
    apart.laser.fill(DVec3::ZERO);
    assert_error(write(&apart, &path), Kind::Options, &["Stanford", "apart"]);
    let mut bent = c;
    (bent.laser[7].z, bent.sensor[7].z) = (0.1, 0.1);
    assert_error(write(&bent, &path), Kind::Options, &["lattice"]);
}

#[test]
fn warnings_are_said_and_sound_captures_have_none() {
    let c = one_point(12, dvec3(0.2, 0.1, 0.4));
    assert_eq!(c.warnings(), Vec::<String>::new());
    // Half the wall's width is given as the whole.
    let mut narrow = c.clone();
    narrow.set_wall(0.5).unwrap();
    let warnings = narrow.warnings().join("\n");
    assert!(warnings.contains("half its width") && warnings.contains("wall is larger"), "{warnings}");
    // Time zero is far too late: light arrives before it left.
    let mut early = c.clone();
    early.laser.fill(dvec3(0.0, 0.0, 0.0));
    early.t_start = -0.8;
    let warnings = early.warnings().join("\n");
    assert!(warnings.contains("before light can") && warnings.contains("t_start"), "{warnings}");
    let mut empty = c;
    empty.histograms[240 * 20..].fill(0.0);
    assert!(empty.warnings().join("").contains("124 of 144"), "{:?}", empty.warnings());
}

#[test]
fn a_capture_is_drawn() {
    let (_folder, path) = place("capture.png");
    for c in [one_point(12, dvec3(0.2, 0.1, 0.4)), ramp(), capture([1, 1], 1, |_, _| 3.0)] {
        export::inspection::write(&path, &c).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgb).unwrap();
        assert!(info.width > 800 && info.height > 600);
        // Paper, curve and the colours of the maps.
        for wanted in [[255, 255, 255], [0, 114, 178], [253, 231, 37]] {
            assert!(rgb.chunks_exact(3).any(|p| *p == wanted), "{wanted:?} is nowhere");
        }
    }
    // The pair of the largest x and y has all the counts: the upper left corner of the second map is bright, as the
    // upper end of its bar is, and the lower right one is dark.
    let corner = capture([2, 2], 4, |p, _| if p == 3 { 100.0 } else { 1.0 });
    export::inspection::write(&path, &corner).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    let width = reader.next_frame(&mut rgb).unwrap().width as usize;
    let at = |x: usize, y: usize| [0, 1, 2].map(|c| rgb[3 * (y * width + x) + c]);
    assert_eq!((at(630 + 20, 450), at(630 + 360, 790)), ([253, 231, 37], [68, 1, 84]));
    assert_eq!((at(630 + 400, 430), at(630 + 400, 809)), ([253, 231, 37], [68, 1, 84]));
    let mut silent = ramp();
    silent.histograms.fill(0.0);
    assert_error(export::inspection::write(&path, &silent), Kind::Input, &["no signal"]);
}
