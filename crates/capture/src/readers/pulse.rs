//! Reads an instrument's pulse from an npz, HDF5 or MATLAB file.

use std::path::Path;

use super::contents::{self, Contents};
use super::documented::Documented;
use super::variables::Variables;
use crate::Pulse;
use crate::error::{Error, Result};
use crate::files::archive::Npz;

const WANTED: &str = "pulse [n], pulse_delta_t and pulse_t_start, in metres of path";

impl Pulse {
    /// Reads `pulse` \[n\], `pulse_delta_t` (width of a sample) and `pulse_t_start` (leading edge of the first sample,
    /// 0 if missing), metres of path. `None` if it has no `pulse`.
    ///
    /// # Errors
    /// `Kind::Input` for damaged arrays, and for values that are not a valid pulse.
    pub(super) fn read_from(file: &Documented) -> Result<Option<Pulse>> {
        let Some((_, samples)) = file.numbers("pulse")? else { return Ok(None) };
        let Some(width) = file.number("pulse_delta_t")? else {
            return Err(Error::input(
                "there is a pulse, but no pulse_delta_t",
                "store the width of its samples in metres of path as pulse_delta_t",
            ));
        };
        let start = file.number("pulse_t_start")?.unwrap_or(0.0);
        let pulse = Pulse { samples, width, start };
        pulse.check()?;
        Ok(Some(pulse))
    }

    /// Reads a pulse from an npz, HDF5 or MATLAB file of its own, or from a capture that has one.
    ///
    /// # Errors
    /// `Kind::Input`, with the path, for a file without a pulse, damaged arrays, and values that are not a valid pulse.
    pub fn read(path: &Path) -> Result<Pulse> {
        let read = || match contents::of(path)? {
            Contents::Hdf5 | Contents::Matlab5 => {
                let file = Variables::open(path)?;
                Pulse::read_from(&Documented::of_file(&file, &[], WANTED)?)
            }
            _ => Pulse::read_from(&Documented::of_npz(Npz::open(path)?, WANTED)),
        };
        let pulse = read()
            .and_then(|p| p.ok_or_else(|| Error::input("holds no array pulse", format!("store {WANTED}"))));
        pulse.map_err(|e| e.at(path.display()))
    }
}
