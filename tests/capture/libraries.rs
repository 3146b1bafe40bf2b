//! Files as other libraries write them (`tests/fixtures/files/README.md`).

use std::path::{Path, PathBuf};

use fixtures::captures::{assert_error, place};
use fixtures::files::{hdf5, matrix, scalar};
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::{Pulse, read, read_with_notes};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/files").join(name)
}

#[test]
fn the_same_keys_in_every_container() {
    for name in ["keys_scipy.mat", "keys_hdf5storage.mat", "keys_h5py.h5", "keys_octave.h5", "keys_xarray.nc"]
    {
        let c = read(&file(name)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((c.scan, c.bins, c.bin_width, c.t_start), ([3, 2], 5, 0.02, 0.3), "{name}");
        assert_eq!(c.sensor[5], dvec3(0.2, 0.1, 0.0), "{name}");
        assert_eq!(c.laser, [dvec3(0.05, 0.1, 0.0); 6], "{name}");
        assert_eq!(c.histograms[5 * 5 + 3], 123.0, "{name}");
        assert_eq!((c.sensor_spot, c.cycles), (Some(0.03), Some(1000.0)), "{name}");
        assert!(c.integer_counts && c.sensor_normal == Some(vec![DVec3::Z; 6]), "{name}");
        let pulse = Pulse::read(&file(name)).unwrap();
        assert_eq!((pulse.samples, pulse.width), (vec![1.0, 2.0, 1.0], 0.01), "{name}");
    }
    assert_error(
        read(&file("long_double.h5")),
        Kind::Input,
        &["dataset H holds long doubles", "16 bytes", "float64"],
    );
    // The error names the missing array and those of the file.
    let (_folder, path) = place("made.h5");
    let h = matrix("H", &[2, 3, 5], |_| 1.0);
    let points = matrix("sensor_xyz", &[3, 2, 3], |at| 0.1 * at[at[0] % 2 + 1] as f64);
    hdf5(&path, &[h, points, scalar("delta_t", 0.02)]);
    assert_error(read(&path), Kind::Input, &["no array laser_xyz", "H, delta_t, sensor_xyz", "wanted: H,"]);
}

#[test]
fn ytal_normals_follow_downscaled_points() {
    let opened = read_with_notes(&file("ytal_downscale.hdf5")).unwrap();
    let c = opened.capture;
    assert_eq!((c.scan, c.bins), ([2, 2], 24));
    let normals = c.sensor_normal.unwrap();
    let block = [0.099_503_72, 0.033_314_83].map(|x: f64| dvec3(x, 0.0, (1.0 - x * x).sqrt()));
    assert!(normals[0].distance((block[0] + block[1]).normalize()) < 1e-6, "{}", normals[0]);
    assert!((normals[3] - normals[0] * dvec3(-1.0, 1.0, 1.0)).length() < 1e-6 && c.laser_normal.is_some());
    let notes = opened.notes.join("\n");
    assert!(notes.contains("[4, 4, 3]") && notes.contains("mean of each 2 x 2"), "{notes}");
}

#[test]
fn ytal_arrays_in_an_npz_are_those_of_ytal() {
    let c = read(&file("ytal_as_dict.npz")).unwrap();
    assert_eq!((c.scan, c.bins, c.bin_width), ([4, 4], 24, 0.05));
    assert!(c.is_confocal() && c.sensor[4].distance(dvec3(-0.5 + 1.0 / 3.0, -0.5, 0.0)) < 1e-6);
    assert_eq!(c.histograms[(3 * 4 + 2) * 24 + 7], 15.0);
}

/// The axes of the tensor of mitransient, in the file of the library.
#[test]
fn tensors_of_mitransient_are_recognised() {
    let sum = "t.sum(-1).transpose";
    assert_error(read(&file("mitransient_confocal.npy")), Kind::Input, &[&format!("{sum}(2, 1, 0)")]);
    assert_error(read(&file("mitransient_exhaustive.npy")), Kind::Input, &[&format!("{sum}(4, 3, 2, 1, 0)")]);
    let (_folder, path) = place("made.npz");
    let points: Vec<f64> =
        (0..6).flat_map(|p| [0.1 * f64::from(p / 2), 0.1 * f64::from(p % 2), 0.0]).collect();
    for (shape, h) in [
        (&[2, 3, 16, 1][..], "H.sum(-1).transpose(2, 1, 0)"),
        (&[2, 3, 16, 3], "H.sum(-1).transpose(2, 1, 0)"),
        // A Stokes vector: its first number is the intensity.
        (&[2, 3, 16, 4], "H[..., 0].transpose(2, 1, 0)"),
        (&[2, 3, 2, 3, 16, 3], "H.sum(-1).transpose(4, 3, 2, 1, 0)"),
    ] {
        let mut arrays = vec![("H", Array::from_f32(shape, &vec![1.0; shape.iter().product()]))];
        arrays.extend(["laser_xyz", "sensor_xyz"].map(|name| (name, Array::from_f64(&[3, 2, 3], &points))));
        arrays.push(("delta_t", Array::from_f64(&[], &[0.1])));
        std::fs::write(&path, npz_bytes(&arrays).unwrap()).unwrap();
        assert_error(read(&path), Kind::Input, &[&format!("H has shape {shape:?}"), "do not agree", h]);
    }
}
