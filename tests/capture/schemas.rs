//! Formats without a sample: files built from their schemas, in both axis orders, are read as their schema means them.

use std::path::{Path, PathBuf};

use fixtures::captures::{assert_error, place};
use fixtures::files::{Matrix, Stored, hdf5, matlab5, matlab5_struct, matrix, scalar, vector};
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::{
    Bounce, Capture, Flip, METRES_PER_PICOSECOND, ReadOptions, Turn, read, read_given,
};

/// Counts of (t, x, y): all different, so that every axis that is mixed up shows.
fn count(t: usize, x: usize, y: usize) -> f64 {
    (1 + t + 10 * x + 100 * y) as f64
}

/// Writes arrays as HDF5 of either axis order and as MATLAB v5 of either byte order, plain and compressed, and
/// passes each file to `check`. The fixture has MATLAB's order; an HDF5 file written by a C program has it reversed.
fn every_file(arrays: &[Matrix], check: impl Fn(&Path, &str)) {
    let (_folder, path) = place("made.mat");
    hdf5(&path, arrays);
    check(&path, "v7.3");
    for stored in [Stored::Plain, Stored::BigEndian, Stored::Compressed] {
        std::fs::write(&path, matlab5(arrays, stored)).unwrap();
        check(&path, "v5");
    }
}

const GRID: [usize; 2] = [3, 2];
const BINS: usize = 40;
const WIDTH: f64 = 0.05;

/// The wall of the Z-NLOS fixtures: x and z across, facing -y.
fn wall_point(x: usize, y: usize) -> DVec3 {
    dvec3(0.2 * x as f64 - 0.2, 0.0, 0.3 * y as f64 - 0.15)
}

fn znlos(bounces: usize, confocal: bool) -> Vec<Matrix> {
    // Camera and laser are placed so that every outer leg is a whole number of bins for the middle column only.
    let camera = dvec3(0.0, -1.0, 0.0);
    let positions = |name: &str| matrix(name, &[3, GRID[0], GRID[1]], |at| wall_point(at[1], at[2])[at[0]]);
    let normals = |name: &str| matrix(name, &[3, GRID[0], GRID[1]], |at| if at[0] == 1 { -1.0 } else { 0.0 });
    // One path: that of a point at the wall's inner side, in the bin it falls into with its legs.
    let hidden = dvec3(0.1, -0.6, 0.05);
    let inner = |x: usize, y: usize| 2.0 * wall_point(x, y).distance(hidden);
    let outer = |x: usize, y: usize| 2.0 * wall_point(x, y).distance(camera);
    let value = |t: usize, bounce: usize, x: usize, y: usize| {
        let bin = ((inner(x, y) + outer(x, y)) / WIDTH) as usize;
        if t == bin && bounce == 1.min(bounces - 1) {
            100.0
        } else if t + bounce == 5 {
            7.0
        } else {
            0.0
        }
    };
    let data = if confocal {
        matrix("data", &[2, 100, bounces, GRID[0], GRID[1]], |a| value(a[1], a[2], a[3], a[4]))
    } else {
        // A single laser point in the middle of the wall, whose path is made up from the same numbers.
        matrix("data", &[2, 100, bounces, GRID[0], GRID[1], 1, 1], |a| value(a[1], a[2], a[3], a[4]))
    };
    let mut all = vec![
        data,
        positions("cameraGridPositions"),
        normals("cameraGridNormals"),
        vector("cameraPosition", &camera.to_array()),
        vector("laserPosition", &camera.to_array()),
        vector("hiddenVolumePosition", &hidden.to_array()),
        scalar("deltaT", WIDTH),
        scalar("t0", 0.0),
        scalar("t", 100.0),
        scalar("isConfocal", f64::from(u8::from(confocal))),
    ];
    if confocal {
        all.extend([positions("laserGridPositions"), normals("laserGridNormals")]);
    } else {
        all.push(matrix("laserGridPositions", &[3, 1, 1], |_| 0.0));
        all.push(matrix("laserGridNormals", &[3, 1, 1], |at| if at[0] == 1 { -1.0 } else { 0.0 }));
    }
    all
}

