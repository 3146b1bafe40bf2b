//! PicoQuant's `.phu`: histograms that the instrument made itself, one for each curve.
//!
//! Source: the tag dictionary and the PHU demos (PicoQuant, PicoQuant-Time-Tagged-File-Format-Demos). Bins are uint32, little
//! endian.

use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::header::{Header, damaged};
use super::{open, unreadable};
use crate::error::{Error, Result};
use crate::host;

/// Most bins of all curves together: 4 GiB of counts.
const MOST: u64 = 1 << 30;

/// A histogram.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Seconds of a bin.
    pub tick: f64,
    /// Counts by bin.
    pub counts: Vec<u32>,
}

/// The histograms of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// In the order of the file.
    pub curves: Vec<Curve>,
}

impl Curves {
    /// Whether a file is one of PicoQuant's histograms, by its first bytes.
    pub fn is_one(path: &Path) -> bool {
        let mut magic = [0; 7];
        open(path).is_ok_and(|mut file| file.read_exact(&mut magic).is_ok()) && &magic == b"PQHISTO"
    }

    /// Reads all histograms of a file.
    ///
    /// # Errors
    /// `Kind::Input`, beginning with the path: no such file, another format, a damaged header, counts that are missing.
    pub fn read(path: &Path) -> Result<Curves> {
        Self::of(path).map_err(|e| e.at(path.display()))
    }

    fn of(path: &Path) -> Result<Curves> {
        let mut file = open(path)?;
        let mut magic = [0; 8];
        file.read_exact(&mut magic).map_err(unreadable)?;
        if !magic.starts_with(b"PQHISTO") {
            return Err(Error::input("is no PHU file", "give a .phu of a PicoQuant instrument"));
        }
        let header = Header::read(&mut BufReader::new(&mut file))?;
        let length = file.metadata().map_err(unreadable)?.len();
        let number = header.required("HistoResult_NumberOfCurves", -1)?;
        if let Some(bits) = header.whole("HistoResult_BitsPerBin").filter(|b| *b != 32) {
            return Err(damaged(format!("bins have {bits} bits, not 32")));
        }
        let mut held = 0;
        let number = i32::try_from(number).ok().filter(|n| *n > 0);
        let number = number.ok_or_else(|| damaged("there is no curve".into()))?;
        let curve = |index: i32| {
            let whole = |name| Ok::<_, Error>(header.required(name, index)?.max(0) as u64);
            let (from, bins) = (whole("HistResDscr_DataOffset")?, whole("HistResDscr_HistogramBins")?);
            held += 4 * bins.min(MOST);
            let fits = bins > 0
                && bins < MOST
                && held <= length
                && from.checked_add(4 * bins).is_some_and(|end| end <= length);
            if !fits {
                return Err(Error::input(
                    format!("the {bins} bins of curve {index} are not all in the file"),
                    "the file is cut: copy it again",
                ));
            }
            let mut bytes = host::filled("a curve", 4 * bins as usize, 0)?;
            file.seek(SeekFrom::Start(from)).map_err(unreadable)?;
            file.read_exact(&mut bytes).map_err(unreadable)?;
            let counts = bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
            Ok(Curve { tick: header.seconds("HistResDscr_MDescResolution", index)?, counts })
        };
        Ok(Curves { curves: (0..number).map(curve).collect::<Result<_>>()? })
    }
}
