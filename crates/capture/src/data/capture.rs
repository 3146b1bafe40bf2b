//! A capture: pairs, bins and counts.

use std::sync::Arc;

use glam::DVec3;

use super::pulse::Pulse;

/// Metres that light travels in a picosecond.
pub const METRES_PER_PICOSECOND: f64 = 299_792_458e-12;

/// Transient histograms of P pairs of wall points.
///
/// [`Capture::new`] takes what every capture has; the other fields are set afterwards. Nothing is checked before
/// [`Capture::check`].
#[derive(Clone, PartialEq)]
#[non_exhaustive]
pub struct Capture {
    /// A short name: the stem of the file, or the name of the scene.
    pub name: String,
    /// Scan shape (X, Y), X * Y = P. Pair `ix * Y + iy` is at ix along +x and iy along +y.
    pub scan: [usize; 2],
    /// Laser points, one per pair, in metres.
    pub laser: Vec<DVec3>,
    /// Sensor points, one per pair, in metres.
    pub sensor: Vec<DVec3>,
    /// Unit wall normals at the laser points, one per pair, if known.
    pub laser_normal: Option<Vec<DVec3>>,
    /// Unit wall normals at the sensor points, one per pair, if known.
    pub sensor_normal: Option<Vec<DVec3>>,
    /// Number of bins T.
    pub bins: usize,
    /// Bin width Δ in metres of path.
    pub bin_width: f64,
    /// Leading edge of bin 0 in metres of path.
    pub t_start: f64,
    /// Counts, `[pair * bins + bin]`, P * T of them. Negative ones are counts less a background.
    pub histograms: Vec<f32>,
    /// Counts of the same pairs and bins without the object, `[pair * bins + bin]`, if they were measured ([`Capture::set_empty`]).
    pub empty: Option<Vec<f32>>,
    /// Variance of a bin per count of its light, and variance of a bin without light in counts squared, where both are known; else
    /// they are estimated.
    pub noise: Option<[f64; 2]>,
    /// Whether all counts are whole numbers and none is negative: photon counts. They remain so when pile-up is taken out.
    pub integer_counts: bool,
    /// The instrument's pulse, if known.
    pub pulse: Option<Pulse>,
    /// Full width at half maximum of what the laser lights on the wall, a Gaussian, metres; `None` or 0: a point.
    pub laser_spot: Option<f64>,
    /// Full width at half maximum of what the sensor sees of the wall, a Gaussian, metres; `None` or 0: a point.
    pub sensor_spot: Option<f64>,
    /// Laser pulses of every pair, if known, and if the detector records only the first photon of each.
    pub cycles: Option<f64>,
    /// The path of direct light, laser to wall point to sensor, in every pair, metres, where bins hold it and it is known: 0 in
    /// a capture of time tags. [`crate::auto_gate`] leaves it out however weak it is.
    pub direct: Option<f64>,
    /// Laser and sensor points as they were given, where a correction moved them. Solvers hold out the same pairs with both.
    #[doc(hidden)]
    pub given: Option<Arc<[Vec<DVec3>; 2]>>,
    /// Positions of the laser and of the detector, metres, in the frame of the wall points, if known. Paths do not begin there; light may
    /// weaken on its way from there to the wall: [`super::GainLaw`].
    pub devices: [Option<DVec3>; 2],
}

/// A line without counts and points, of which there may be millions.
impl std::fmt::Debug for Capture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Capture")
            .field("name", &self.name)
            .field("scan", &self.scan)
            .field("pairs", &self.pair_count())
            .field("bins", &self.bins)
            .field("bin_width", &self.bin_width)
            .field("t_start", &self.t_start)
            .field("counts", &self.histograms.iter().map(|v| f64::from(*v)).sum::<f64>())
            .finish_non_exhaustive()
    }
}

impl Capture {
    /// A capture without name, normals, pulse and spots. Its bins begin at path 0, and its counts are real numbers.
    ///
    /// - `scan`: points along x and along y, [X, Y]; X * Y = P pairs. A list of pairs is [P, 1].
    /// - `laser`, `sensor`: wall points of pair `ix * Y + iy`, in metres; P of each.
    /// - `bins`: number of bins T of every histogram.
    /// - `bin_width`: metres of path, that is seconds times 299 792 458.
    /// - `histograms`: counts `[pair * bins + bin]`; P * T of them.
    pub fn new(
        scan: [usize; 2],
        laser: Vec<DVec3>,
        sensor: Vec<DVec3>,
        bins: usize,
        bin_width: f64,
        histograms: Vec<f32>,
    ) -> Capture {
        Capture {
            name: String::new(),
            scan,
            laser,
            sensor,
            laser_normal: None,
            sensor_normal: None,
            bins,
            bin_width,
            t_start: 0.0,
            histograms,
            empty: None,
            noise: None,
            integer_counts: false,
            pulse: None,
            laser_spot: None,
            sensor_spot: None,
            cycles: None,
            direct: None,
            given: None,
            devices: [None; 2],
        }
    }

    /// The capture after `change`.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Capture)) -> Capture {
        change(&mut self);
        self
    }

    /// The capture without its counts: points, bins and all the rest. Enough to choose pairs and to plan a solve.
    #[doc(hidden)]
    pub fn outline(&self) -> Capture {
        self.with_bins(self.bins, self.bin_width, self.t_start, vec![])
    }

    /// The same pairs with other bins; `histograms` holds `bins` counts for each pair. Without counts of the empty room.
    pub(crate) fn with_bins(
        &self,
        bins: usize,
        bin_width: f64,
        t_start: f64,
        histograms: Vec<f32>,
    ) -> Capture {
        Capture {
            bins,
            bin_width,
            t_start,
            histograms,
            empty: None,
            name: self.name.clone(),
            laser: self.laser.clone(),
            sensor: self.sensor.clone(),
            laser_normal: self.laser_normal.clone(),
            sensor_normal: self.sensor_normal.clone(),
            pulse: self.pulse.clone(),
            given: self.given.clone(),
            ..*self
        }
    }
}
