//! One small file or folder per reader, for tests and for the corpus of the fuzzer.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use thirdbounce::capture::Given;

use super::fixtures::{Matrix, Stored, hdf5, matlab5, matlab5_struct, matrix, scalar, vector};

const WALL: Given = Given { wall: Some(1.0), bin_width: None, bounce: None, time_of_flight: None };

pub fn counts(name: &str, dims: &[usize]) -> Matrix {
    matrix(name, dims, |at| (1 + at.iter().sum::<usize>()) as f64).of_counts()
}

fn points(name: &str, dims: &[usize], axis: usize) -> Matrix {
    matrix(name, dims, |at| if at[axis] < 2 { 0.1 * at[1 - axis.min(1)] as f64 } else { 0.0 })
}

/// One small file or folder per reader, by name: the file that is damaged, and what is opened.
pub fn every_reader(folder: &Path) -> Vec<(&'static str, PathBuf, PathBuf, Given)> {
    let mut all = Vec::new();
    let mut add = |name: &'static str, bytes: Option<Vec<u8>>, arrays: &[Matrix], given: Given| {
        let path = folder.join(name);
        match bytes {
            Some(bytes) => std::fs::write(&path, bytes).unwrap(),
            None => hdf5(&path, arrays),
        }
        all.push((name, path.clone(), path, given));
    };
    let lct = [counts("rect_data", &[3, 4, 20]), scalar("width", 0.5)];
    add("lct.mat", Some(matlab5(&lct, Stored::Plain)), &[], Given::default());
    add("lct_big_endian.mat", Some(matlab5(&lct, Stored::BigEndian)), &[], Given::default());
    add("lct_compressed.mat", Some(matlab5(&lct, Stored::Compressed)), &[], Given::default());
    let stanford = [counts("meas", &[3, 4, 20]), matrix("tofgrid", &[3, 4], |at| 40.0 * at[0] as f64)];
    add("stanford.h5", None, &stanford, Given::default());
    let plain = Given { bin_width: Some(0.01), ..WALL };
    add("one_array.h5", None, &[counts("tof_data", &[3, 4, 20])], plain.clone());
    let znlos = [
        counts("data", &[1, 30, 2, 3, 2]),
        points("cameraGridPositions", &[3, 3, 2], 0),
        vector("cameraPosition", &[0.0, 0.0, 0.2]),
        scalar("deltaT", 0.1),
        scalar("t", 30.0),
    ];
    add("znlos.h5", None, &znlos, Given::default());
    let netf =
        [counts("data", &[30, 3, 2]), points("cameraGridPositions", &[3, 6], 0), scalar("deltaT", 0.1)];
    add("netf.mat", Some(matlab5(&netf, Stored::Plain)), &[], Given::default());
    let general = [
        counts("data", &[2, 4, 20]),
        points("laserpoints", &[2, 4, 3], 2),
        points("detectpoints", &[2, 4, 3], 2),
    ];
    add("general.mat", Some(matlab5(&general, Stored::Plain)), &[], Given::default());
    let ccsocr = [
        counts("sub_Sig", &[6, 20]),
        matrix("C_i", &[6, 3], |at| [0, at[0] / 3, at[0] % 3][at[1]] as f64),
        matrix("C_d", &[6, 3], |at| [0, at[0] / 3, at[0] % 3][at[1]] as f64),
    ];
    add("ccsocr.mat", Some(matlab5(&ccsocr, Stored::Plain)), &[], WALL);
    let diffraction = [
        counts("rect_data", &[20, 3, 4]),
        scalar("ts", 4e-12),
        scalar("sampling_spacing", 0.01),
        vector("SPAD_index", &[1.0, 1.0]),
    ];
    add("phasor_2020.mat", Some(matlab5(&diffraction, Stored::Plain)), &[], Given::default());
    let fields = [
        counts("data", &[30, 1, 4]),
        points("laserPos", &[4, 3], 1),
        points("cameraPos", &[1, 3], 1),
        vector("laserOrigin", &[0.0, 0.0, 0.2]),
        vector("cameraOrigin", &[0.0, 0.0, 0.2]),
        scalar("deltat", 0.1),
        scalar("t0", 0.0),
    ];
    let virtual_wave = matlab5_struct("dataset", &fields, Stored::Plain);
    add("phasor_2019.mat", Some(virtual_wave), &[], Given::default());
    add(
        "phasor_2019_compressed.mat",
        Some(matlab5_struct("dataset", &fields, Stored::Compressed)),
        &[],
        Given::default(),
    );
    // A folder whose counts are damaged while the points are whole.
    let several = folder.join("several");
    std::fs::create_dir(&several).unwrap();
    for m in &ccsocr {
        let stored = if m.name == "sub_Sig" { Stored::Compressed } else { Stored::Plain };
        std::fs::write(several.join(format!("{}.mat", m.name)), matlab5(std::slice::from_ref(m), stored))
            .unwrap();
    }
    all.push(("folder", several.join("sub_Sig.mat"), several, WALL));
    all
}
