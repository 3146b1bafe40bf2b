//! Time tags of photon-counting instruments as one stream of events, and captures made of them.
//!
//! [`Tags`] reads PicoQuant's `.ptu` (every record type, T2 and T3), arrays of timestamps and channels in npz and HDF5, and text.
//! Files are read block by block, in bounded memory. [`histogram()`] makes a capture of them, or of an instrument's own histograms in
//! an npy or npz array, from the photons of each point ([`Division`]), the points ([`Scan`]) and the delay of path 0 ([`Zero`]).
//! docs/data.md describes the formats.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod arrange;
mod arrays;
mod collect;
mod cuts;
mod division;
mod header;
mod histogram;
mod records;
mod shape;
mod stored;
mod survey;
mod syncs;
mod text;
mod zero;

pub use arrange::Scan;
pub use division::Division;
pub use histogram::{Asked, Histograms, PileUp, histogram};
pub use survey::{Channel, Survey};
pub use zero::Zero;

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use thirdbounce_base::{advice, error, files, host};
use thirdbounce_capture as capture;

use crate::error::{Error, Result};
use arrays::Holder;
use header::Header;
use records::{Layout, Word};
use syncs::Syncs;

/// What a file stores at one place. Times are sync numbers if the instrument counts them itself (T3), else ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record {
    /// A laser pulse. T3 records do not store them.
    Sync {
        /// When, in ticks.
        time: i64,
    },
    /// A photon.
    Photon {
        /// The detector: an input of a PicoQuant instrument, from 1, or the number that an array or a text gives.
        channel: i32,
        /// T3: the number of the laser pulse before it. Else: when, in ticks.
        time: i64,
        /// T3: ticks since that laser pulse. Else 0.
        delay: u32,
    },
    /// Markers of a scanner, one bit each: bit 0 is marker 1.
    Marker {
        /// Which, several at once.
        bits: u16,
        /// T3: the number of the laser pulse before it. Else: when, in ticks.
        time: i64,
    },
}

/// A photon or a marker by the laser pulse before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A photon.
    Photon {
        /// The detector, as in [`Record::Photon`].
        channel: i32,
        /// Number of the laser pulse before it, the first is 0.
        sync: i64,
        /// Ticks since that laser pulse.
        delay: i64,
    },
    /// Markers of a scanner, one bit each: bit 0 is marker 1.
    Marker {
        /// Which, several at once.
        bits: u16,
        /// Number of the laser pulse before it.
        sync: i64,
    },
}

/// The channels of files that number everything alike: arrays and text. PicoQuant's files tell laser pulses, photons and
/// markers apart themselves.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Inputs {
    /// The channel of the laser's trigger; 0 by default.
    pub sync: i32,
    /// The channels of markers: the first is marker 1.
    pub markers: Vec<i32>,
}

impl Inputs {
    /// What an event of this channel at this time is.
    #[inline]
    fn record(&self, channel: i32, time: i64) -> Record {
        if channel == self.sync {
            return Record::Sync { time };
        }
        match self.markers.iter().position(|m| *m == channel) {
            Some(marker) => Record::Marker { bits: 1 << marker, time },
            None => Record::Photon { channel, time, delay: 0 },
        }
    }
}

/// How a scanner's markers are wired, as the header of an image says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Image {
    /// Markers, from 1, of a line's begin, its end, and a new frame.
    pub markers: [Option<u32>; 3],
    /// Pixels of a line, and lines.
    pub size: [Option<usize>; 2],
    /// Whether every other line runs backwards.
    pub both_ways: bool,
}

enum Format {
    Picoquant(Layout),
    Text,
    Arrays(arrays::Named),
}

/// A file of time tags.
pub struct Tags {
    path: PathBuf,
    format: Format,
    inputs: Inputs,
    /// Where the records begin, bytes.
    start: u64,
    /// Records, if the header says.
    count: Option<u64>,
    /// What wrote the file.
    pub instrument: String,
    /// Seconds of a tick, the unit of delays.
    pub tick: f64,
    /// Seconds between laser pulses, if the header says.
    pub period: Option<f64>,
    /// How a scanner's markers are wired.
    pub image: Image,
}

/// What became of the records of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Passed {
    /// Records, those of overflow included.
    pub records: u64,
    /// Records of no known kind, which were left out.
    pub unknown: u64,
    /// Photons before the first laser pulse, or out of order, which have no delay and were left out.
    pub without_sync: u64,
    /// Seconds between laser pulses, where the file holds them.
    pub period: Option<f64>,
    /// Sentences: an end that is missing, records that were left out.
    pub notes: Vec<String>,
}

/// Bytes that are read at once.
const BLOCK: usize = 1 << 20;

/// Whether a file holds PicoQuant's time tags, by its first bytes.
pub fn is_picoquant(path: &Path) -> bool {
    let mut magic = [0; 6];
    open(path).is_ok_and(|mut file| file.read_exact(&mut magic).is_ok()) && &magic == b"PQTTTR"
}

