//! y-tal files: their layouts, the outer legs, and real ones against their plain twins.

use std::path::Path;

use fixtures::captures::{assert_error, place};
use glam::DVec3;
use thirdbounce::Kind;
use thirdbounce::capture::read;

/// A y-tal file in another layout than the writer's, or with devices.
fn ytal(
    path: &Path,
    format: i32,
    h_shape: &[usize],
    h: &[f64],
    laser: &[f64],
    sensor: &[f64],
    devices: Option<[f64; 3]>,
) {
    let file = rust_hdf5::H5File::create(path).unwrap();
    file.new_dataset::<f64>().shape(h_shape).create("H").unwrap().write_raw(h).unwrap();
    // A negative one is an empty value.
    match format {
        0.. => file.new_dataset::<i32>().shape([1]).create("H_format").unwrap().write_raw(&[format]).unwrap(),
        _ => drop(file.new_dataset::<f64>().null().create("H_format").unwrap()),
    }
    // Grids stand in the axes of H, lists are lists.
    let places = |n: usize, side: usize| match *h_shape {
        [_, x, y] if format != 4 && x * y == n => vec![x, y, 3],
        [_, lx, ly, sx, sy] => [[lx, ly, 3], [sx, sy, 3]][side].to_vec(),
        _ => vec![n, 3],
    };
    for (side, (name, points)) in
        [("laser_grid_xyz", laser), ("sensor_grid_xyz", sensor)].into_iter().enumerate()
    {
        file.new_dataset::<f64>()
            .shape(places(points.len() / 3, side))
            .create(name)
            .unwrap()
            .write_raw(points)
            .unwrap();
    }
    for name in ["laser_xyz", "sensor_xyz"] {
        match devices {
            Some(at) => file.new_dataset::<f64>().shape([3]).create(name).unwrap().write_raw(&at).unwrap(),
            None => drop(file.new_dataset::<f64>().null().create(name).unwrap()),
        }
    }
    for (name, value) in [("delta_t", 0.1), ("t_start", 2.0)] {
        file.new_dataset::<f64>().scalar().create(name).unwrap().write_raw(&[value]).unwrap();
    }
    file.new_dataset::<u8>()
        .scalar()
        .create("t_accounts_first_and_last_bounces")
        .unwrap()
        .write_raw(&[u8::from(format == 1 || devices.is_some())])
        .unwrap();
    file.close().unwrap();
}

#[test]
fn ytal_layouts() {
    let (_folder, path) = place("layout.hdf5");
    let points = |n: usize| (0..3 * n).map(|v| v as f64).collect::<Vec<_>>();
    let count = |n: usize| (0..n).map(|v| v as f64).collect::<Vec<_>>();
    // Two laser points, a 1 x 3 sensor grid, two bins.
    ytal(&path, 2, &[2, 2, 1, 1, 3], &count(12), &points(2), &points(3), None);
    let c = read(&path).unwrap();
    assert_eq!((c.scan, c.bins, c.t_start), ([2, 3], 2, 2.0));
    assert_eq!((c.laser[4], c.sensor[4]), (DVec3::new(3., 4., 5.), DVec3::new(3., 4., 5.)));
    assert_eq!((c.laser[3], c.sensor[3]), (DVec3::new(3., 4., 5.), DVec3::new(0., 1., 2.)));
    assert_eq!(c.histograms[2 * 4..2 * 4 + 2], [4.0, 10.0]);
    // The same as T_Li_Si.
    ytal(&path, 4, &[2, 2, 3], &count(12), &points(2), &points(3), None);
    assert_eq!(read(&path).unwrap(), c);
    // T_Si with one laser point.
    ytal(&path, 3, &[2, 3], &count(6), &points(1), &points(3), None);
    let c = read(&path).unwrap();
    assert_eq!((c.scan, c.laser[2], c.histograms[5]), ([3, 1], DVec3::new(0., 1., 2.), 5.0));
    ytal(&path, 3, &[2, 3], &count(6), &points(2), &points(3), None);
    assert_error(read(&path), Kind::Input, &["laser_grid_xyz", "[2, 3]"]);
    for (format, shape) in [(10, &[2, 3, 1][..]), (11, &[2, 1, 1, 3, 1]), (12, &[2, 3]), (13, &[2, 1, 3])] {
        ytal(&path, format, shape, &count(6), &points(1), &points(3), None);
        let words = ["frequencies", "time domain"];
        assert_error(read(&path), Kind::Input, &[&format!("H_format {format}"), words[0], words[1]]);
    }
}

