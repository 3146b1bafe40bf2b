//! What is to be solved.

use crate::capture::Capture;
use crate::maps::Maps;
use crate::transport::Grid;

/// A capture, the grid that it is solved on, and what the solve may take and is to give.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'c> {
    /// The capture. For plans and preparations its counts do not matter.
    pub capture: &'c Capture,
    /// The grid whose lateral cells are the maps' pixels.
    pub grid: Grid,
    /// The most bytes that each device may hold, if there is a budget.
    pub memory: Option<u64>,
    /// The volume is read back.
    pub with_volume: bool,
    /// What a surface begins with, if that is known; pairs are then held out of its fits.
    pub begin: Option<&'c Begun>,
}

/// A surface that earlier fits of the same capture found, on coarse pixels.
#[derive(Debug, Clone)]
pub struct Begun {
    /// Its layers.
    pub layers: Vec<Maps>,
    /// Those of the closed form.
    pub closed: Vec<Maps>,
    /// The length of the last steps, as a share of the longest ones.
    pub step: f64,
}

impl<'c> Problem<'c> {
    /// The maps of a capture alone, without a budget.
    pub fn new(capture: &'c Capture, grid: Grid) -> Problem<'c> {
        Problem { capture, grid, memory: None, with_volume: false, begin: None }
    }

    /// The same, and the volume.
    pub fn and_volume(self) -> Problem<'c> {
        Problem { with_volume: true, ..self }
    }
}
