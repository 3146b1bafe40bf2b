//! A blob: a small object as a position, an amount of light and an extent.

use glam::DVec3;

use crate::constants::{KNOWN, ROUNDNESS};

/// Numbers of a blob: x, y, z, the logarithms of light and extent, roundness.
pub const NUMBERS: usize = 6;

/// An object of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Its centre, metres.
    pub at: DVec3,
    /// Logarithm of the counts that a pair at a distance of one unit of length ([`thirdbounce_capture::Capture::unit`]) gets.
    pub light: f64,
    /// Logarithm of its radius in metres.
    pub extent: f64,
    /// How far the light comes from in front of the centre: 0, the centre itself; 1, the side of a ball that faces the wall.
    pub roundness: f64,
}

impl Blob {
    /// The blob after a step of its numbers.
    pub(crate) fn stepped(&self, step: &[f64]) -> Blob {
        Blob {
            at: self.at + DVec3::from_slice(step),
            light: self.light + step[3],
            extent: self.extent + step[4],
            roundness: self.roundness + step[5],
        }
    }
}

/// What is known of the shape of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BlobShape {
    /// Nothing: the error includes both others.
    #[default]
    Any,
    /// Round: the centre is behind the light.
    Ball,
    /// Flat: the centre is where the light comes from.
    Flat,
    /// Upright on the scanned surface, such as a floor: light comes from all heights up to twice that of the centre.
    Upright,
}

impl BlobShape {
    /// Mean and standard deviation of the roundness.
    pub(crate) fn roundness(self) -> [f64; 2] {
        match self {
            BlobShape::Any => ROUNDNESS,
            BlobShape::Ball => [1.0, KNOWN],
            BlobShape::Flat | BlobShape::Upright => [0.0, KNOWN],
        }
    }
}