#[test]
fn ytal_without_a_format_is_told_by_its_axes() {
    let (_folder, path) = place("format.hdf5");
    let points = |n: usize| (0..3 * n).map(|v| 0.001 * v as f64).collect::<Vec<_>>();
    let count = |n: usize| (0..n).map(|v| v as f64).collect::<Vec<_>>();
    for (format, shape, lasers, sensors) in [
        (1, &[2, 2, 3][..], 6, 6),
        (1, &[2, 1, 3], 1, 3),
        (2, &[2, 2, 1, 1, 3], 2, 3),
        (3, &[2, 6], 1, 6),
        (4, &[2, 2, 3], 2, 3),
    ] {
        let values = count(shape.iter().product());
        let read_as = |format: i32| {
            ytal(&path, format, shape, &values, &points(lasers), &points(sensors), Some([0.1, 0.2, -0.3]));
            read(&path).unwrap()
        };
        let reported = read_as(format);
        assert_eq!(read_as(-1), reported, "{shape:?} with an empty H_format");
        assert_eq!(read_as(0), reported, "{shape:?} with H_format 0");
    }
}

#[test]
fn outer_legs_go_from_every_layout() {
    let (_folder, path) = place("legs.hdf5");
    // Two laser points and three sensor points; both devices 1 m before the first ones, 1.3 m from the
    // others. Light in the bin that holds 0.55 m of inner path and the legs.
    let far = 0.69f64.sqrt();
    let (laser, sensor) = ([0.0, 0.0, 0.0, far, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, far, 0.0, 0.0, -far, 0.0]);
    let leg = |place: f64| 1f64.hypot(place);
    let pairs = [(0.0, 0.0), (0.0, far), (0.0, far), (far, 0.0), (far, far), (far, far)];
    let mut h = vec![0.0; 30 * 6];
    for (pair, (l, s)) in pairs.iter().enumerate() {
        h[((0.55 + leg(*l) + leg(*s) - 2.0) / 0.1) as usize * 6 + pair] = 3.0;
    }
    let device = Some([0.0, 0.0, -1.0]);
    let check = |format: i32, shape: &[usize], h: &[f64], laser: &[f64], sensor: &[f64], count: usize| {
        ytal(&path, format, shape, h, laser, sensor, device);
        let c = read(&path).unwrap();
        assert_eq!(c.pair_count(), count);
        for histogram in c.histograms.chunks_exact(c.bins) {
            assert!((histogram[5] - 3.0).abs() < 1e-5 && histogram.iter().sum::<f32>() == histogram[5]);
        }
    };
    check(2, &[30, 2, 1, 3, 1], &h, &laser, &sensor, 6);
    check(4, &[30, 2, 3], &h, &laser, &sensor, 6);
    let first: Vec<f64> = h.chunks_exact(6).flat_map(|bin| bin[..3].to_vec()).collect();
    check(3, &[30, 3], &first, &laser[..3], &sensor, 3);
    check(1, &[30, 3, 1], &first, &laser[..3], &sensor, 3);
}

#[test]
fn ytal_outer_legs_are_removed() {
    let (_folder, path) = place("legs.hdf5");
    // Two confocal points 0.3 m apart; both devices at the first one's side, 1 m before it.
    let points = [0.0, 0.0, 0.0, 0.75, 0.0, 0.0];
    let device = [0.0, 0.0, -1.0];
    // Legs: 2 x 1 m and 2 x 1.25 m. Inner path 0.55 m: recorded 2.55 m and 3.05 m.
    let mut h = vec![0.0; 20 * 2];
    h[5 * 2] = 4.0;
    h[10 * 2 + 1] = 8.0;
    ytal(&path, 1, &[20, 2, 1], &h, &points, &points, Some(device));
    let c = read(&path).unwrap();
    assert_eq!(c.t_start, 0.0);
    // Recorded up to 4.0 m, so inner paths are known up to 1.5 m by both.
    assert_eq!(c.bins, 15);
    for pair in 0..2 {
        let histogram = &c.histograms[15 * pair..15 * (pair + 1)];
        assert_eq!(histogram[5], [4.0, 8.0][pair], "{histogram:?}");
        assert_eq!(histogram.iter().sum::<f32>(), [4.0, 8.0][pair]);
    }
    // A shift by part of a bin keeps the counts: 1.03 m instead of 1 m moves the first pair 0.6 bins more.
    ytal(&path, 1, &[20, 2, 1], &h, &points, &points, Some([0.0, 0.0, -1.03]));
    let c = read(&path).unwrap();
    let first = &c.histograms[..c.bins];
    assert!((first.iter().sum::<f32>() - 4.0).abs() < 1e-5);
    let centre: f64 =
        (0..c.bins).map(|b| f64::from(first[b]) * (c.t_start + (b as f64 + 0.5) * c.bin_width)).sum();
    assert!((centre / 4.0 - (2.55 - 2.06)).abs() < 1e-6, "{centre}");
    // Light before it can have gone the legs: the flag is wrong, and they stay.
    let mut inner = vec![0.0; 40 * 2];
    inner[2 * 2] = 4.0;
    inner[7 * 2 + 1] = 8.0;
    ytal(&path, 1, &[40, 2, 1], &inner, &points, &points, Some([0.0, 0.0, -1.4]));
    let opened = thirdbounce::capture::read_with_notes(&path).unwrap();
    let notes = opened.notes.join(" ");
    assert!(notes.contains("100 % of the light comes before"), "{notes}");
    assert_eq!((opened.capture.t_start, opened.capture.histograms[2]), (2.0, 4.0));
    // Without devices the legs are unknown.
    ytal(&path, 1, &[20, 2, 1], &h, &points, &points, None);
    assert_error(read(&path), Kind::Input, &["laser_xyz", "t_accounts_first_and_last_bounces"]);
    // Devices so far away that no bin is left.
    ytal(&path, 1, &[20, 2, 1], &h, &points, &points, Some([0.0, 0.0, -9.0]));
    assert_error(read(&path), Kind::Input, &["leaves no valid range"]);
}

