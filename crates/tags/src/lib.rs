//! Time tags of photon-counting instruments as one stream of events, and captures made of them.
//!
//! [`Tags`] reads PicoQuant's `.ptu` (every record type, T2 and T3), arrays of timestamps and channels in npz and HDF5, Photon-HDF5,
//! and text.
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
mod guess;
mod header;
mod histogram;
mod lines;
mod order;
pub mod program;
mod records;
mod shape;
mod stored;
mod survey;
mod syncs;
mod tables;
mod text;
mod zero;
mod zone_logs;

pub use arrange::Scan;
pub use division::Division;
pub use guess::Guess;
pub use histogram::{Asked, Histograms, PileUp, histogram};
pub use stored::Readings;
pub use survey::{Channel, Survey};
pub use thirdbounce_capture::formats::recognised::hold_tags;
pub use zero::Zero;

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use thirdbounce_base::{advice, error, files, host};
use thirdbounce_capture as capture;
use thirdbounce_capture::formats::recognised::{self, Content};

use crate::advice::advice;
use crate::error::{Error, Result};
use arrays::Holder;
use header::Header;
use order::Order;
use records::{RecordLayout, Word};
use syncs::{Filtered, Syncs};

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

/// How a file is to be read where it does not say so itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Inputs {
    /// The channel of the laser's trigger in arrays and text, which number laser pulses, photons and markers alike.
    pub sync: i32,
    /// The channels of markers in arrays and text: the first is marker 1.
    pub markers: Vec<i32>,
    /// Seconds of the unit of times in arrays and text; `None`: picoseconds, or the unit in a column's name.
    pub unit: Option<f64>,
    /// Laser pulses for each that the file holds, for records of times (T2, arrays, text); `None`: as the header says, or 1.
    pub divider: Option<u32>,
    /// Seconds between laser pulses, where the file holds only the pulse after each photon (a conditional filter).
    pub filtered: Option<f64>,
    /// Whether a PicoQuant file holds T3 records (`true`) or T2 records; `None`: as the header says.
    pub t3: Option<bool>,
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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Image {
    /// Markers, from 1, of a line's begin, its end, and a new frame.
    pub markers: [Option<u32>; 3],
    /// Pixels of a line, and lines.
    pub size: [Option<usize>; 2],
    /// Whether every other line runs backwards.
    pub both_ways: bool,
    /// Seconds of a pixel.
    pub pixel: Option<f64>,
    /// Share of a sine's quarter periods on both sides of its zero that a line takes; `None` for a constant speed.
    pub sine: Option<f64>,
}

enum TagFormat {
    Picoquant(RecordLayout),
    Text(text::TextColumns),
    Arrays(arrays::Named),
}

impl TagFormat {
    /// Ticks of a unit of the times as they are stored.
    fn ticks(&self) -> i64 {
        if let TagFormat::Text(layout) = self { layout.ticks() } else { 1 }
    }
}

/// A file of time tags.
pub struct Tags {
    path: PathBuf,
    format: TagFormat,
    inputs: Inputs,
    /// Where the records begin, bytes.
    start: u64,
    /// Records, if the header says.
    count: Option<u64>,
    /// Laser pulses for each that the file holds.
    divider: u32,
    /// Ticks between laser pulses where the file does not hold all of them, once found.
    every: OnceLock<f64>,
    /// Whether the unit of times is an assumption.
    assumed_unit: bool,
    notes: Vec<String>,
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
    /// Ticks between laser pulses, if the file does not hold all of them.
    pub sparse: Option<f64>,
    /// How the file ends too early, if it does; also among the notes.
    pub cut: Option<String>,
    /// Sentences: an end that is missing, records that were left out.
    pub notes: Vec<String>,
}

impl Passed {
    fn cut(&mut self, what: String) {
        self.notes.push(what.clone());
        self.cut = Some(what);
    }
}

