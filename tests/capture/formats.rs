//! Capture files: round trips, layouts, and the error of every damage.

use std::io::{Cursor, Write};

use fixtures::captures::{as_written, assert_error, capture, changed, place, ramp};
use glam::DVec3;
use thirdbounce::capture::{
    Capture, Flip, ReadOptions, Turn, formats, read, read_given, read_with_notes, write,
};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::{Array, Element};
use thirdbounce::{Kind, Result};

fn round_trip(capture: &Capture, name: &str) -> Capture {
    let (_folder, path) = place(name);
    write(capture, &path).unwrap();
    read(&path).unwrap()
}

#[test]
fn captures_come_back_as_they_were() {
    let whole = ramp();
    let mut large = ramp();
    large.histograms[3] = 70_000.0;
    let mut real = ramp();
    (real.integer_counts, real.histograms[7]) = (false, 0.25);
    let mut one_sensor = ramp();
    one_sensor.sensor.fill(DVec3::new(0.1, 0.2, 0.3));
    one_sensor.sensor_normal = Some(vec![DVec3::Z; 6]);
    let single = capture([1, 1], 1, |_, _| 1.0);
    for ending in ["npz", "hdf5"] {
        for c in [&whole, &large, &real, &one_sensor, &single] {
            assert_eq!(round_trip(c, &format!("made.{ending}")), as_written(c, ending));
        }
    }
}

#[test]
fn counts_are_whole_by_value() {
    let as_floats = changed(&ramp(), |c| c.integer_counts = false);
    let fraction = changed(&as_floats, |c| c.histograms[17] = 0.5);
    let below = changed(&as_floats, |c| c.histograms[17] = -1.0);
    for ending in ["npz", "hdf5"] {
        let read = |c: &Capture| round_trip(c, &format!("made.{ending}"));
        assert!(read(&as_floats).integer_counts, "{ending}");
        assert!(!read(&fraction).integer_counts && !read(&below).integer_counts, "{ending}");
        // Nothing but zeros is no count.
        let (_folder, path) = place(&format!("made.{ending}"));
        let dark = changed(&as_floats, |c| c.histograms.fill(0.0));
        assert_error(write(&dark, &path), Kind::Input, &["no signal"]);
    }
}

#[test]
fn negative_counts_are_told_with_their_noise() {
    let taken_off = capture([4, 4], 64, |p, b| match b {
        10..16 => 100.0,
        // Noise of mean 0 and variance 4.
        _ => {
            if (7 * p + 3 * b) % 4 < 2 {
                2.0
            } else {
                -2.0
            }
        }
    });
    for ending in ["npz", "hdf5"] {
        let (_folder, path) = place(&format!("made.{ending}"));
        write(&taken_off, &path).unwrap();
        let opened = read_with_notes(&path).unwrap();
        let note = opened.notes.iter().find(|n| n.contains("are negative")).unwrap();
        let count = opened.capture.histograms.iter().filter(|v| **v < 0.0).count();
        assert!(count > 100 && note.starts_with(&format!("{count} of 1024 counts")), "{note}");
        assert!(!opened.capture.integer_counts && note.contains("noise"), "{note}");
        write(&ramp(), &path).unwrap();
        assert!(!read_with_notes(&path).unwrap().notes.iter().any(|n| n.contains("negative")));
    }
}

#[test]
fn equal_captures_give_equal_bytes() {
    for ending in ["npz", "hdf5"] {
        let bytes = || {
            let (_folder, path) = place(&format!("made.{ending}"));
            write(&ramp(), &path).unwrap();
            std::fs::read(path).unwrap()
        };
        let first = bytes();
        std::thread::sleep(std::time::Duration::from_millis(1100));
        assert!(first == bytes(), "{ending}");
    }
}

#[test]
fn positions_of_devices_are_kept_and_follow_the_points() {
    let (near, far) = (DVec3::new(-0.5, 0.1, 0.25), DVec3::new(1.0, 0.0, 2.0));
    for devices in [[Some(near); 2], [Some(near), Some(far)], [Some(near), None], [None, Some(far)]] {
        let named = changed(&ramp(), |c| c.devices = devices);
        assert_eq!(round_trip(&named, "named.npz").devices, devices);
        let (_folder, path) = place("named.hdf5");
        assert!(write(&named, &path).unwrap().concat().contains("positions of the devices"));
    }
    let named = changed(&ramp(), |c| c.devices = [Some(near), None]);
    let mirrored = named.clone().turned(Turn::of(Some(Flip::X), None).unwrap());
    assert_eq!(mirrored.devices, [Some(DVec3::new(0.5, 0.1, 0.25)), None]);
    let mut scaled = named.clone();
    let before = named.sensor[5].distance(named.sensor[0]);
    scaled.set_wall(7.0).unwrap();
    let scale = scaled.sensor[5].distance(scaled.sensor[0]) / before;
    assert!(scale > 1.5 && scaled.devices[0].unwrap().distance(near * scale) < 1e-9);
    let wrong = |values: &[f64]| {
        let device = ("device_xyz", Array::from_f64(&[values.len()], values));
        read_arrays(&[arrays(), vec![device]].concat())
    };
    assert_eq!(wrong(&[-0.5, 0.1, 0.25]).unwrap().devices, [Some(near); 2]);
    assert_error(wrong(&[1.0, 2.0]), Kind::Input, &["device_xyz", "[2]", "three numbers"]);
    assert_error(wrong(&[1.0, f64::NAN, 1.0]), Kind::Input, &["device of the laser", "x, y, z"]);
}

