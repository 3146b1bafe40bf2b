//! Files as people have them: read correctly, or refused with the cause and the fix.

use std::path::Path;

use fixtures::captures::{assert_error, changed, place};
use fixtures::files::{Matrix, Stored, hdf5, matlab_file, matlab_matrix, matlab5, matrix, scalar};
use glam::DVec3;
use thirdbounce::capture::conditioning::{Conditioned, Conditioning, prepare};
use thirdbounce::capture::{
    AxisOrder, Capture, METRES_PER_PICOSECOND, PairKind, ReadOptions, read, read_given, write,
};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce::job::load;
use thirdbounce::methods::SolverOptions;
use thirdbounce::options::SceneTraits;
use thirdbounce::settings::Settings;
use thirdbounce::{Kind, Result};

/// Photons of a small thing 0.6 m behind a wall of 1 m, in bins of 2 cm.
fn light(at: DVec3, bin: usize) -> f32 {
    let after = bin as f64 - 2.0 * at.distance(DVec3::new(0.05, -0.1, 0.6)) / 0.02;
    if after < 0.0 { 0.0 } else { (300.0 * (-0.2 * after).exp()).round() as f32 }
}

fn scene([nx, ny]: [usize; 2]) -> Capture {
    const BINS: usize = 128;
    let at = |i: usize, n: usize| i as f64 / (n - 1) as f64 - 0.5;
    let points: Vec<DVec3> = (0..nx * ny).map(|p| DVec3::new(at(p / ny, nx), at(p % ny, ny), 0.0)).collect();
    let counts = points.iter().flat_map(|p| (0..BINS).map(move |bin| light(*p, bin))).collect();
    let mut made = Capture::new([nx, ny], points.clone(), points, BINS, 0.02, counts);
    made.integer_counts = true;
    made
}

fn prepared(capture: Capture) -> Result<Conditioned> {
    prepare(capture, &Conditioning { no_auto_gate: true, ..Conditioning::default() })
}

/// An npz file of counts [T, X, Y] with points of these shapes.
fn npz(path: &Path, h: &[usize], points: &[(&str, &[usize])]) {
    let count = |shape: &[usize]| shape.iter().product::<usize>();
    let values = |shape: &[usize]| (0..count(shape)).map(|v| 0.01 * v as f64).collect::<Vec<_>>();
    let unit = |shape: &[usize]| [0.0, 0.0, 1.0].repeat(count(shape) / 3);
    let mut arrays = vec![("H", Array::from_f32(h, &vec![1.0; count(h)]))];
    if !points.iter().any(|(name, _)| *name == "delta_t") {
        arrays.push(("delta_t", Array::from_f64(&[], &[0.02])));
    }
    for (name, shape) in points {
        let values = if name.ends_with("normal") { unit(shape) } else { values(shape) };
        arrays.push((name, Array::from_f64(shape, &values)));
    }
    std::fs::write(path, npz_bytes(&arrays).unwrap()).unwrap();
}

#[test]
fn points_that_only_number_as_many_as_the_counts_are_refused() {
    let (_folder, path) = place("made.npz");
    let good: &[usize] = &[5, 3, 3];
    for (name, shape) in [("sensor_xyz", &[3, 5, 3][..]), ("laser_xyz", &[3, 5, 3]), ("sensor_xyz", &[15, 3])]
    {
        let other = if name == "sensor_xyz" { "laser_xyz" } else { "sensor_xyz" };
        npz(&path, &[7, 5, 3], &[(name, shape), (other, good)]);
        assert_error(read(&path), Kind::Input, &["H has shape [7, 5, 3]", name, &format!("{shape:?}")]);
    }
    for normal in ["sensor_normal", "laser_normal"] {
        npz(&path, &[7, 5, 3], &[("sensor_xyz", good), ("laser_xyz", good), (normal, &[3, 5, 3])]);
        assert_error(read(&path), Kind::Input, &[normal, "[3, 5, 3]", "[5, 3, 3]"]);
    }
    npz(&path, &[7, 15], &[("sensor_xyz", good), ("laser_xyz", good)]);
    assert_error(read(&path), Kind::Input, &["[7, 15]", "[5, 3, 3]"]);
    // What agrees: the same axes, lists of both, single points.
    for (h, points) in
        [(&[7, 5, 3][..], good), (&[7, 15], &[15, 3]), (&[7, 5, 3], &[1, 3]), (&[7, 15, 1], &[15, 1, 3])]
    {
        npz(&path, h, &[("sensor_xyz", points), ("laser_xyz", points), ("laser_normal", &[1, 3])]);
        assert_eq!(read(&path).unwrap().pair_count(), 15, "{h:?} {points:?}");
    }
}

