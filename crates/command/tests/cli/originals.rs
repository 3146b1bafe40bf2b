//! The command on large chunked files: its memory follows what is kept, not the file.

use std::path::Path;

use fixtures::command::*;
use fixtures::originals::{Cube, Kind, ORIGINAL, photons, times_of_flight, write};
use serde_json::Value;

fn made(path: &Path, shape: [usize; 3]) {
    let cube = Cube { shape, repeat: 1, ..ORIGINAL };
    let tof = times_of_flight(shape);
    write(path, &cube, &|at| photons(at, shape), &[("tofgrid", &shape[1..], &tof)]);
}

fn peak(arguments: &[&str]) -> f64 {
    // With one arena: how much the arenas of threads keep is chance.
    let program = program().display().to_string();
    let all = [&["MALLOC_ARENA_MAX=1", &program], arguments].concat();
    let (_, taken) = measured(Path::new("env"), &all);
    taken.peak as f64 / f64::from(1 << 20)
}

#[test]
fn memory_follows_what_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [small, large] = ["small.mat", "large.mat"].map(|name| folder.path().join(name));
    made(&small, [2048, 32, 32]);
    made(&large, [2048, 96, 96]);
    let [small, large] = [&small, &large].map(|path| path.to_str().unwrap());
    let least = peak(&["info", small, "--stride", "16"]);
    assert!(least > 0.0, "no VmHWM in /proc");
    let thin = peak(&["info", large, "--stride", "16"]);
    // The large file holds 72 MB of counts, 18 MB after the shift. Blocks in work take some of it, and the more the more is
    // kept.
    assert!(thin < least + 15.0, "{thin} MB for a few pairs of the large file, {least} MB of the small one");
    let all = peak(&["info", large]);
    assert!(all < least + 15.0 + 1.25 * 18.0, "{all} MB for all pairs, {least} MB for a few");
}

#[test]
fn parts_are_told_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.mat");
    made(&path, [256, 18, 20]);
    let path = path.to_str().unwrap();
    let json = |more: &[&str]| -> Value {
        serde_json::from_str(&succeed(&[&["info", "--json", path], more].concat())).unwrap()
    };
    let part = json(&["--stride", "7", "--subset", "5", "--seed", "3", "--gate", "0.5:1.5", "--wall", "1"]);
    assert_eq!(part["capture"]["pairs"], 5);
    let notes: Vec<&str> = part["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let order = [
        "bin width",
        "shifted by its time of flight",
        "the wall is scaled",
        "every 7th of 18 x 20",
        "5 of 9",
    ];
    let places: Vec<_> = order.map(|what| notes.iter().position(|n| n.contains(what))).to_vec();
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{notes:?}");
    // The wall is scaled before the scan is thinned: 20 points to a metre along y, of which 3 are kept,
    // and half a gap of these on both sides.
    let wide = json(&["--stride", "7", "--wall", "1"])["capture"]["wall_extent_m"].clone();
    let extent = |i: usize| wide[i].as_f64().unwrap();
    assert!((extent(3) - extent(2) - 21.0 / 19.0).abs() < 1e-9, "{wide}");
    fail(&["info", path, "--bounce", "all"], 1, "does not keep bounces apart");
    fail(&["info", path, "--stride", "0"], 1, "--stride is 0");
    fail(&["info", path, "--gate", "90:99"], 1, "outside the recorded paths");
}

#[test]
fn a_damaged_chunk_is_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.mat");
    let shape = [256, 48, 48];
    let cube = Cube { shape, kind: Kind::Counts, repeat: 1, ..ORIGINAL };
    write(&path, &cube, &|at| photons(at, shape), &[("tofgrid", &shape[1..], &times_of_flight(shape))]);
    let good = std::fs::read(&path).unwrap();
    let name = path.to_str().unwrap();
    let mut bad = good.clone();
    let middle = bad.len() / 2;
    bad[middle..middle + 64].fill(0x5a);
    std::fs::write(&path, bad).unwrap();
    fail(&["info", name, "--stride", "8"], 1, "dataset meas");
    std::fs::write(&path, &good[..middle]).unwrap();
    fail(&["info", name], 1, "cut short");
}
