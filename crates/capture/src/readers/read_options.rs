//! Values that a capture file may not hold: the user gives them. If a usual value is taken instead, a note says so.

use std::path::PathBuf;

use crate::advice::advice;
use crate::conditioning::Conditioning;
use crate::error::{Error, Result};
use crate::{AxisOrder, Bounce, Turn};

/// Values that the user gives because the file does not hold them; none by default.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Distance in metres of the outermost scan points along the longer side.
    pub wall: Option<f64>,
    /// Bin width in metres of path.
    pub bin_width: Option<f64>,
    /// Metres of a step of the wall's depth, for CC-SOCR captures of walls that are not flat.
    pub depth_unit: Option<f64>,
    /// Bounces to use, for formats that keep them apart; the third by default.
    pub bounce: Option<Bounce>,
    /// The file with the times of flight to the wall, for formats that keep them in a second file.
    pub time_of_flight: Option<PathBuf>,
    /// How to mirror and rotate the scan, for files that do not say how it lies on the wall.
    pub turn: Turn,
    /// Whether pairs without any count are kept, although their neighbours have many.
    pub keep_empty: bool,
    /// Metres that waves travel in a second, for files whose bins are seconds.
    pub speed: Option<f64>,
    /// The axes of a file with a single array of counts; by default found by where the light is.
    pub axes: Option<AxisOrder>,
    /// The array of counts among several of three axes, for files in no known format.
    pub array: Option<String>,
}

impl ReadOptions {
    /// With the wall's size in metres, between the outermost scan points along the longer side.
    pub fn with_wall(self, size: impl Into<Option<f64>>) -> ReadOptions {
        ReadOptions { wall: size.into(), ..self }
    }

    /// With the bin width in metres of path.
    pub fn with_bin_width(self, width: impl Into<Option<f64>>) -> ReadOptions {
        ReadOptions { bin_width: width.into(), ..self }
    }

    /// With the metres of a step of the wall's depth.
    pub fn with_depth_unit(self, unit: impl Into<Option<f64>>) -> ReadOptions {
        ReadOptions { depth_unit: unit.into(), ..self }
    }

    /// With the bounces to use.
    pub fn with_bounce(self, bounce: impl Into<Option<Bounce>>) -> ReadOptions {
        ReadOptions { bounce: bounce.into(), ..self }
    }

    /// With the file that holds the times of flight to the wall.
    pub fn with_time_of_flight(self, file: impl Into<Option<PathBuf>>) -> ReadOptions {
        ReadOptions { time_of_flight: file.into(), ..self }
    }

    /// With a scan that is mirrored or rotated.
    pub fn with_turn(self, turn: Turn) -> ReadOptions {
        ReadOptions { turn, ..self }
    }

    /// With pairs that have no count at all, as dark ones.
    pub fn with_keep_empty(self, keep_empty: bool) -> ReadOptions {
        ReadOptions { keep_empty, ..self }
    }

    /// With the speed of waves in metres per second: bin widths of the file are seconds.
    pub fn with_speed(self, speed: impl Into<Option<f64>>) -> ReadOptions {
        ReadOptions { speed: speed.into(), ..self }
    }

    /// With the axes of a file with a single array of counts.
    pub fn with_axes(self, axes: impl Into<Option<AxisOrder>>) -> ReadOptions {
        ReadOptions { axes: axes.into(), ..self }
    }

    /// With the name of the array of counts.
    pub fn with_array(self, name: impl Into<Option<String>>) -> ReadOptions {
        ReadOptions { array: name.into(), ..self }
    }

    /// The steps that follow from these values.
    pub(super) fn conditioning(&self) -> Conditioning {
        Conditioning {
            turn: self.turn,
            keep_empty: self.keep_empty,
            speed: self.speed,
            ..Conditioning::default()
        }
    }