#[test]
fn points_of_ytal_and_netf_stand_in_the_axes_of_the_counts() {
    let (folder, path) = place("made.hdf5");
    let grid = |name: &str, shape: &[usize]| {
        matrix(name, &shape.iter().rev().copied().collect::<Vec<_>>(), |at| 0.01 * at[1] as f64)
    };
    let file = |laser: &[usize], sensor: &[usize], normal: &[usize]| {
        let facing = matrix("sensor_grid_normals", &normal.iter().rev().copied().collect::<Vec<_>>(), |at| {
            f64::from(at[0] == 2)
        });
        let h = matrix("H", &[3, 5, 7], |_| 1.0);
        hdf5(
            &path,
            &[
                h,
                grid("laser_grid_xyz", laser),
                grid("sensor_grid_xyz", sensor),
                facing,
                scalar("delta_t", 0.02),
                scalar("H_format", 1.0),
            ],
        );
        read(&path)
    };
    let good: &[usize] = &[5, 3, 3];
    file(good, good, good).unwrap();
    file(&[1, 1, 3], good, &[1, 1, 3]).unwrap();
    assert_error(file(&[3, 5, 3], good, good), Kind::Input, &["[7, 5, 3]", "laser_grid_xyz", "[3, 5, 3]"]);
    assert_error(file(good, &[3, 5, 3], good), Kind::Input, &["sensor_grid_xyz", "[3, 5, 3]"]);
    // Normals of another grid are left out.
    assert_eq!(file(good, good, &[3, 5, 3]).unwrap().sensor_normal, None);
    let path = folder.path().join("netf.mat");
    let of = |grid: &[usize]| {
        let all = [
            matrix("data", &[9, 5, 4], |_| 1.0),
            matrix("cameraGridPositions", grid, |_| 0.1),
            scalar("deltaT", 0.01),
        ];
        std::fs::write(&path, matlab5(&all, Stored::Plain)).unwrap();
        read(&path)
    };
    of(&[3, 5, 4]).unwrap();
    assert_error(of(&[3, 4, 5]), Kind::Input, &["cameraGridPositions", "5 x 4"]);
}

/// M pairs as the captures of curved walls have them.
fn listed(m: usize, points: &[(&str, &[usize])]) -> Vec<Matrix> {
    let mut all = vec![matrix("trans_data", &[m, 1, 40], |at| f64::from(u8::from(at[2] == at[0] % 40)))];
    for (name, dims) in points {
        let axis = dims.iter().position(|n| *n == 3).unwrap();
        all.push(matrix(name, dims, |at| {
            0.01 * (10 * at.iter().enumerate().filter(|(k, _)| *k != axis).map(|(_, i)| i).sum::<usize>()
                + at[axis]) as f64
        }));
    }
    all
}

#[test]
fn lists_of_points_beside_counts_are_read_or_refused_never_ignored() {
    let (folder, path) = place("curved.mat");
    let given = ReadOptions::default().with_bin_width(0.02);
    let of = |arrays: &[Matrix]| {
        std::fs::write(&path, matlab5(arrays, Stored::Compressed)).unwrap();
        read_given(&path, &given).map(|o| o.capture)
    };
    let both: [(&str, &[usize]); 2] = [("camera_points", &[20, 3]), ("laser_points", &[20, 3])];
    let c = of(&listed(20, &both)).unwrap();
    assert_eq!((c.pair_count(), c.bins, c.histograms[5 * 40 + 5]), (20, 40, 1.0));
    assert!(c.laser[7].distance(DVec3::new(0.70, 0.71, 0.72)) < 1e-12, "{}", c.laser[7]);
    // Of h5py, in the order of C.
    let by_hand = folder.path().join("curved.h5");
    hdf5(&by_hand, &listed(20, &both).iter().map(Matrix::reversed).collect::<Vec<_>>());
    assert_eq!(read_given(&by_hand, &given).unwrap().capture.laser, c.laser);
    // One list is that of a confocal scan; two that do not agree, or whose names say nothing, are refused.
    assert!(of(&listed(20, &both[..1])).unwrap().is_confocal());
    let wrong: [(&str, &[usize]); 2] = [("camera_points", &[20, 3]), ("laser_points", &[10, 3])];
    assert_error(of(&listed(20, &wrong)), Kind::Input, &["trans_data", "laser_points", "do not agree"]);
    let unnamed: [(&str, &[usize]); 2] = [("points_a", &[20, 3]), ("points_b", &[20, 3])];
    assert_error(of(&listed(20, &unnamed)), Kind::Input, &["points_a", "laser_points"]);
    std::fs::write(&path, matlab5(&listed(20, &both), Stored::Plain)).unwrap();
    assert_error(read(&path), Kind::Options, &["bin_width", "32ps"]);
}