#[test]
fn the_format_is_read_from_the_contents() {
    let (folder, path) = place("made.npz");
    write(&ramp(), &path).unwrap();
    let other = folder.path().join("made.hdf5");
    std::fs::rename(&path, &other).unwrap();
    assert_eq!(read(&other).unwrap(), ramp());
    write(&ramp(), &path.with_extension("h5")).unwrap();
    let mut behind_user_block = vec![0u8; 512];
    behind_user_block.extend(std::fs::read(path.with_extension("h5")).unwrap());
    std::fs::write(&path, &behind_user_block).unwrap();
    // It is recognised as HDF5 whether or not its addresses are valid.
    if let Err(e) = read(&path) {
        assert!(e.to_string().contains("HDF5"), "{e}");
    }
    assert_error(write(&ramp(), &folder.path().join("made.txt")), Kind::Options, &["made.txt", ".npz"]);
}

/// Writes arrays as an npz and reads them as a capture.
fn read_arrays(arrays: &[(&str, Array)]) -> Result<Capture> {
    let (_folder, path) = place("arrays.npz");
    std::fs::write(&path, npz_bytes(arrays).unwrap()).unwrap();
    read(&path)
}

/// The arrays of `ramp`, with one wall point.
fn arrays() -> Vec<(&'static str, Array)> {
    let h: Vec<f32> = (0..5).flat_map(|b| (0..6).map(move |p| (10 * p + b) as f32)).collect();
    vec![
        ("H", Array::from_f32(&[5, 3, 2], &h)),
        ("sensor_xyz", Array::from_f64(&[1, 3], &[0.0, 0.1, 0.2])),
        (
            "laser_xyz",
            Array::from_f32(
                &[3, 2, 3],
                &(0..18).map(|v| if v % 3 == 2 { 0.0 } else { v as f32 }).collect::<Vec<_>>(),
            ),
        ),
        ("delta_t", Array::from_f64(&[], &[0.01])),
        ("t_start", Array::from_f32(&[1], &[0.5])),
    ]
}

fn with(name: &'static str, array: Array) -> Vec<(&'static str, Array)> {
    arrays().into_iter().filter(|a| a.0 != name).chain([(name, array)]).collect()
}

#[test]
fn npz_of_every_element_type_and_order() {
    let wanted = read_arrays(&arrays()).unwrap();
    assert_eq!(wanted.histograms, ramp().histograms);
    assert_eq!(wanted.sensor, vec![DVec3::new(0.0, 0.1, 0.2); 6]);
    assert_eq!(wanted.laser[5], DVec3::new(15.0, 16.0, 0.0));
    assert!(wanted.integer_counts);
    let values: Vec<u8> = (0..5u8).flat_map(|b| (0..6).map(move |p| 10 * p + b)).collect();
    let bytes = |v: u8, element: Element, big: bool| -> Vec<u8> {
        let mut bytes = match element {
            Element::F32 => f32::from(v).to_le_bytes().to_vec(),
            Element::F64 => f64::from(v).to_le_bytes().to_vec(),
            _ => u64::from(v).to_le_bytes()[..element.size()].to_vec(),
        };
        if big {
            bytes.reverse();
        }
        bytes
    };
    use Element::*;
    for element in [U8, U16, U32, U64, I8, I16, I32, I64, F32, F64] {
        for big_endian in [false, true] {
            for fortran in [false, true] {
                let ordered: Vec<u8> = if fortran {
                    // Bins first: within (iy, ix, bin) the bin runs fastest.
                    (0..2)
                        .flat_map(|y| (0..3).map(move |x| (x, y)))
                        .flat_map(|(x, y)| (0..5).map(move |b| (x, y, b)))
                        .map(|(x, y, b)| values[b * 6 + x * 2 + y])
                        .collect()
                } else {
                    values.clone()
                };
                let bytes = ordered.iter().flat_map(|&v| bytes(v, element, big_endian)).collect();
                let h = Array { shape: vec![5, 3, 2], element, big_endian, fortran, bytes };
                let read = read_arrays(&with("H", h)).unwrap();
                assert_eq!(read.histograms, wanted.histograms, "{element:?} {big_endian} {fortran}");
                assert!(read.integer_counts, "{element:?}: whole by value, whatever the type");
            }
        }
    }
}

