//! Hostile files for every reader, from a seed: the same file for the same seed.

use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::{DeflateEncoder, ZlibEncoder};
use thirdbounce::capture::ReadOptions;

use crate::tags;
use fixtures::files::{Stored, matlab5, noise, scalar};
use fixtures::readers::every_reader;

/// How a file is to be opened.
pub enum Opened {
    Capture(PathBuf, ReadOptions),
    Tags(PathBuf),
    Truth(PathBuf),
}

/// Kinds of hostile files; one after the other with the seeds.
const KINDS: u64 = 10;

/// What the file of this seed does, and how it is opened.
pub fn hostile(folder: &Path, seed: u64) -> (String, Opened) {
    let mut random = noise(seed.wrapping_mul(977) + 13);
    let mut pick = move |most: usize| (random() >> 11) % most;
    let own = folder.join(format!("{seed}"));
    std::fs::create_dir_all(&own).expect("a folder");
    let written = |name: &str, bytes: Vec<u8>| {
        let path = own.join(name);
        std::fs::write(&path, bytes).expect("the file can be written");
        path
    };
    let npz = |what: &str, entries: &[Entry]| {
        (
            format!("{what}, seed {seed}"),
            Opened::Capture(written("hostile.npz", archive(entries)), ReadOptions::default()),
        )
    };
    match seed % KINDS {
        0 => {
            // No data, and a size beyond all memory along another axis.
            let huge = 10usize.pow(6 + pick(13) as u32);
            let shape = [
                format!("0, 1, {huge}"),
                format!("1, {huge}, 0"),
                format!("{huge}, 0"),
                format!("0, {huge}, {huge}"),
            ];
            npz("no count of too many pairs", &whole(Entry::new("H", &shape[pick(4)], "<f4", 0, 0)))
        }
        1 => {
            // Real zeros, packed a thousand times as tightly.
            let kinds = ["|u1", "<u2", "<f4", "<f8", "|b1"];
            let kind = kinds[pick(5)];
            let pairs = 1 << pick(16);
            let bins = (60 << 20) / pairs / kind[2..].parse::<usize>().unwrap_or(1) * (1 + pick(4));
            npz("zeros", &whole(Entry::new("H", &format!("{bins}, 1, {pairs}"), kind, 0, 1)))
        }
        2 => {
            let names = ["laser_xyz", "sensor_xyz", "laser_normal", "pulse", "delta_t", "t_start"];
            let points = (80 << 20) / 24 * (1 + pick(2));
            let mut all = whole(Entry::new("H", "4, 2, 2", "<f4", 1, 1));
            all.push(Entry::new(names[pick(6)], &format!("{points}, 1, 3"), "<f8", 0, 1));
            all.reverse();
            npz("points without end", &all)
        }
        3 => {
            // Sizes that overflow 64 bits when they are multiplied, or that the data do not have.
            let sizes = ["4294967296", "18446744073709551615", "9223372036854775807", "65537", "-1", "1e9"];
            let shape = format!("{}, {}, {}", sizes[pick(6)], sizes[pick(6)], sizes[pick(6)]);
            npz("sizes beyond the data", &whole(Entry { data: 64, ..Entry::new("H", &shape, "<f4", 1, 1) }))
        }
        4 => {
            // One bit of an archive that is stored or packed.
            let mut bytes = archive(&whole(Entry::new("H", "8, 2, 2", "<f4", 1 + pick(200) as u8, 1)));
            let at = pick(bytes.len());
            bytes[at] ^= 1 << pick(8);
            (
                format!("one bit at {at}, seed {seed}"),
                Opened::Capture(written("bit.npz", bytes), ReadOptions::default()),
            )
        }
        5 => {
            // A compressed element of MATLAB that unpacks to zeros or claims more.
            let zeros = (30 << 20) * (1 + pick(6));
            let pairs = 1 << pick(12);
            let dims = [1, pairs as u32, (zeros / 2 / pairs) as u32];
            let bytes = matlab(dims, zeros, pick(2) == 0);
            (
                format!("MATLAB of zeros, seed {seed}"),
                Opened::Capture(written("zeros.mat", bytes), ReadOptions::default()),
            )
        }
        6 => {
            // An HDF5 file whose chunks were never written.
            let path = own.join("empty.h5");
            let file = rust_hdf5::H5File::create(&path).expect("a file");
            let n = 1 + pick(24);
            let meas = file.new_dataset::<f32>().shape([1024, 64, 64 * n]).chunk(&[64, 16, 16]).deflate(3);
            meas.create("meas").expect("a dataset");
            let tof = file.new_dataset::<f64>().shape([64, 64 * n]).create("tofgrid").expect("a dataset");
            tof.write_raw(&vec![0.0; 64 * 64 * n]).expect("values");
            // As large as its counts are allowed to claim.
            file.new_dataset::<u8>()
                .shape([300_000])
                .create("padding")
                .expect("a dataset")
                .write_raw(&vec![7u8; 300_000])
                .expect("values");
            file.close().expect("a file");
            (format!("HDF5 without chunks, seed {seed}"), Opened::Capture(path, ReadOptions::default()))
        }
        7 => {
            let mut all = every_reader(&own);
            let (name, damaged, opened, given) = all.swap_remove(pick(all.len()));
            let mut bytes = std::fs::read(&damaged).expect("a file");
            for _ in 0..1 + pick(12) {
                let at = pick(bytes.len());
                let run = (1 + pick(8)).min(bytes.len() - at);
                bytes[at..at + run].fill([0, 0xff, 0x7f, 0x80][pick(4)]);
            }
            std::fs::write(&damaged, bytes).expect("the file can be written");
            (format!("{name} with runs of bytes, seed {seed}"), Opened::Capture(opened, given))
        }
        8 => {
            let late = 10i64.pow(6 + pick(10) as u32);
            let (name, text) = match pick(3) {
                0 => ("late.csv", format!("0,0\n1,{late}\n0,{}\n1,{}\n", 2 * late, 3 * late)),
                1 => ("channels.csv", (0..60_000).map(|i| format!("{i},{i}\n")).collect()),
                _ => {
                    let mut all = tags::every_reader();
                    let (_, _, mut bytes) = all.swap_remove(pick(all.len()));
                    bytes.truncate(pick(bytes.len()));
                    return (format!("cut tags, seed {seed}"), Opened::Tags(written("cut.ptu", bytes)));
                }
            };
            (format!("{name}, seed {seed}"), Opened::Tags(written(name, text.into_bytes())))
        }
        _ => {
            let side = 4096 * (1 + pick(2));
            let mut all = vec![
                Entry::new("truth_depth", &format!("{side}, {side}"), "<f4", 0, 1),
                Entry::new("truth_normals", &format!("{side}, {side}, 3"), "<f4", 0, 1),
                Entry::new("extent", "4", "<f8", 0, 1),
            ];
            all.rotate_left(pick(3));
            (format!("maps of zeros, seed {seed}"), Opened::Truth(written("truth.npz", archive(&all))))
        }
    }
}