/// The bright bin of each pair: that of the path wall, hidden point, wall.
fn assert_confocal_paths(c: &Capture, what: &str) {
    assert_eq!(c.scan, GRID, "{what}");
    let hidden = dvec3(0.1, 0.05, 0.6);
    for (p, (l, s)) in c.laser.iter().zip(&c.sensor).enumerate() {
        let (ix, iy) = (p / 2, p % 2);
        assert!(s.distance(dvec3(0.2 * ix as f64 - 0.2, 0.3 * iy as f64 - 0.15, 0.0)) < 1e-9, "{what}: {s}");
        assert_eq!(l, s);
        let h = &c.histograms[p * c.bins..(p + 1) * c.bins];
        let bright = (0..c.bins).max_by(|a, b| h[*a].total_cmp(&h[*b])).unwrap();
        let path = c.t_start + (bright as f64 + 0.5) * c.bin_width;
        let wanted = l.distance(hidden) + s.distance(hidden);
        assert!((path - wanted).abs() < 1.01 * c.bin_width, "{what}: pair {p} at {path}, not {wanted}");
    }
    for n in c.laser_normal.iter().chain(&c.sensor_normal).flatten() {
        assert!(n.distance(DVec3::Z) < 1e-12);
    }
}

#[test]
fn znlos_confocal_in_both_axis_orders() {
    let arrays = znlos(4, true);
    let reversed: Vec<Matrix> = arrays.iter().map(Matrix::reversed).collect();
    for (arrays, order) in [(&arrays, "reversed in HDF5"), (&reversed, "in the order of the format")] {
        every_file(arrays, |path, kind| {
            let what = format!("{kind}, {order}");
            let opened = read_given(path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_confocal_paths(&opened.capture, &what);
            // Two colours of 100 counts, split between two bins at most.
            let total: f32 = opened.capture.histograms.iter().sum();
            assert!((total - 6.0 * 200.0).abs() < 1e-2, "{what}: {total}");
            let notes = opened.notes.join("\n");
            assert!(
                notes.contains("only bounce 3 of") && notes.contains("summed") && notes.contains("+z"),
                "{notes}"
            );
            let with = |bounce| {
                let given = ReadOptions::default().with_bounce(bounce);
                read_given(path, &given).map(|o| o.capture.histograms.iter().sum::<f32>())
            };
            let all = with(Bounce::All).unwrap();
            assert!(all >= total, "{what}: {all}");
            assert_error(with(Bounce::Nth(6)), Kind::Options, &["bounce 6 was given", "2 to 5"]);
        });
    }
}

#[test]
fn znlos_without_colours_with_one_list_of_points() {
    // The counts of one colour, [t, bounce, x, y], and every position in one list in the order of the histograms.
    let one_colour = |arrays: &[Matrix], at: &dyn Fn(usize) -> [usize; 2]| -> Vec<Matrix> {
        let whole = &arrays[0];
        let data = matrix("data", &whole.dims[1..], |a| whole.at(&[0, a[0], a[1], a[2], a[3]]));
        let listed = arrays[1..].iter().map(|m| match &m.dims[..] {
            [3, 3, 2] => matrix(&m.name, &[3, 6, 1], |a| m.at(&[a[0], at(a[1])[0], at(a[1])[1]])),
            _ => m.clone(),
        });
        std::iter::once(data).chain(listed).collect()
    };
    // MATLAB stores its first axis fastest, a C program its last.
    let matlab = one_colour(&znlos(4, true), &|p| [p % 3, p / 3]);
    let plain = one_colour(&znlos(4, true), &|p| [p / 2, p % 2]);
    let plain: Vec<Matrix> = plain.iter().map(Matrix::reversed).collect();
    for (arrays, order) in [(&matlab, "MATLAB"), (&plain, "C")] {
        every_file(arrays, |path, kind| {
            let c = read(path).unwrap_or_else(|e| panic!("{kind}, {order}: {e}"));
            assert_confocal_paths(&c, &format!("{kind}, {order}"));
            let total: f32 = c.histograms.iter().sum();
            assert!((total - 6.0 * 100.0).abs() < 1e-2, "{kind}, {order}: {total}");
        });
    }
    // A list of another length is still refused.
    let mut short = matlab.clone();
    short[1] = matrix("cameraGridPositions", &[3, 5, 1], |_| 0.1);
    short.remove(2);
    let (_folder, path) = place("made.hdf5");
    hdf5(&path, &short);
    assert_error(read(&path), Kind::Input, &["[2, 3, 4, 100] for 1 x 5 camera points"]);
}

#[test]
fn znlos_with_one_laser_point() {
    let arrays = znlos(4, false);
    let reversed: Vec<Matrix> = arrays.iter().map(Matrix::reversed).collect();
    for arrays in [&arrays, &reversed] {
        every_file(arrays, |path, what| {
            let c = read(path).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_eq!((c.scan, c.pair_count()), (GRID, 6), "{what}");
            assert!(c.laser.iter().all(|l| l.length() < 1e-9));
            assert!(c.sensor[5].distance(dvec3(0.2, 0.15, 0.0)) < 1e-9, "{what}: {}", c.sensor[5]);
            let total: f32 = c.histograms.iter().sum();
            assert!((total - 6.0 * 200.0).abs() < 1e-2, "{what}: {total}");
        });
    }
}

#[test]
fn znlos_exhaustive() {
    // Two by one laser points and three by two sensor points, legs of no length.
    let data =
        matrix("data", &[1, 8, 1, 3, 2, 2, 1], |a| (1 + a[1] + 10 * a[3] + 100 * a[4] + 1000 * a[5]) as f64);
    let arrays = [
        data.clone(),
        matrix("cameraGridPositions", &[3, 3, 2], |a| [0.1 * a[1] as f64, 0.1 * a[2] as f64, 0.0][a[0]]),
        matrix("laserGridPositions", &[3, 2, 1], |a| [0.3 * a[1] as f64, 0.05, 0.0][a[0]]),
        vector("cameraPosition", &[0.0, 0.0, 0.0]),
        vector("laserPosition", &[0.0, 0.0, 0.0]),
        scalar("deltaT", 0.5),
    ];
    let reversed: Vec<Matrix> = arrays.iter().map(Matrix::reversed).collect();
    let mut seen = Vec::new();
    for arrays in [&arrays[..], &reversed] {
        let (_folder, path) = place("made.hdf5");
        hdf5(&path, arrays);
        let c = read(&path).unwrap();
        assert_eq!(c.scan, [2, 6]);
        for p in 0..12 {
            let (l, s) = (p / 6, p % 6);
            assert!(c.laser[p].distance(dvec3(0.3 * l as f64, 0.05, 0.0)) < 1e-9);
            assert!(c.sensor[p].distance(dvec3(0.1 * (s / 2) as f64, 0.1 * (s % 2) as f64, 0.0)) < 1e-9);
            // The legs are shorter than a bin: counts move by less than one bin and keep their sum, except those that fall
            // before path 0.
            let most = c.histograms[p * c.bins..(p + 1) * c.bins].iter().fold(0.0f32, |a, b| a.max(*b));
            let wanted = (8 + 10 * (s / 2) + 100 * (s % 2) + 1000 * l) as f32;
            assert!(most <= wanted && most > wanted - 3.0, "pair {p}: {most}, not {wanted}");
        }
        seen.push(c);
    }
    assert_eq!(seen[0], seen[1]);
}

#[test]
fn znlos_that_does_not_fit() {
    let without = |name: &str| {
        let (_folder, path) = place("made.hdf5");
        hdf5(&path, &znlos(4, true).into_iter().filter(|m| m.name != name).collect::<Vec<_>>());
        read(&path)
    };
    for name in ["deltaT", "cameraPosition"] {
        assert_error(without(name), Kind::Input, &["made.hdf5", name, "holds"]);
    }
    without("t").unwrap();
    without("hiddenVolumePosition").unwrap();
    let (_folder, path) = place("made.hdf5");
    let mut arrays = znlos(4, true);
    arrays[0] = matrix("data", &[2, 99, 4, 3, 2], |_| 1.0);
    hdf5(&path, &arrays);
    assert_error(read(&path), Kind::Input, &["[2, 3, 4, 99, 2]", "t = 100"]);
    let given = ReadOptions::default().with_bin_width(0.1);
    assert_error(read_given(&path, &given), Kind::Options, &["a bin width was given"]);
}

#[test]
fn netf_counts_one_way() {
    let mut arrays = vec![
        matrix("data", &[BINS, 3, 2], |a| count(a[0], a[1], a[2])).of_counts(),
        matrix("cameraGridPositions", &[3, 6], |a| {
            [0.2 - 0.2 * (a[1] / 2) as f64, 0.0, 0.1 * (a[1] % 2) as f64][a[0]]
        }),
        vector("hiddenVolumePosition", &[0.0, -0.8, 0.0]),
        scalar("deltaT", 0.01),
    ];
    let (_folder, path) = place("netf.mat");
    for (width, metres) in [(0.01, 0.02), (32e-12, 0.0191867)] {
        arrays[3] = scalar("deltaT", width);
        for stored in [Stored::Plain, Stored::Compressed] {
            std::fs::write(&path, matlab5(&arrays, stored)).unwrap();
            let c = read(&path).unwrap();
            assert!((c.bin_width - metres).abs() < 1e-7, "{}", c.bin_width);
            assert_eq!((c.scan, c.bins, c.integer_counts), ([3, 2], BINS, true));
            // i runs along -x in the file; ours along +x.
            assert!(c.sensor[0].distance(dvec3(-0.2, 0.0, 0.0)) < 1e-9, "{}", c.sensor[0]);
            assert_eq!(f64::from(c.histograms[3]), count(3, 2, 0));
            assert_eq!(f64::from(c.histograms[5 * BINS + 4]), count(4, 0, 1));
        }
    }
}

#[test]
fn general_nlos_folder_in_both_axis_orders() {
    let arrays = |reversed: bool| {
        let points = |name: &str, shift: f64| {
            matrix(name, &[3, 2, 3], move |a| {
                [0.1 * a[0] as f64, 0.2 * a[1] as f64 + shift, 0.03 * a[0] as f64][a[2]]
            })
        };
        let all = [
            matrix("data", &[3, 2, BINS], |a| count(a[2], a[0], a[1])).of_counts(),
            points("laserpoints", 0.0),
            points("detectpoints", 0.05),
        ];
        if reversed { all.map(|m| m.reversed()) } else { all }
    };
    for reversed in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let [data, lasers, sensors] = arrays(reversed);
        let files: [(&str, Vec<Matrix>); 2] =
            [("scan_01.mat", vec![data]), ("setup.mat", vec![lasers, sensors])];
        for (name, arrays) in files {
            hdf5(&folder.path().join(name), &arrays);
            if !reversed {
                std::fs::write(folder.path().join(name), matlab5(&arrays, Stored::Compressed)).unwrap();
            }
        }
        let opened = read_given(folder.path(), &ReadOptions::default()).unwrap();
        let c = opened.capture;
        assert!(opened.notes.iter().any(|n| n.contains("32 ps") && n.contains("bin width")));
        assert_eq!((c.scan, c.bins), ([3, 2], BINS));
        assert!(c.laser[5].distance(dvec3(0.2, 0.2, 0.06)) < 1e-9);
        assert!(c.sensor[1].distance(dvec3(0.0, 0.25, 0.0)) < 1e-9);
        assert_eq!(f64::from(c.histograms[5 * BINS + 7]), count(7, 2, 1));
        std::fs::remove_file(folder.path().join("scan_01.mat")).unwrap();
        assert_error(read(folder.path()), Kind::Input, &["no file with data", "General-NLOS"]);
    }
}

