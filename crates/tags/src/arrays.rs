//! Time tags as arrays: `timestamps` and `channels`, as people store what Swabian's Time Tagger gives to Python
//! (`getTimestamps`, `getChannels`), in npz or HDF5.
//!
//! Both arrays have one axis and one length, whole numbers, timestamps in picoseconds. They are read part by part. Swabian's
//! `event_types` (`getEventTypes`) may be a third one: 0 is a tag, all else is left out.
//!
//! Photon-HDF5 (photon-hdf5.readthedocs.io, version 0.5) has `photon_data/timestamps` in units of `timestamps_specs/timestamps_unit`,
//! `nanotimes` since the laser pulse in units of `nanotimes_specs/tcspc_unit`, and `detectors`.

use std::path::Path;

use super::{Inputs, Passed, Record};
use crate::capture::formats::recognised::{CHANNELS, NANOTIMES, TIMES};
use crate::capture::formats::{self, hdf5::Hdf5};
use crate::error::{Error, Result};
use crate::files::archive::{Elements, Npz};
use crate::files::array::Head;

/// Names of further arrays.
const TYPES: [&str; 2] = ["event_types", "types"];
const DETECTORS: [&str; 1] = ["detectors"];
/// Tags that are read at once: at least, and at most where a chunk of HDF5 has more than the least.
const PART: [usize; 2] = [1 << 16, 1 << 24];

/// The kind of a file that may hold arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Holder {
    Npz,
    Hdf5,
}

impl Holder {
    /// By the first bytes of the file.
    pub(super) fn of(magic: &[u8]) -> Option<Holder> {
        match magic {
            [b'P', b'K', 3, 4, ..] => Some(Holder::Npz),
            _ if magic.starts_with(formats::HDF5) => Some(Holder::Hdf5),
            _ => None,
        }
    }
}

/// The names of the arrays of a file.
#[derive(Debug, Clone)]
pub(super) struct Named {
    holder: Holder,
    times: String,
    channels: Option<String>,
    types: Option<String>,
    /// Photon-HDF5.
    pub(super) nanotimes: Option<Nanotimes>,
}

/// Delays of photons since their laser pulses.
#[derive(Debug, Clone)]
pub(super) struct Nanotimes {
    name: String,
    /// Seconds of a delay's unit, and between laser pulses.
    pub(super) tick: f64,
    pub(super) period: f64,
    /// Laser pulses in a unit of the timestamps.
    pulses: f64,
}

impl Nanotimes {
    /// The number of the laser pulse at a time.
    fn pulse(&self, time: i64) -> i64 {
        (time as f64 * self.pulses).clamp(0.0, (1u64 << 61) as f64) as i64
    }
}

enum File {
    Npz(Npz),
    Hdf5(Hdf5),
}

fn open(holder: Holder, path: &Path) -> Result<File> {
    Ok(match holder {
        Holder::Npz => File::Npz(Npz::open(path)?),
        Holder::Hdf5 => File::Hdf5(Hdf5::open(path)?),
    })
}

impl Named {
    /// Finds the arrays.
    pub(super) fn find(holder: Holder, path: &Path) -> Result<Named> {
        let names = match open(holder, path)? {
            File::Npz(npz) => npz.names(),
            File::Hdf5(file) => file.names(),
        };
        let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_lowercase();
        let one = |known: &[&str]| -> Result<Option<String>> {
            let mut found = names.iter().filter(|name| known.contains(&last(name).as_str()));
            match (found.next(), found.next()) {
                (Some(first), Some(second)) => Err(Error::input(
                    format!("{first} and {second} may both be what is called {} here", known[0]),
                    "keep one of them in the file",
                )),
                (first, _) => Ok(first.cloned()),
            }
        };
        if let (Some(times), Some(name), Holder::Hdf5) = (one(&TIMES)?, one(&NANOTIMES)?, holder) {
            let file = Hdf5::open(path)?;
            let unit = |suffix: &str| -> Result<Option<f64>> {
                let Some(name) = names.iter().find(|name| name.ends_with(suffix)) else { return Ok(None) };
                let value = file.numbers(name)?.and_then(|(_, values)| values.first().copied());
                Ok(value.filter(|unit| unit.is_finite() && *unit > 0.0))
            };
            let needed = |suffix: &str| {
                unit(suffix)?.ok_or_else(|| {
                    Error::input(
                        format!("the Photon-HDF5 file has no {suffix}"),
                        format!("store {suffix} in seconds, above 0"),
                    )
                })
            };
            let (macrotime, tick) = (needed("timestamps_unit")?, needed("tcspc_unit")?);
            let period = unit("laser_repetition_rates")?.map_or(macrotime, |rate| 1.0 / rate);
            let nanotimes = Nanotimes { name, tick, period, pulses: macrotime / period };
            let channels = one(&DETECTORS)?;
            return Ok(Named { holder, times, channels, types: None, nanotimes: Some(nanotimes) });
        }
        let (Some(times), Some(channels)) = (one(&TIMES)?, one(&CHANNELS)?) else {
            let there = if names.is_empty() { "nothing".to_string() } else { names.join(", ") };
            return Err(Error::input(
                format!("holds no time tags: there are no arrays timestamps and channels (it holds {there})"),
                "store timestamps (picoseconds) and channels, whole numbers of one axis each; or, if it is a capture, open it as one, \
                 without a scan",
            ));
        };
        Ok(Named { holder, times, channels: Some(channels), types: one(&TYPES)?, nanotimes: None })
    }