/// An entry of an npz: an array of one byte again and again.
#[derive(Clone)]
struct Entry {
    name: String,
    shape: String,
    kind: &'static str,
    byte: u8,
    data: usize,
}

impl Entry {
    /// `fill` 0 has no data.
    fn new(name: &str, shape: &str, kind: &'static str, byte: u8, fill: usize) -> Entry {
        let count = shape
            .split(',')
            .filter_map(|n| n.trim().parse::<usize>().ok())
            .fold(1usize, usize::saturating_mul);
        let data = count.saturating_mul(kind[2..].parse().unwrap_or(1)).min(1 << 30) * fill;
        Entry { name: name.into(), shape: shape.into(), kind, byte, data }
    }
}

/// An otherwise whole capture with this entry.
fn whole(h: Entry) -> Vec<Entry> {
    let mut all = vec![h];
    all.extend(["laser_xyz", "sensor_xyz"].map(|name| Entry::new(name, "1, 3", "<f8", 0, 1)));
    all.push(Entry::new("delta_t", "1", "<f8", 0x3f, 1));
    all
}

fn archive(entries: &[Entry]) -> Vec<u8> {
    let (mut bytes, mut directory) = (vec![], vec![]);
    for entry in entries {
        let text =
            format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({},), }}", entry.kind, entry.shape);
        let text = format!("{text:<117}\n");
        let head = [b"\x93NUMPY\x01\0", &(text.len() as u16).to_le_bytes()[..], text.as_bytes()].concat();
        let (mut packed, mut sum) = (DeflateEncoder::new(vec![], Compression::best()), flate2::Crc::new());
        let block = vec![entry.byte; 1 << 16];
        let mut left = entry.data;
        packed.write_all(&head).expect("memory");
        sum.update(&head);
        while left > 0 {
            let part = &block[..left.min(block.len())];
            packed.write_all(part).expect("memory");
            sum.update(part);
            left -= part.len();
        }
        let (packed, name) = (packed.finish().expect("memory"), format!("{}.npy", entry.name));
        let word = |n: usize| (n as u32).to_le_bytes();
        let mut about = vec![20, 0, 0, 0, 8, 0, 0, 0, 0, 0];
        about.extend([sum.sum().to_le_bytes(), word(packed.len()), word(head.len() + entry.data)].concat());
        about.extend((name.len() as u16).to_le_bytes());
        about.extend([0, 0]);
        let from = word(bytes.len());
        bytes.extend([&b"PK\x03\x04"[..], &about, name.as_bytes(), &packed].concat());
        directory.extend([&b"PK\x01\x02"[..], &[20, 0], &about, &[0; 10], &from, name.as_bytes()].concat());
    }
    let count = (entries.len() as u16).to_le_bytes();
    let end = [(directory.len() as u32).to_le_bytes(), (bytes.len() as u32).to_le_bytes()].concat();
    bytes.extend([&directory[..], b"PK\x05\x06\0\0\0\0", &count, &count, &end, &[0, 0]].concat());
    bytes
}

/// A MATLAB v5 file with one compressed array of uint16; `lies` claims twice the bytes.
fn matlab(dims: [u32; 3], zeros: usize, lies: bool) -> Vec<u8> {
    let claimed = if lies { 2 * zeros } else { zeros } as u32;
    let mut element = [14u32, claimed + 64].map(u32::to_le_bytes).concat();
    element.extend([6u32, 8, 11, 0, 5, 12].map(u32::to_le_bytes).concat());
    element.extend(dims.map(u32::to_le_bytes).concat());
    element.extend([0; 4]);
    element.extend([1u32, 9].map(u32::to_le_bytes).concat());
    element.extend(b"rect_data\0\0\0\0\0\0\0");
    element.extend([4u32, claimed].map(u32::to_le_bytes).concat());
    let mut packed = ZlibEncoder::new(vec![], Compression::best());
    packed.write_all(&element).expect("memory");
    std::io::copy(&mut std::io::Read::take(std::io::repeat(0), zeros as u64), &mut packed).expect("memory");
    let packed = packed.finish().expect("memory");
    let mut file = format!("{:<124}", "MATLAB 5.0 MAT-file").into_bytes();
    file.extend(b"\x00\x01IM");
    file.extend([15, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    // Half of the wall, which such a file holds.
    let width = matlab5(&[scalar("width", 0.5)], Stored::Plain);
    file.extend(&width[128..]);
    file
}