/// Bytes that are read at once.
const BLOCK: usize = 1 << 20;

/// Shortest time between laser pulses, seconds.
const SHORTEST: f64 = 0.8e-9;

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
        const PICOSECOND: f64 = 1e-12;
        let tags = |format, tick: f64, instrument: &str| Tags {
            path: path.into(),
            format,
            inputs: inputs.clone(),
            start: 0,
            count: None,
            divider: inputs.divider.unwrap_or(1),
            every: OnceLock::new(),
            assumed_unit: inputs.unit.is_none(),
            notes: vec![],
            instrument: instrument.into(),
            tick,
            period: None,
            image: Image::default(),
        };
        let unit = inputs.unit.unwrap_or(PICOSECOND);
        if !(unit.is_finite()
            && unit > 0.0
            && inputs.filtered.is_none_or(|period| period.is_finite() && period > 0.0))
        {
            return Err(Error::options(
                format!("the unit of times is {unit} s, the laser's period {:?} s", inputs.filtered),
                "give times above 0",
            ));
        }
        if let Some(holder) = Holder::of(&magic) {
            let named = arrays::Named::find(holder, path)?;
            let Some(nanotimes) = named.nanotimes.clone() else {
                let name = format!("arrays, times in units of {:.6} ps", 1e12 * unit);
                return Ok(tags(TagFormat::Arrays(named), unit, &name));
            };
            let opened = tags(TagFormat::Arrays(named), nanotimes.tick, "Photon-HDF5");
            return Ok(Tags { period: Some(nanotimes.period), assumed_unit: false, ..opened });
        }
        if magic.is_empty() {
            return Err(Error::input("is empty", "copy or write the file again"));
        }
        match recognised::of(path)? {
            Some(known) if magic.starts_with(b"PQTTTR") => {
                debug_assert!(known.content == Content::Tags);
                Self::picoquant(path, &mut file, inputs)
            }
            Some(known) if known.content == Content::Tags => {
                let mut notes = vec![];
                let layout = text::TextColumns::find(open(path)?, inputs, &mut notes)?;
                let tick = inputs.unit.filter(|unit| text::power_of(*unit).is_none()).unwrap_or(PICOSECOND);
                let opened = tags(TagFormat::Text(layout), tick, "text");
                Ok(Tags { notes, assumed_unit: opened.assumed_unit && layout.is_assumed(), ..opened })
            }
            Some(known) => Err(known.refusal()),
            None => Err(Error::input(
                "is no file of time tags that is known",
                "give PicoQuant's .ptu, npz or HDF5 with timestamps and channels, or text (channel, time in ps); store the tags of a \
                 raw dump as such arrays",
            )),
        }
    }

    /// Reads the header of a PTU file behind its magic.
    fn picoquant(path: &Path, file: &mut File, inputs: &Inputs) -> Result<Tags> {
        let header = Header::read(&mut std::io::BufReader::new(&mut *file))?;
        let number = header.whole("TTResultFormat_TTTRRecType");
        let number = number.ok_or_else(|| header::damaged("it has no record type".into()))?;
        let known = |number| {
            records::of_type(number).ok_or_else(|| {
                Error::input(
                    format!("the record type {number:#010x} is not known"),
                    "export the file anew as one of PicoHarp 300 or 330, HydraHarp, TimeHarp 260 or MultiHarp",
                )
            })
        };
        let (name, layout) = known(number)?;
        if let Some(bits) = header.whole("TTResultFormat_BitsPerRecord").filter(|b| ![0, 32].contains(b)) {
            return Err(header::damaged(format!("records have {bits} bits, not 32")));
        }
        let mode = header.whole("Measurement_Mode").filter(|mode| matches!(mode, 2 | 3));
        let mut notes = vec![];
        file.seek(SeekFrom::Start(header.length)).map_err(unreadable)?;
        let stated = mode.is_none_or(|mode| (mode == 3) == layout.is_t3());
        let syncs = layout.holds_syncs(file)?;
        let holds_t3 = syncs != Some(true);
        let t3 = match inputs.t3 {
            Some(t3) => t3,
            None if stated && (layout.is_t3() || syncs != Some(false)) => layout.is_t3(),
            None if stated => {
                return Err(Error::input(
                    format!("the header says {name}, but no record is a laser pulse"),
                    advice!["if these are T3 records, say so: " Records " t3; else record the laser's trigger, too"],
                ));
            }
            None => {
                notes.push(format!(
                    "the header contradicts itself: measurement mode T{}, record type {name}; the records are those of T{}",
                    mode.unwrap_or(0),
                    if holds_t3 { 3 } else { 2 }
                ));
                holds_t3
            }
        };
        let (instrument, layout) = known(number & !0xF00 | if t3 { 0x300 } else { 0x200 })?;
        let global = header.seconds("MeasDesc_GlobalResolution")?;
        let tick = if t3 { header.seconds("MeasDesc_Resolution")? } else { global };
        let marker =
            |name| header.whole(name).and_then(|m| u32::try_from(m).ok()).filter(|m| (1..=16).contains(m));
        let size = |name| header.whole(name).and_then(|n| usize::try_from(n).ok()).filter(|n| *n > 0);
        let divider = header.whole("HWSync_Divider").and_then(|n| u32::try_from(n).ok());
        // T3 records number laser pulses whatever the divider.
        let divider = if t3 { 1 } else { inputs.divider.or(divider).unwrap_or(1).max(1) };
        if divider > 1 {
            notes.push(format!(
                "the file holds every {divider}th laser pulse: delays are taken from the pulses between, too"
            ));
        }
        Ok(Tags {
            path: path.into(),
            format: TagFormat::Picoquant(layout),
            inputs: inputs.clone(),
            start: header.length,
            count: header.whole("TTResult_NumberOfRecords").filter(|n| *n > 0).map(|n| n as u64),
            divider,
            every: OnceLock::new(),
            assumed_unit: false,
            notes,
            instrument: instrument.into(),
            tick,
            period: t3.then_some(global),
            image: Image {
                markers: ["ImgHdr_LineStart", "ImgHdr_LineStop", "ImgHdr_Frame"].map(marker),
                size: ["ImgHdr_PixX", "ImgHdr_PixY"].map(size),
                both_ways: header.whole("ImgHdr_BiDirect").is_some_and(|b| b != 0),
                // Milliseconds and per cent.
                pixel: header.number("ImgHdr_TimePerPixel").filter(|ms| *ms > 0.0).map(|ms| 1e-3 * ms),
                sine: header
                    .number("ImgHdr_SinCorrection")
                    .filter(|share| (1.0..=100.0).contains(share))
                    .map(|share| 0.01 * share),
            },
        })
    }

    /// Whether a record holds the number of its laser pulse and the delay since.
    fn is_t3(&self) -> bool {
        match &self.format {
            TagFormat::Picoquant(layout) => layout.is_t3(),
            TagFormat::Arrays(named) => named.nanotimes.is_some(),
            TagFormat::Text(_) => false,
        }
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
        let mut passed = if self.is_t3() {
            self.read(|record| match record {
                Record::Photon { channel, time, delay } => {
                    hear(Event::Photon { channel, sync: time, delay: i64::from(delay) });
                }
                Record::Marker { bits, time } => hear(Event::Marker { bits, sync: time }),
                Record::Sync { .. } => {}
            })?
        } else if let Some(period) = self.inputs.filtered {
            let mut filtered = Filtered::new(period / self.tick);
            let passed = self.read_in_order(|record| filtered.hear(record, &mut hear))?;
            Passed { without_sync: filtered.without, period: Some(period), ..passed }
        } else {
            let mut syncs =
                Syncs::new(self.divider, self.every.get().copied(), (SHORTEST / self.tick) as i64);
            let mut passed = self.read_in_order(|record| {
                if let Some(event) = syncs.event(record) {
                    hear(event);
                }
            })?;
            passed.without_sync = syncs.without;
            passed.period = syncs.period().map(|ticks| ticks * self.tick);
            if syncs.late > 0 {
                passed.notes.push(format!("{} laser pulses were out of order and are left out", syncs.late));
            }
            self.check_syncs(&syncs)?;
            if !matches!(self.format, TagFormat::Picoquant(_)) && !syncs.is_regular() {
                passed.notes.push(format!(
                    "the tags of channel {}, read as laser pulses, are not regular, as those of a detector: check which channel is the \
                     laser's",
                    self.inputs.sync
                ));
            }
            passed.sparse = syncs.sparse();
            if let Some(period) = self.every.get() {
                passed.notes.push(format!(
                    "not all laser pulses are in the file: they are numbered by time, {:.4} ns apart",
                    1e9 * period * self.tick
                ));
            }
            passed
        };
        if passed.without_sync > 0 {
            passed.notes.push(format!(
                "{} photons came before the first laser pulse, or out of order, and are left out",
                passed.without_sync
            ));
        }
        passed.notes.splice(0..0, self.notes.iter().cloned());
        Ok(passed)
    }

    /// Calls `hear` with every record in the order of time, as far as the file may be out of order.
    fn read_in_order(&self, mut hear: impl FnMut(Record)) -> Result<Passed> {
        if matches!(self.format, TagFormat::Picoquant(_)) {
            return self.read(hear);
        }
        let mut order = Order::of_unit(self.format.ticks());
        let mut passed = self.read(|record| order.push(record, &mut hear))?;
        order.end(&mut passed, &mut hear)?;
        Ok(passed)
    }

    /// Refuses laser pulses that no laser gives, and those of a conditional filter.
    fn check_syncs(&self, syncs: &Syncs) -> Result<()> {
        let pulses = syncs.count().max(0) as u64;
        let one_time = pulses == 1 && syncs.late > 10;
        if self.assumed_unit && (20 * syncs.short > pulses || one_time) {
            let rate = syncs.period().map_or(f64::INFINITY, |ticks| 1e-6 / (ticks * self.tick));
            let what = match one_time {
                true => "all laser pulses come at one time, if times are in picoseconds".into(),
                false => format!("the laser pulses come at {rate:.0} MHz, if times are in picoseconds"),
            };
            return Err(Error::input(what, advice!["give the unit of the times, such as " TagUnit " 1ns"]));
        }
        if let Some(times) = syncs.divided().filter(|_| self.inputs.divider.is_none()) {
            return Err(Error::input(
                format!(
                    "the delays of photons repeat {times} times from one laser pulse of the file to the next"
                ),
                advice!["if the file holds every " (times.to_string()) "th pulse, say so: " SyncDivider (format!(" {times}; else 1"))],
            ));
        }
        if syncs.is_filtered() {
            return Err(Error::input(
                "the file holds the laser pulse after each photon only, as a conditional filter leaves it",
                advice!["give the time between laser pulses, such as " SyncAfter " 50ns, or record without the filter"],
            ));
        }
        Ok(())
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
            TagFormat::Arrays(named) => named.read(&self.path, &self.inputs, &mut passed, hear)?,
            TagFormat::Text(layout) => layout.read(file, &self.inputs, &mut passed, hear)?,
            TagFormat::Picoquant(layout) => self.words(file, *layout, &mut passed, &mut hear)?,
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
        layout: RecordLayout,
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
            Some(count) => passed.cut(format!(
                "the file ends after {} of its {count} records: the rest is missing",
                passed.records
            )),
            None if held > 0 => {
                passed.cut(format!("the last record is cut: its {held} bytes are left out"));
            }
            None => {}
        }
        Ok(())
    }
}
