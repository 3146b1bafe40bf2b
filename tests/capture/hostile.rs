//! Damaged and malicious files: every reader gives an error, soon, with bounded memory, and never panics.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use fixtures::captures::{assert_error, place};
use fixtures::files::{
    Matrix, Stored, hdf5, matlab_file, matlab_matrix, matlab_struct, matlab5, matrix, noise, scalar, vector,
};
use fixtures::readers::{counts, every_reader};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use thirdbounce::Kind;
use thirdbounce::capture::formats::hdf5::Hdf5;
use thirdbounce::capture::formats::matlab5::Matlab5;
use thirdbounce::capture::{ReadOptions, read, read_given};

/// Opens a damaged file: an error or a sound capture, within a second.
fn open(opened: &Path, given: &ReadOptions, what: &str) -> bool {
    let start = Instant::now();
    let result = read_given(opened, given);
    assert!(start.elapsed().as_secs_f64() < 5.0, "{what} took {:?}", start.elapsed());
    match result {
        Ok(read) => {
            read.capture.check().unwrap_or_else(|e| panic!("{what}: {e}"));
            true
        }
        Err(e) => {
            assert!(!e.what.is_empty() && !e.hint.to_string().is_empty(), "{what}");
            let place = opened.display().to_string();
            assert!(e.what.starts_with(&place), "{what}: {} does not open with the path", e.what);
            assert!(matches!(e.kind, Kind::Input | Kind::Options | Kind::Memory), "{what}: {e}");
            false
        }
    }
}

#[test]
fn whole_files_open() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _, opened, given) in every_reader(folder.path()) {
        let read = read_given(&opened, &given).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(read.capture.pair_count() >= 4, "{name}");
    }
}

#[test]
fn cut_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, damaged, opened, given) in every_reader(folder.path()) {
        let good = std::fs::read(&damaged).unwrap();
        // Every length at the start, where the structure is, then every few bytes.
        let step = (good.len() / 200).max(1);
        let lengths = (1..good.len().min(400)).chain((400..good.len()).step_by(step)).chain([good.len() - 1]);
        let mut survived = Vec::new();
        for length in lengths {
            std::fs::write(&damaged, &good[..length]).unwrap();
            if open(&opened, &given, &format!("{name} cut to {length} bytes")) {
                survived.push(length);
            }
        }
        // Padding after the last value may be missing, and so may an array that is not needed.
        let whole = survived.iter().all(|l| good.len() - l < 700);
        assert!(whole, "{name} of {} bytes opens though cut to {survived:?}", good.len());
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for (at, (name, damaged, opened, given)) in every_reader(folder.path()).into_iter().enumerate() {
        let good = std::fs::read(&damaged).unwrap();
        let mut random = noise(at as u64 + 1);
        for case in 0..300 {
            let mut bad = good.clone();
            // Half of the cases aim at the start, where tags and dimensions are.
            let reach = if case % 2 == 0 { bad.len() } else { bad.len().min(600) };
            for _ in 0..1 + random() % 4 {
                let place = random() % reach;
                bad[place] = match random() % 4 {
                    0 => 0xff,
                    1 => 0,
                    2 => bad[place] ^ (1 << (random() % 8)),
                    _ => random() as u8,
                };
            }
            std::fs::write(&damaged, &bad).unwrap();
            refused += usize::from(!open(&opened, &given, &format!("{name}, case {case}")));
        }
    }
    assert!(refused > 1000, "only {refused} were refused: do the cases damage anything?");
}

#[test]
fn random_bytes_behind_a_good_start() {
    let folder = tempfile::tempdir().unwrap();
    for (name, damaged, opened, given) in every_reader(folder.path()) {
        let good = std::fs::read(&damaged).unwrap();
        let mut random = noise(77);
        for case in 0..60 {
            let kept = [8, 128, 136, 200][case % 4].min(good.len());
            let mut bad = good[..kept].to_vec();
            bad.extend((0..2000).map(|_| random() as u8));
            std::fs::write(&damaged, &bad).unwrap();
            assert!(!open(&opened, &given, &format!("{name}, noise {case}")), "{name}, noise {case}");
        }
    }
}

