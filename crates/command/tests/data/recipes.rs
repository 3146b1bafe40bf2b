//! The lines of Python that errors print make captures that are read.

use std::path::Path;
use std::process::Command;

use thirdbounce::capture::read;
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
