//! Time tags as arrays: `timestamps` and `channels`, as people store what Swabian's Time Tagger gives to Python
//! (`getTimestamps`, `getChannels`), in npz or HDF5.
//!
//! Both arrays have one axis and one length, whole numbers, timestamps in picoseconds. They are read part by part. Swabian's
//! `event_types` (`getEventTypes`) may be a third one: 0 is a tag, all else is left out.

use std::path::Path;

use super::{Inputs, Passed, Record};
use crate::capture::formats::{self, hdf5::Hdf5};
use crate::error::{Error, Result};
use crate::files::archive::{Elements, Npz};
use crate::files::array::Head;

/// Names of the arrays, the first is what Swabian calls it. Case does not matter, and groups before them do not.
const TIMES: [&str; 8] =
    ["timestamps", "timestamp", "timestamps_ps", "times", "times_ps", "time", "time_tags", "timetags"];
const CHANNELS: [&str; 3] = ["channels", "channel", "channel_ids"];
const TYPES: [&str; 2] = ["event_types", "types"];
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
    types: Option<String>,
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
        Ok(Named { holder, times, channels, types: one(&TYPES)? })
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
        let mut types = self.types.as_ref().map(|name| column(&mut file, name)).transpose()?;
        for other in [Some(&channels), types.as_ref()].into_iter().flatten() {
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
        let mut missed = 0;
        while times.left > 0 {
            let (at, to) = (times.part(hdf5, part)?, channels.part(hdf5, part)?);
            let types = types.as_mut().map(|column| column.part(hdf5, part)).transpose()?;
            for (i, (time, channel)) in at.into_iter().zip(to).enumerate() {
                passed.records += 1;
                let channel = i32::try_from(channel).map_err(|_| {
                    Error::input(
                        format!("{} holds {channel}, which is no channel", self.channels),
                        "store the numbers of inputs",
                    )
                })?;
                match types.as_ref().map_or(0, |types| types[i]) {
                    0 => hear(inputs.record(channel, time)),
                    _ => missed += 1,
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