const TEXT: [&str; 3] = ["csv", "txt", "tsv"];

fn open(path: &Path) -> Result<File> {
    // Asked before it is opened: opening a pipe waits for its writer.
    let about = std::fs::metadata(path).map_err(unreadable)?;
    match (about.is_dir(), about.is_file()) {
        (true, _) => Err(Error::input("is a folder", "give a file of time tags")),
        (_, false) => {
            Err(Error::input("is not a regular file", "write the tags to a file: it is read twice"))
        }
        _ => File::open(path).map_err(unreadable),
    }
}

fn unreadable(e: std::io::Error) -> Error {
    let hint = match e.kind() {
        ErrorKind::NotFound => "check the path: there is no such file",
        ErrorKind::PermissionDenied => "make the file readable for you",
        _ => "check the path and the disk",
    };
    Error::input(format!("cannot be read: {e}"), hint)
}

impl Tags {
    /// Opens a file of time tags. `inputs` are those of arrays and text.
    ///
    /// # Errors
    /// `Kind::Input`, beginning with the path: no such file, an unknown format, a damaged header. `Kind::Options` for
    /// inputs that do not fit.
    pub fn open(path: &Path, inputs: &Inputs) -> Result<Tags> {
        Self::of(path, inputs).map_err(|e| e.at(path.display()))
    }