#[test]
fn phasor_field_2019() {
    // Two camera points, three laser points, devices 1 m before the wall.
    let fields = |prefix: &str| {
        let name = |n: &str| format!("{prefix}{n}");
        vec![
            matrix(&name("data"), &[3, 2, 60], |a| if a[2] == 20 + a[0] + 5 * a[1] { 50.0 } else { 0.0 }),
            matrix(&name("laserPos"), &[3, 3], |a| if a[1] == 0 { 0.1 * a[0] as f64 } else { 0.0 }),
            matrix(&name("cameraPos"), &[2, 3], |a| if a[1] == 1 { 0.2 * a[0] as f64 } else { 0.0 }),
            matrix(&name("laserNorm"), &[3, 3], |a| if a[1] == 2 { 1.0 } else { 0.0 }),
            vector(&name("laserOrigin"), &[0.0, 0.0, 1.0]),
            vector(&name("cameraOrigin"), &[0.0, 0.0, 1.0]),
            scalar(&name("deltat"), 0.2),
            scalar(&name("t0"), 0.0),
            scalar(&name("t"), 60.0),
        ]
    };
    let check = |path: &Path, what: &str| {
        let c = read(path).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(c.scan, [3, 2], "{what}");
        for (pair, histogram) in c.histograms.chunks_exact(c.bins).enumerate() {
            let (l, s) = (pair / 2, pair % 2);
            let (laser, sensor) = (dvec3(0.1 * l as f64, 0.0, 0.0), dvec3(0.0, 0.2 * s as f64, 0.0));
            assert!(c.laser[pair].distance(laser) < 1e-9 && c.sensor[pair].distance(sensor) < 1e-9, "{what}");
            // The middle of the bright bin without the legs, which are apart by parts of a bin.
            let legs = 1f64.hypot(0.1 * l as f64) + 1f64.hypot(0.2 * s as f64);
            let bright = 0.2 * ((20 + l + 5 * s) as f64 + 0.5) - legs;
            let moment = |b: usize| f64::from(histogram[b]) * (c.t_start + (b as f64 + 0.5) * c.bin_width);
            let middle = (0..c.bins).map(moment).sum::<f64>() / 50.0;
            assert!((middle - bright).abs() < 1e-5, "{what}: pair {pair} at {middle}, not {bright}");
        }
    };
    let (_folder, path) = place("pf.mat");
    for stored in [Stored::Plain, Stored::Compressed] {
        std::fs::write(&path, matlab5_struct("dataset", &fields(""), stored)).unwrap();
        check(&path, "struct of v5");
    }
    hdf5(&path, &fields("dataset/"));
    check(&path, "group of v7.3");
    // Another program's order, which HDF5 does not reverse.
    let mut other = fields("dataset/");
    other[0] = other[0].reversed();
    hdf5(&path, &other);
    check(&path, "group of another program");
}

