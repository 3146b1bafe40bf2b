//! How finely a capture is solved: how many of its bins are one, and the box and the depth of voxels.

use std::borrow::Cow;

use super::{Bins, SolverOptions, default_volume};
use crate::capture::Capture;
use crate::transport::{Grid, Volume};
use crate::{Error, Result};

/// How finely a capture is solved. The default is the solver's usual one.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Discretisation {
    /// How many of the capture's bins are one for the solver.
    pub bins: Bins,
    /// Voxel size along z in metres; `None`: [`SolverOptions::usual_depth_pitch`], and a bin where native bins are asked for.
    pub depth_pitch: Option<f64>,
    /// The box to reconstruct; `None`: [`default_volume`].
    pub volume: Option<Volume>,
}

/// A capture in the bins that the solver takes, with the grid for it.
pub struct Ready<'c> {
    /// The capture, summed.
    pub capture: Cow<'c, Capture>,
    /// The grid.
    pub grid: Grid,
    /// How many bins were summed.
    pub sum: usize,
}

impl Discretisation {
    /// Sums the bins of a capture, whose pulse is known if it ever will be, and makes the grid for it.
    ///
    /// # Errors
    /// As [`Discretisation::grid`], and a number of bins to sum that the capture does not have.
    pub fn ready<'c>(&self, solver: &SolverOptions, capture: Cow<'c, Capture>) -> Result<Ready<'c>> {
        let (capture, sum) = self.summed(solver, capture)?;
        Ok(Ready { grid: self.grid(solver, &capture)?, capture, sum })
    }

    /// Sums the bins of a capture, and says how many are one.
    ///
    /// # Errors
    /// More than the capture has.
    pub fn summed<'c>(
        &self,
        solver: &SolverOptions,
        capture: Cow<'c, Capture>,
    ) -> Result<(Cow<'c, Capture>, usize)> {
        let sum = self.sum(solver, &capture);
        Ok((if sum == 1 { capture } else { Cow::Owned(capture.binned(sum)?) }, sum))
    }

    /// How many bins of a capture are one for the solver. The counts do not matter.
    pub fn sum(&self, solver: &SolverOptions, capture: &Capture) -> usize {
        match self.bins {
            Bins::Native => 1,
            Bins::Sum(n) => n,
            Bins::Auto => solver.usual_sum(capture, self.volume),
        }
    }

    /// The grid for a capture whose bins are those of the solver.
    ///
    /// # Errors
    /// A scan without aperture, a box without voxels, a box nearer than the least depth, or more voxels than can be counted.
    pub fn grid(&self, solver: &SolverOptions, capture: &Capture) -> Result<Grid> {
        capture.check_aperture()?;
        let least = solver.common().min_depth;
        let volume = self.volume.map_or_else(|| default_volume(capture, least), Ok)?;
        let usual = || match self.bins {
            Bins::Native => capture.bin_width,
            _ => solver.usual_depth_pitch(capture, self.volume),
        };
        let pitch = self.depth_pitch.unwrap_or_else(usual);
        let grid = Grid::new(volume, solver.common().lateral, pitch)?;
        if volume.max.z <= least {
            return Err(Error::options(
                format!("the volume ends at a depth of {} m", volume.max.z),
                format!(
                    "give a deeper volume: nothing nearer than the least depth, {least} m, is reconstructed"
                ),
            ));
        }
        if grid.origin.z > volume.max.z {
            return Err(Error::options(
                format!("no voxel of {pitch} m depth fits from {:.4} to {:.4} m", volume.min.z, volume.max.z),
                "give a smaller depth pitch or a deeper volume",
            ));
        }
        Ok(grid)
    }
}