    fn of(path: &Path, inputs: &Inputs) -> Result<Tags> {
        if inputs.markers.len() > 16 || inputs.markers.contains(&inputs.sync) {
            return Err(Error::options(
                format!(
                    "the markers are channels {:?}, laser pulses channel {}",
                    inputs.markers, inputs.sync
                ),
                "give up to 16 channels of markers, and another one of laser pulses",
            ));
        }
        let mut file = open(path)?;
        let mut magic = vec![];
        (&mut file).take(8).read_to_end(&mut magic).map_err(unreadable)?;
        let tags = |format, tick: f64, instrument: &str| Tags {
            path: path.into(),
            format,
            inputs: inputs.clone(),
            start: 0,
            count: None,
            instrument: instrument.into(),
            tick,
            period: None,
            image: Image::default(),
        };
        const PICOSECOND: f64 = 1e-12;
        if let Some(holder) = Holder::of(&magic) {
            let named = arrays::Named::find(holder, path)?;
            return Ok(tags(Format::Arrays(named), PICOSECOND, "arrays, picoseconds"));
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match &magic[..] {
            magic if magic.starts_with(b"PQTTTR") => Self::picoquant(path, &mut file),
            magic if magic.starts_with(b"PQHISTO") => Err(Error::input(
                "holds histograms of the instrument (PHU), which are not read",
                "export the histograms as an array [points, bins], npy or npz, and give the width of a bin",
            )),
            [] => Err(Error::input("is empty", "copy or write the file again")),
            _ if TEXT.contains(&&ending[..]) => Ok(tags(Format::Text, PICOSECOND, "text, picoseconds")),
            _ => Err(Error::input(
                "is no file of time tags that is known",
                "give PicoQuant's .ptu, npz or HDF5 with timestamps and channels, or text named .csv or .txt (channel, time in ps); \
                 store the tags of a raw dump as such arrays",
            )),
        }
    }

    /// Reads the header of a PTU file behind its magic.
    fn picoquant(path: &Path, file: &mut File) -> Result<Tags> {
        let header = Header::read(&mut std::io::BufReader::new(file))?;
        let number = header.whole("TTResultFormat_TTTRRecType");
        let number = number.ok_or_else(|| header::damaged("it has no record type".into()))?;
        let (instrument, layout) = records::of_type(number).ok_or_else(|| {
            Error::input(
                format!("the record type {number:#010x} is not known"),
                "export the file anew as one of PicoHarp 300 or 330, HydraHarp, TimeHarp 260 or MultiHarp",
            )
        })?;
        let mode = header.whole("Measurement_Mode").filter(|mode| matches!(mode, 2 | 3));
        if let Some(mode) = mode.filter(|mode| (*mode == 3) != layout.is_t3()) {
            return Err(Error::input(
                format!(
                    "the header contradicts itself: the measurement mode is T{mode}, the record type {instrument}"
                ),
                "export the file anew from the instrument's software: its records cannot be reported apart",
            ));
        }
        if let Some(bits) = header.whole("TTResultFormat_BitsPerRecord").filter(|b| ![0, 32].contains(b)) {
            return Err(header::damaged(format!("records have {bits} bits, not 32")));
        }
        let global = header.seconds("MeasDesc_GlobalResolution")?;
        let t3 = layout.is_t3();
        let tick = if t3 { header.seconds("MeasDesc_Resolution")? } else { global };
        let marker =
            |name| header.whole(name).and_then(|m| u32::try_from(m).ok()).filter(|m| (1..=16).contains(m));
        let size = |name| header.whole(name).and_then(|n| usize::try_from(n).ok()).filter(|n| *n > 0);
        Ok(Tags {
            path: path.into(),
            format: Format::Picoquant(layout),
            inputs: Inputs::default(),
            start: header.length,
            count: header.whole("TTResult_NumberOfRecords").filter(|n| *n > 0).map(|n| n as u64),
            instrument: instrument.into(),
            tick,
            period: t3.then_some(global),
            image: Image {
                markers: ["ImgHdr_LineStart", "ImgHdr_LineStop", "ImgHdr_Frame"].map(marker),
                size: ["ImgHdr_PixX", "ImgHdr_PixY"].map(size),
                both_ways: header.whole("ImgHdr_BiDirect").is_some_and(|b| b != 0),
            },
        })
    }

    /// Calls `hear` with every record in the order of the file.
    ///
    /// # Errors
    /// `Kind::Input`, beginning with the path, if the file cannot be read, or a line of text is not one.
    pub fn records(&self, hear: impl FnMut(Record)) -> Result<Passed> {
        self.read(hear).map_err(|e| e.at(self.path.display()))
    }

    /// Calls `hear` with every photon and marker in the order of the file. Instruments write markers a little out of order.
    ///
    /// # Errors
    /// Those of [`Tags::records`].
    pub fn events(&self, hear: impl FnMut(Event)) -> Result<Passed> {
        self.read_events(hear).map_err(|e| e.at(self.path.display()))
    }

    fn read_events(&self, mut hear: impl FnMut(Event)) -> Result<Passed> {
        let t3 = matches!(self.format, Format::Picoquant(layout) if layout.is_t3());
        let mut passed = if t3 {
            self.read(|record| match record {
                Record::Photon { channel, time, delay } => {
                    hear(Event::Photon { channel, sync: time, delay: i64::from(delay) });
                }
                Record::Marker { bits, time } => hear(Event::Marker { bits, sync: time }),
                Record::Sync { .. } => {}
            })?
        } else {
            let mut syncs = Syncs::default();
            let mut passed = self.read(|record| {
                if let Some(event) = syncs.event(record) {
                    hear(event);
                }
            })?;
            passed.without_sync = syncs.without;
            passed.period = syncs.period().map(|ticks| ticks * self.tick);
            if syncs.late > 0 {
                passed.notes.push(format!("{} laser pulses were out of order and are left out", syncs.late));
            }
            passed
        };
        if passed.without_sync > 0 {
            passed.notes.push(format!(
                "{} photons came before the first laser pulse, or out of order, and are left out",
                passed.without_sync
            ));
        }
        Ok(passed)
    }

    /// Bytes of the file.
    fn length(&self) -> Result<u64> {
        Ok(std::fs::metadata(&self.path).map_err(unreadable)?.len())
    }

    /// The file, at its first record.
    fn begin(&self) -> Result<File> {
        let mut file = open(&self.path)?;
        file.seek(SeekFrom::Start(self.start)).map_err(unreadable)?;
        Ok(file)
    }

    /// Calls `hear` with every record: as many as the header says, or as the file has.
    fn read(&self, mut hear: impl FnMut(Record)) -> Result<Passed> {
        let file = self.begin()?.take(self.count.map_or(u64::MAX, |n| n.saturating_mul(4)));
        let mut passed = Passed::default();
        match &self.format {
            Format::Arrays(named) => named.read(&self.path, &self.inputs, &mut passed, hear)?,
            Format::Text => text::read(file, &self.inputs, &mut passed, hear)?,
            Format::Picoquant(layout) => self.words(file, *layout, &mut passed, &mut hear)?,
        }
        if passed.unknown > 0 {
            passed.notes.push(format!("{} records of no known kind are left out", passed.unknown));
        }
        Ok(passed)
    }

    /// Reads records of 32 bits, as many as the header says, or to the end of the file.
    fn words(
        &self,
        mut file: impl Read,
        layout: Layout,
        passed: &mut Passed,
        hear: &mut impl FnMut(Record),
    ) -> Result<()> {
        let mut block = vec![0; BLOCK]; // bounded: a block
        let (mut base, mut held) = (0, 0);
        loop {
            let end = match file.read(&mut block[held..]) {
                Ok(0) => break,
                Ok(read) => held + read,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(unreadable(e)),
            };
            let (words, rest) = block[..end].as_chunks::<4>();
            for word in words {
                match layout.record(u32::from_le_bytes(*word), &mut base) {
                    Word::Record(record) => hear(record),
                    Word::Overflow => {}
                    Word::Unknown => passed.unknown += 1,
                }
            }
            passed.records += words.len() as u64;
            held = rest.len();
            block.copy_within(end - held..end, 0);
        }
        match self.count.filter(|n| *n > passed.records) {
            Some(count) => passed.notes.push(format!(
                "the file ends after {} of its {count} records: the rest is missing",
                passed.records
            )),
            None if held > 0 => {
                passed.notes.push(format!("the last record is cut: its {held} bytes are left out"));
            }
            None => {}
        }
        Ok(())
    }
}
