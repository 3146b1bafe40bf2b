//! Scan of a session.

use std::borrow::Cow;
use std::mem::offset_of;

use engine::capture::{Capture, Pulse};
use engine::{Error, Result};
use glam::DVec3;

use crate::error::{TbStatus, free_handle, guarded, no_handle};
use crate::sized::{self, Versioned};

/// A capture that was read from a file.
pub struct TbCapture(pub Capture);

/// Laser-sensor pairs and histogram layout. Zero-initialise, then set `size`; zero is the default of every optional
/// field.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct TbScan {
    /// sizeof(tb_scan).
    pub size: usize,
    /// Points along x and y; 1 for a list of pairs. Pair ix * points_y + iy is at ix along +x and iy along +y.
    pub points_x: usize,
    pub points_y: usize,
    /// Laser points in metres, x, y, z per pair. Copied.
    pub laser_xyz: *const f64,
    /// Sensor points in metres, x, y, z per pair; NULL: the laser points (confocal). Copied.
    pub sensor_xyz: *const f64,
    /// Bins per histogram.
    pub bins: usize,
    /// Bin width, metres of path (seconds times 299792458).
    pub bin_width: f64,
    /// Leading edge of bin 0, metres of path.
    pub t_start: f64,
    /// 1 if counts are photon counts (integers with a variance equal to their mean).
    pub photon_counts: u32,
    /// Reserved: 0.
    pub reserved: u32,
    /// Full width at half maximum of the impulse response, metres of path; 0 if unknown.
    pub pulse_fwhm: f64,
    /// Full width at half maximum of the laser and sensor spots on the wall, metres; 0 for points.
    pub laser_spot_fwhm: f64,
    pub sensor_spot_fwhm: f64,
    /// Counts of one frame, bin b of pair p at [p * bins + b], copied: the volume then ends at their deepest signal,
    /// and unspecified reflectance model and impulse response are estimated. NULL: the volume ends with the bins, and
    /// the model is cosine unless set in `options` of tb_settings.
    pub counts: *const f32,
    /// A capture of `tb_read` in place of all fields above; NULL: none. `tb_capture_scan` sets it.
    pub capture: *const TbCapture,
    /// Counts of the same scan without the object, as `counts`, copied: their light is subtracted from every frame, with a gain of its own,
    /// where held-out pairs of `counts` prove it. NULL: none. Needs `counts`.
    pub empty: *const f32,
}

// SAFETY: `repr(C)`, begins with its size; zero is valid for all fields.
unsafe impl Versioned for TbScan {
    const NAME: &'static str = "tb_scan";
    const FIRST: usize = offset_of!(TbScan, sensor_spot_fwhm) + size_of::<f64>();
}

impl TbScan {
    /// The scan of a capture.
    pub fn of(from: &TbCapture) -> TbScan {
        let capture = &from.0;
        TbScan {
            size: size_of::<TbScan>(),
            points_x: capture.scan[0],
            points_y: capture.scan[1],
            laser_xyz: capture.laser.as_ptr().cast(),
            sensor_xyz: capture.sensor.as_ptr().cast(),
            bins: capture.bins,
            bin_width: capture.bin_width,
            t_start: capture.t_start,
            photon_counts: capture.integer_counts.into(),
            reserved: 0,
            pulse_fwhm: 0.0,
            laser_spot_fwhm: capture.laser_spot.unwrap_or(0.0),
            sensor_spot_fwhm: capture.sensor_spot.unwrap_or(0.0),
            counts: capture.histograms.as_ptr(),
            capture: from,
            empty: capture.empty.as_ref().map_or(std::ptr::null(), |empty| empty.as_ptr()),
        }
    }

