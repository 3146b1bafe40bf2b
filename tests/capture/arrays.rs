//! Captures: checks, thinning, gates, summary.

use fixtures::captures::{assert_error, capture, changed, ramp};
use glam::DVec3;
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, Gate, auto_gate, light_gate, write};
use thirdbounce::job::load;
use thirdbounce::settings::Settings;

#[test]
fn a_good_capture_passes() {
    ramp().check().unwrap();
}

#[test]
fn each_fault_has_its_own_error() {
    let broken = |fault: &dyn Fn(&mut Capture), words: &[&str]| {
        let mut c = ramp();
        fault(&mut c);
        assert_error(c.check(), Kind::Input, words);
    };
    broken(&|c| c.histograms[2 * 5 + 3] = f32::NAN, &["pair 2", "ix 1, iy 0", "bin 3", "NaN"]);
    broken(&|c| c.histograms[5] = f32::INFINITY, &["pair 1", "bin 0", "inf"]);
    broken(&|c| c.histograms[7] = -4e6, &["no signal", "negative counts outweigh"]);
    broken(&|c| c.histograms.iter_mut().for_each(|v| *v = -*v), &["no signal", "upside down"]);
    broken(&|c| c.histograms.fill(0.0), &["no signal", "zero"]);
    broken(&|c| c.bin_width = 0.0, &["bin width is 0"]);
    broken(&|c| c.bin_width = f64::NAN, &["bin width is NaN"]);
    broken(&|c| c.t_start = f64::INFINITY, &["start of bin 0"]);
    broken(&|c| c.t_start = -9.0, &["before path 0"]);
    broken(&|c| c.laser[4].y = f64::NAN, &["pair 4", "laser point", "NaN"]);
    broken(&|c| c.sensor_normal = Some(vec![DVec3::Z * 2.0; 6]), &["pair 0", "sensor normal", "length 2"]);
    broken(&|c| c.laser_normal = Some(vec![DVec3::Z; 5]), &["5 laser normals", "6"]);
    broken(&|c| c.sensor.truncate(4), &["4 sensor points"]);
    broken(&|c| c.histograms.truncate(29), &["29 counts", "6 pairs of 5 bins"]);
    broken(&|c| c.scan = [3, 3], &["3 x 3", "6 pairs"]);
    broken(&|c| c.scan = [usize::MAX, 2], &["6 pairs"]);
    broken(&|c| c.bins = 0, &["no bin"]);
    broken(&|c| c.laser.clear(), &["no pair"]);
}

#[test]
fn stride_keeps_every_nth_point() {
    let c = capture([5, 4], 2, |p, b| (10 * p + b) as f32);
    let s = c.stride(2).unwrap();
    assert_eq!(s.scan, [3, 2]);
    assert_eq!(s.histograms[..4], [0.0, 1.0, 20.0, 21.0]);
    assert_eq!(s.sensor[3], c.sensor[2 * 4 + 2]);
    s.check().unwrap();
    assert_eq!(c.stride(1).unwrap(), c);
    assert_eq!(c.stride(100).unwrap().pair_count(), 1);
    assert_error(c.stride(0), Kind::Options, &["stride of 0"]);
}