/// An npy file with a header made by hand.
fn npy(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let mut npy = b"\x93NUMPY".to_vec();
    npy.extend([version, 0]);
    match version {
        1 => npy.extend((header.len() as u16).to_le_bytes()),
        _ => npy.extend((header.len() as u32).to_le_bytes()),
    }
    npy.extend(header.as_bytes());
    npy.extend(data);
    npy
}

#[test]
fn npy_headers() {
    let data: Vec<u8> = (0..6).collect();
    let shape = |npy: &[u8]| Array::parse(npy).map(|a| (a.shape.clone(), a.to_f64()));
    let good = "{'shape': (2, 3), 'fortran_order': True, 'descr': '|u1'}\n";
    for version in [1, 2, 3] {
        assert_eq!(shape(&npy(version, good, &data)).unwrap(), (vec![2, 3], vec![0., 2., 4., 1., 3., 5.]));
    }
    assert_eq!(
        shape(&npy(1, "{\"descr\":\"<u2\",\"fortran_order\":False,\"shape\":(3,)}", &data)).unwrap().0,
        [3]
    );
    assert_eq!(
        shape(&npy(1, "{'descr': '|u1', 'fortran_order': False, 'shape': ()}", &[7])).unwrap().1,
        [7.0]
    );
    for (header, words) in [
        ("{'descr': '|u1', 'fortran_order': False, 'shape': (7,)}", "7"),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': (18446744073709551615, 3)}", "fit"),
        ("{'descr': '|O', 'fortran_order': False, 'shape': (6,)}", "plain number"),
        ("{'descr': [('a', '<i4')], 'fortran_order': False, 'shape': (6,)}", "plain number"),
        ("{'descr': '<c16', 'fortran_order': False, 'shape': (6,)}", "plain number"),
        ("{'descr': '|u1', 'shape': (6,)}", "header"),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': (-1, 6)}", "header"),
        ("{'descr': 'é', 'fortran_order': False, 'shape': (6,)}", "plain number"),
        ("", "plain number"),
    ] {
        assert_error(Array::parse(&npy(1, header, &data)), Kind::Input, &[words]);
    }
    assert_error(Array::parse(b"not an array"), Kind::Input, &["not an npy"]);
    assert_error(Array::parse(&npy(9, good, &data)), Kind::Input, &["version 9"]);
    assert_error(Array::parse(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{}"), Kind::Input, &["cut short"]);
}

#[test]
fn wrong_npz_captures() {
    let without = |name| arrays().into_iter().filter(|a| a.0 != name).collect::<Vec<_>>();
    for name in ["H", "sensor_xyz", "laser_xyz"] {
        assert_error(
            read_arrays(&without(name)),
            Kind::Input,
            &["arrays.npz", name, "it holds", "wanted: H, sensor_xyz"],
        );
    }
    assert_eq!(read_arrays(&without("t_start")).unwrap().t_start, 0.0);
    // The bin width may be given in place of the file's.
    let (_folder, path) = place("bare.npz");
    std::fs::write(&path, npz_bytes(&without("delta_t")).unwrap()).unwrap();
    assert_error(read(&path), Kind::Options, &["without delta_t", "bin_width"]);
    let given = ReadOptions::default().with_bin_width(0.01);
    assert_eq!(read_given(&path, &given).unwrap().capture.bin_width, 0.01);
    read_arrays(&with("notes", Array::from_f64(&[2], &[1.0, 2.0]))).unwrap();
    let wrong =
        |name, array, words: &[&str]| assert_error(read_arrays(&with(name, array)), Kind::Input, words);
    wrong("H", Array::from_f32(&[5, 6], &[1.0; 30]), &["[5, 6]", "[T, X, Y]", "[T, Lx, Ly, Sx, Sy]"]);
    wrong("H", Array::from_f32(&[0, 3, 2], &[]), &["no bin"]);
    wrong("H", Array::from_f32(&[5, 0, 2], &[]), &["no bin, or no pair"]);
    wrong("H", Array::from_f32(&[5, 3, 2], &[0.0; 30]), &["no signal"]);
    wrong("H", Array::from_f32(&[5, 3, 2], &[f32::NAN; 30]), &["no pair", "6"]);
    wrong("H", Array::from_f32(&[5, 3, 2], &[-1.0; 30]), &["no signal", "upside down"]);
    wrong("sensor_xyz", Array::from_f64(&[5, 3], &[0.0; 15]), &["sensor_xyz", "[5, 3]", "[5, 3, 2]"]);
    wrong("laser_xyz", Array::from_f64(&[3, 2], &[0.0; 6]), &["laser_xyz", "[3, 2]"]);
    wrong("sensor_normal", Array::from_f64(&[1, 3], &[0.0; 3]), &["sensor normal", "unit length"]);
    wrong("delta_t", Array::from_f64(&[2], &[0.1, 0.1]), &["delta_t", "[2]", "scalar"]);
    wrong("delta_t", Array::from_f64(&[], &[-0.1]), &["bin width"]);
}

#[test]
fn unreadable_files_give_errors() {
    let (folder, path) = place("file");
    assert_error(read(&path), Kind::Input, &["file", "no such file"]);
    assert_error(read(folder.path()), Kind::Input, &["folder"]);
    // A damaged file is named where nothing else holds a capture.
    std::fs::write(folder.path().join("half.mat"), b"not a MATLAB file").unwrap();
    assert_error(read(folder.path()), Kind::Input, &["half.mat"]);
    let contents = |bytes: &[u8], words: &[&str]| {
        std::fs::write(&path, bytes).unwrap();
        assert_error(read(&path), Kind::Input, words);
    };
    contents(b"", &["empty"]);
    contents(b"hello", &["format is not known", "npz", "y-tal"]);
    contents(&[0u8; 5000], &["format is not known"]);
    contents(b"MATLAB 5.0 MAT-file", &["MATLAB"]);
    contents(b"PK\x03\x04 and no more", &["zip archive"]);
    contents(b"\x89HDF\r\n\x1a\n", &["HDF5"]);
    contents(&Array::from_f64(&[1], &[1.0]).to_npy(), &["single npy"]);
}

#[test]
fn a_zip_bomb_is_refused() {
    // A good archive, whose directory is changed to claim a terabyte for H.
    let mut bytes = npz_bytes(&arrays()).unwrap();
    let directory = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    bytes[directory + 24..directory + 28].copy_from_slice(&0xf000_0000u32.to_le_bytes());
    let (_folder, path) = place("bomb.npz");
    std::fs::write(&path, bytes).unwrap();
    assert_error(read(&path), Kind::Input, &["H", "claims"]);
}

/// Small, fast, repeatable noise.
fn noise(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    }
}

#[test]
fn damaged_files_never_panic() {
    for ending in ["npz", "hdf5"] {
        let (_folder, path) = place(&format!("damaged.{ending}"));
        write(&ramp(), &path).unwrap();
        let good = std::fs::read(&path).unwrap();
        let step = (good.len() / 150).max(1);
        for length in (0..good.len()).step_by(step) {
            std::fs::write(&path, &good[..length]).unwrap();
            if length == 0 {
                continue;
            }
            assert_error(read(&path), Kind::Input, &["damaged"]);
        }
        let mut random = noise(7);
        for _ in 0..300 {
            let mut bad = good.clone();
            for _ in 0..1 + random() % 4 {
                let at = random() as usize % bad.len();
                bad[at] = random() as u8;
            }
            std::fs::write(&path, &bad).unwrap();
            // Some damage is harmless; none may cause a panic or a hang.
            if let Ok(c) = read(&path) {
                c.check().unwrap();
            }
        }
        for _ in 0..50 {
            let mut bad = good[..8].to_vec();
            bad.extend((0..2000).map(|_| random() as u8));
            std::fs::write(&path, &bad).unwrap();
            assert_error(read(&path), Kind::Input, &["damaged"]);
        }
    }
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "here").unwrap();
    for ending in ["npz", "hdf5"] {
        let path = blocked.join(format!("made.{ending}"));
        assert_error(write(&ramp(), &path), Kind::Output, &["file", "not a folder"]);
        let mut silent = ramp();
        silent.histograms.fill(0.0);
        let path = folder.path().join(format!("made.{ending}"));
        assert_error(write(&silent, &path), Kind::Input, &["no signal"]);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_npz_from_another_zip_writer() {
    // Stored, not deflated, as numpy.savez does.
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, array) in arrays() {
        zip.start_file(format!("{name}.npy"), options).unwrap();
        zip.write_all(&array.to_npy()).unwrap();
    }
    let (_folder, path) = place("stored.npz");
    std::fs::write(&path, zip.finish().unwrap().into_inner()).unwrap();
    assert_eq!(read(&path).unwrap().histograms, ramp().histograms);
}

#[test]
fn per_format_modules_are_public() {
    // A reader may be called directly; the values are then not checked.
    let (_folder, path) = place("made.npz");
    formats::npz::write(&ramp(), &path).unwrap();
    assert_eq!(
        formats::npz::read(&path, &ReadOptions::default(), &mut vec![]).unwrap().histograms,
        ramp().histograms
    );
}
