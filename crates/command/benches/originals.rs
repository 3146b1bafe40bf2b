//! Time and peak memory of reading a capture as large as the originals of the f-k migration data set.
//!
//! `cargo bench --bench originals` writes files of 512 x 512 x 2,048 counts (up to 4 GB, in the system's folder for
//! temporary files, one at a time) and runs the command on them. A word after `--` selects rows that contain it.

use std::path::Path;

use fixtures::command::measured;
use fixtures::originals::{Cube, Kind, ORIGINAL, photons, times_of_flight, write};

/// Stored as MATLAB and other programs do.
const LAYOUTS: [(&str, Cube); 7] = [
    ("single, chunks 64 x 16 x 16", ORIGINAL),
    ("single, chunks 2048 x 2 x 1", Cube { chunk: [2048, 2, 1], repeat: 64, ..ORIGINAL }),
    ("single, chunks 128 x 32 x 32", Cube { chunk: [128, 32, 32], repeat: 2, ..ORIGINAL }),
    ("single, chunks 4 x 512 x 512", Cube { chunk: [4, 512, 512], repeat: 1, ..ORIGINAL }),
    ("single, plain", Cube { chunk: [0; 3], ..ORIGINAL }),
    ("double, chunks 64 x 16 x 16", Cube { kind: Kind::Double, ..ORIGINAL }),
    ("uint16, chunks 64 x 16 x 16", Cube { kind: Kind::Counts, ..ORIGINAL }),
];

fn main() {
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("meas.mat");
    println!(
        "| stored | file | `info` | peak | `info --stride 4` | peak | `info --stride 8` | peak |\n\
         |---|---|---|---|---|---|---|---|"
    );
    for (what, cube) in LAYOUTS.iter().filter(|(what, _)| what.contains(&wanted)) {
        let [_, n2, n1] = cube.shape;
        let tof = times_of_flight(cube.shape);
        write(&path, cube, &|at| photons(at, cube.shape), &[("tofgrid", &[n2, n1], &tof)]);
        let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
        let name = path.to_str().expect("a path of ASCII letters");
        let program = Path::new(env!("CARGO_BIN_EXE_thirdbounce"));
        let row = [&["info", name][..], &["info", name, "--stride", "4"], &["info", name, "--stride", "8"]]
            .map(|arguments| {
                let (_, taken) = measured(program, arguments);
                format!("{:.1} s | {:.0} MB", taken.seconds, taken.peak as f64 / 1e6)
            });
        println!("| {what} | {:.0} MB | {} |", bytes as f64 / 1e6, row.join(" | "));
    }
}