#[test]
fn nlos_dirac_as_y_tal_reads_it() {
    let (_folder, path) = place("dirac.hdf5");
    let at = |k: usize| 0.1 * k as f64 - 0.1;
    let arrays = |offset: f64, across: usize| {
        [
            // A C program's [T, X, Y].
            matrix("data_t", &[20, 3, 2], |p| count(p[0], p[1], p[2])).reversed(),
            matrix("xg", &[across, 2], |p| at(p[0])).reversed(),
            matrix("yg", &[across, 2], |p| at(p[1])).reversed(),
            vector("da", &(0..20).map(|b| 0.5 + 0.02 * b as f64).collect::<Vec<_>>()),
            scalar("offset_laser", offset),
        ]
    };
    hdf5(&path, &arrays(1.5, 3));
    let c = read(&path).unwrap();
    assert_eq!((c.scan, c.bins, c.t_start), ([3, 2], 20, 0.0));
    assert!((c.bin_width - 0.02).abs() < 1e-12 && c.laser == c.sensor);
    for p in 0..6 {
        let (x, y) = (p / 2, p % 2);
        assert_eq!(c.sensor[p], dvec3(at(x), at(y), 0.0));
        (0..20).for_each(|t| assert_eq!(f64::from(c.histograms[p * 20 + t]), count(t, x, y)));
    }
    hdf5(&path, &arrays(0.0, 3));
    assert_error(read(&path), Kind::Input, &["offset_laser", "positions of the devices"]);
    hdf5(&path, &arrays(1.5, 4));
    assert_error(read(&path), Kind::Input, &["data_t", "[4, 2]"]);
    let given = ReadOptions::default().with_bin_width(0.02);
    assert_error(read_given(&path, &given), Kind::Options, &["a bin width was given", "NLOS-Dirac"]);
}