#[test]
fn wall_extent_covers_the_cells() {
    let close = |c: &Capture, wanted: [f64; 4]| {
        let extent = c.wall_extent();
        assert!(extent.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{extent:?} is not {wanted:?}");
    };
    close(&capture([5, 4], 1, |_, _| 1.0), [-0.05, 0.45, -1.05, -0.65]);
    close(&capture([5, 1], 1, |_, _| 1.0), [-0.05, 0.45, -1.05, -0.95]);
    // One point: a square of half the longest path (0.51 m) around it.
    close(&capture([1, 1], 1, |_, _| 1.0), [-0.1275, 0.1275, -1.1275, -0.8725]);
    // Every laser point with one sensor point: the laser's side counts.
    let mut c = capture([5, 4], 1, |_, _| 1.0);
    c.sensor.fill(DVec3::new(7.0, 7.0, 0.0));
    close(&c, [-0.05, 0.45, -1.05, -0.65]);
    assert!(!c.is_confocal());
    // All combinations of 3 laser points and 4 sensor points.
    let mut c = capture([3, 4], 1, |_, _| 1.0);
    c.sensor = (0..12).map(|p| DVec3::new((p % 4 % 2) as f64, (p % 4 / 2) as f64, 0.0)).collect();
    c.laser = (0..12).map(|p| DVec3::new((p / 4) as f64, 0.0, 0.0)).collect();
    close(&c, [-0.5, 2.5, -0.5, 1.5]);
}

#[test]
fn confocal_and_planar_are_recognised() {
    let c = capture([4, 4], 1, |_, _| 1.0);
    assert!(c.is_confocal() && c.is_planar());
    let mut jitter = c.clone();
    jitter.sensor.iter_mut().for_each(|p| *p += DVec3::splat(1e-8));
    assert!(jitter.is_confocal() && jitter.is_planar());
    let mut bent = c.clone();
    bent.laser[3].z = 0.01;
    assert!(!bent.is_planar());
    let mut tilted = c;
    tilted.laser_normal = Some(vec![DVec3::new(0.1, 0.0, 1.0).normalize(); 16]);
    assert!(!tilted.is_planar());
}

#[test]
fn set_wall_scales_the_points() {
    let mut c = capture([5, 3], 1, |_, _| 1.0);
    c.set_wall(2.0).unwrap();
    assert!((c.sensor[14].x - c.sensor[0].x - 2.0).abs() < 1e-12);
    assert!((c.laser[2].y - c.laser[0].y - 1.0).abs() < 1e-12);
    assert_error(c.set_wall(-1.0), Kind::Options, &["-1"]);
    assert_error(c.set_wall(f64::NAN), Kind::Options, &["NaN"]);
    assert_error(capture([1, 1], 1, |_, _| 1.0).set_wall(1.0), Kind::Options, &["single scan point"]);
}

#[test]
fn gates_are_read() {
    let gate = |text| Gate::parse(text).unwrap();
    assert_eq!(gate("0.8:2.4"), Gate { from: 0.8, to: 2.4 });
    assert_eq!(gate(" 0.8 : "), Gate { from: 0.8, to: f64::INFINITY });
    assert_eq!(gate(":2.4"), Gate { from: f64::NEG_INFINITY, to: 2.4 });
    assert_eq!(gate(":").to_string(), ":");
    assert_eq!(gate("0.8:").to_string(), "0.8:");
    for text in ["", "1", "a:b", "2:1", "1:1", "nan:2", "1:inf", "1:2:3"] {
        assert_error(Gate::parse(text), Kind::Options, &["gate", "0.8:2.4"]);
    }
}

#[test]
fn gates_crop_bins() {
    let c = ramp();
    // Bins are [0.50, 0.51) ... [0.54, 0.55).
    let g = c.gated(Gate::parse("0.515:0.53").unwrap()).unwrap();
    assert_eq!((g.bins, g.t_start), (2, 0.51));
    assert_eq!(g.histograms, [1., 2., 11., 12., 21., 22., 31., 32., 41., 42., 51., 52.]);
    assert_eq!(c.gated(Gate::parse(":").unwrap()).unwrap(), c);
    assert_error(c.gated(Gate::parse("0.6:").unwrap()), Kind::Options, &["outside", "0.5500"]);
    assert_error(c.gated(Gate::parse(":0.5").unwrap()), Kind::Options, &["outside"]);
    assert_error(c.gated(Gate { from: f64::NAN, to: 1.0 }), Kind::Options, &["NaN"]);
    assert_error(c.gated(Gate { from: 2.0, to: 1.0 }), Kind::Options, &["2 m to 1 m is empty"]);
}

/// An indirect signal around bin 120, earlier or later by pair.
fn indirect(pair: usize, bin: usize) -> f32 {
    let peak = 110 + 3 * (pair % 8);
    30.0 * (-((bin as f32 - peak as f32) / 6.0).powi(2)).exp()
}

#[test]
fn a_direct_peak_is_gated_away() {
    let mut c = capture([8, 8], 256, |p, b| 2000.0 * (-(b as f32) / 5.0).exp() + indirect(p, b));
    c.t_start = 0.0;
    let found = auto_gate(&c).expect("a gate");
    assert!(found.gate.from > 0.15 && found.gate.from < 1.0, "{found:?}");
    assert!(found.reason.contains("direct light"));
    assert!(auto_gate(&c.gated(found.gate).unwrap()).is_none(), "once is enough");
}

#[test]
fn without_a_direct_peak_there_is_no_gate() {
    let gate = |count: &dyn Fn(usize, usize) -> f32| {
        let mut c = capture([8, 8], 256, count);
        c.t_start = 0.0;
        auto_gate(&c)
    };
    assert_eq!(gate(&indirect), None);
    assert_eq!(gate(&|_, _| 1.0), None);
    assert_eq!(gate(&|_, _| 0.0), None);
    // A peak with nothing after it may be the signal.
    assert_eq!(gate(&|_, b| 2000.0 * (-(b as f32) / 5.0).exp()), None);
    // A first surface near the wall, at another path for every pair.
    assert_eq!(gate(&|p, b| if b == p % 12 { 900.0 } else { indirect(p, b) }), None);
    // A flat surface parallel to the wall, far from it.
    assert_eq!(gate(&|p, b| if b == 60 { 900.0 } else { indirect(p, b) }), None);
}

/// Photons over a background, as a gated instrument records them: from bin 40 to 200 of 256, one column of the scan from bin 130.
#[test]
fn what_a_gated_instrument_did_not_record_is_not_taken_as_dark() {
    let late = |pair: usize| pair / 8 == 5;
    let recorded = |pair: usize, bin: usize| (if late(pair) { 130 } else { 40 }..200).contains(&bin);
    let count = |p: usize, b: usize| {
        if recorded(p, b) { (20.0 * indirect(p, b)).round() + 10.0 + (p / 8) as f32 } else { 0.0 }
    };
    let mut c = capture([8, 8], 256, count);
    c.integer_counts = true;
    let (edge, end) = (c.t_start + 40.0 * c.bin_width, c.t_start + 200.0 * c.bin_width);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gated.npz");
    write(&c, &path).unwrap();
    let loaded = load(&path, &Settings::default()).unwrap();
    let notes = loaded.notes.join("\n");
    assert!(
        notes.contains("8 pairs were not recorded") && notes.contains("the instrument recorded"),
        "{notes}"
    );
    let gate = loaded.gate.expect("a gate");
    // Of them, captured counts keep what is not behind nearly all light.
    assert!(gate.from >= edge - 1e-9 && gate.to <= end + 1e-9, "{gate}");
    assert!(loaded.capture.histograms.iter().all(|v| *v > 0.0), "no zeros of a closed detector are left");
    // Whoever asks for all bins gets the file's own counts.
    let all = load(&path, &Settings::default().with(|s| s.auto_gate = Some(false))).unwrap();
    assert_eq!((all.capture.histograms, all.gate), (c.histograms, None));
}

#[test]
fn the_summary_says_what_there_is() {
    let s = ramp().summary();
    assert_eq!((s.pairs, s.bins, s.signal_bins, s.peak), (6, 5, Some([0, 4]), 54.0));
    assert_eq!((s.peak_pair, s.peak_bin, s.total), (5, 4, (0..6).map(|p| 50 * p + 10).sum::<i32>() as f64));
    assert!((s.bin_width_ps - 33.356).abs() < 1e-3);
    let text = s.to_string();
    assert!(text.contains("3 x 2 = 6 pairs, confocal") && text.contains("pair 5 (ix 2, iy 1)"), "{text}");
    let json = serde_json::to_string(&s).unwrap();
    assert_eq!(serde_json::from_str::<thirdbounce::capture::Summary>(&json).unwrap(), s);
}

#[test]
fn the_end_of_the_light_does_not_depend_on_the_record() {
    // Light of two surfaces over a background, and noise.
    let count = |p: usize, b: usize| {
        let light = if (20..26).contains(&b) {
            40.0
        } else if (60..66).contains(&b) {
            10.0
        } else {
            0.0
        };
        light + 5.0 + ((7 * p + 13 * b + b * b) % 5) as f32
    };
    let ends = [128, 512, 2048].map(|bins| {
        let c = capture([8, 8], bins, count);
        let gate = light_gate(&c, None).expect("an end").gate;
        assert_eq!(gate.from, f64::NEG_INFINITY);
        ((gate.to - c.t_start) / c.bin_width).round() as usize
    });
    assert!(ends.iter().all(|end| (62..70).contains(end)), "{ends:?}");
    // Light in front of that does not count.
    let c = capture([8, 8], 512, |p, b| if b < 4 { 9000.0 } else { count(p, b) });
    let end = |after| ((light_gate(&c, after).unwrap().gate.to - c.t_start) / c.bin_width).round() as usize;
    assert!(end(None) <= 26 && end(Some(c.edge(8))) > 60, "{} {}", end(None), end(Some(c.edge(8))));
    // With light up to the end of the record, nothing is left out.
    assert_eq!(light_gate(&capture([8, 8], 128, |_, b| b as f32), None), None);
}

#[test]
fn direct_light_is_found_over_a_background() {
    let c = capture([8, 8], 256, |p, b| 2000.0 * (-(b as f32) / 5.0).exp() + indirect(p, b) + 25.0);
    let c = changed(&c, |c| c.t_start = 0.0);
    let found = auto_gate(&c).expect("a gate");
    assert!(found.gate.from > 0.15 && found.gate.from < 1.0, "{found:?}");
}

#[test]
fn published_gate_is_the_half_of_the_bins_with_the_most_counts() {
    // A bright bin 3 (in the first 15 % of 40, so dropped), signal in bins 20 to 25.
    let c = capture([2, 2], 40, |_, b| match b {
        3 => 1000.0,
        20..26 => 10.0,
        _ => 1.0,
    });
    let gate = thirdbounce::capture::published_gate(&c, None).gate;
    let kept = c.gated(gate).unwrap();
    assert_eq!(kept.bins, 20);
    let first = ((kept.t_start - c.t_start) / c.bin_width).round() as usize;
    assert!((6..=20).contains(&first), "{first}");
    assert_eq!(kept.histograms.iter().fold(0.0f32, |a, b| a.max(*b)), 10.0);
}

#[test]
fn published_gate_does_not_count_direct_light() {
    let c = capture([2, 2], 40, |_, b| match b {
        8..12 => 100.0,
        30..36 => 10.0,
        _ => 0.0,
    });
    let with = thirdbounce::capture::published_gate(&c, Some(c.t_start + 15.0 * c.bin_width)).gate;
    assert!(
        with.from > c.t_start + 12.0 * c.bin_width && with.to >= c.t_start + 35.5 * c.bin_width,
        "{with}"
    );
    let without = thirdbounce::capture::published_gate(&c, None).gate;
    assert!(without.from < c.t_start + 9.0 * c.bin_width, "{without}");
}
