//! The bins and the grid of a job: as fine as the capture can tell, and no finer.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use super::{Request, SolverOptions};
use crate::capture::Capture;
use crate::transport::Grid;
use crate::{Error, Result};

/// How many of the capture's bins are one for the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bins {
    /// As many as neither the maps' pixels nor the instrument's pulse tell apart. The paper's solver takes the
    /// capture's own bins.
    #[default]
    Auto,
    /// One: the capture's own bins, and voxels as deep as they are wide.
    Native,
    /// This many.
    Sum(usize),
}

/// A bin is this share of what blurs it, whichever is more: the width of a pixel, or the standard deviation of the
/// pulse. Over a pixel, paths differ by about its width. Timing loses less than a hundredth of its precision to such a
/// bin: its variance is a 48th of what blurs it (benches/NOTES.md).
const OF_BLUR: f64 = 0.5;

/// A voxel is at least this share of its width deep. Flatter voxels cost time, and the surface after the volume finds
/// depths between them.
const OF_WIDTH: f64 = 0.5;

/// A capture in the bins that the solver takes, with the grid for it.
pub(super) struct Ready<'c> {
    /// The capture, summed.
    pub capture: Cow<'c, Capture>,
    /// The grid.
    pub grid: Grid,
    /// How many bins were summed.
    pub sum: usize,
}

impl Request {
    /// Sums the bins of a capture, whose pulse is known if it ever will be, and makes the grid for it.
    ///
    /// # Errors
    /// As [`Request::grid`], and a number of bins to sum that the capture does not have.
    pub(super) fn ready<'c>(&self, capture: Cow<'c, Capture>) -> Result<Ready<'c>> {
        let sum = match self.bins {
            Bins::Native => 1,
            Bins::Sum(n) => n,
            Bins::Auto => self.bins_to_sum(&capture)?,
        };
        let capture = if sum == 1 { capture } else { Cow::Owned(capture.binned(sum)?) };
        Ok(Ready { grid: self.grid(&capture)?, capture, sum })
    }

    /// How many bins the maps' pixels and the pulse do not tell apart.
    fn bins_to_sum(&self, capture: &Capture) -> Result<usize> {
        if self.is_of_paper() {
            return Ok(1);
        }
        let pulse = capture.pulse.as_ref().map_or(0.0, |p| p.moments()[1]);
        let blur = self.pixel(capture)?.max(pulse);
        Ok(((OF_BLUR * blur / capture.bin_width + 1e-6) as usize).clamp(1, capture.bins))
    }

    /// The depth of a voxel where none is given: a bin of path, or a share of the voxel's width if that is more. The
    /// paper's solver and native bins take the bin.
    pub(super) fn usual_depth_pitch(&self, capture: &Capture) -> Result<f64> {
        let wide = match &self.solver {
            SolverOptions::Vector(o) if self.bins != Bins::Native => {
                o.pixels_per_voxel() as f64 * self.pixel(capture)?
            }
            _ => 0.0,
        };
        Ok(capture.bin_width.max(OF_WIDTH * wide))
    }

    fn is_of_paper(&self) -> bool {
        matches!(self.solver, SolverOptions::Paper(_))
    }

    /// Width of a pixel of the maps, metres; of pixels that are not square, the shorter side.
    fn pixel(&self, capture: &Capture) -> Result<f64> {
        let size = self.volume_of(capture)?;
        let size = size.max - size.min;
        Ok(size.x.min(size.y) / self.solver.common().lateral as f64)
    }
}

impl fmt::Display for Bins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bins::Auto => f.write_str("auto"),
            Bins::Native => f.write_str("native"),
            Bins::Sum(n) => write!(f, "{n}"),
        }
    }
}

impl FromStr for Bins {
    type Err = Error;

    fn from_str(text: &str) -> Result<Bins> {
        match (text.trim(), text.trim().parse()) {
            ("auto", _) => Ok(Bins::Auto),
            ("native", _) => Ok(Bins::Native),
            (_, Ok(n)) if n > 0 => Ok(Bins::Sum(n)),
            _ => Err(Error::options(
                format!("the bins are {text:?}"),
                "give auto, native, or how many neighbouring bins are one",
            )),
        }
    }
}

impl Serialize for Bins {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_read_as_they_are_written() {
        for bins in [Bins::Auto, Bins::Native, Bins::Sum(4)] {
            assert_eq!(bins.to_string().parse::<Bins>().unwrap(), bins);
        }
        for wrong in ["", "0", "-1", "1.5", "all"] {
            assert!(wrong.parse::<Bins>().is_err(), "{wrong:?}");
        }
    }
}
