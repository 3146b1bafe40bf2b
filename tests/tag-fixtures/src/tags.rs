//! Files of time tags, as instruments write them.

use std::path::Path;

use rust_hdf5::H5File;
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce_tags::{self as tags, Asked, Division, Inputs, Record, Scan, Zero};

use fixtures::files::stored_zip;

/// PicoQuant's record types: number and name. T3 have a 3 in their third last place.
pub const TYPES: [(i64, &str); 12] = [
    (0x0001_0203, "PicoHarp 300, T2"),
    (0x0001_0303, "PicoHarp 300, T3"),
    (0x0001_0204, "HydraHarp 1, T2"),
    (0x0001_0304, "HydraHarp 1, T3"),
    (0x0101_0204, "HydraHarp 2, T2"),
    (0x0101_0304, "HydraHarp 2, T3"),
    (0x0001_0205, "TimeHarp 260 N, T2"),
    (0x0001_0305, "TimeHarp 260 N, T3"),
    (0x0001_0206, "TimeHarp 260 P, T2"),
    (0x0001_0306, "TimeHarp 260 P, T3"),
    (0x0001_0207, "generic, T2"),
    (0x0001_0307, "generic, T3"),
];

pub fn is_t3(number: i64) -> bool {
    number >> 8 & 15 == 3
}

/// Writes records of one type, with the overflows between them.
pub struct Writer {
    pub number: i64,
    pub words: Vec<u32>,
    /// What a reader should find.
    pub wanted: Vec<Record>,
    /// Further numbers of the header.
    pub reals: Vec<(&'static str, f64)>,
    base: i64,
}

impl Writer {
    pub fn new(number: i64) -> Writer {
        Writer { number, words: vec![], wanted: vec![], reals: vec![], base: 0 }
    }

    fn pico(&self) -> bool {
        self.number & 15 == 3
    }

    fn wrap(&self) -> i64 {
        match (self.pico(), is_t3(self.number), self.number) {
            (true, true, _) => 1 << 16,
            (true, false, _) => 210_698_240,
            (false, true, _) => 1 << 10,
            (false, false, 0x0001_0204) => 33_552_000,
            (false, false, _) => 1 << 25,
        }
    }

    /// The low part of a time, after as many overflows as it needs. Newer instruments write many as one record.
    fn low(&mut self, time: i64) -> u32 {
        let wrap = self.wrap();
        let mut periods = (time - self.base).max(0) / wrap;
        self.base += periods * wrap;
        let old = matches!(self.number, 0x0001_0204 | 0x0001_0304);
        while periods > 0 {
            let most = if self.pico() || old {
                1
            } else if is_t3(self.number) {
                1023
            } else {
                (1 << 25) - 1
            };
            let now = periods.min(most);
            self.words.push(match (self.pico(), old) {
                // The unused bits of an overflow may be anything.
                (true, _) if is_t3(self.number) => 0xF000_1234,
                (true, _) => 0xF000_0120,
                (_, true) => 0xFE00_0000 | (periods as u32 & 0x3FF),
                // A single overflow is also written as none.
                (_, false) if now == 1 && periods % 2 == 1 => 0xFE00_0000,
                _ => 0xFE00_0000 | now as u32,
            });
            periods -= now;
        }
        u32::try_from(time - self.base).expect("no time before the last overflow")
    }

    /// `channel` from 1. T3: `time` is a sync number; T2: ticks, and `delay` is not written.
    pub fn photon(&mut self, channel: i32, time: i64, delay: u32) {
        let (low, code) = (self.low(time), channel as u32);
        let t3 = is_t3(self.number);
        self.words.push(match (self.pico(), t3) {
            (true, true) => code << 28 | delay << 16 | low,
            (true, false) => code << 28 | low,
            (false, true) => (code - 1) << 25 | delay << 10 | low,
            (false, false) => (code - 1) << 25 | low,
        });
        self.wanted.push(Record::Photon { channel, time, delay: if t3 { delay } else { 0 } });
    }

    /// T3 writes none.
    pub fn sync(&mut self, time: i64) {
        if is_t3(self.number) {
            return;
        }
        let low = self.low(time);
        self.words.push(if self.pico() { low } else { 1 << 31 | low });
        self.wanted.push(Record::Sync { time });
    }