#[test]
fn phasor_field_2020_has_d1_down_and_d2_to_the_left() {
    let arrays = |at: [f64; 2]| {
        [
            scanned("rect_data"),
            scalar("ts", 4e-12),
            scalar("sampling_spacing", 0.5),
            matrix("SPAD_index", &[1, 2], |a| at[a[1]]),
        ]
    };
    every_file(&arrays([1.0, 3.0]), |path, what| {
        let c = read(path).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((c.scan, c.bins), ([3, 2], BINS));
        assert_axes(&c, 0, |ix, iy| [1 - iy, ix], what);
        // The first of d1 is the upper row, the last of d2 the left column.
        assert!(c.sensor.iter().all(|s| s.distance(dvec3(0.5, 0.25, 0.0)) < 1e-12), "{}", c.sensor[0]);
        assert!((c.bin_width - 4.0 * 299_792_458e-12).abs() < 1e-12);
    });
    every_file(&arrays([3.0, 1.0]), |path, _| {
        assert_error(read(path), Kind::Input, &["SPAD_index", "(3, 1)", "2 x 3"]);
    });
}

/// Counts of (d1, d2, t), all different.
fn scanned(name: &str) -> Matrix {
    matrix(name, &[2, 3, BINS], |a| count(a[2], a[0], a[1])).of_counts()
}

