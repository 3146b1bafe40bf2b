//! Time tags as arrays: `timestamps` and `channels`, as people store what Swabian's Time Tagger gives to Python
//! (`getTimestamps`, `getChannels`), in npz or HDF5.
//!
//! Both arrays have one axis and one length, whole numbers, timestamps in picoseconds. `event_types` and `missed_events`
//! (`getEventTypes`, `getMissedEvents`) may stand beside them, with the meaning that they have in a dump ([`super::dump`]). They are
//! read part by part.

use std::path::Path;

use super::dump::Kinds;
use super::{Inputs, Passed, Record};
use crate::capture::formats::{self, hdf5::Hdf5};
use crate::error::{Error, Result};
use crate::files::archive::{Elements, Npz};
use crate::files::array::Head;

/// Names of the arrays, the first is what Swabian calls it. Case does not matter, and groups before them do not.
const TIMES: [&str; 8] =
    ["timestamps", "timestamp", "timestamps_ps", "times", "times_ps", "time", "time_tags", "timetags"];
const CHANNELS: [&str; 3] = ["channels", "channel", "channel_ids"];
const KINDS: [&str; 2] = ["event_types", "types"];
const MISSED: [&str; 2] = ["missed_events", "missed"];
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
    channels: String,
    kinds: Option<String>,
    missed: Option<String>,
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
        let (Some(times), Some(channels)) = (one(&TIMES)?, one(&CHANNELS)?) else {
            let there = if names.is_empty() { "nothing".to_string() } else { names.join(", ") };
            return Err(Error::input(
                format!("holds no time tags: there are no arrays timestamps and channels (it holds {there})"),
                "store timestamps (picoseconds) and channels, whole numbers of one axis each; or, if it is a capture, open it as one, \
                 without a scan",
            ));
        };
        Ok(Named { holder, times, channels, kinds: one(&KINDS)?, missed: one(&MISSED)? })
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
        let mut channels = column(&mut file, &self.channels)?;
        let optional =
            |file: &mut File, name: &Option<String>| name.as_ref().map(|n| column(file, n)).transpose();
        let mut types = optional(&mut file, &self.kinds)?;
        let mut missed = optional(&mut file, &self.missed)?;
        for other in [Some(&channels), types.as_ref(), missed.as_ref()].into_iter().flatten() {
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
            for name in [&self.times, &self.channels] {
                part = part.max(hdf5.chunk(name)?.min(PART[1]));
            }
        }
        let mut kinds = Kinds::default();
        while times.left > 0 {
            let (at, to) = (times.part(hdf5, part)?, channels.part(hdf5, part)?);
            let types = types.as_mut().map(|column| column.part(hdf5, part)).transpose()?;
            let lost = missed.as_mut().map(|column| column.part(hdf5, part)).transpose()?;
            for (i, (time, channel)) in at.into_iter().zip(to).enumerate() {
                passed.records += 1;
                let channel = i32::try_from(channel).map_err(|_| {
                    Error::input(
                        format!("{} holds {channel}, which is no channel", self.channels),
                        "store the numbers of inputs",
                    )
                })?;
                let kind = types.as_ref().map_or(0, |types| u8::try_from(types[i]).unwrap_or(u8::MAX));
                let lost = lost.as_ref().map_or(0, |lost| u64::try_from(lost[i]).unwrap_or(0));
                if kinds.take(kind, lost, passed) {
                    hear(inputs.record(channel, time));
                }
            }
        }
        kinds.tell(passed);
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
    /// The next values, at most so many.
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
