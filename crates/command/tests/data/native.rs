//! Real files of other programs against their plain twins.

use std::path::Path;

use fixtures::captures::{assert_error, changed};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, Flip, ReadOptions, Turn, read, read_given};

/// Same counts at the same wall points; bins as wide to a thousandth (the twins take c = 3e8).
fn assert_twins(native: &Capture, plain: &Capture, what: &str) {
    assert_eq!((native.scan, native.bins), (plain.scan, plain.bins), "{what}");
    assert!(native.histograms == plain.histograms, "{what}: other counts");
    assert!((native.bin_width / plain.bin_width - 1.0).abs() < 1e-3, "{what}: {} m", native.bin_width);
    assert_eq!(native.t_start, plain.t_start, "{what}");
    assert_eq!(native.integer_counts, plain.integer_counts, "{what}");
    for (a, b) in native.laser.iter().chain(&native.sensor).zip(plain.laser.iter().chain(&plain.sensor)) {
        assert!(a.distance(*b) < 1e-6, "{what}: {a} is not {b}");
    }
}

/// Four neighbouring bins as one.
fn by_fours(capture: Capture) -> Capture {
    changed(&capture, |c| {
        c.histograms = c.histograms.chunks_exact(4).map(|b| b.iter().sum()).collect();
        (c.bins, c.bin_width) = (c.bins / 4, 4.0 * c.bin_width);
    })
}

fn wall(size: f64) -> ReadOptions {
    ReadOptions::default().with_wall(size)
}

/// A plain twin that is laid out for pictures with +x to the right.
fn mirrored(data: &Path, name: &str) -> Capture {
    read(&data.join(name)).unwrap().turned(Turn::of(Some(Flip::X), None).unwrap())
}

fn open(path: &Path, given: &ReadOptions) -> Capture {
    read_given(path, given).unwrap_or_else(|e| panic!("{e}")).capture
}

pub fn stanford_statue(data: &Path) {
    let plain = mirrored(data, "statue_confocal_64.npz");
    let folder = data.join("native");
    for name in ["stanford_statue64_meas.mat", "stanford_statue64_tof.mat"] {
        let opened = read_given(&folder.join(name), &ReadOptions::default()).unwrap();
        assert_twins(&opened.capture, &plain, name);
        let notes = opened.notes.join("\n");
        for said in ["32 ps", "2 m", "wall size", "512 bins"] {
            assert!(notes.contains(said), "{notes} does not say {said}");
        }
    }
    // A folder of these two files, and the second file by name.
    let two = tempfile::tempdir().unwrap();
    for (name, to) in
        [("stanford_statue64_meas.mat", "meas_10min.mat"), ("stanford_statue64_tof.mat", "tof.mat")]
    {
        std::fs::copy(folder.join(name), two.path().join(to)).unwrap();
    }
    assert_twins(&open(two.path(), &ReadOptions::default()), &plain, "folder");
    assert_twins(
        &open(&two.path().join("meas_10min.mat"), &ReadOptions::default()),
        &plain,
        "tof.mat beside",
    );
    std::fs::rename(two.path().join("tof.mat"), two.path().join("times.mat")).unwrap();
    let meas = two.path().join("meas_10min.mat");
    assert_error(read(&meas), Kind::Options, &["meas_10min.mat", "tofgrid", "wall size"]);
    let given = wall(1.0).with_time_of_flight(two.path().join("times.mat"));
    let narrow = open(&meas, &given);
    assert!((narrow.laser[0].x + 0.5).abs() < 1e-12);
}

pub fn lct_letters(data: &Path) {
    let plain = mirrored(data, "su_confocal_64.npz");
    let native = open(&data.join("native/lct_data_s_u.mat"), &ReadOptions::default());
    assert_eq!(native.bins, 2048);
    assert_twins(&by_fours(native), &plain, "S U");
}

pub fn one_array_of_v73(data: &Path) {
    let plain = mirrored(data, "z_captured_confocal_64.npz");
    let path = data.join("native/z_v73.mat");
    assert_error(read(&path), Kind::Options, &["z_v73.mat", "wall", "1m", "32ps"]);
    assert_error(read_given(&path, &wall(0.8)), Kind::Options, &["bin", "32ps"]);
    let given = wall(0.8).with_bin_width(5.0 * 299_792_458e-12);
    assert_twins(&by_fours(open(&path, &given)), &plain, "Z");
}

pub fn ccsocr_statue(data: &Path) {
    // CC-SOCR draws the horizontal axis to the left, along +x: its pictures show the mirror image of Stanford's.
    let plain = read(&data.join("statue_confocal_64.npz")).unwrap();
    let folder = data.join("native/ccsocr_statue");
    assert_error(read(&folder), Kind::Options, &["CC-SOCR", "wall", "1m"]);
    for path in [folder.clone(), folder.join("sub_Sig.mat"), folder.join("C_d.mat"), folder.join("C_i.mat")] {
        assert_twins(&open(&path, &wall(2.0)), &plain, &path.display().to_string());
    }
}

pub fn ytal_files_equal_their_twins(data: &Path) {
    for name in ["z_confocal_32", "spheres_confocal_32", "z_bumpwall_confocal_32"] {
        let plain = read(&data.join(format!("{name}.npz"))).unwrap();
        let native = open(&data.join(format!("native/{name}.hdf5")), &ReadOptions::default());
        assert_twins(&native, &plain, name);
        if plain.sensor_normal.is_some() {
            assert_eq!(native.sensor_normal, plain.sensor_normal);
        }
    }
}

pub fn a_folder_of_many_captures_is_no_capture(data: &Path) {
    // Its one pair of meas and tofgrid is still found.
    let opened = read_given(&data.join("native"), &ReadOptions::default()).unwrap();
    assert!(opened.notes.iter().any(|n| n.contains("Stanford")));
    assert_error(read(data), Kind::Input, &["folder"]);
}
