//! A capture: transient histograms of pairs of points on a relay wall.
//!
//! Metres and path length everywhere (c = 1). A pair is a laser point and a sensor point on the wall; its
//! histogram counts the inner path laser point → hidden point → sensor point. Bin b of width Δ collects
//! path lengths in [t0 + bΔ, t0 + (b+1)Δ). The wall is near z = 0, the hidden scene at z > 0, y is up.

pub mod calibrate;
pub mod check;
mod choose;
mod doubts;
pub mod formats;
pub mod gate;
mod lattice;
mod nearest;
mod normals;
pub mod pairs;
pub mod pulse;
pub mod scan;
mod sum;
pub mod summary;

pub use formats::{Bounce, Given, Opened, read, read_given, read_with_notes, write};
pub use gate::{AutoGate, Gate, auto_gate, published_gate};
pub use pairs::{PairKind, Product};
pub use pulse::{Pulse, PulseTaps, Way};
pub use summary::Summary;

use glam::DVec3;

/// Metres that light goes in a picosecond.
pub const METRES_PER_PICOSECOND: f64 = 299_792_458e-12;

/// Transient histograms of pairs of wall points, all arrays of one length `P` (pairs).
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// A short name for people: the file's stem or the scene's name.
    pub name: String,
    /// Scan shape (X, Y): pair `ix * Y + iy`; ix along +x, iy along +y. X * Y = P.
    pub scan: [usize; 2],
    /// Laser points, one per pair, in metres.
    pub laser: Vec<DVec3>,
    /// Sensor points, one per pair, in metres.
    pub sensor: Vec<DVec3>,
    /// Unit wall normals at the laser points, if known.
    pub laser_normal: Option<Vec<DVec3>>,
    /// Unit wall normals at the sensor points, if known.
    pub sensor_normal: Option<Vec<DVec3>>,
    /// Number of bins T.
    pub bins: usize,
    /// Bin width Δ in metres of path.
    pub bin_width: f64,
    /// Leading edge of bin 0 in metres of path.
    pub t_start: f64,
    /// Counts, `[pair * bins + bin]`.
    pub histograms: Vec<f32>,
    /// Whether the source held integers (photon counts).
    pub integer_counts: bool,
    /// How the instrument spreads a path of light over time, if known.
    pub pulse: Option<Pulse>,
}

impl Capture {
    /// The same pairs with other bins; `histograms` holds `bins` for each.
    fn with_bins(&self, bins: usize, bin_width: f64, t_start: f64, histograms: Vec<f32>) -> Capture {
        Capture {
            bins,
            bin_width,
            t_start,
            histograms,
            name: self.name.clone(),
            laser: self.laser.clone(),
            sensor: self.sensor.clone(),
            laser_normal: self.laser_normal.clone(),
            sensor_normal: self.sensor_normal.clone(),
            pulse: self.pulse.clone(),
            ..*self
        }
    }
}