    /// `bits` 1 to 15.
    pub fn marker(&mut self, bits: u16, time: i64) {
        let pico_t2 = self.pico() && !is_t3(self.number);
        let time = if pico_t2 { self.base + ((time - self.base) & !15 | i64::from(bits)) } else { time };
        let low = self.low(time);
        let code = u32::from(bits);
        self.words.push(match (self.pico(), is_t3(self.number)) {
            (true, true) => 0xF000_0000 | code << 16 | low,
            // Its bits are the lowest of its time.
            (true, false) => 0xF000_0000 | low & !15 | code,
            _ => 1 << 31 | code << 25 | low,
        });
        self.wanted.push(Record::Marker { bits, time });
    }

    /// The file, with this tick and time between laser pulses, seconds, and further whole numbers in its header.
    pub fn file(&self, tick: f64, period: f64, more: &[(&str, i64)]) -> Vec<u8> {
        let t3 = is_t3(self.number);
        let mut entries = vec![
            text("File_GUID", -1, "{00000000-0000-0000-0000-000000000000}"),
            text("File_Comment", -1, "made by a test"),
            whole("Measurement_Mode", -1, if t3 { 3 } else { 2 }),
            whole("Measurement_SubMode", -1, 0),
            empty("Fast_Load_End"),
            real("MeasDesc_Resolution", -1, tick),
            real("MeasDesc_GlobalResolution", -1, if t3 { period } else { tick }),
            whole("TTResultFormat_TTTRRecType", -1, self.number),
            whole("TTResultFormat_BitsPerRecord", -1, 32),
            whole("TTResult_NumberOfRecords", -1, self.words.len() as i64),
        ];
        entries.extend(more.iter().map(|(name, value)| whole(name, -1, *value)));
        entries.extend(self.reals.iter().map(|(name, value)| real(name, -1, *value)));
        let mut bytes = head(b"PQTTTR\0\0", entries);
        bytes.extend(self.words.iter().flat_map(|word| word.to_le_bytes()));
        bytes
    }
}

fn entry(name: &str, index: i32, kind: u32, value: [u8; 8]) -> Vec<u8> {
    let mut bytes = name.as_bytes().to_vec();
    bytes.resize(32, 0);
    bytes.extend(index.to_le_bytes());
    bytes.extend(kind.to_le_bytes());
    bytes.extend(value);
    bytes
}

fn whole(name: &str, index: i32, value: i64) -> Vec<u8> {
    entry(name, index, 0x1000_0008, value.to_le_bytes())
}

fn real(name: &str, index: i32, value: f64) -> Vec<u8> {
    entry(name, index, 0x2000_0008, value.to_le_bytes())
}

fn empty(name: &str) -> Vec<u8> {
    entry(name, -1, 0xFFFF_0008, [0; 8])
}

fn text(name: &str, index: i32, value: &str) -> Vec<u8> {
    // Entries begin at multiples of 8.
    let length = (value.len() + 1).next_multiple_of(8);
    let mut bytes = entry(name, index, 0x4001_FFFF, (length as u64).to_le_bytes());
    bytes.extend(value.as_bytes());
    bytes.resize(48 + length, 0);
    bytes
}

fn head(magic: &[u8; 8], entries: Vec<Vec<u8>>) -> Vec<u8> {
    let mut bytes = magic.to_vec();
    bytes.extend(b"1.0.00\0\0");
    bytes.extend(entries.into_iter().flatten());
    bytes.extend(empty("Header_End"));
    bytes
}

/// Histograms of points in bins of `tick` seconds as PicoQuant's software stores them.
pub fn phu(points: &[Vec<u32>], tick: f64) -> Vec<u8> {
    let bins = points[0].len();
    let all = |start: usize| {
        let of_curve = |curve: usize| {
            let at = curve as i32;
            vec![
                whole("HistResDscr_CurveIndex", at, i64::from(at)),
                whole("HistResDscr_DataOffset", at, (start + 4 * bins * curve) as i64),
                whole("HistResDscr_HistogramBins", at, bins as i64),
                real("HistResDscr_MDescResolution", at, tick),
            ]
        };
        let curves = whole("HistoResult_NumberOfCurves", -1, points.len() as i64);
        head(b"PQHISTO\0", std::iter::once(curves).chain((0..points.len()).flat_map(of_curve)).collect())
    };
    let mut bytes = all(all(0).len());
    bytes.extend(points.iter().flatten().flat_map(|count| count.to_le_bytes()));
    bytes
}

/// Records as text.
pub fn csv(records: &[Record]) -> String {
    let lines: Vec<_> = numbered(records).map(|(channel, time)| format!("{channel},{time}\n")).collect();
    format!("channel,time_ps\n{}", lines.concat())
}

/// Times and channels of records as arrays.
pub fn arrays(records: &[Record]) -> [(&'static str, Vec<i64>); 2] {
    let (channels, times) = numbered(records).map(|(channel, time)| (i64::from(channel), time)).unzip();
    [("timestamps", times), ("channels", channels)]
}

/// An npz of whole numbers, one axis each, deflated or as they are.
pub fn npz_of(arrays: &[(&str, Vec<i64>)], deflated: bool) -> Vec<u8> {
    let made: Vec<_> = arrays.iter().map(|(name, all)| (*name, Array::from_i64(&[all.len()], all))).collect();
    if deflated {
        return npz_bytes(&made).expect("it is packed");
    }
    let names: Vec<_> = made.iter().map(|(name, _)| format!("{name}.npy")).collect();
    let files: Vec<_> =
        names.iter().zip(&made).map(|(name, (_, array))| (&name[..], array.to_npy())).collect();
    stored_zip(&files)
}

/// Writes an HDF5 file of whole numbers, one axis each, chunked by the given length unless 0.
pub fn hdf5_of(path: &Path, arrays: &[(&str, Vec<i64>)], chunk: usize) {
    let file = H5File::create(path).expect("the file can be made");
    for (name, all) in arrays {
        let new = file.new_dataset::<i64>().shape([all.len()]);
        let new = if chunk > 0 { new.chunk(&[chunk]).shuffle_deflate(3) } else { new };
        new.create(name).expect("a dataset").write_raw(all).expect("its values");
    }
    file.close().expect("the file is written");
}

/// The number of ways of [`in_a_way`].
pub const WAYS: usize = 8;

/// Makes a capture of four points of a file in one of several ways: an error is fine, anything else but a sound capture
/// panics. Tells whether there is a capture.
pub fn in_a_way(path: &Path, way: usize) -> bool {
    let scan = Scan::grid([2, 2], 1.0, false).expect("a scan");
    let division = match way % 4 {
        0 => None,
        1 => Some(Division::Pixels { marker: 1, frame: None }),
        2 => Some(Division::Lines { start: 1, stop: Some(2), frame: Some(3) }),
        _ => Some(Division::Pulses { each: 30, before: 10 }),
    };
    // Few and wide bins: delays of a damaged file may be of any length.
    let asked = Asked {
        inputs: Inputs { sync: 0, markers: vec![100, 101, 102], ..Inputs::default() },
        bin_width: Some(0.1),
        until: Some(2e-8),
        division,
        zero: if way < 4 { Zero::Direct } else { Zero::At(1e-9) },
        seen_from: (way == 1).then_some([[0.3, -0.2, 1.4].into(), [0.0, 0.0, 1.0].into()]),
        ..Asked::default()
    };
    let made = tags::histogram(path, &scan, &asked);
    match &made {
        Ok(made) => made.capture.check().expect("a capture that was made is sound"),
        Err(error) => assert!(!error.what.is_empty() && !error.hint.to_string().is_empty()),
    }
    made.is_ok()
}

fn numbered(records: &[Record]) -> impl Iterator<Item = (i32, i64)> + '_ {
    records.iter().map(|record| match *record {
        Record::Sync { time } => (0, time),
        Record::Photon { channel, time, .. } => (channel, time),
        Record::Marker { bits, time } => (100 + bits.trailing_zeros() as i32, time),
    })
}

pub fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::write(path, bytes).expect("the file can be written");
}

