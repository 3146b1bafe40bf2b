//! What a capture file may leave unsaid: the user says it, nothing is guessed in silence.

use std::path::PathBuf;

use crate::capture::Turn;
use crate::error::{Error, Result};

/// Which bounces of a rendered capture count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounce {
    /// The nth, 2 being the first that reaches the wall again: 3 is wall, hidden scene, wall.
    Nth(usize),
    /// The sum of all that the file holds.
    All,
}

impl Bounce {
    /// Reads `third`, `all` or a number from 2.
    ///
    /// # Errors
    /// `Kind::Options` for anything else.
    pub fn parse(text: &str) -> Result<Bounce> {
        match (text, text.parse()) {
            ("third", _) => Ok(Bounce::Nth(3)),
            ("all", _) => Ok(Bounce::All),
            (_, Ok(n)) if n >= 2 => Ok(Bounce::Nth(n)),
            _ => Err(Error::options(
                format!("--bounce is {text:?}"),
                "give third (wall, hidden scene, wall), all, or a number from 2",
            )),
        }
    }
}

/// What the user says about a capture that its file does not; nothing by default.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Given {
    /// Distance in metres of the outermost scan points along the longer side.
    pub wall: Option<f64>,
    /// Bin width in metres of path.
    pub bin_width: Option<f64>,
    /// Bounces that count, of formats that keep them apart; the third unless said.
    pub bounce: Option<Bounce>,
    /// The file with the times of flight to the wall, of formats that keep them in a second file.
    pub time_of_flight: Option<PathBuf>,
    /// How the scan is turned over, for files that do not say which way it lies on the wall.
    pub turn: Turn,
}

impl Given {
    /// With the wall's size in metres, between the outermost scan points along the longer side.
    pub fn with_wall(self, size: impl Into<Option<f64>>) -> Given {
        Given { wall: size.into(), ..self }
    }

    /// With the bin width in metres of path.
    pub fn with_bin_width(self, width: impl Into<Option<f64>>) -> Given {
        Given { bin_width: width.into(), ..self }
    }

    /// With the bounces that count.
    pub fn with_bounce(self, bounce: impl Into<Option<Bounce>>) -> Given {
        Given { bounce: bounce.into(), ..self }
    }

    /// With the file that holds the times of flight to the wall.
    pub fn with_time_of_flight(self, file: impl Into<Option<PathBuf>>) -> Given {
        Given { time_of_flight: file.into(), ..self }
    }

    /// With a scan that is turned over.
    pub fn with_turn(self, turn: Turn) -> Given {
        Given { turn, ..self }
    }

    /// The wall's size, which the file does not say.
    ///
    /// # Errors
    /// `Kind::Options` if the user did not say it either, or no length.
    pub(super) fn wall(&self, format: &str) -> Result<f64> {
        let wall = self.wall.ok_or_else(|| {
            Error::options(
                format!("{format} does not say how wide the wall is"),
                "give --wall SIZE, the distance in metres between the outermost scan points",
            )
        })?;
        if wall.is_finite() && wall > 0.0 { Ok(wall) } else { Err(bad_length("--wall", wall)) }
    }

    /// The bin width in metres, which the file does not say and the format only by custom (`usual` picoseconds, if
    /// there is a custom); a note tells which was taken.
    ///
    /// # Errors
    /// `Kind::Options` if there is neither, or no length.
    pub(super) fn bin_width(&self, format: &str, usual: Option<f64>, notes: &mut Vec<String>) -> Result<f64> {
        match (self.bin_width, usual) {
            (Some(width), _) if width.is_finite() && width > 0.0 => Ok(width),
            (Some(width), _) => Err(bad_length("--bin-width", width)),
            (None, Some(ps)) => {
                notes.push(format!(
                    "{format} does not say how wide a bin is: {ps} ps are taken, as in its publication (--bin-width)"
                ));
                Ok(ps * crate::capture::METRES_PER_PICOSECOND)
            }
            (None, None) => Err(Error::options(
                format!("{format} does not say how wide a bin is"),
                "give --bin-width M, in metres of path (picoseconds times 0.000299792458)",
            )),
        }
    }
}

fn bad_length(option: &str, value: f64) -> Error {
    Error::options(format!("{option} is {value}"), "give a length in metres above zero")
}