#[test]
fn ytal_points_that_were_not_measured_go_before_their_legs() {
    let (_folder, path) = place("holes.hdf5");
    let nan = f64::NAN;
    // Three confocal points: a sound one, one whose place is unknown, one without a histogram.
    let points = [0.0, 0.0, 0.0, nan, nan, nan, 0.75, 0.0, 0.0];
    let mut h = vec![0.0; 20 * 3];
    h[5 * 3] = 4.0;
    h[6 * 3 + 1] = 7.0;
    (0..20).for_each(|b| h[b * 3 + 2] = nan);
    ytal(&path, 1, &[20, 3, 1], &h, &points, &points, Some([0.0, 0.0, -1.0]));
    let opened = thirdbounce::capture::read_with_notes(&path).unwrap();
    assert_eq!((opened.dropped, opened.capture.pair_count(), opened.notes.len()), (2, 1, 2));
    assert_eq!(opened.capture.histograms[5], 4.0);
    assert_eq!(opened.capture.histograms.iter().sum::<f32>(), 4.0);
}

#[test]
fn a_chunk_of_absurd_size_is_refused() {
    // The oldest form of HDF5 has no checksums: the chunk's size can be changed in the file.
    let (_folder, path) = place("chunk.hdf5");
    let file = rust_hdf5::H5File::options().libver(rust_hdf5::LibverBound::Earliest).create(&path).unwrap();
    let h = file.new_dataset::<f32>().shape([9, 3, 2]).chunk(&[7, 3, 2]).deflate(6).create("H").unwrap();
    h.write_raw(&[1.0f32; 54]).unwrap();
    file.close().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let chunk: Vec<u8> = [7u32, 3, 2, 4].iter().flat_map(|v| v.to_le_bytes()).collect();
    let at = bytes.windows(16).position(|w| w == chunk).unwrap();
    bytes[at..at + 4].copy_from_slice(&0xfff0_0000u32.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    assert_error(read(&path), Kind::Input, &["dataset H claims", "4293918720"]);
}

/// y-tal's renders store normals as whole numbers of 64 bits, and enums as arrays of one.
#[test]
fn renders_have_whole_normals_and_enums_in_arrays() {
    let (_folder, path) = place("render.hdf5");
    let render = || {
        let file = rust_hdf5::H5File::create(&path).unwrap();
        let counts: Vec<f32> = (0..5 * 6).map(|v| v as f32).collect();
        file.new_dataset::<f32>().shape([5, 2, 3]).create("H").unwrap().write_raw(&counts).unwrap();
        for (name, value) in [("H_format", 1i64), ("laser_grid_format", 2), ("sensor_grid_format", 2)] {
            file.new_dataset::<i64>().shape([1]).create(name).unwrap().write_raw(&[value]).unwrap();
        }
        let points: Vec<f64> =
            (0..6).flat_map(|p| [0.1 * f64::from(p / 3), 0.1 * f64::from(p % 3), 0.0]).collect();
        let normals: Vec<i64> = [0, 0, 1].repeat(6);
        for side in ["laser", "sensor"] {
            let grid = |name: &str| format!("{side}_grid_{name}");
            let made = file.new_dataset::<f64>().shape([2, 3, 3]).create(&grid("xyz")).unwrap();
            made.write_raw(&points).unwrap();
            let made = file.new_dataset::<i64>().shape([2, 3, 3]).create(&grid("normals")).unwrap();
            made.write_raw(&normals).unwrap();
        }
        for (name, value) in [("delta_t", 0.1), ("t_start", 0.0)] {
            file.new_dataset::<f64>().scalar().create(name).unwrap().write_raw(&[value]).unwrap();
        }
        file.close().unwrap();
        read(&path).unwrap()
    };
    let c = render();
    assert_eq!((c.scan, c.bins, c.histogram(4)[1]), ([2, 3], 5, 10.0));
    let all = [c.laser_normal.unwrap(), c.sensor_normal.unwrap()].concat();
    assert!(all.iter().all(|n| *n == DVec3::Z), "{all:?}");
}