    /// The scan as a capture, with its counts.
    ///
    /// # Safety
    /// `capture` is NULL or valid. The arrays are NULL or have three values per pair, `counts` and `empty` one value per bin and pair.
    pub unsafe fn capture<'c>(&self) -> Result<Cow<'c, Capture>> {
        // SAFETY: guaranteed by the caller.
        match unsafe { self.capture.as_ref() } {
            Some(read) => Ok(Cow::Borrowed(&read.0)),
            // SAFETY: guaranteed by the caller.
            None => unsafe { self.of_arrays() }.map(Cow::Owned),
        }
    }

    /// # Safety
    /// As [`TbScan::capture`].
    unsafe fn of_arrays(&self) -> Result<Capture> {
        if self.laser_xyz.is_null() {
            let sensor =
                if self.sensor_xyz.is_null() { ", and so is `sensor_xyz`" } else { "; `sensor_xyz` is set" };
            return Err(Error::options(
                format!("`laser_xyz` of tb_scan is NULL{sensor}"),
                "give the laser points; `sensor_xyz` alone may be NULL, for a confocal scan",
            ));
        }
        let pairs = self.points_x.checked_mul(self.points_y).filter(|n| *n > 0 && *n < 1 << 31);
        let pairs = pairs.ok_or_else(|| {
            let what = format!("a scan of {} x {} points", self.points_x, self.points_y);
            Error::options(what, "give `points_x` and `points_y`; `points_y` is 1 for a list of pairs")
        })?;
        // SAFETY: the array has this length, as the caller guarantees.
        let laser = points(unsafe { std::slice::from_raw_parts(self.laser_xyz, 3 * pairs) });
        let sensor = match self.sensor_xyz.is_null() {
            true => laser.clone(),
            // SAFETY: as above.
            false => points(unsafe { std::slice::from_raw_parts(self.sensor_xyz, 3 * pairs) }),
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
        (capture.laser_spot, capture.sensor_spot) = (spot(self.laser_spot_fwhm), spot(self.sensor_spot_fwhm));
        if let (false, Some(count)) = (self.empty.is_null(), count) {
            let mut room = capture.outline();
            // SAFETY: as above.
            room.histograms = unsafe { std::slice::from_raw_parts(self.empty, count) }.to_vec();
            capture.set_empty(&room)?;
        }
        Ok(capture)
    }
}

/// Writes the scan of a capture with its counts to `scan`, with the lifetime of `capture`. A session of it also has the
/// capture's impulse response and wall normals.
///
/// # Safety
/// `capture` is valid. `scan` begins with its size and is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_capture_scan(capture: *const TbCapture, scan: *mut TbScan) -> TbStatus {
    guarded(|| {
        // SAFETY: the caller provides a valid capture, or NULL.
        let capture = unsafe { capture.as_ref() }.ok_or_else(|| no_handle("capture"))?;
        // SAFETY: the caller provides a struct that begins with its size.
        unsafe { sized::write(scan, &TbScan::of(capture)) }
    })
}

/// Frees a capture; NULL is ignored. Sessions do not need it after `tb_session_new`. Any thread, once.
///
/// # Safety
/// `capture` is valid and not used concurrently or afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tb_capture_free(capture: *mut TbCapture) {
    // SAFETY: created by `tb_read` and freed once.
    unsafe { free_handle(capture) };
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
        (scan.laser_xyz, scan.counts) = (point.as_ptr(), &raw const count);
        // SAFETY: the laser array has two points; the counts are refused before they are read.
        let error = unsafe { scan.capture() }.unwrap_err();
        assert!(error.what.contains("do not fit any memory"), "{error}");
        scan.laser_xyz = std::ptr::null();
        for (sensor, words) in
            [(std::ptr::null(), "and so is `sensor_xyz`"), (point.as_ptr(), "`sensor_xyz` is set")]
        {
            scan.sensor_xyz = sensor;
            // SAFETY: the points are refused before they are read.
            let error = unsafe { scan.capture() }.unwrap_err();
            assert!(
                error.what.starts_with("`laser_xyz` of tb_scan is NULL") && error.what.contains(words),
                "{error}"
            );
        }
    }
}
