//! The scan that a session is made for.

use std::mem::offset_of;

use engine::capture::{Capture, Pulse};
use engine::{Error, Result};
use glam::DVec3;

use crate::sized::Versioned;

/// Pairs of wall points and their histograms' bins. Zero everything, then set `size`; zero is the default of every field
/// that may be left out.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbScan {
    /// sizeof(tb_scan).
    pub size: usize,
    /// Points along x, and along y; 1 for a list of pairs. Pair ix * points_y + iy is at ix along +x and iy along +y.
    pub points_x: usize,
    pub points_y: usize,
    /// Laser points, metres: x, y, z of each pair. Copied.
    pub laser: *const f64,
    /// Sensor points, metres: x, y, z of each pair. NULL: the laser's. Copied.
    pub sensor: *const f64,
    /// Bins of a histogram.
    pub bins: usize,
    /// Width of a bin, metres of path: seconds times 299792458.
    pub bin_width: f64,
    /// Leading edge of bin 0, metres of path.
    pub t_start: f64,
    /// 1 if counts are photon counts: whole, and their variance is their mean.
    pub photon_counts: u32,
    /// Not used: 0.
    pub reserved: u32,
    /// Full width at half maximum of the instrument's pulse, metres of path; 0 if unknown.
    pub pulse_fwhm: f64,
    /// The same of the laser's and of the sensor's spot on the wall, metres; 0 for points.
    pub laser_spot: f64,
    pub sensor_spot: f64,
    /// The counts of a frame, bin b of pair p at [p * bins + b], copied. The box ends where their light does, and quick solves
    /// find the model and the pulse that nobody gave. NULL: the box ends where the bins do, and the model is cosine unless
    /// `options` of tb_settings says otherwise.
    pub counts: *const f32,
}

// SAFETY: it is `repr(C)` and begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbScan {
    const NAME: &'static str = "tb_scan";
    const FIRST: usize = offset_of!(TbScan, sensor_spot) + size_of::<f64>();
}

impl TbScan {
    /// The scan as a capture, with the counts that it has.
    ///
    /// # Safety
    /// The arrays are NULL or hold three numbers for every pair, `counts` a number for every bin of every pair.
    pub unsafe fn capture(&self) -> Result<Capture> {
        let pairs = self.points_x.checked_mul(self.points_y).filter(|n| *n > 0 && *n < 1 << 31);
        let Some(pairs) = pairs.filter(|_| !self.laser.is_null()) else {
            return Err(Error::options(
                format!("a scan of {} x {} points, or without laser points", self.points_x, self.points_y),
                "give `points_x`, `points_y` and `laser`",
            ));
        };
        // SAFETY: so many numbers are there, as the caller states.
        let laser = points(unsafe { std::slice::from_raw_parts(self.laser, 3 * pairs) });
        let sensor = match self.sensor.is_null() {
            true => laser.clone(),
            // SAFETY: as above.
            false => points(unsafe { std::slice::from_raw_parts(self.sensor, 3 * pairs) }),
        };
        let scan = [self.points_x, self.points_y];
        let count =
            pairs.checked_mul(self.bins).filter(|count| *count <= isize::MAX as usize / size_of::<f32>());
        let counts = match (self.counts.is_null(), count) {
            (true, _) => vec![],
            // SAFETY: as above.
            (false, Some(count)) => unsafe { std::slice::from_raw_parts(self.counts, count) }.to_vec(),
            (false, None) => {
                return Err(Error::options(
                    format!("counts of {pairs} pairs of {} bins do not fit any memory", self.bins),
                    "set `bins` to the bins of a histogram",
                ));
            }
        };
        let mut capture = Capture::new(scan, laser, sensor, self.bins, self.bin_width, counts);
        capture.t_start = self.t_start;
        capture.integer_counts = self.photon_counts != 0;
        capture.pulse = (self.pulse_fwhm != 0.0).then(|| Pulse::gaussian(self.pulse_fwhm)).transpose()?;
        let spot = |width: f64| (width != 0.0).then_some(width);
        (capture.laser_spot, capture.sensor_spot) = (spot(self.laser_spot), spot(self.sensor_spot));
        Ok(capture)
    }
}

fn points(numbers: &[f64]) -> Vec<DVec3> {
    numbers.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_beyond_all_memory_are_refused() {
        let (point, count) = ([0.0f64; 6], 1.0f32);
        // SAFETY: zero is valid for all fields.
        let mut scan: TbScan = unsafe { std::mem::zeroed() };
        (scan.points_x, scan.points_y, scan.bins) = (2, 1, usize::MAX / 2 + 2);
        (scan.laser, scan.counts) = (point.as_ptr(), &raw const count);
        // SAFETY: the laser has two points; the counts are refused before they are read.
        let error = unsafe { scan.capture() }.unwrap_err();
        assert!(error.what.contains("do not fit any memory"), "{error}");
    }
}