#[test]
fn numbers_that_are_none() {
    let with = |changed: Matrix, words: &[&str]| {
        let mut lct = [matrix("rect_data", &[2, 3, 10], |_| 1.0), scalar("width", 0.5)];
        let at = usize::from(changed.name == "width");
        lct[at] = changed;
        for stored in [Stored::Plain, Stored::Compressed] {
            let (_folder, path) = place("lct.mat");
            std::fs::write(&path, matlab5(&lct, stored)).unwrap();
            assert_error(read(&path), Kind::Input, words);
        }
    };
    for width in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        with(scalar("width", width), &["lct.mat", "width", "half the wall"]);
    }
    with(vector("width", &[1.0, 2.0]), &["width", "[1, 2]", "single number"]);
    with(matrix("rect_data", &[2, 3, 10], |at| if at[2] == 4 { f64::NAN } else { 1.0 }), &["bin 4", "NaN"]);
    with(matrix("rect_data", &[2, 3, 10], |_| f64::NAN), &["no pair"]);
    with(matrix("rect_data", &[2, 3, 10], |_| -1.0), &["negative"]);
    with(matrix("rect_data", &[2, 3, 10], |_| 0.0), &["no signal"]);
    with(
        matrix("rect_data", &[2, 30], |_| 1.0),
        &["rect_data", "two", "three"].map(|w| if w == "two" { "2 axes" } else { w }),
    );
    with(matrix("rect_data", &[0, 3, 10], |_| 1.0), &["rect_data", "empty"]);
}