#[test]
fn captures_of_3d_rsd_are_read() {
    let (_folder, path) = place("scene_0_raw.mat");
    let laser = matrix("camera_pos", &[36, 3], |at| {
        [0.1 * (at[0] / 6) as f64, 0.1 * (at[0] % 6) as f64, 0.01 * (at[0] % 5) as f64][at[1]]
    });
    let counts = matrix("total_rect_data", &[36, 50], |at| (at[0] + at[1]) as f64);
    let sensor = matrix("laser_pos_base", &[1, 1, 3], |at| [0.2, 0.3, 0.0][at[2]]);
    let all = [counts, laser, sensor, scalar("ts", 16e-12)];
    std::fs::write(&path, matlab5(&all, Stored::Plain)).unwrap();
    let c = read(&path).unwrap();
    assert_eq!((c.pair_count(), c.bins, c.histograms[7 * 50 + 3]), (36, 50, 10.0));
    assert!((c.bin_width - 16.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
    assert_eq!((c.laser[7], c.sensor[7]), (DVec3::new(0.1, 0.1, 0.02), DVec3::new(0.2, 0.3, 0.0)));
    assert_error(
        read_given(&path, &ReadOptions::default().with_bin_width(0.1)),
        Kind::Options,
        &["a bin width was given"],
    );
    std::fs::write(&path, matlab5(&all[..2], Stored::Plain)).unwrap();
    assert_error(read(&path), Kind::Input, &["ts"]);
}

#[test]
fn the_bins_of_a_single_array_are_where_light_rises_and_decays() {
    let (folder, _) = place("");
    let c = scene([16, 12]);
    let value = |x: usize, y: usize, t: usize| f64::from(c.histograms[(x * 12 + y) * 128 + t]);
    let given = ReadOptions::default().with_wall(1.0).with_bin_width(0.02);
    let total = f64::from(c.histograms.iter().sum::<f32>());
    // As h5py shows the axes, and as MATLAB does.
    let by_hand: [(&str, [usize; 3]); 3] = [("xyt", [0, 1, 2]), ("yxt", [1, 0, 2]), ("txy", [2, 0, 1])];
    for (name, order) in by_hand {
        for ending in ["h5", "mat"] {
            let size = order.map(|axis| [16, 12, 128][axis]);
            let array = matrix("counts_of_mine", &size, |at| {
                let mut place = [0; 3];
                order.iter().zip(at).for_each(|(axis, i)| place[*axis] = *i);
                value(place[0], place[1], place[2])
            });
            let path = folder.path().join(format!("{name}.{ending}"));
            // `hdf5` reverses the axes, as MATLAB's own files have them.
            if ending == "h5" {
                hdf5(&path, &[array.reversed()]);
            } else {
                std::fs::write(&path, matlab5(&[array], Stored::Plain)).unwrap();
            }
            let named =
                read_given(&path, &given.clone().with_axes(AxisOrder::parse(name).unwrap())).unwrap().capture;
            assert_eq!((named.scan, named.bins), ([16, 12], 128), "{name} {ending}");
            let found = read_given(&path, &given).unwrap().capture;
            assert_eq!(found.bins, 128, "{name} {ending}");
            let sum: f64 = found.histograms.iter().map(|v| f64::from(*v)).sum();
            assert!((sum - total).abs() < 1e-6 * total, "{name} {ending}");
            // Without MATLAB's convention only the order of x and y is open.
            if name != "yxt" && ending == "h5" {
                assert_eq!(found, named, "{name}");
            }
        }
    }
    let path = folder.path().join("even.h5");
    hdf5(&path, &[matrix("a", &[9, 8, 10], |at| 1.0 + at.iter().sum::<usize>() as f64)]);
    assert_error(read_given(&path, &given), Kind::Options, &["no axis of a", "axes", "xyt"]);
    for wrong in ["xy", "xyz", "xxt", "xytt", ""] {
        assert_error(AxisOrder::parse(wrong), Kind::Options, &["xyt"]);
    }
    // All that is missing is asked for at once.
    assert_error(read(&path), Kind::Options, &["wall", "1m", "bin_width", "32ps"]);
    let known = folder.path().join("known.npz");
    write(&c, &known).unwrap();
    let axes = ReadOptions::default().with_axes(AxisOrder::parse("xyt").unwrap());
    assert_error(read_given(&known, &axes), Kind::Options, &["axes were given", "npz"]);
}

#[test]
fn points_that_were_never_measured_are_left_out_and_noted() {
    let whole = scene([16, 16]);
    let dark = |is_dark: &dyn Fn(usize, usize) -> bool, scale: f32| {
        changed(&whole, |c| {
            for (pair, counts) in c.histograms.chunks_exact_mut(128).enumerate() {
                let dim = if is_dark(pair / 16, pair % 16) { 0.0 } else { scale };
                counts.iter_mut().for_each(|v| *v *= dim);
            }
            c.integer_counts = scale == 1.0;
        })
    };
    let border = |x: usize, y: usize| x < 2 || y < 2 || x > 13 || y > 13;
    let sparse = |x: usize, y: usize| x % 4 != 1 || y % 4 != 2;
    for scale in [1.0, 0.013] {
        for (is_dark, left) in [(&border as &dyn Fn(usize, usize) -> bool, [12, 12]), (&sparse, [4, 4])] {
            let c = dark(is_dark, scale);
            let done = prepared(c.clone()).unwrap();
            assert_eq!((done.capture.scan, done.dropped), (left, 256 - left[0] * left[1]), "{scale}");
            assert!(done.notes.iter().any(|n| n.contains("no count at all")), "{:?}", done.notes);
            let kept =
                prepare(c, &Conditioning { keep_empty: true, no_auto_gate: true, ..Conditioning::default() });
            assert_eq!(kept.unwrap().capture.pair_count(), 256);
        }
        // Here and there: a list.
        assert_eq!(prepared(dark(&|x, y| (x * 7 + y) % 11 == 0, scale)).unwrap().capture.scan[1], 1);
    }
    // Few photons: chance leaves pairs dark, and they stay.
    let few = changed(&dark(&|x, y| (x + y) % 3 == 0, 1.0), |c| {
        c.histograms.iter_mut().for_each(|v| *v = f32::from(*v > 250.0))
    });
    assert_eq!(prepared(few).unwrap().dropped, 0);
    // The same from a file that is read in parts, and one that is read whole.
    let (folder, path) = place("sparse.mat");
    let c = dark(&sparse, 1.0);
    write(&c, &path).unwrap();
    let npz = folder.path().join("sparse.npz");
    write(&c, &npz).unwrap();
    let [a, b] = [(&path, Some(0.02)), (&npz, None)].map(|(path, bin_width)| {
        load(path, &Settings { wall: Some(1.0), bin_width, ..Settings::default() }).unwrap().capture
    });
    assert_eq!((a.scan, &a.histograms), ([4, 4], &b.histograms));
}

#[test]
fn units_that_cannot_be_are_refused_with_the_likely_one() {
    let c = scene([16, 16]);
    assert!(prepared(c.clone()).unwrap().warnings.is_empty(), "{:?}", prepared(c.clone()).unwrap().warnings);
    let points =
        |scale: f64| move |c: &mut Capture| c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p *= scale);
    let bins = |scale: f64| move |c: &mut Capture| c.bin_width *= scale;
    let ps = 1.0 / METRES_PER_PICOSECOND;
    for (change, words) in [
        (Box::new(bins(ps)) as Box<dyn Fn(&mut Capture)>, &["delta_t 66.7", "picoseconds", "0.0200"][..]),
        (Box::new(bins(1e-12 * ps)), &["delta_t", "seconds", "0.0200"]),
        (Box::new(bins(1e3)), &["delta_t 20", "millimetres"]),
        (Box::new(points(1e3)), &["points look like millimetres", "1.0000 m"]),
        (
            Box::new(move |c: &mut Capture| (points(1e3)(c), bins(1e3)(c)).1),
            &["points look like millimetres", "delta_t 20 looks like millimetres"],
        ),
        (
            Box::new(move |c: &mut Capture| (points(1e3)(c), bins(ps)(c)).1),
            &["points look like millimetres", "picoseconds"],
        ),
        (Box::new(|c: &mut Capture| c.t_start = 3000.0), &["t_start 3000 looks like"]),
    ] {
        let wrong = changed(&c, |c| change(c));
        assert_error(prepared(wrong.clone()), Kind::Input, words);
        let error = prepared(wrong).unwrap_err();
        assert!(!error.to_string().contains("min_depth"), "{error}");
    }
    // Unlikely, but not beyond reason: a warning.
    for change in [Box::new(points(1e2)) as Box<dyn Fn(&mut Capture)>, Box::new(bins(1e2))] {
        let done = prepared(changed(&c, |c| change(c)));
        let reported = done.map_or_else(|e| e.to_string(), |done| done.warnings.join("\n"));
        assert!(reported.contains("centimetres"), "{reported}");
    }
    // Small scenes with small bins, and scenes of many metres, are sound.
    for scale in [0.01, 0.1, 10.0] {
        let scaled = changed(&c, |c| (points(scale)(c), bins(scale)(c)).1);
        assert!(prepared(scaled).unwrap().warnings.is_empty(), "{scale}");
    }
}

#[test]
fn half_a_wall_and_light_that_is_too_early_are_warned_of() {
    let c = scene([16, 16]);
    let narrow =
        prepare(c.clone(), &Conditioning { wall: Some(0.5), no_auto_gate: true, ..Conditioning::default() });
    assert!(narrow.unwrap().warnings.join("").contains("half its width"));
    let one_laser = changed(&c, |c| c.laser.fill(DVec3::new(-4.0, 0.0, 0.0)));
    assert!(prepared(one_laser).unwrap().warnings.join("").contains("before light can travel"));
}

#[test]
fn opaque_variables_of_matlab_are_skipped() {
    let element = |kind: u32, content: &[u8]| {
        let mut all = [kind.to_le_bytes(), (content.len() as u32).to_le_bytes()].concat();
        all.extend(content);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    // Flags of class 17, the name, the type system, the class; no dimensions. Then its data.
    let parts = [
        element(6, &[17, 0, 0, 0, 0, 0, 0, 0]),
        element(1, b"note"),
        element(1, b"MCOS"),
        element(1, b"string"),
        matlab_matrix(&matrix("", &[6, 1], |at| at[0] as f64), false),
    ];
    let opaque = element(14, &parts.concat());
    let (_folder, path) = place("opaque.mat");
    let counts = matrix("rect_data", &[4, 4, 30], |at| (at[2] + 1) as f64);
    for stored in [Stored::Plain, Stored::Compressed] {
        let all = [
            opaque.clone(),
            matlab_matrix(&counts, false),
            opaque.clone(),
            matlab_matrix(&scalar("width", 0.5), false),
        ];
        std::fs::write(&path, matlab_file(&all, stored)).unwrap();
        assert_eq!(read(&path).unwrap().bins, 30);
    }
    // Cut within the opaque variable: damaged.
    let file = matlab_file(&[opaque], Stored::Plain);
    std::fs::write(&path, &file[..file.len() - 20]).unwrap();
    assert_error(read(&path), Kind::Input, &["damaged"]);
}

#[test]
fn empty_arrays_of_matlab_are_missing() {
    let (_folder, path) = place("empty.mat");
    let file = rust_hdf5::H5File::create(&path).unwrap();
    let put = |name: &str, shape: &[usize], values: &[f64], empty: bool| {
        let made = file.new_dataset::<f64>().shape(shape).create(name).unwrap();
        made.write_raw(values).unwrap();
        if empty {
            made.new_attr::<u8>().create("MATLAB_empty").unwrap().write_numeric(&1u8).unwrap();
        }
    };
    put("meas", &[600, 4, 4], &[1.0; 600 * 16], false);
    put("tofgrid", &[2], &[0.0, 0.0], true);
    file.close().unwrap();
    assert_error(read(&path), Kind::Input, &["meas", "tofgrid", "times of flight"]);
}

#[test]
fn files_of_matlab_version_4_are_named() {
    let (folder, path) = place("tofgrid.mat");
    let mut file: Vec<u8> = [0u32, 4, 4, 0, 8].iter().flat_map(|v| v.to_le_bytes()).collect();
    file.extend(b"tofgrid\0");
    file.extend([0u8; 128]);
    std::fs::write(&path, file).unwrap();
    assert_error(read(&path), Kind::Input, &["version 4", "-v7"]);
    let meas = folder.path().join("meas.mat");
    std::fs::write(&meas, matlab5(&[matrix("meas", &[4, 4, 600], |_| 1.0)], Stored::Plain)).unwrap();
    let given = ReadOptions::default().with_time_of_flight(path.clone());
    assert_error(read_given(&meas, &given), Kind::Input, &["tofgrid.mat", "version 4"]);
}

#[test]
fn packed_datasets_are_read_or_the_filter_is_named() {
    use rust_hdf5::{Filter, FilterPipeline};
    let (_folder, path) = place("packed.hdf5");
    let points: Vec<f64> =
        (0..16).flat_map(|p| [0.1 * f64::from(p / 4), 0.1 * f64::from(p % 4), 0.0]).collect();
    let made = |filter: Filter, packed: bool| {
        let file = rust_hdf5::H5File::create(&path).unwrap();
        let new = file.new_dataset::<f32>().shape([8, 4, 4]).chunk(&[8, 4, 4]);
        let h = new.filter_pipeline(FilterPipeline { filters: vec![filter] }).create("H").unwrap();
        let values: Vec<f32> = (0..128).map(|v| v as f32).collect();
        if packed {
            h.write_raw(&values).unwrap();
        } else {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            h.write_chunk_raw(0, &bytes, 0).unwrap();
        }
        for name in ["laser_grid_xyz", "sensor_grid_xyz"] {
            file.new_dataset::<f64>().shape([4, 4, 3]).create(name).unwrap().write_raw(&points).unwrap();
        }
        file.new_dataset::<f64>().scalar().create("delta_t").unwrap().write_raw(&[0.1]).unwrap();
        file.close().unwrap();
        read(&path)
    };
    let filter = |id: u16, cd_values: Vec<u32>| Filter { id, flags: 0, cd_values };
    for (name, filter) in [
        ("zstd", filter(32015, vec![3])),
        ("lz4", filter(32004, vec![])),
        ("blosc", filter(32001, vec![2, 2, 4, 512, 5, 1, 1])),
        ("bitshuffle", filter(32008, vec![0, 2, 4, 0, 2])),
    ] {
        if cfg!(feature = "hdf5-filters") {
            let c = made(filter, true).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(c.histograms[..3], [0.0, 16.0, 32.0], "{name}");
        } else {
            assert_error(made(filter, false), Kind::Input, &["the feature hdf5-filters", "h5repack"]);
        }
    }
    for (name, filter) in [
        ("Blosc2", filter(32026, vec![])),
        ("ZFP", filter(32013, vec![])),
        ("bzip2", filter(307, vec![9])),
        ("unknown filter (HDF5 filter 40000)", filter(40000, vec![])),
        ("bitshuffle with Zstandard", filter(32008, vec![0, 2, 4, 0, 3])),
    ] {
        let error = made(filter, false).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains(name) && text.contains("h5repack") && !text.contains("damaged"),
            "{name}: {text}"
        );
    }
}

#[test]
fn stokes_vectors_are_read_as_intensity() {
    let (_folder, path) = place("stokes.hdf5");
    let grid = |name: &str| matrix(name, &[3, 3, 5], |at| 0.1 * at[at[0] % 2 + 1] as f64);
    let file = |h: Matrix, format: f64| {
        hdf5(
            &path,
            &[
                h,
                grid("laser_grid_xyz"),
                grid("sensor_grid_xyz"),
                scalar("delta_t", 0.02),
                scalar("H_format", format),
            ],
        );
        thirdbounce::capture::read_with_notes(&path)
    };
    let plain = file(matrix("H", &[3, 5, 7], |at| (at[0] + 10 * at[1] + 100 * at[2]) as f64), 1.0).unwrap();
    for format in [1.0, 0.0] {
        let of = |at: &[usize]| if at[0] == 0 { (at[1] + 10 * at[2] + 100 * at[3]) as f64 } else { -9.5 };
        let opened = file(matrix("H", &[4, 3, 5, 7], of), format).unwrap();
        assert_eq!(opened.capture, plain.capture);
        assert!(opened.notes.join("").contains("Stokes"), "{:?}", opened.notes);
    }
}

#[test]
fn bins_that_differ_by_pixel_are_refused_with_what_is_supported() {
    let (_folder, path) = place("widths.npz");
    npz(&path, &[7, 5, 3], &[("sensor_xyz", &[5, 3, 3]), ("laser_xyz", &[5, 3, 3]), ("delta_t", &[5, 3])]);
    assert_error(read(&path), Kind::Input, &["delta_t", "[5, 3]", "resample"]);
    let path = path.with_extension("hdf5");
    let grid = |name: &str| matrix(name, &[3, 3, 5], |_| 0.1);
    hdf5(
        &path,
        &[
            matrix("H", &[3, 5, 7], |_| 1.0),
            grid("laser_grid_xyz"),
            grid("sensor_grid_xyz"),
            matrix("delta_t", &[3, 5], |_| 0.1),
        ],
    );
    assert_error(read(&path), Kind::Input, &["delta_t", "[5, 3]", "resample"]);
}

#[test]
fn counts_that_come_alone_are_told_how_to_become_a_capture() {
    let (folder, path) = place("alone.npy");
    let array = Array::from_f32(&[7, 5, 3], &[1.0; 105]);
    std::fs::write(&path, array.to_npy()).unwrap();
    let text = folder.path().join("counts.csv");
    std::fs::write(&text, "0, 1, 2\n3, 4, 5\n").unwrap();
    let archive = folder.path().join("alone.npz");
    std::fs::write(&archive, npz_bytes(&[("arr_0", array)]).unwrap()).unwrap();
    for path in [path, text, archive] {
        assert_error(
            read(&path),
            Kind::Input,
            &["np.savez", "H=H", "sensor_xyz", "laser_xyz", "delta_t", "histogram"],
        );
    }
}

#[test]
fn readings_of_zones_say_what_bin_width_is_assumed() {
    let (_folder, path) = place("zones.npz");
    let cloud: Vec<f64> =
        (0..16).flat_map(|p| [0.1 * f64::from(p / 4), 0.1 * f64::from(p % 4), 0.0]).collect();
    let arrays =
        [("hists", Array::from_f32(&[16, 20], &[1.0; 320])), ("pt_cloud", Array::from_f64(&[16, 3], &cloud))];
    std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
    let notes = |given: &ReadOptions| read_given(&path, given).unwrap().notes.join("\n");
    let assumed = notes(&ReadOptions::default());
    assert!(
        assumed.contains("250 ps") && assumed.contains("TMF8820") && assumed.contains("91 ps"),
        "{assumed}"
    );
    assert!(!notes(&ReadOptions::default().with_bin_width(0.027)).contains("TMF8820"));
}

#[test]
fn containers_and_empty_arrays_are_refused_by_their_cause() {
    let (_folder, path) = place("made.h5");
    let named = |name: &str, dims: &[usize]| matrix(name, dims, |at| (1 + at.iter().sum::<usize>()) as f64);
    for (arrays, words) in [
        (
            vec![
                named("s/rect_data", &[4, 4, 20]),
                named("t/rect_data", &[4, 4, 20]),
                scalar("s/width", 0.46875),
            ],
            &["s/rect_data inside the struct s", "-struct"][..],
        ),
        (vec![named("#refs#/a", &[20, 1]), named("#refs#/b", &[20, 1])], &["MATLAB cell array", "cat(2, "]),
        (
            vec![named("#refs#/a", &[20, 1]), named("#refs#/b", &[30, 1])],
            &["MATLAB cell array", "histcounts"],
        ),
        (vec![named("#refs#/a", &[20, 4]), named("#refs#/b", &[20, 4])], &["MATLAB cell array", "cell2mat"]),
        (vec![named("data", &[6, 5, 20, 3])], &["[3, 20, 5, 6]", "colours"]),
    ] {
        hdf5(&path, &arrays);
        assert_error(read_given(&path, &ReadOptions::default().with_wall(1.0)), Kind::Input, words);
    }
    let empty = [named("meas", &[4, 4, 20]), matrix("tofgrid", &[0, 0], |_| 0.0)];
    std::fs::write(&path, matlab5(&empty, Stored::Plain)).unwrap();
    assert_error(read(&path), Kind::Input, &["tofgrid", "is empty"]);
}

#[test]
fn a_sensor_beside_the_laser_is_confocal_within_a_tenth_of_the_step() {
    let step = 1.0 / 15.0;
    let beside = |metres: f64| changed(&scene([16, 16]), |c| c.sensor.iter_mut().for_each(|p| p.x += metres));
    for metres in [1e-4, 0.09 * step] {
        let near = beside(metres);
        assert!(near.pair_kind() == PairKind::Confocal && !near.is_confocal() && near.offset().is_none());
    }
    for metres in [0.01, 0.02] {
        let apart = beside(metres);
        assert!(
            apart.pair_kind() == PairKind::Irregular && (apart.offset().unwrap().x - metres).abs() < 1e-12
        );
        let done = prepared(apart.clone()).unwrap();
        let words = format!("{:.1} mm beside the laser point", 1e3 * metres);
        assert!(
            done.notes.iter().any(|n| n.contains(&words) && n.contains("wrong by up to 0.")),
            "{:?}",
            done.notes
        );
        let method = SolverOptions::defaults_for("lct", &SceneTraits::DEFAULT).unwrap();
        method.takes(&apart).unwrap();
    }
    // A wide spot counts as the step does; points that are apart by other ways are no offset.
    let wide = changed(&beside(0.01), |c| c.laser_spot = Some(0.11));
    assert_eq!(wide.pair_kind(), PairKind::Confocal);
    let mixed = changed(&beside(0.01), |c| c.sensor[7].x -= 0.02);
    assert!(mixed.offset().is_none());
}

#[test]
fn walls_units_and_totals_are_told() {
    // ROS: x forward, z up.
    let upright = scene([6, 5]);
    let turned = changed(&upright, |c| {
        c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p = DVec3::new(p.z, -p.x, p.y));
        (c.laser_normal, c.sensor_normal) = (Some(vec![DVec3::X; 30]), Some(vec![DVec3::X; 30]));
    });
    let done = prepared(turned.clone()).unwrap();
    let note = done.notes.iter().find(|n| n.contains("y of the file is taken as up")).unwrap();
    assert!(note.contains("a rotation of 270 degrees"), "{note}");
    let turn = thirdbounce::capture::Turn::of(None, Some(270)).unwrap();
    let right =
        prepare(turned, &Conditioning { turn, no_auto_gate: true, ..Conditioning::default() }).unwrap();
    assert_eq!(right.capture.scan, upright.scan);
    for (found, wanted) in right.capture.laser.iter().zip(&upright.laser) {
        assert!(
            found.distance(DVec3::new(-wanted.x, wanted.y, 0.0)) < 1e-9 || found.distance(*wanted) < 1e-9
        );
    }
    // Sound: bins in seconds.
    let (_folder, path) = place("sound.npz");
    let sound = changed(&upright, |c| c.bin_width /= 343.0);
    write(&sound, &path).unwrap();
    let heard = Settings { speed: Some(343.0), ..Settings::default() };
    let found = load(&path, &heard).unwrap();
    assert!((found.capture.bin_width - upright.bin_width).abs() < 1e-12, "{}", found.capture.bin_width);
    assert!(found.notes.iter().any(|n| n.contains("343 m/s")), "{:?}", found.notes);
    let wrong = Settings { speed: Some(-1.0), ..Settings::default() };
    assert!(load(&path, &wrong).is_err());
    // A bin width beside the file's own, and a pulse without its unit.
    let given = ReadOptions::default().with_bin_width(3.0);
    assert_error(read_given(&path, &given), Kind::Options, &["the file holds its own bin width"]);
    let mut settings = Settings::default();
    assert_error(settings.set("pulse", "60"), Kind::Options, &["for picoseconds give 60ps"]);
    // Histograms that were divided by their totals.
    let same = changed(&upright, |c| {
        c.integer_counts = false;
        let bins = c.bins;
        c.histograms.chunks_exact_mut(bins).for_each(|h| {
            let total: f32 = h.iter().sum();
            h.iter_mut().for_each(|n| *n /= total);
        });
    });
    let done = prepared(same).unwrap();
    assert!(done.notes.iter().any(|n| n.contains("the same total")), "{:?}", done.notes);
}

