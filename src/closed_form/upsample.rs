//! A finer scan for closed-form methods: empty points between the measured ones, or histograms interpolated between them.

use std::borrow::Cow;

use glam::DVec3;
use rayon::prelude::*;

use super::options::{Between, ImageOptions};
use super::resample::{add, cubic};
use super::scan::RegularScan;
use crate::capture::Capture;
use crate::{Error, Result};

impl RegularScan {
    /// The scan with `factor` - 1 points between neighbours along x and y.
    pub fn finer(&self, factor: usize) -> RegularScan {
        if factor == 1 {
            return self.clone();
        }
        let n = self.n.map(|n| (n - 1) * factor + 1);
        RegularScan {
            n,
            step: self.step.map(|step| step / factor as f64),
            measured: self.measured,
            pair_of: (0..n[0] * n[1]).collect(),
            gaps: vec![],
            ..*self
        }
    }
}

/// The capture on the finer scan that `image` asks for. Of a capture without counts, the pairs alone. `scan`: that of the
/// capture, with the places without a pair added.
pub fn finer<'c>(capture: &'c Capture, scan: &RegularScan, image: &ImageOptions) -> Cow<'c, Capture> {
    if image.upsample == 1 {
        return Cow::Borrowed(capture);
    }
    let fine = scan.finer(image.upsample);
    let points = fine.places();
    let histograms = match capture.histograms.is_empty() {
        true => vec![],
        false => match image.upsample_by {
            Between::Zero => with_gaps(capture, scan, &fine, image.upsample),
            Between::Bicubic => interpolated(capture, scan, &fine, image.upsample),
        },
    };
    // The one point of the other side stays; it may be that of the laser or of the sensor.
    let side = |all: &[DVec3]| match scan.spot {
        Some(spot) if all.first() == all.last() && all.first() == Some(&spot) => vec![spot; points.len()],
        _ => points.clone(),
    };
    Cow::Owned(capture.outline().with(|c| {
        c.scan = fine.n;
        (c.laser, c.sensor) = (side(&capture.laser), side(&capture.sensor));
        (c.laser_normal, c.sensor_normal) = (None, None);
        (c.histograms, c.integer_counts) = (histograms, false);
    }))
}

fn with_gaps(capture: &Capture, scan: &RegularScan, fine: &RegularScan, factor: usize) -> Vec<f32> {
    let mut all = vec![0.0; fine.points() * capture.bins];
    all.par_chunks_mut(capture.bins).enumerate().for_each(|(i, to)| {
        let [x, y] = [i / fine.n[1], i % fine.n[1]];
        if x.is_multiple_of(factor) && y.is_multiple_of(factor) {
            let pair = scan.pair_of[x / factor * scan.n[1] + y / factor];
            to.copy_from_slice(capture.histogram(pair));
        }
    });
    all
}

fn interpolated(capture: &Capture, scan: &RegularScan, fine: &RegularScan, factor: usize) -> Vec<f32> {
    let mut all = vec![0.0; fine.points() * capture.bins];
    all.par_chunks_mut(capture.bins).enumerate().for_each(|(i, to)| {
        let at = [i / fine.n[1], i % fine.n[1]].map(|place| place as f64 / factor as f64);
        let weights = [0, 1].map(|axis| cubic(at[axis], scan.n[axis], 0.5).unwrap_or_default());
        for (x, of_x) in weights[0] {
            for (y, of_y) in weights[1] {
                add(to, capture.histogram(scan.pair_of[x * scan.n[1] + y]), of_x * of_y);
            }
        }
    });
    all
}

/// Refuses a finer scan by empty points for a method that sums pairs.
///
/// # Errors
/// `Kind::Options`.
pub fn check_sum(image: &ImageOptions, method: &str) -> Result<()> {
    if image.upsample > 1 && image.upsample_by == Between::Zero {
        return Err(Error::options(
            format!(
                "a scan with empty points is asked for, and {method} sums pairs: empty ones change nothing"
            ),
            "interpolate between the points (upsample-by bicubic), or choose lct, fk or phasor",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::reference::random_capture;
    use super::*;

    fn fine(by: Between, factor: usize, spot: Option<DVec3>) -> (Capture, RegularScan, Capture) {
        let capture = random_capture(spot);
        let scan = RegularScan::with_one_spot(&capture, "it").unwrap();
        let mut image = ImageOptions::default();
        (image.upsample, image.upsample_by) = (factor, by);
        let fine = finer(&capture, &scan, &image).into_owned();
        fine.check().unwrap();
        (capture, scan, fine)
    }

    #[test]
    fn measured_points_stay_and_others_are_between() {
        for by in [Between::Zero, Between::Bicubic] {
            for factor in [2, 3] {
                let (capture, scan, fine) = fine(by, factor, None);
                assert_eq!(fine.scan, [3 * factor + 1, 2 * factor + 1]);
                for (i, point) in fine.sensor.iter().enumerate() {
                    let [x, y] = [i / fine.scan[1], i % fine.scan[1]];
                    assert_eq!(fine.laser[i], *point);
                    if x % factor == 0 && y % factor == 0 {
                        let pair = scan.pair_of[x / factor * scan.n[1] + y / factor];
                        assert!((*point - capture.sensor[pair]).length() < 1e-12);
                        let same = fine.histogram(i).iter().zip(capture.histogram(pair));
                        assert!(same.into_iter().all(|(a, b)| (a - b).abs() < 1e-5));
                    } else if by == Between::Zero {
                        assert!(fine.histogram(i).iter().all(|v| *v == 0.0));
                    } else {
                        assert!(fine.histogram(i).iter().any(|v| *v != 0.0));
                    }
                }
                // It is the regular scan that was asked for.
                let again = RegularScan::with_one_spot(&fine, "it").unwrap();
                assert!((again.step[0] * factor as f64 - scan.step[0]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn the_one_point_of_the_laser_stays() {
        let spot = DVec3::new(0.03, 0.2, 0.05);
        let (_, _, fine) = fine(Between::Bicubic, 2, Some(spot));
        assert!(fine.laser.iter().all(|p| *p == spot) && fine.sensor.iter().all(|p| *p != spot));
    }
}