/// A writer of every kind of record: wrap-arounds, long pauses, markers late by a few records, several markers at once.
pub fn varied(number: i64, records: usize) -> Writer {
    let mut writer = Writer::new(number);
    let mut state = 0x9E37_79B9_7F4A_7C15u64 ^ number as u64;
    let mut random = move |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % below
    };
    let wrap = writer.wrap();
    let most_delay = if number & 15 == 3 { 1 << 12 } else { 1 << 15 };
    let channels = if number & 15 == 3 { 4 } else { 62 };
    let mut time = 3;
    writer.sync(time);
    while writer.wanted.len() < records {
        time += match random(50) {
            0 => wrap * (1 + random(40) as i64) + random(wrap as u64) as i64,
            1 => wrap - (time - writer.base).min(wrap),
            2 => 0,
            _ => random((wrap / 20) as u64) as i64,
        };
        match random(12) {
            0 => {
                // The lowest bits of a marker may be those of a time before the overflow.
                let late = (time - random(20) as i64).max(writer.base);
                writer.marker(1 + random(15) as u16, late);
                time = time.max(writer.base + 16);
            }
            1..4 => writer.sync(time),
            // Channel 2 at least: PicoQuant's other readers do not tell the first input of T2 from the sync.
            _ => writer.photon(2 + random(channels - 1) as i32, time, random(most_delay) as u32),
        }
    }
    writer
}