#[test]
fn scans_that_were_enlarged_are_told() {
    let proper = scene([16, 16]);
    let is_told = |c: Capture| prepared(c).unwrap().notes.iter().any(|note| note.contains("enlarged"));
    assert!(!is_told(proper.clone()));
    let from = |p: usize| p / 16 / 2 * 2 * 16 + p % 16 / 2 * 2;
    let doubled = (0..256).flat_map(|p| proper.histogram(from(p)).to_vec()).collect();
    assert!(is_told(changed(&proper, |c| c.histograms = doubled)));
}

#[test]
fn what_is_no_capture_is_named_with_the_way_to_one() {
    let (folder, path) = place("made.npz");
    // A picture by its first bytes.
    let picture = folder.path().join("scan.mat");
    std::fs::write(&picture, b"\x89PNG\r\n\x1a\n and more").unwrap();
    assert_error(read(&picture), Kind::Input, &["a picture", "holds none"]);
    // Times and counts are a histogram, channels and times are tags.
    let text = folder.path().join("one.txt");
    let lines =
        |line: fn(usize) -> String| std::fs::write(&text, (0..40).map(line).collect::<String>()).unwrap();
    lines(|i| format!("{:.3}\t{}\n", 0.032 * i as f64, i % 7));
    assert_error(read(&text), Kind::Input, &["table of times and counts", "histogram"]);
    lines(|i| format!("{}\t{}\n", i % 2, 1000 * i));
    assert_error(read(&text), Kind::Input, &["a text of numbers"]);
    // A digitiser's negative pulses.
    let mut upside_down = scene([9, 9]);
    upside_down.histograms.iter_mut().for_each(|v| *v = -*v);
    assert_error(upside_down.check(), Kind::Input, &["upside down", "H = np.median(H) - H"]);
    // Results.
    let one = || Array::from_f32(&[2, 2, 2], &[1.0; 8]);
    let packed = |names: [&str; 2]| {
        std::fs::write(&path, npz_bytes(&names.map(|name| (name, one()))).unwrap()).unwrap()
    };
    packed(["albedo", "extent"]);
    assert_error(read(&path), Kind::Input, &["a result or a truth", "capture that it was made from"]);
    // A matrix of pairs and bins.
    let matrices = folder.path().join("matrix.mat");
    let made = |rows: usize, bins: usize| {
        let m = matrix("Confocal_signal", &[rows, bins], |at| f64::from(u8::from(at[1] == 9)));
        std::fs::write(&matrices, matlab5(&[m], Stored::Plain)).unwrap();
        read(&matrices)
    };
    assert_error(made(256, 40), Kind::Input, &["Confocal_signal is a matrix of 256 x 40", "--scan 16x16"]);
    assert_error(made(250, 40), Kind::Input, &["250 x 40", "columns x rows"]);
}
