//! Time tags and histograms as arrays in npz, npy and HDF5.

use std::path::Path;

use fixtures::captures::{self, assert_error, place};
use tag_fixtures::tags::{arrays, csv, hdf5_of, npz_of, scanned, write};
use thirdbounce::capture::METRES_PER_PICOSECOND;
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce::{Kind, Result};
use thirdbounce_tags::{Asked, Division, Histograms, Inputs, Record, Scan, Tags, Zero, histogram};

fn grid() -> Scan {
    Scan::grid([2, 2], 1.0, false).unwrap()
}

fn asked() -> Asked {
    Asked {
        inputs: Inputs { sync: 0, markers: vec![100, 101, 102], ..Inputs::default() },
        division: Some(Division::Pixels { marker: 1, frame: Some(3) }),
        bin_width: Some(8.0 * METRES_PER_PICOSECOND),
        ..Asked::default()
    }
}

fn made(path: &Path) -> Result<Histograms> {
    histogram(path, &grid(), &asked())
}

#[test]
fn arrays_hold_the_tags_of_a_text() {
    let writer = scanned(0x0001_0207);
    let (_folder, path) = place("scan.csv");
    write(&path, csv(&writer.wanted));
    let wanted = made(&path).unwrap();
    let mut plain = arrays(&writer.wanted).to_vec();
    let same = |name: &str, arrays: &[(&str, Vec<i64>)], chunk: Option<usize>| {
        let path = path.with_file_name(name);
        match chunk {
            Some(chunk) => hdf5_of(&path, arrays, chunk),
            None => write(&path, npz_of(arrays, name.contains("deflated"))),
        }
        let found = made(&path).unwrap();
        assert_eq!(found.capture.histograms, wanted.capture.histograms, "{name}");
        assert!(found.photons == wanted.photons && found.photons > 400, "{name}: {}", found.photons);
        found
    };
    same("stored.npz", &plain, None);
    same("deflated.npz", &plain, None);
    same("scan.h5", &plain, Some(0));
    same("chunked.hdf5", &plain, Some(64));
    // An event of another type is no tag.
    let count = plain[0].1.len();
    let mut types = vec![0; count];
    let at = plain[1].1.iter().position(|c| *c == 2).unwrap();
    plain.iter_mut().for_each(|(_, all)| all.insert(at, all[at]));
    types.insert(at, 4);
    let all = [&plain[..], &[("event_types", types)]].concat();
    for found in [same("typed.npz", &all, None), same("typed.h5", &all, Some(64))] {
        assert!(found.notes.iter().any(|note| note.contains("1 events are no tags")), "{:?}", found.notes);
    }
}

#[test]
fn elements_of_all_types_are_whole_numbers() {
    let (_folder, path) = place("tags.npz");
    let times = [5i64, 300, 70_000];
    let read = |times: Array, channels: Array| {
        write(&path, npz_bytes(&[("Time", times), ("CHANNELS", channels)]).unwrap());
        let mut all = vec![];
        Tags::open(&path, &Inputs { sync: 9, markers: vec![], ..Inputs::default() })?
            .records(|record| all.push(record))?;
        Ok(all)
    };
    let wanted: Vec<_> = times
        .iter()
        .zip([1, 2, 3])
        .map(|(time, channel)| Record::Photon { channel, time: *time, delay: 0 })
        .collect();
    let three = || Array::from_u16(&[3], &[1, 2, 3]);
    let real: Vec<f64> = times.iter().map(|t| *t as f64 + 0.2).collect();
    let mut big = Array::from_i64(&[3], &times);
    big.big_endian = true;
    big.bytes.chunks_exact_mut(8).for_each(<[u8]>::reverse);
    for times in [Array::from_i64(&[3], &times), Array::from_f64(&[3], &real), big] {
        assert_eq!(read(times, three()).unwrap(), wanted);
    }
    let below = read(Array::from_i64(&[1], &[-7]), Array::from_i64(&[1], &[-2])).unwrap();
    assert_eq!(below, [Record::Photon { channel: -2, time: -7, delay: 0 }]);
    let error = |times, channels, words: &[&str]| assert_error(read(times, channels), Kind::Input, words);
    error(Array::from_f64(&[1], &[f64::NAN]), Array::from_i64(&[1], &[1]), &["Time holds NaN"]);
    error(Array::from_i64(&[1], &[1]), Array::from_i64(&[1], &[1 << 40]), &["CHANNELS", "no channel"]);
    error(Array::from_i64(&[2], &[1, 2]), three(), &["Time holds 2 values and CHANNELS 3"]);
    error(Array::from_i64(&[3, 1], &times), three(), &["one axis"]);
}