    /// Calls `hear` with every tag.
    pub(super) fn read(
        &self,
        path: &Path,
        inputs: &Inputs,
        passed: &mut Passed,
        mut hear: impl FnMut(Record),
    ) -> Result<()> {
        let mut file = open(self.holder, path)?;
        let mut times = column(&mut file, &self.times)?;
        let mut optional = |name: Option<&String>| name.map(|name| column(&mut file, name)).transpose();
        let mut channels = optional(self.channels.as_ref())?;
        let mut types = optional(self.types.as_ref())?;
        let mut nanotimes = optional(self.nanotimes.as_ref().map(|n| &n.name))?;
        for other in [&channels, &types, &nanotimes].into_iter().flatten() {
            if other.left != times.left {
                return Err(Error::input(
                    format!("{} holds {} values and {} {}", self.times, times.left, other.name, other.left),
                    "store one value of each for every tag",
                ));
            }
        }
        let hdf5 = if let File::Hdf5(file) = &file { Some(file) } else { None };
        // No chunk is decoded twice.
        let mut part = PART[0];
        if let Some(hdf5) = hdf5 {
            for name in [Some(&self.times), self.channels.as_ref(), nanotimes.as_ref().map(|c| &c.name)]
                .into_iter()
                .flatten()
            {
                part = part.max(hdf5.chunk(name)?.min(PART[1]));
            }
        }
        let mut missed = 0;
        while times.left > 0 {
            let at = times.part(hdf5, part)?;
            let more = |column: &mut Option<Column>| {
                column.as_mut().map(|column| column.part(hdf5, part)).transpose()
            };
            let (to, types, delays) = (more(&mut channels)?, more(&mut types)?, more(&mut nanotimes)?);
            for (i, time) in at.into_iter().enumerate() {
                passed.records += 1;
                let channel = to.as_ref().map_or(1, |to| to[i]);
                let channel = i32::try_from(channel).map_err(|_| {
                    Error::input(
                        format!(
                            "{} holds {channel}, which is no channel",
                            self.channels.as_deref().unwrap_or_default()
                        ),
                        "store the numbers of inputs",
                    )
                })?;
                if types.as_ref().is_some_and(|types| types[i] != 0) {
                    missed += 1;
                    continue;
                }
                let Some((delays, of)) = delays.as_ref().zip(self.nanotimes.as_ref()) else {
                    hear(inputs.record(channel, time));
                    continue;
                };
                match u32::try_from(delays[i]) {
                    Ok(delay) => hear(Record::Photon { channel, time: of.pulse(time), delay }),
                    Err(_) => missed += 1,
                }
            }
        }
        if missed > 0 {
            passed.notes.push(format!("{missed} events are no tags, such as overflows, and are left out"));
        }
        Ok(())
    }
}

/// An array of one axis that is read part by part.
struct Column {
    name: String,
    /// Values that were not read yet, and those that were.
    left: usize,
    at: usize,
    /// In an npz: how elements are stored, and where they come from.
    npy: Option<(Head, Elements)>,
}

fn column(file: &mut File, name: &str) -> Result<Column> {
    let gone = || Error::input(format!("there is no array {name}"), "the file has changed: try again");
    let (shape, npy) = match file {
        File::Npz(npz) => {
            let (head, elements) = npz.stream(name)?.ok_or_else(gone)?;
            (head.shape.clone(), Some((head, elements)))
        }
        // An empty dataset has no shape.
        File::Hdf5(file) => (file.shape(name)?.unwrap_or_else(|| vec![0]), None), // bounded: one element
    };
    let &[left] = &shape[..] else {
        return Err(Error::input(
            format!("{name} has shape {shape:?}, not one axis"),
            "store timestamps and channels as one array each, with a value for every tag",
        ));
    };
    Ok(Column { name: name.into(), left, at: 0, npy })
}

impl Column {
    /// The next values, at most `count`.
    fn part(&mut self, file: Option<&Hdf5>, most: usize) -> Result<Vec<i64>> {
        let count = self.left.min(most);
        let values = match (&mut self.npy, file) {
            (Some((head, elements)), _) => {
                let part = head.part(elements, count).map_err(|e| e.at(&self.name))?;
                part.to_i64().map_err(|wrong| {
                    Error::input(
                        format!("{} holds {wrong}, which is no whole number of 64 bits", self.name),
                        "store whole numbers",
                    )
                })?
            }
            (None, Some(file)) => file.whole(&self.name, self.at, count)?,
            (None, None) => vec![],
        };
        self.left -= count;
        self.at += count;
        Ok(values)
    }
}