/// Every pair of a scan over a 1 m wall must have the counts, from bin `late` on, of the place (d1, d2) that `from` tells.
fn assert_axes(c: &Capture, late: usize, from: impl Fn(usize, usize) -> [usize; 2], what: &str) {
    let [nx, ny] = c.scan;
    for (ix, iy) in (0..nx).flat_map(|ix| (0..ny).map(move |iy| (ix, iy))) {
        let pair = ix * ny + iy;
        let [d1, d2] = from(ix, iy);
        assert_eq!(f64::from(c.histograms[pair * c.bins + 5]), count(5 + late, d1, d2), "{what}: {ix}, {iy}");
        let middle = |i: usize, n: usize| 0.5 * (i as f64 - 0.5 * (n - 1) as f64);
        assert!(c.laser[pair].distance(dvec3(middle(ix, nx), middle(iy, ny), 0.0)) < 1e-12, "{what}");
    }
}

#[test]
fn lct_of_every_storage_has_d1_to_the_left_and_d2_down() {
    every_file(&[scanned("rect_data"), scalar("width", 0.5)], |path, what| {
        let c = read(path).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((c.scan, c.bins, c.integer_counts), ([2, 3], BINS, true));
        assert_axes(&c, 0, |ix, iy| [ix, 2 - iy], what);
    });
}

