//! What is written opens in the programs of others: check_outputs.py with numpy, h5py, scipy, matplotlib and OpenEXR.

use std::path::Path;
use std::process::Command;

use fixtures::captures::capture;
use thirdbounce::capture::write;
use thirdbounce::export::{self, volume};
use thirdbounce::maps::Maps;

/// A dome over a floor that lies far behind, and nothing at its edge; written into `result`.
fn write_result(result: &Path) -> [usize; 2] {
    let (nx, ny) = (24, 16);
    let mut maps = Maps { mask_fraction: Some(0.0), ..Maps::empty([nx, ny], [-0.6, 0.6, -0.4, 0.4]) };
    for p in 0..nx * ny {
        let (x, y) = ((p / ny) as f32 - 11.5, (p % ny) as f32 - 7.5);
        let r2 = (x * x + y * y) / 36.0;
        if r2 < 1.0 {
            let z = (1.0 - r2).sqrt();
            (maps.albedo[p], maps.depth[p]) = (0.5 + 0.5 * z, 1.0 - 0.3 * z);
            maps.normal[p] = [x / 6.0, y / 6.0, -z];
        } else if p / ny > 2 {
            (maps.albedo[p], maps.depth[p], maps.normal[p]) = (0.7, 2.0, [0.0, 0.0, -1.0]);
        }
    }
    maps.set_mask(0.3);
    maps.depth_error = Some(maps.depth.iter().map(|z| 0.01 * z).collect());
    export::write_maps(result, &maps).unwrap();
    [nx, ny]
}

/// Runs a script on folders; it prints these words where all is well.
fn check(python: &Path, script: &str, folders: &[&Path], words: &str) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(script);
    let output = Command::new(python).arg(script).args(folders).output().expect("Python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains(words), "{text}{errors}");
}

pub fn viewers_agree(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    write_result(folder.path());
    check(python, "check_viewers.py", &[folder.path()], "all viewers agree");
}

pub fn python_opens_everything(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let (result, captures) = (folder.path().join("result"), folder.path().join("captures"));
    let [nx, ny] = write_result(&result);
    let albedo: Vec<f32> = (0..nx * ny * 20).map(|v| (v % 97) as f32).collect();
    let extent = [-0.6, 0.6, -0.4, 0.4, 0.5, 2.5];
    let voxels = volume::VolumeArrays { size: [nx, ny, 20], extent, albedo, normal: None };
    for name in ["volume.npz", "volume.hdf5"] {
        volume::write(&result.join(name), &voxels).unwrap();
    }
    let mut made = capture([5, 4], 30, |p, b| (p * 7 + b * 3) as f32);
    made.t_start = 0.0;
    for (p, point) in made.laser.iter_mut().enumerate() {
        *point = glam::dvec3(0.1 * (p / 4) as f64 - 0.2, 0.1 * (p % 4) as f64 - 0.15, 0.0);
    }
    made.sensor = made.laser.clone();
    for name in ["made.npz", "made.hdf5", "made.mat"] {
        write(&made, &captures.join(name)).unwrap();
    }
    check(python, "check_outputs.py", &[&result, &captures], "all outputs open");
}