#[test]
fn files_without_tags_are_told() {
    let (_folder, path) = place("other.npz");
    let one = Array::from_i64(&[1], &[1]);
    write(&path, npz_bytes(&[("H", one.clone())]).unwrap());
    assert_error(made(&path), Kind::Input, &["other.npz", "timestamps and channels", "it holds H"]);
    let twice = [("times", one.clone()), ("timestamps", one.clone()), ("channels", one)];
    write(&path, npz_bytes(&twice).unwrap());
    assert_error(made(&path), Kind::Input, &["times and timestamps may both be"]);
    let mut cut = npz_of(&arrays(&scanned(0x0001_0207).wanted), false);
    // The elements of the first array are fewer than its header says.
    let at = cut.windows(10).position(|w| w == b"'shape': (").unwrap() + 10;
    cut[at] = b'8';
    write(&path, cut);
    assert_error(made(&path), Kind::Input, &["timestamps holds 8"]);
    let h5 = path.with_extension("h5");
    hdf5_of(&h5, &[("data", vec![1, 2])], 0);
    assert_error(made(&h5), Kind::Input, &["other.h5", "it holds data"]);
}

#[test]
fn zones_in_an_array_are_histograms_of_points() {
    let (_folder, path) = place("zones.npy");
    // Direct light at bin 10 + the point's number, and a weaker peak 20 bins behind.
    let counts: Vec<i64> = (0..2 * 4 * 64)
        .map(|i| match (i % 64 - 10, i / 64 % 4) {
            (bin, point) if bin == point => 90,
            (bin, point) if bin == point + 20 => 30,
            (bin, _) => (bin & 7 == 0) as i64,
        })
        .collect();
    let wide = Asked { division: None, bin_width: Some(0.075), ..asked() };
    let with = |shape: &[usize], count: usize| {
        write(&path, Array::from_i64(shape, &counts[..count]).to_npy());
        histogram(&path, &grid(), &wide)
    };
    for (shape, count, readings) in [
        (&[4, 64][..], 256, 1.0),
        (&[2, 2, 64], 256, 1.0),
        (&[2, 4, 64], 512, 2.0),
        (&[2, 2, 2, 64], 512, 2.0),
    ] {
        let found = with(shape, count).unwrap();
        let c = &found.capture;
        assert_eq!((c.scan, c.direct, found.dropped), ([2, 2], Some(0.0), 0), "{shape:?}");
        assert!((c.bin_width / 0.075 - 1.0).abs() < 1e-9);
        // Every point's direct light is at path 0, as bins allow, and the peak behind it 20 bins later.
        let zero = (-c.t_start / c.bin_width).round() as usize;
        for pair in 0..4 {
            let h = captures::histogram(c, pair);
            let near = |at: usize| h[at - 1..at + 2].iter().copied().fold(0.0, f32::max);
            assert_eq!((near(zero), near(zero + 20)), (90.0 * readings, 30.0 * readings), "{shape:?} {pair}");
        }
    }
    assert_error(with(&[2, 64], 128), Kind::Input, &["zones.npy", "does not fit 4 points"]);
    let unsaid = Asked { bin_width: None, ..wide.clone() };
    assert_error(histogram(&path, &grid(), &unsaid), Kind::Options, &["how wide its bins"]);
    let npz = path.with_extension("npz");
    write(&npz, npz_bytes(&[("hists", Array::from_f64(&[4, 2], &[0.5; 8]))]).unwrap());
    assert_error(histogram(&npz, &grid(), &wide), Kind::Input, &["hists holds 0.5", "pt_cloud"]);
    let divided = Asked { division: asked().division, ..wide };
    write(&path, Array::from_i64(&[4, 64], &counts[..256]).to_npy());
    assert_error(histogram(&path, &grid(), &divided), Kind::Options, &["has divided"]);
    assert!(matches!(asked().zero, Zero::Direct));
}

#[test]
fn light_of_the_scene_is_not_taken_for_direct_light() {
    let (_folder, path) = place("counts.npy");
    // Path 0 is at bin 0, and all light is that of a thing at 1 m.
    let light = |point: i64, bin: i64| match bin - 26 - point {
        0.. => (4000.0 * (-0.3 * (bin - 26 - point) as f64).exp()).round() as i64,
        _ => 0,
    };
    let counts: Vec<i64> = (0..4 * 64).map(|i| light(i / 64, i % 64)).collect();
    write(&path, Array::from_i64(&[4, 64], &counts).to_npy());
    let direct = Asked { division: None, bin_width: Some(0.075), ..asked() };
    assert_error(
        histogram(&path, &grid(), &direct),
        Kind::Input,
        &["counts.npy", "path of -2.0", "`zero` 0ps"],
    );
    let zero = Asked { zero: Zero::At(0.0), ..direct };
    assert_eq!(histogram(&path, &grid(), &zero).unwrap().capture.t_start, 0.0);
}