/// What a MATLAB user's file states is used, quoted where it is not clear, and asked for where it is missing.
#[test]
fn counts_alone_are_read_by_what_the_file_and_the_user_say() {
    let given = || ReadOptions::default().with_wall(1.0).with_bin_width(0.01);
    every_file(&[scanned("meas")], |path, what| {
        assert_error(
            read(path),
            Kind::Options,
            &["meas", "tofgrid", "neither the wall size nor the bin width"],
        );
        let c = read_given(path, &given()).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((c.capture.bins, c.capture.pair_count()), (BINS, 6), "{what}");
        assert!(c.notes.iter().any(|note| note.contains("no tofgrid")), "{:?}", c.notes);
        let none = read_given(path, &given().with_time_of_flight(PathBuf::from("none"))).unwrap();
        assert!(none.notes.iter().all(|note| !note.contains("tofgrid")), "{:?}", none.notes);
        assert_eq!(none.capture.histograms, c.capture.histograms);
        let seconds = read_given(path, &given().with_bin_width(32e-12));
        assert_error(seconds, Kind::Options, &["3.2e-11 m", "32ps"]);
    });
    // A file that is given as the times of flight holds them.
    every_file(&[scanned("meas")], |path, _| {
        let (_folder, other) = place("times.mat");
        hdf5(&other, &[scalar("gain", 2.0)]);
        let times = given().with_time_of_flight(other);
        assert_error(read_given(path, &times), Kind::Input, &["times.mat", "holds no tofgrid"]);
        let bounce = given().with_bounce(Bounce::All);
        assert_error(read_given(path, &bounce), Kind::Options, &["a bounce was given"]);
    });
    let stated = [scanned("meas"), scalar("bin_resolution", 3.2e-11), scalar("wall_size", 2.0)];
    every_file(&stated, |path, what| {
        let c = read_given(path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert!((c.capture.bin_width - 32.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
        assert!((c.capture.wall_extent()[1] - c.capture.wall_extent()[0]) > 1.0, "{what}");
        for words in ["bin_resolution 3.2e-11", "32.00 ps", "wall_size 2"] {
            assert!(c.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", c.notes);
        }
        // What the user gives goes before it.
        assert_eq!(read_given(path, &given()).unwrap().capture.bin_width, 0.01);
    });
    every_file(&[scanned("meas"), scalar("width", 0.5), scalar("dt", 32.0)], |path, _| {
        assert_error(read(path), Kind::Options, &["width = 0.5", "dt = 32"]);
    });
    every_file(&[scanned("signal"), scanned("noise"), scalar("gain", 2.0)], |path, _| {
        assert_error(read_given(path, &given()), Kind::Options, &["signal", "noise", "name one"]);
        let c = read_given(path, &given().with_array(String::from("noise"))).unwrap();
        assert!(c.notes.iter().any(|note| note.starts_with("noise is read")), "{:?}", c.notes);
    });
    every_file(
        &[scanned("rect_data"), scalar("width", 0.5), scalar("bin_resolution", 3.2e-11)],
        |path, _| {
            assert!((read(path).unwrap().bin_width - 32.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
        },
    );
    // The width of an LCT file is its wall.
    every_file(&[scanned("rect_data"), scalar("width", 0.5), scalar("wall_size", 7.0)], |path, _| {
        let c = read_given(path, &ReadOptions::default()).unwrap();
        assert!(c.notes.iter().all(|note| !note.contains("wall_size")), "{:?}", c.notes);
    });
    let fewer = [scanned("measlr"), matrix("tofgridlr", &[2, 3], |_| 0.0)];
    every_file(&fewer, |path, what| {
        let c = read_given(path, &ReadOptions::default().with_wall(1.0)).unwrap();
        assert_axes(&c.capture, 0, |ix, iy| [iy, ix], what);
    });
}

#[test]
fn stanford_of_every_storage_has_d1_up_and_d2_to_the_left() {
    let stanford = |tof: f64| [scanned("meas"), matrix("tofgrid", &[2, 3], move |a| tof * a[0] as f64)];
    // 100 ps are three bins.
    every_file(&stanford(0.0), |path, what| {
        let c = read_given(path, &ReadOptions::default().with_wall(1.0))
            .unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((c.capture.scan, c.capture.bins), ([3, 2], BINS));
        assert_axes(&c.capture, 0, |ix, iy| [iy, ix], what);
    });
    every_file(&stanford(100.0), |path, what| {
        let c = read(path).unwrap_or_else(|e| panic!("{what}: {e}"));
        // d1 of 0 is the lower row, whose time of flight is 0.
        assert_eq!(f64::from(c.histograms[5]), count(5, 0, 0), "{what}");
        assert_eq!(f64::from(c.histograms[BINS + 5]), count(8, 1, 0), "{what}");
        assert_eq!(c.histograms[2 * BINS - 1], 0.0);
    });
    for wrong in [-1.0, 1e9, f64::INFINITY] {
        every_file(&stanford(wrong), |path, _| assert_error(read(path), Kind::Input, &["tofgrid", "ps"]));
    }
    // A time that is not known is a pair that was not measured.
    every_file(&stanford(f64::NAN), |path, _| {
        assert_error(read(path), Kind::Input, &["no pair"]);
    });
}

#[test]
fn one_array_has_rows_from_the_top_unless_it_is_turned() {
    every_file(&[scanned("counts")], |path, what| {
        let given = ReadOptions::default().with_wall(1.0).with_bin_width(0.01);
        let c = read_given(path, &given).unwrap().capture;
        assert_axes(&c, 0, |ix, iy| [1 - iy, 2 - ix], what);
        let opened = read_given(path, &given.with_turn(Turn::of(Some(Flip::X), Some(90)).unwrap())).unwrap();
        assert!(opened.notes.iter().any(|n| n.contains("left to right") && n.contains("rotated by 90")));
        // Mirrored, columns run from the right; a quarter clockwise then has them run down.
        assert_eq!(opened.capture.scan, [2, 3]);
        assert_axes(&opened.capture, 0, |ix, iy| [ix, iy], what);
    });
}

#[test]
fn ccsocr_has_its_horizontal_axis_to_the_left() {
    let points = |name: &str| matrix(name, &[6, 3], |a| [0, a[0] / 2, a[0] % 2][a[1]] as f64);
    let arrays =
        [matrix("sub_Sig", &[6, BINS], |a| count(a[1], a[0] % 2, a[0] / 2)), points("C_i"), points("C_d")];
    every_file(&arrays, |path, what| {
        let given = ReadOptions::default().with_wall(1.0);
        let c = read_given(path, &given).unwrap_or_else(|e| panic!("{what}: {e}")).capture;
        assert_eq!((c.scan, c.bins), ([3, 2], BINS));
        assert_axes(&c, 0, |ix, iy| [iy, ix], what);
    });
}

#[test]
fn what_is_no_capture_says_what_it_holds() {
    let strange = [scalar("a", 1.0), vector("b", &[1.0, 2.0])];
    every_file(&strange, |path, _| assert_error(read(path), Kind::Input, &["no known format", "a, b"]));
    let bounce = ReadOptions::default().with_bounce(Bounce::All);
    let lct = [matrix("rect_data", &[2, 3, BINS], |a| count(a[2], a[1], a[0])), scalar("width", 0.5)];
    every_file(&lct, |path, _| {
        assert_error(read_given(path, &bounce), Kind::Options, &["a bounce was given"]);
        let tof = ReadOptions::default().with_time_of_flight(PathBuf::from("tof.mat"));
        assert_error(read_given(path, &tof), Kind::Options, &["times of flight were given"]);
        for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let given = ReadOptions::default().with_bin_width(width);
            assert_error(read_given(path, &given), Kind::Options, &["the bin width is"]);
        }
    });
}
