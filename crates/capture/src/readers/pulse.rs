//! Reads an instrument's pulse from an npz file.

use std::path::Path;

use crate::Pulse;
use crate::error::{Error, Result};
use crate::files::archive::Npz;

impl Pulse {
    /// Reads `pulse` \[n\], `pulse_delta_t` (width of a sample) and `pulse_t_start` (leading edge of the first sample,
    /// 0 if missing), metres of path, from an npz file. `None` if it has no `pulse`.
    ///
    /// # Errors
    /// `Kind::Input` for damaged arrays, and for values that are not a valid pulse.
    pub(super) fn read_from(npz: &mut Npz) -> Result<Option<Pulse>> {
        let Some(samples) = npz.get("pulse")? else { return Ok(None) };
        let Some(width) = npz.scalar("pulse_delta_t")? else {
            return Err(Error::input(
                "there is a pulse, but no pulse_delta_t",
                "store the width of its samples in metres of path as pulse_delta_t",
            ));
        };
        let start = npz.scalar("pulse_t_start")?.unwrap_or(0.0);
        let pulse = Pulse { samples: samples.to_f64(), width, start };
        pulse.check()?;
        Ok(Some(pulse))
    }

    /// Reads a pulse from an npz file of its own, or from a capture that has one.
    ///
    /// # Errors
    /// `Kind::Input`, with the path, for a file without a pulse, damaged arrays, and values that are not a valid pulse.
    pub fn read(path: &Path) -> Result<Pulse> {
        let found = Npz::open(path).and_then(|mut npz| Pulse::read_from(&mut npz));
        let wanted = "store pulse [n], pulse_delta_t and pulse_t_start, in metres of path";
        let pulse = found.and_then(|p| p.ok_or_else(|| Error::input("holds no array pulse", wanted)));
        pulse.map_err(|e| e.at(path.display()))
    }
}