/// A compressed matrix element of a claimed size whose dimensions are these.
fn bomb(claimed: u32, dims: [u32; 3], zeros: usize) -> Vec<u8> {
    let mut element = [14u32, claimed].map(u32::to_le_bytes).concat();
    element.extend([6u32, 8, 7, 0, 5, 12].map(u32::to_le_bytes).concat());
    element.extend(dims.map(u32::to_le_bytes).concat());
    element.extend([0; 4]);
    element.extend([1u32, 9].map(u32::to_le_bytes).concat());
    element.extend(b"rect_data\0\0\0\0\0\0\0");
    element.extend([7u32, claimed.saturating_sub(72)].map(u32::to_le_bytes).concat());
    element.resize(element.len() + zeros, 0);
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&element).unwrap();
    let packed = encoder.finish().unwrap();
    let mut file = format!("{:<124}", "MATLAB 5.0 MAT-file").into_bytes();
    file.extend(b"\x00\x01IM");
    file.extend([15, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    file
}

#[test]
fn bombs_take_no_memory() {
    // Four gigabytes claimed by a hundred bytes.
    let file = Matlab5::parse(bomb(u32::MAX - 8, [1024, 1024, 1024], 100)).unwrap();
    assert_error(file.counts("rect_data"), Kind::Input, &["claims", "compressed"]);
    // Dimensions beyond what the element holds.
    let file = Matlab5::parse(bomb(72 + 400, [2_000_000_000, 2_000_000_000, 2_000_000_000], 400)).unwrap();
    assert_error(file.counts("rect_data"), Kind::Input, &["rect_data", "do not fit any memory"]);
    // As points, whose number is beyond what can be counted.
    assert_error(file.numbers("rect_data"), Kind::Input, &["rect_data", "too large"]);
    let file = Matlab5::parse(bomb(72 + 400, [1000, 1000, 1000], 400)).unwrap();
    assert_error(file.counts("rect_data"), Kind::Input, &["rect_data", "400 bytes"]);
    // Real zeros, far more than claimed: only the claim is wrong.
    let file = Matlab5::parse(bomb(72 + 400, [10, 10, 1], 50_000_000)).unwrap();
    assert_eq!(file.counts("rect_data").unwrap().unwrap().values, vec![0.0; 100]);
    // A size that goes beyond a file without compression.
    let mut plain = matlab5(&[scalar("width", 0.5)], Stored::Plain);
    plain[132..136].copy_from_slice(&0xffff_fff0u32.to_le_bytes());
    assert_error(Matlab5::parse(plain).map(|_| ()), Kind::Input, &["beyond the end"]);
}

#[test]
fn points_at_the_end_of_all_numbers_take_no_time() {
    for largest in [f64::MAX, 0.3 * f64::MAX, f64::MIN_POSITIVE, 5e-324] {
        let points =
            |name: &str, sign: f64| {
                matrix(name, &[2, 4, 3], |at| {
                    if at[1] == 2 { sign * largest } else { 0.1 * (at[0] + at[2]) as f64 }
                })
            };
        let general = [counts("data", &[2, 4, 20]), points("laserpoints", 1.0), points("detectpoints", -1.0)];
        let (_folder, path) = place("general.mat");
        std::fs::write(&path, matlab5(&general, Stored::Plain)).unwrap();
        open(&path, &ReadOptions::default(), &format!("points at {largest:e}"));
    }
}

#[test]
fn structs_without_end() {
    // A struct in a struct, and so on: listed to a depth, then left alone.
    let mut inner = matlab_struct("", &[]);
    for _ in 0..5000 {
        inner = matlab_struct("s", &[("f", inner)]);
    }
    let deep = matlab_struct("s", &[("n", matlab_matrix(&scalar("", 2.0), false)), ("f", inner)]);
    for stored in [Stored::Plain, Stored::Compressed] {
        let file = Matlab5::parse(matlab_file(std::slice::from_ref(&deep), stored)).unwrap();
        assert_eq!(file.names(), ["s/n"]);
        assert_eq!(file.numbers("s/n").unwrap().unwrap().1, [2.0]);
    }
}

#[test]
fn what_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("empty")).unwrap();
    assert_error(read(&at("empty")), Kind::Input, &["empty", "folder", "f-k"]);
    std::fs::create_dir_all(at("nested/meas.mat")).unwrap();
    assert_error(read(&at("nested")), Kind::Input, &["nested", "folder"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(at("loop"), at("loop")).unwrap();
        assert_error(read(&at("loop")), Kind::Input, &["loop", "cannot be read"]);
        std::os::unix::fs::symlink(at("gone"), at("dangling")).unwrap();
        assert_error(read(&at("dangling")), Kind::Input, &["dangling", "no such file"]);
        assert_error(read(Path::new("/dev/zero")), Kind::Input, &["/dev/zero", "regular file"]);
        // A link to a capture is as good as the capture.
        let lct = matlab5(&[counts("rect_data", &[2, 3, 10]), scalar("width", 0.5)], Stored::Plain);
        std::fs::write(at("lct.mat"), lct).unwrap();
        std::os::unix::fs::symlink(at("lct.mat"), at("link")).unwrap();
        assert_eq!(read(&at("link")).unwrap().pair_count(), 6);
    }
    // Damaged or foreign files in a folder do not hide the good ones.
    let several = at("several");
    std::fs::create_dir(&several).unwrap();
    std::fs::write(several.join("broken.mat"), b"MATLAB 5.0 and no more").unwrap();
    std::fs::write(several.join("tof.mat"), matlab5(&[matrix("tofgrid", &[2, 3], |_| 0.0)], Stored::Plain))
        .unwrap();
    std::fs::write(several.join("a.mat"), matlab5(&[counts("meas", &[2, 3, 10])], Stored::Plain)).unwrap();
    assert_eq!(read(&several).unwrap().pair_count(), 6);
    std::fs::copy(several.join("a.mat"), several.join("b.mat")).unwrap();
    assert_error(read(&several), Kind::Input, &["2 files with meas", "a.mat, b.mat"]);
}

#[test]
fn values_in_other_files_are_not_followed() {
    let (folder, path) = place("outside.h5");
    std::fs::write(folder.path().join("secret"), vec![1u8; 4096]).unwrap();
    let file = rust_hdf5::H5File::create(&path).unwrap();
    let secret = folder.path().join("secret");
    let new = file.new_dataset::<f32>().shape([10, 3, 2]).external(&[(secret.to_str().unwrap(), 0, 240)]);
    new.create("meas").unwrap();
    file.new_dataset::<f64>().shape([3, 2]).create("tofgrid").unwrap().write_raw(&[0.0f64; 6]).unwrap();
    file.close().unwrap();
    assert_error(read(&path), Kind::Input, &["meas", "other files"]);
}