/// A scan of four points, three times over: marker 1 begins each point, marker 2 ends it, marker 3 begins each round; a peak of
/// direct light, and some photons behind it.
pub fn scanned(number: i64) -> Writer {
    let mut writer = Writer::new(number);
    let t3 = is_t3(number);
    // T3 count laser pulses, T2 ticks of which a laser pulse takes 20,000.
    let pulse = |sync: i64| if t3 { sync } else { 20_000 * sync };
    for point in 0..13 {
        let begin = 10 + 40 * point;
        if point % 4 == 0 {
            writer.marker(4, pulse(begin));
        }
        writer.marker(1, pulse(begin));
        for sync in begin..begin + 36 {
            writer.sync(pulse(sync));
            let delay = if sync % 3 == 0 { 1200 + 7 * sync as u32 % 900 } else { 400 + sync as u32 % 3 };
            writer.photon(2, if t3 { sync } else { pulse(sync) + i64::from(delay) }, delay);
        }
        writer.marker(2, pulse(begin + 36));
    }
    writer
}

/// Small files of every reader: the reader, a name, and the bytes.
pub fn every_reader() -> Vec<(&'static str, String, Vec<u8>)> {
    let mut all = vec![];
    for (number, name) in TYPES {
        let name = name.replace([' ', ','], "");
        for (kind, writer) in [("varied", varied(number, 200)), ("scanned", scanned(number))] {
            let image =
                [("ImgHdr_LineStart", 1), ("ImgHdr_LineStop", 2), ("ImgHdr_PixX", 2), ("ImgHdr_PixY", 2)];
            all.push(("ptu", format!("{kind}-{name}.ptu"), writer.file(16e-12, 1e-7, &image)));
        }
    }
    let t2 = scanned(0x0001_0207);
    all.push(("text", "scanned.csv".into(), csv(&t2.wanted).into_bytes()));
    let of_arrays = arrays(&t2.wanted);
    for (name, deflated) in [("stored.npz", false), ("deflated.npz", true)] {
        all.push(("arrays", name.into(), npz_of(&of_arrays, deflated)));
    }
    let folder = tempfile::tempdir().expect("a folder");
    for (name, chunk) in [("plain.h5", 0), ("chunked.h5", 100)] {
        let path = folder.path().join(name);
        hdf5_of(&path, &of_arrays, chunk);
        all.push(("arrays", name.into(), std::fs::read(path).expect("the file")));
    }
    let curves: Vec<Vec<u32>> = (0..4)
        .map(|point| (0..64).map(|bin| bin * 3 % 7 + 40 * u32::from(bin == 9 + point)).collect())
        .collect();
    all.push(("histograms", "curves.phu".into(), phu(&curves, 1e-10)));
    all.push((
        "histograms",
        "zones.txt".into(),
        b"#Raw,0,1,2,90,3\n#Raw,1,1,90,2,3\n#Raw,2,1,90,2,3\n#Raw,3,9,90,2,3\n".into(),
    ));
    let counts: Vec<i64> = (0..256).map(|i| if i % 64 == 10 { 90 } else { i % 3 }).collect();
    all.push(("arrays", "zones.npy".into(), Array::from_i64(&[4, 64], &counts).to_npy()));
    let zones = [("hists", Array::from_i64(&[2, 2, 2, 32], &counts))];
    all.push(("arrays", "zones.npz".into(), npz_bytes(&zones).expect("it is packed")));
    all
}
