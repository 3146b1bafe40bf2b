//! Maps of other programs: the same maps from every kind of file, and what a file does not hold.

use std::path::Path;

use fixtures::files::{Matrix, Stored, hdf5, matlab5, matrix, vector};
use thirdbounce::export::{exr, npz};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce::maps::Maps;
use thirdbounce_benchmark::foreign;

const EXTENT: [f64; 4] = [-0.5, 0.25, 1.0, 2.0];
const OTHER: [f64; 4] = [0.0, 1.0, 0.0, 1.0];

/// Maps of 3 x 2 pixels that no axis or mirror leaves as they are. One pixel holds nothing.
fn maps() -> Maps {
    let mut maps = Maps {
        albedo: (0..6).map(|i| 0.5 + 0.1 * i as f32).collect(),
        depth: (0..6).map(|i| 0.75 + 0.125 * i as f32).collect(),
        normal: (0..6)
            .map(|i| [0.6, 0.0, -0.8].map(|v: f32| if i % 2 == 0 { v } else { -v.abs() }))
            .collect(),
        ..Maps::empty([3, 2], EXTENT)
    };
    (maps.albedo[4], maps.depth[4], maps.normal[4]) = (0.0, f32::NAN, [f32::NAN; 3]);
    maps.set_mask(0.3);
    maps
}

/// The arrays as one writes them in MATLAB: `depth(ix, iy)`.
fn matrices(maps: &Maps) -> [Matrix; 5] {
    let at = |p: &[usize]| p[0] * maps.ny + p[1];
    [
        matrix("depth", &[3, 2], |p| f64::from(maps.depth[at(p)])),
        matrix("albedo", &[3, 2], |p| f64::from(maps.albedo[at(p)])),
        matrix("mask", &[3, 2], |p| f64::from(u8::from(maps.mask[at(p)]))),
        matrix("normal", &[3, 2, 3], |p| f64::from(maps.normal[at(p)][p[2]])),
        vector("extent", &EXTENT),
    ]
}

#[track_caller]
fn same(found: &Maps, wanted: &Maps) {
    let bits = |all: &[f32]| all.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!((found.nx, found.ny, found.extent), (wanted.nx, wanted.ny, wanted.extent));
    assert_eq!(bits(&found.albedo), bits(&wanted.albedo));
    assert_eq!(bits(&found.depth), bits(&wanted.depth));
    assert_eq!(bits(found.normal.as_flattened()), bits(wanted.normal.as_flattened()));
    assert_eq!(found.mask, wanted.mask);
}

fn read(file: &Path) -> Maps {
    foreign::read(file, OTHER).unwrap()
}

#[test]
fn every_kind_of_file_gives_the_same_maps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let wanted = maps();
    npz::write_maps(&at("one.npz"), &wanted).unwrap();
    exr::write(&at("two.exr"), &wanted).unwrap();
    std::fs::write(at("three.mat"), matlab5(&matrices(&wanted), Stored::Compressed)).unwrap();
    hdf5(&at("four.mat"), &matrices(&wanted));
    for name in ["one.npz", "two.exr", "three.mat", "four.mat"] {
        println!("{name}");
        same(&read(&at(name)), &wanted);
    }
    std::fs::rename(at("two.exr"), at("maps.exr")).unwrap();
    same(&read(folder.path()), &wanted);
}

#[test]
fn depths_alone_suffice() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("depths.npz");
    let depth = Array::from_f32(&[3, 2], &[0.0, 0.5, 0.6, 0.7, f32::NAN, 0.9]);
    std::fs::write(&file, npz_bytes(&[("depth", depth)]).unwrap()).unwrap();
    let found = read(&file);
    assert_eq!(found.mask, [false, true, true, true, false, true]);
    assert!(found.extent == OTHER && found.depth[0].is_nan() && found.normal[1][2].is_nan());
    let mat = folder.path().join("depths.mat");
    std::fs::write(&mat, matlab5(&[matrix("depth", &[3, 2], |p| 0.5 + p[0] as f64)], Stored::Plain)).unwrap();
    assert_eq!(read(&mat).depth, [0.5, 0.5, 1.5, 1.5, 2.5, 2.5]);
}

#[test]
fn what_is_missing_or_does_not_fit_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let says = |name: &str, bytes: &[u8], what: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        let error = foreign::read(&file, OTHER).unwrap_err();
        assert!(error.to_string().contains(what) && error.to_string().contains(name), "{error}");
    };
    let [depth, albedo, ..] = matrices(&maps());
    says("a.mat", &matlab5(std::slice::from_ref(&albedo), Stored::Plain), "no array depth");
    let wide = matrix("albedo", &[2, 3], |_| 1.0);
    says("b.mat", &matlab5(&[depth, wide], Stored::Plain), "albedo has shape [2, 3]");
    says("c.exr", b"no picture", "cannot be read as EXR");
    says("d.npz", b"no archive", "");
    says("e.png", b"", "not a known file type for maps");
    let empty = tempfile::tempdir().unwrap();
    assert!(foreign::read(empty.path(), OTHER).unwrap_err().to_string().contains("holds none of maps.npz"));
    assert!(foreign::read(&folder.path().join("gone.exr"), OTHER).is_err());
}
