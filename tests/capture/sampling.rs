//! Scans of any shape: rectangles, rows, lists, random subsets, pairs that were not measured.

use fixtures::captures::{as_written, assert_error, capture, changed, place};
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, PairKind, read, read_with_notes, write};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;

/// A confocal capture of the given points, as a list.
fn list(points: Vec<DVec3>) -> Capture {
    let scan = [points.len(), 1];
    let mut made = capture(scan, 4, |p, b| (p + b) as f32);
    (made.laser, made.sensor) = (points.clone(), points);
    made
}

/// Points that form no lattice, spread over [0, width] x [0, height].
fn scattered(count: usize, width: f64, height: f64) -> Vec<DVec3> {
    let part = |k: usize, a: f64| (k as f64 * a).fract();
    // The corners, so that the range is known; the rest by a sequence of low discrepancy.
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    let inside = (4..count).map(|k| (part(k, 0.754_877_666), part(k, 0.569_840_291)));
    corners.into_iter().chain(inside).map(|(x, y)| dvec3(x * width, y * height, 0.0)).collect()
}

/// Every laser point with every sensor point.
fn exhaustive(lasers: &[DVec3], sensors: &[DVec3]) -> Capture {
    let scan = [lasers.len(), sensors.len()];
    let mut made = capture(scan, 3, |p, b| (3 * p + b) as f32);
    made.laser = lasers.iter().flat_map(|&l| std::iter::repeat_n(l, sensors.len())).collect();
    made.sensor = sensors.repeat(lasers.len());
    made
}

fn grid(nx: usize, ny: usize, shift: f64) -> Vec<DVec3> {
    (0..nx * ny).map(|k| dvec3(0.1 * (k / ny) as f64 + shift, 0.2 * (k % ny) as f64, 0.0)).collect()
}

#[test]
fn scans_of_any_shape_are_read_and_checked() {
    for scan in [[5, 5], [7, 3], [1, 9], [9, 1], [1, 1], [256, 256]] {
        let c = capture(scan, 2, |p, b| (p + b + 1) as f32);
        for ending in ["npz", "hdf5"] {
            let (_folder, path) = place(&format!("made.{ending}"));
            write(&c, &path).unwrap();
            let back = read(&path).unwrap();
            assert_eq!((back.scan, back.pair_kind(), back.resolution()), (scan, PairKind::Confocal, scan));
        }
    }
    let c = list(scattered(50, 1.0, 0.5));
    let (_folder, path) = place("made.npz");
    write(&c, &path).unwrap();
    assert_eq!(read(&path).unwrap(), c);
}

