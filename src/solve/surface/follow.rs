//! Frames that follow each other: a frame begins with the surface of the frame before.

use std::time::Duration;

use super::SurfaceOptions;
use crate::{Error, Result};

/// How a frame follows the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    /// Iterations of a frame that begins warm; `None`: a fifth of those of a frame that begins cold.
    pub iterations: Option<usize>,
    /// A frame begins cold if the surface before loses more than this share of the light that it explained.
    pub cut_above: f64,
    /// The time that a frame may take. Every frame ends with a whole picture.
    pub budget: Option<Duration>,
}

impl Default for Follow {
    fn default() -> Follow {
        Follow { iterations: None, cut_above: 0.5, budget: None }
    }
}
