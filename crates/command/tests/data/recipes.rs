//! The lines of Python that errors print make captures that are read; those of a page find time zero.

use std::path::Path;
use std::process::Command;

use fixtures::captures::capture;
use glam::dvec3;
use thirdbounce::capture::{read, write};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;

/// Invented counts of this shape.
fn counts(shape: &[usize]) -> Array {
    let count: usize = shape.iter().product();
    Array::from_f32(shape, &(0..count).map(|v| (v % 7) as f32).collect::<Vec<_>>())
}

/// Runs the recipe of the error of a file; returns scan and bins of the capture that it makes.
fn made(python: &Path, file: &Path) -> ([usize; 2], usize) {
    let folder = file.parent().unwrap();
    let error = read(file).unwrap_err().to_string();
    let start = error.find("import numpy").unwrap_or_else(|| panic!("no recipe in {error}"));
    let end = error[start..].find("np.savez").unwrap() + start;
    let end = error[end..].find('\n').map_or(error.len(), |line| end + line);
    let lines = error[start..end].replace("FILE", &file.file_name().unwrap().to_string_lossy());
    let lines = lines.replace("POINTS", "points.csv");
    let output = Command::new(python).args(["-c", &lines]).current_dir(folder).output().expect("Python runs");
    assert!(output.status.success(), "{file:?}: {lines}\n{}", String::from_utf8_lossy(&output.stderr));
    let capture = read(&folder.join("capture.npz")).unwrap_or_else(|e| panic!("{file:?}: {e}"));
    (capture.scan, capture.bins)
}

pub fn printed_recipes_make_captures(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("points.csv"), "0,0,0\n0.1,0,0\n0.1,0.2,0\n").unwrap();
    for (shape, wanted) in [
        (&[9, 3, 2][..], ([3, 2], 9)),
        (&[9, 3, 2, 5, 4], ([6, 20], 9)),
        (&[9, 3], ([3, 1], 9)),
        // Tensors of mitransient: [Y, X, T, C] and [Sy, Sx, Ly, Lx, T, C].
        (&[2, 3, 9, 1], ([3, 2], 9)),
        (&[2, 3, 9, 3], ([3, 2], 9)),
        (&[2, 3, 9, 4], ([3, 2], 9)),
        (&[4, 5, 2, 3, 9, 1], ([6, 20], 9)),
        (&[4, 5, 2, 3, 9, 3], ([6, 20], 9)),
    ] {
        std::fs::write(at("alone.npy"), counts(shape).to_npy()).unwrap();
        assert_eq!(made(python, &at("alone.npy")), wanted, "{shape:?}");
        let arrays = [("arr_0", counts(shape)), ("delta_t", Array::from_f64(&[], &[0.1]))];
        std::fs::write(at("alone.npz"), npz_bytes(&arrays).unwrap()).unwrap();
        assert_eq!(made(python, &at("alone.npz")), wanted, "{shape:?} in an npz");
    }
    for (name, text) in [("commas.csv", "0, 1, 2\n3, 4, 5\n"), ("spaces.txt", "0 1 2\n3 4 5\n")] {
        std::fs::write(at(name), text).unwrap();
        assert_eq!(made(python, &at(name)), ([3, 1], 2), "{name}");
    }
    // As H beside points.
    let points: Vec<f64> =
        (0..6).flat_map(|p| [0.1 * f64::from(p / 2), 0.1 * f64::from(p % 2), 0.0]).collect();
    let grid = |nx: usize| Array::from_f64(&[nx, 2, 3], &points[..nx * 6]);
    for (shape, lasers, wanted) in [
        (&[2, 3, 9, 1][..], 3, ([3, 2], 9)),
        (&[2, 3, 9, 4], 3, ([3, 2], 9)),
        (&[2, 3, 2, 2, 9, 3], 2, ([4, 6], 9)),
    ] {
        let arrays = [
            ("H", counts(shape)),
            ("laser_xyz", grid(lasers)),
            ("sensor_xyz", grid(3)),
            ("delta_t", Array::from_f64(&[], &[0.1])),
        ];
        std::fs::write(at("tensor.npz"), npz_bytes(&arrays).unwrap()).unwrap();
        assert_eq!(made(python, &at("tensor.npz")), wanted, "{shape:?}");
    }
}

/// The recipe of docs/data.md finds a known shift from a square of 3 cm, 0.5 m before a wall of 1 m.
pub fn the_recipe_of_the_page_finds_time_zero(python: &Path) {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/data.md")).unwrap();
    let section = page.split("## Time zero\n").nth(1).expect("the section");
    let recipe =
        section.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a recipe");
    let mut c = capture([16, 16], 400, |_, _| 0.0);
    (c.t_start, c.bin_width) = (0.0, 0.006);
    for p in 0..256 {
        let wall = dvec3((p / 16) as f64 / 15.0 - 0.5, (p % 16) as f64 / 15.0 - 0.5, 0.0);
        (c.laser[p], c.sensor[p]) = (wall, wall);
        for k in 0..36 {
            let at = dvec3(0.085 + 0.006 * (k / 6) as f64, 0.035 + 0.006 * (k % 6) as f64, 0.5);
            let (to, r) = (at - wall, at.distance(wall));
            let bin = (2.0 * r / c.bin_width) as usize;
            c.histograms[p * c.bins + bin] += ((to.z / r).powi(2) / r.powi(4)) as f32;
        }
    }
    let folder = tempfile::tempdir().unwrap();
    for bins in [-23.0, 0.0, 7.25] {
        c.t_start = bins * c.bin_width;
        write(&c, &folder.path().join("target.npz")).unwrap();
        let run = Command::new(python).args(["-c", recipe]).current_dir(folder.path()).output();
        let output = run.expect("Python runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let corrected = read(&folder.path().join("corrected.npz")).unwrap();
        let off = corrected.t_start / c.bin_width;
        assert!(off.abs() < 1.0, "{bins} bins are found with {off} off");
        assert!(corrected.histograms == c.histograms);
    }
}