#[test]
fn irregular_points_have_the_spacing_of_their_area() {
    // 200 points on 1 m x 0.5 m: cells of 1/20 m, 20 by 10 of them.
    let c = list(scattered(200, 0.95, 0.45));
    assert!((c.spacing().unwrap() - 0.05).abs() < 1e-6, "{:?}", c.spacing());
    assert_eq!(c.resolution(), [20, 10]);
    let extent = c.wall_extent();
    let wanted = [-0.025, 0.975, -0.025, 0.475];
    assert!(extent.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{extent:?}");
    // A scan written as a list is recognised as a lattice.
    let mut c = capture([6, 4], 2, |_, _| 1.0);
    c.scan = [24, 1];
    assert_eq!((c.resolution(), c.spacing().map(|s| (s * 1e9).round())), ([6, 4], Some(1e8)));
    // With a hole it keeps its spacing; a few of its points have a spacing of their own.
    let holed = c.subset(20, 1).unwrap();
    assert_eq!((holed.resolution(), holed.spacing().map(|s| (s * 1e9).round())), ([6, 4], Some(1e8)));
    let few = capture([64, 64], 1, |_, _| 1.0).subset(1024, 3).unwrap();
    let [x, y] = few.resolution();
    assert!(x.abs_diff(32) <= 1 && y.abs_diff(32) <= 1, "{x} x {y}");
}

#[test]
fn an_exhaustive_capture_has_the_resolution_of_its_scanned_side() {
    let c = exhaustive(&grid(2, 3, 0.03), &grid(5, 4, 0.0));
    assert_eq!(c.pair_kind(), PairKind::Exhaustive { lasers: 6, sensors: 20 });
    assert_eq!(c.resolution(), [5, 4]);
    let extent = c.wall_extent();
    let wanted = [-0.05, 0.45, -0.1, 0.7];
    assert!(extent.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{extent:?}");
}

#[test]
fn a_subset_is_random_whole_and_repeatable() {
    let c = capture([10, 10], 3, |p, b| (10 * p + b) as f32);
    let s = c.subset(30, 7).unwrap();
    s.check().unwrap();
    assert_eq!((s.pair_count(), s.scan), (30, [30, 1]));
    for (k, point) in s.sensor.iter().enumerate() {
        let pair = c.sensor.iter().position(|p| p == point).unwrap();
        assert_eq!(s.histograms[3 * k..3 * k + 3], c.histograms[3 * pair..3 * pair + 3]);
    }
    assert_eq!(s, c.subset(30, 7).unwrap());
    assert_ne!(s, c.subset(30, 8).unwrap());
    assert_eq!(c.subset(100, 7).unwrap(), c);
    assert_error(c.subset(0, 1), Kind::Options, &["0 pairs of 100"]);
    assert_error(c.subset(101, 1), Kind::Options, &["101 pairs of 100", "1 to 100"]);
}

#[test]
fn stride_thins_both_sides_of_an_exhaustive_capture_and_refuses_lists() {
    let c = exhaustive(&grid(3, 3, 0.03), &grid(5, 4, 0.0));
    let s = c.stride(2).unwrap();
    assert_eq!(s.pair_kind(), PairKind::Exhaustive { lasers: 4, sensors: 6 });
    assert_eq!((s.scan, s.resolution()), ([4, 6], [3, 2]));
    let kept =
        c.laser.iter().zip(&c.sensor).position(|(l, p)| (*l, *p) == (s.laser[9], s.sensor[9])).unwrap();
    assert_eq!(s.histograms[27..30], c.histograms[3 * kept..3 * kept + 3]);
    let random = list(scattered(40, 1.0, 1.0));
    assert_error(random.stride(2), Kind::Options, &["stride of 2", "40 pairs", "random subset of 10 pairs"]);
    assert_eq!(random.stride(1).unwrap(), random);
    assert_eq!(capture([9, 1], 1, |_, _| 1.0).stride(2).unwrap().pair_count(), 5);
}

#[test]
fn pairs_that_were_not_measured_are_left_out_and_told() {
    let whole = capture([8, 8], 4, |_, _| 10.0);
    let mut c = whole.clone();
    c.laser[3] = DVec3::NAN;
    c.sensor[3].x = f64::NAN;
    c.sensor[9].y = f64::NAN;
    c.histograms[4 * 20..4 * 21].fill(f32::NAN);
    c.histograms[4 * 30..4 * 31].fill(0.0);
    let (left, dropped, notes) = c.clone().without_missing(false).unwrap();
    assert_eq!((dropped, left.pair_count(), left.scan), (4, 60, [60, 1]));
    left.check().unwrap();
    assert!(notes[0].contains("2 of 64") && notes[0].contains("point"), "{notes:?}");
    assert!(notes[1].contains("1 of 64") && notes[1].contains("histogram"), "{notes:?}");
    assert!(notes[2].contains("1 of 64") && notes[2].contains("no count at all"), "{notes:?}");
    // The points have not moved.
    assert_eq!((left.resolution(), left.spacing()), ([8, 8], whole.spacing()));
    assert_eq!(left.wall_extent(), whole.wall_extent());
    assert_eq!(left.sensor[3], whole.sensor[4]);
    // With few counts, or values that are not counts, a pair without signal may be real.
    let mut few = capture([8, 8], 4, |_, _| 5.0);
    few.histograms[..4].fill(0.0);
    assert_eq!(few.clone().without_missing(false).unwrap(), (few, 0, vec![]));
    let mut real = whole.clone();
    real.integer_counts = false;
    real.histograms[..4].fill(0.0);
    assert_eq!(real.clone().without_missing(false).unwrap().1, 0);
    // A histogram with some NaN is an error, and so are infinite points.
    let mut part = whole.clone();
    part.histograms[5] = f32::NAN;
    assert_error(part.without_missing(false).unwrap().0.check(), Kind::Input, &["pair 1", "bin 1", "NaN"]);
    let mut far = whole.clone();
    far.laser[2].x = f64::INFINITY;
    assert_error(far.without_missing(false).unwrap().0.check(), Kind::Input, &["pair 2", "inf"]);
    let mut none = whole;
    none.histograms.fill(f32::NAN);
    assert_error(none.without_missing(false), Kind::Input, &["64"]);
}

#[test]
fn a_file_with_unmeasured_points_is_read_with_a_note() {
    let points: Vec<f64> = (0..12)
        .flat_map(|k| if k == 7 { [f64::NAN; 3] } else { [(k / 4) as f64, (k % 4) as f64, 0.0] })
        .collect();
    let mut h = vec![3.0f32; 5 * 12];
    (0..5).for_each(|b| h[b * 12 + 2] = f32::NAN);
    let arrays = [
        ("H", Array::from_f32(&[5, 3, 4], &h)),
        ("sensor_xyz", Array::from_f64(&[3, 4, 3], &points)),
        ("laser_xyz", Array::from_f64(&[3, 4, 3], &points)),
        ("delta_t", Array::from_f64(&[], &[0.01])),
    ];
    let (_folder, path) = place("holes.npz");
    std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
    let opened = read_with_notes(&path).unwrap();
    assert_eq!((opened.dropped, opened.notes.len(), opened.capture.pair_count()), (2, 2, 10));
    assert_eq!(opened.capture.resolution(), [3, 4]);
    assert_eq!(opened.capture.pair_kind(), PairKind::Confocal);
}

#[test]
fn a_list_of_pairs_needs_no_second_axis() {
    let points: Vec<f64> = scattered(9, 1.0, 1.0).iter().flat_map(|p| p.to_array()).collect();
    let h: Vec<f32> = (0..4 * 9).map(|k| 1.0 + k as f32).collect();
    let stored = |axes: &[usize]| {
        let (h_shape, of_points) = ([&[4], axes].concat(), [axes, &[3]].concat());
        let arrays = [
            ("H", Array::from_f32(&h_shape, &h)),
            ("sensor_xyz", Array::from_f64(&of_points, &points)),
            ("laser_xyz", Array::from_f64(&of_points, &points)),
            ("delta_t", Array::from_f64(&[], &[0.01])),
        ];
        let (folder, path) = place("list.npz");
        std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
        (folder, read(&path))
    };
    let listed = stored(&[9]).1.unwrap();
    assert_eq!((listed.scan, listed.pair_kind()), ([9, 1], PairKind::Confocal));
    assert_eq!(listed.histograms[4..8], [2.0, 11.0, 20.0, 29.0]);
    assert_eq!(stored(&[9, 1]).1.unwrap(), listed);
}

#[test]
fn hot_pairs_are_left_out_and_told() {
    let mut c = capture([8, 8], 4, |p, b| (100 + p + b) as f32);
    c.histograms[4 * 20..4 * 21].fill(2000.0);
    let (left, dropped, notes) = c.clone().without_missing(false).unwrap();
    assert_eq!((dropped, left.pair_count(), notes.len()), (1, 63, 1));
    assert!(notes[0].contains("1 of 64") && notes[0].contains("8 times the counts"), "{notes:?}");
    assert_eq!(left.sensor[20], c.sensor[21]);
    let (_folder, path) = place("hot.npz");
    write(&c, &path).unwrap();
    assert_eq!(read_with_notes(&path).unwrap().dropped, 1);
    // Beside a dead pair, and where the scan is a list.
    c.histograms[..4].fill(0.0);
    assert_eq!(c.clone().without_missing(false).unwrap().1, 2);
    assert_eq!(changed(&c, |c| c.scan = [64, 1]).without_missing(false).unwrap().1, 2);
}

#[test]
fn exhaustive_captures_come_back_as_they_were() {
    let lean = |p: &DVec3| dvec3(p.x, 0.0, 1.0).normalize();
    let mut c = exhaustive(&grid(2, 3, 0.03), &grid(3, 4, 0.0));
    c.sensor_normal = Some(c.sensor.iter().map(lean).collect());
    let random = exhaustive(&scattered(5, 1.0, 1.0), &scattered(7, 0.8, 0.8));
    let mut shuffled = c.clone();
    shuffled.laser.swap(0, 5);
    shuffled.sensor.swap(0, 5);
    for ending in ["npz", "hdf5"] {
        for c in [&c, &random, &shuffled] {
            let (_folder, path) = place(&format!("made.{ending}"));
            write(c, &path).unwrap();
            assert!(read(&path).unwrap() == as_written(c, ending), "{ending}, scan {:?}", c.scan);
        }
    }
    // Stored compactly: each point once.
    let (_folder, path) = place("made.npz");
    write(&c, &path).unwrap();
    let mut npz = thirdbounce::files::archive::Npz::open(&path).unwrap();
    let mut shape = |name: &str| npz.get(name).unwrap().unwrap().shape.clone();
    assert_eq!(shape("H"), [3, 2, 3, 3, 4]);
    assert_eq!((shape("laser_xyz"), shape("sensor_normal")), (vec![2, 3, 3], vec![3, 4, 3]));
}

#[test]
fn lists_of_points_give_every_combination() {
    let h: Vec<f32> = (0..2 * 6).map(|v| v as f32).collect();
    let points = |n: usize| Array::from_f64(&[n, 3], &(0..3 * n).map(|v| v as f64).collect::<Vec<_>>());
    let file = |shape: &[usize], lasers: Array| {
        let arrays = [
            ("H", Array::from_f32(shape, &h)),
            ("laser_xyz", lasers),
            ("sensor_xyz", points(3)),
            ("laser_normal", Array::from_f64(&[1, 3], &[0.0, 0.0, 1.0])),
            ("delta_t", Array::from_f64(&[], &[9.0])),
        ];
        let (_folder, path) = place("lists.npz");
        std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
        read(&path)
    };
    let c = file(&[2, 2, 3], points(2)).unwrap();
    assert_eq!((c.scan, c.pair_kind()), ([2, 3], PairKind::Exhaustive { lasers: 2, sensors: 3 }));
    assert_eq!((c.laser[4], c.sensor[4]), (dvec3(3.0, 4.0, 5.0), dvec3(3.0, 4.0, 5.0)));
    assert_eq!((c.laser_normal.map(|n| n.len()), &c.histograms[8..10]), (Some(6), &[4.0, 10.0][..]));
    let grid = Array::from_f64(&[2, 1, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(file(&[2, 2, 1, 3], grid.clone()).unwrap().laser, c.laser);
    assert_error(file(&[2, 1, 2, 3], grid), Kind::Input, &["[2, 1, 2, 3]", "[T, Lx, Ly, Sx, Sy]"]);
}