    /// The wall's size, which the file does not hold.
    ///
    /// # Errors
    /// `Kind::Options` if the user did not give it either, or if it is not a positive length.
    pub(super) fn wall(&self, format: &str) -> Result<f64> {
        let wall = self.wall.ok_or_else(|| {
            Error::options(
                format!("{format} does not hold the wall size"),
                advice!["give it, the distance in metres between the outermost scan points: " Wall " 1m"],
            )
        })?;
        if wall.is_finite() && wall > 0.0 { Ok(wall) } else { Err(bad_length("the wall size", wall)) }
    }

    /// The wall size and the bin width, neither of which the file holds.
    ///
    /// # Errors
    /// `Kind::Options`, asking for all that is missing at once.
    pub(super) fn wall_and_bin_width(&self, format: &str) -> Result<(f64, f64)> {
        if self.wall.is_none() && self.bin_width.is_none() {
            return Err(Error::options(
                format!("{format} holds neither the wall size nor the bin width"),
                advice![
                    "give the distance between the outermost scan points and the width of a bin, as a time or a path: " Wall
                    " 1m " BinWidth " 32ps"
                ],
            ));
        }
        Ok((self.wall(format)?, self.bin_width(format, None, &mut vec![])?))
    }

    /// The bin width in metres, which the file does not hold. If the user does not give it, the `usual` one of the
    /// format's publication is taken, in picoseconds, and a note says so.
    ///
    /// # Errors
    /// `Kind::Options` if there is neither, or if the given one is not a positive length.
    pub(super) fn bin_width(&self, format: &str, usual: Option<f64>, notes: &mut Vec<String>) -> Result<f64> {
        match (self.bin_width, usual) {
            (Some(width), _) if (f64::MIN_POSITIVE..SHORTEST).contains(&width) => Err(Error::options(
                format!("the bin width is {width:e} m of path"),
                advice!["if these are seconds, write the unit: " BinWidth " " (format!("{}ps", 1e12 * width))],
            )),
            (Some(width), _) if (LONGEST..f64::MAX).contains(&width) => Err(Error::options(
                format!("the bin width is {width} m of path"),
                advice!["if these are picoseconds, write the unit: " BinWidth " " (format!("{width}ps"))],
            )),
            (Some(width), _) if width.is_finite() && width > 0.0 => Ok(width),
            (Some(width), _) => Err(bad_length("the bin width", width)),
            (None, Some(ps)) => {
                notes.push(format!(
                    "{format} does not hold the bin width: {ps} ps is taken, as in its publication"
                ));
                Ok(ps * crate::METRES_PER_PICOSECOND)
            }
            (None, None) => Err(Error::options(
                format!("{format} does not hold the bin width"),
                advice![
                    "give the bin width, as a time or in metres of path (picoseconds times 0.000299792458): " BinWidth " 32ps"
                ],
            )),
        }
    }

    /// Refuses axes where the format has its own.
    ///
    /// # Errors
    /// `Kind::Options` if the user gave any.
    pub(super) fn no_axes(&self, format: &str) -> Result<()> {
        match self.axes {
            None => Ok(()),
            Some(_) => Err(Error::options(
                format!("axes were given, but {format} has its own order"),
                advice!["leave " Axes " out: it is for a file with a single array of counts"],
            )),
        }
    }

    /// Refuses a bin width where the format holds its own.
    ///
    /// # Errors
    /// `Kind::Options` if the user gave one.
    pub(super) fn no_bin_width(&self, format: &str) -> Result<()> {
        match self.bin_width {
            None => Ok(()),
            Some(_) => Err(Error::options(
                format!("a bin width was given, but {format} holds its own bin width"),
                "leave the bin width out",
            )),
        }
    }
}

/// No bin is shorter, metres: a thousandth of a wavelength of light.
const SHORTEST: f64 = 1e-9;
/// No bin is as long, metres: scenes are about a metre from their wall.
const LONGEST: f64 = 1.0;

fn bad_length(option: &str, value: f64) -> Error {
    Error::options(format!("{option} is {value}"), "give a length in metres above zero")
}