/// The counts of a whole capture in another file are not read through a link, whether it is direct, behind a soft link or of a
/// group.
#[test]
fn links_to_other_files_are_not_followed() {
    let (folder, path) = place("links.h5");
    let arrays = |group: &str| {
        let name = |name: &str| format!("{group}{name}");
        [counts(&name("meas"), &[2, 3, 10]), matrix(&name("tofgrid"), &[2, 3], |_| 0.0)]
    };
    let other = folder.path().join("other.h5");
    hdf5(&other, &arrays("g/"));
    let other = other.to_str().unwrap();
    let linked = |link: &dyn Fn(&rust_hdf5::H5File)| {
        hdf5(&path, &arrays("")[1..]);
        let file = rust_hdf5::H5File::open_rw(&path).unwrap();
        link(&file);
        file.close().unwrap();
    };
    linked(&|file| file.create_external_link("meas", other, "/g/meas").unwrap());
    assert_error(read(&path), Kind::Input, &["links.h5", "meas", "link to other files"]);
    linked(&|file| {
        file.create_external_link("x", other, "/g").unwrap();
        file.create_soft_link("meas", "/x/meas").unwrap();
    });
    let file = Hdf5::open(&path).unwrap();
    assert_error(file.counts("meas"), Kind::Input, &["meas", "link to other files"]);
    assert_error(file.counts("x/meas"), Kind::Input, &["x/meas", "link to other files"]);
    assert!(file.numbers("tofgrid").unwrap().is_some() && file.shape("none").unwrap().is_none());
}

/// An entry of a zip archive: name, the first bytes, and how many zeros follow.
type Entry<'e> = (&'e str, Vec<u8>, usize);

fn npy(shape: &str, kind: &str) -> Vec<u8> {
    let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let text = format!("{text:<117}\n");
    [b"\x93NUMPY\x01\0", &(text.len() as u16).to_le_bytes()[..], text.as_bytes()].concat()
}

fn zip_of(entries: &[Entry]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    for (name, start, zeros) in entries {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(*name, options).unwrap();
        zip.write_all(start).unwrap();
        std::io::copy(&mut std::io::Read::take(std::io::repeat(0), *zeros as u64), &mut zip).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn plain_capture(h: Entry<'static>) -> Vec<u8> {
    let point = || [npy("(1, 3)", "<f8"), vec![0; 24]].concat();
    let delta = [npy("()", "<f8"), 0.01f64.to_le_bytes().to_vec()].concat();
    zip_of(&[h, ("laser_xyz.npy", point(), 0), ("sensor_xyz.npy", point(), 0), ("delta_t.npy", delta, 0)])
}

#[test]
fn counts_of_no_bin_ask_for_no_memory() {
    let (_folder, path) = place("huge.npz");
    std::fs::write(&path, plain_capture(("H.npy", npy("(0, 1, 1000000000000)", "<f4"), 0))).unwrap();
    assert_error(read(&path), Kind::Input, &["H has shape [0, 1, 1000000000000]", "no bin"]);
}

#[test]
fn a_flipped_bit_is_found_by_its_sum() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.npz");
    thirdbounce::capture::write(&fixtures::captures::ramp(), &path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let mut npz = zip::ZipArchive::new(std::io::Cursor::new(&whole)).unwrap();
    for index in 0..npz.len() {
        // The sum in the directory, which the bytes then do not have.
        let sum = npz.by_index(index).unwrap().crc32().to_le_bytes();
        let at = whole.windows(4).rposition(|w| w == sum).unwrap();
        let mut bad = whole.clone();
        bad[at] ^= 1;
        std::fs::write(&path, bad).unwrap();
        assert_error(read(&path), Kind::Input, &["array", "CRC-32", "damaged"]);
    }
    // A bit of the counts themselves, as a disk loses it.
    let h = [npy("(1, 2, 2)", "<f4"), [1.0f32, 2.0, 3.0, 4.0].map(f32::to_le_bytes).concat()].concat();
    let point = || [npy("(1, 3)", "<f8"), vec![0; 24]].concat();
    let delta = [npy("()", "<f8"), 0.01f64.to_le_bytes().to_vec()].concat();
    let files =
        [("H.npy", h), ("laser_xyz.npy", point()), ("sensor_xyz.npy", point()), ("delta_t.npy", delta)];
    let mut stored = fixtures::files::stored_zip(&files);
    std::fs::write(&path, &stored).unwrap();
    assert_eq!(read(&path).unwrap().histograms, [1.0, 2.0, 3.0, 4.0]);
    let at = stored.windows(4).position(|w| w == 3.0f32.to_le_bytes()).unwrap();
    stored[at + 2] ^= 1;
    std::fs::write(&path, &stored).unwrap();
    assert_error(read(&path), Kind::Input, &["array H", "CRC-32"]);
}
