//! The tagged header of PicoQuant's unified files (PTU): named values before the data.
//!
//! Source: "Unified file format" and its tag dictionary (PicoQuant, PicoQuant-Time-Tagged-File-Format-Demos). After 8 bytes
//! of magic and 8 of version come entries of 48 bytes: a name of 32, an index (-1 without), a type, and 8 bytes that are
//! the value or the length of what follows. `Header_End` is the last.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};

use crate::error::{Error, Result};

/// Most entries that are read; files have a few hundred.
const MOST_ENTRIES: usize = 100_000;
/// Longest text or block in a header, bytes. Files have at most a few kilobytes.
const LONGEST: u64 = 1 << 24;

const FLOAT: u32 = 0x2000_0008;
/// Types whose value is 8 bytes, besides floats: empty, boolean, integer, bits, colour, date.
const EIGHT_BYTES: [u32; 6] = [0xFFFF_0008, 0x0000_0008, 0x1000_0008, 0x1100_0008, 0x1200_0008, 0x2100_0008];
/// Types that are followed by as many bytes as their value says: floats, two kinds of text, a block.
const FOLLOWED: [u32; 4] = [0x2001_FFFF, 0x4001_FFFF, 0x4002_FFFF, 0xFFFF_FFFF];

/// The numbers of a header by name: 8 bytes that are whole, or of a float.
#[derive(Debug, Clone, Default)]
pub(super) struct Header {
    whole: BTreeMap<String, i64>,
    real: BTreeMap<String, f64>,
    /// Numbers of inputs and curves.
    indexed: BTreeMap<(String, i32), f64>,
    /// Bytes up to the data.
    pub(super) length: u64,
}

impl Header {
    /// Reads a header behind its 8 bytes of magic.
    ///
    /// # Errors
    /// `Kind::Input` for a header that is cut or that no program wrote.
    pub(super) fn read(file: &mut impl Read) -> Result<Header> {
        let mut header = Header { length: 16, ..Header::default() };
        fill(file, &mut [0; 8])?;
        for _ in 0..MOST_ENTRIES {
            let mut entry = [0; 48];
            fill(file, &mut entry)?;
            header.length += 48;
            let name = entry[..32].split(|b| *b == 0).next().unwrap_or_default();
            let name = String::from_utf8_lossy(name).into_owned();
            let kind = u32::from_le_bytes([36, 37, 38, 39].map(|at| entry[at]));
            let value = i64::from_le_bytes([40, 41, 42, 43, 44, 45, 46, 47].map(|at| entry[at]));
            if name == "Header_End" {
                return Ok(header);
            }
            let index = i32::from_le_bytes([32, 33, 34, 35].map(|at| entry[at]));
            let number = if kind == FLOAT { f64::from_bits(value as u64) } else { value as f64 };
            if index >= 0 && (kind == FLOAT || EIGHT_BYTES.contains(&kind)) {
                header.indexed.insert((name, index), number);
            } else if kind == FLOAT {
                header.real.insert(name, number);
            } else if EIGHT_BYTES.contains(&kind) {
                header.whole.insert(name, value);
            } else if FOLLOWED.contains(&kind) {
                let length = value as u64;
                if length > LONGEST {
                    return Err(damaged(format!("its entry {name:?} is said to be {value} bytes long")));
                }
                let passed = std::io::copy(&mut file.take(length), &mut std::io::sink()).map_err(broken)?;
                if passed < length {
                    return Err(cut());
                }
                header.length += length;
            } else {
                return Err(damaged(format!("its entry {name:?} has the unknown type {kind:#010x}")));
            }
        }
        Err(damaged(format!("it has more than {MOST_ENTRIES} entries")))
    }

    /// A whole number; `None` if there is none of this name.
    pub(super) fn whole(&self, name: &str) -> Option<i64> {
        self.whole.get(name).copied()
    }

    /// A number of an input or a curve.
    pub(super) fn of_curve(&self, name: &str, curve: usize) -> Option<f64> {
        self.indexed.get(&(name.into(), i32::try_from(curve).ok()?)).copied()
    }

    /// A number of either kind.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.real.get(name).copied().or(self.whole(name).map(|value| value as f64))
    }

    /// A time in seconds that must be there.
    ///
    /// # Errors
    /// `Kind::Input` if it is missing or not positive.
    pub(super) fn seconds(&self, name: &str) -> Result<f64> {
        match self.real.get(name) {
            Some(value) if value.is_finite() && *value > 0.0 => Ok(*value),
            Some(value) => Err(damaged(format!("{name} is {value} s"))),
            None => Err(damaged(format!("it has no {name}"))),
        }
    }
}

fn fill(file: &mut impl Read, bytes: &mut [u8]) -> Result<()> {
    file.read_exact(bytes).map_err(|e| if e.kind() == ErrorKind::UnexpectedEof { cut() } else { broken(e) })
}

fn cut() -> Error {
    damaged("it is cut short".into())
}

fn broken(e: std::io::Error) -> Error {
    Error::input(format!("cannot be read: {e}"), "check the disk, and copy the file again")
}

pub(super) fn damaged(what: String) -> Error {
    Error::input(
        format!("the header of the PicoQuant file is damaged: {what}"),
        "copy the file again, or export it anew from the instrument's software",
    )
}
