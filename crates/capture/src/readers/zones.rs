//! Low-cost sensors with zones, such as ST's VL53L8CH and AMS's TMF8828: one laser, 4 x 4 to 8 x 8 zones with a field of view
//! each, and bins of centimetres. What the model needs for them is the spot of a zone on the wall (docs/options.md).
//!
//! The npz files of *Imaging Hidden Objects with Consumer LiDAR* hold `hists` (zones, t) and `pt_cloud` (zones, 3), the wall point
//! of each zone in metres; other arrays are not read. Path 0 is at the wall, and direct light is cropped (`data/dataloader.py`).
//! Bins of 250 ps are not in the file but in its code's settings (`t_res`). Every zone is taken as confocal, as its light-cone
//! transform does. The zones of one reading tile the field of view, so that a zone is as wide as their distance.
//!
//! Axes: the coordinates in the file are kept. Nothing in a file says whether they are right-handed.

use glam::DVec3;

use super::points::triples;
use super::read_options::ReadOptions;
use super::{counts, frame};
use crate::Capture;
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::archive::Npz;

const PICOSECONDS: f64 = 250.0;
/// Full width at half maximum of a Gaussian with the variance of a square of side 1: 2 √(2 ln 2) / √12.
const OF_SQUARE: f64 = 0.679_783_1;
/// A field of view is below a half circle, degrees.
const WIDEST: f64 = 179.0;

/// Whether the archive is a reading of such a sensor.
pub(super) fn is_one(npz: &Npz) -> bool {
    let names = npz.names();
    let has = |name: &str| names.iter().any(|n| n == name);
    !has("H") && has("hists") && has("pt_cloud")
}

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for arrays that do not agree.
pub(super) fn read(npz: &mut Npz, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    const WANTED: &str = "hists (zones, t) and pt_cloud (zones, 3)";
    let (hists, cloud) = (counts::shape(npz, "hists", WANTED)?, npz.require("pt_cloud", WANTED)?);
    let points = triples("pt_cloud", &cloud.shape, &cloud.to_f64())?;
    let (zones, bins) = match hists[..] {
        [zones, bins] => (zones, bins),
        [rows, columns, bins] => (rows.saturating_mul(columns), bins),
        _ => (0, 0),
    };
    if zones != points.len() {
        return Err(Error::input(
            format!("hists has shape {hists:?} and pt_cloud {:?}, which do not agree", cloud.shape),
            "hists is (zones, t) and pt_cloud (zones, 3), of the same zones",
        ));
    }
    let bin_width = given.bin_width("a reading of zones (hists, pt_cloud)", Some(PICOSECONDS), notes)?;
    if given.bin_width.is_none() {
        notes.push("bins of other sensors have other widths, such as about 91 ps of a TMF8820 or TMF8828: give the bin width".into());
    }
    let spot = side(&points).map(|side| OF_SQUARE * side);
    notes.push("every zone is taken as confocal, as in the code of its publication".into());
    if let Some(spot) = spot {
        notes.push(format!(
            "zones are as wide as they are apart on the wall: laser and sensor have spots of {spot:.3} m"
        ));
    }
    let histograms = counts::read(npz, "hists", WANTED)?;
    let capture = Capture {
        integer_counts: histogram_figures::whole(&histograms),
        laser_spot: spot,
        sensor_spot: spot,
        ..Capture::new([zones, 1], points.clone(), points, bins, bin_width, histograms)
    };
    Ok(frame::facing_z(capture, None, notes))
}

/// The mean distance of neighbouring zones of a square of them, metres.
fn side(points: &[DVec3]) -> Option<f64> {
    let n = points.len().isqrt();
    if n < 2 || n * n != points.len() {
        return None;
    }
    let along = (0..n * n).filter(|p| p % n + 1 < n).map(|p| points[p].distance(points[p + 1]));
    let across = (0..n * (n - 1)).map(|p| points[p].distance(points[p + n]));
    let mean = along.chain(across).sum::<f64>() / (2 * n * (n - 1)) as f64;
    (mean.is_finite() && mean > 0.0).then_some(mean)
}

/// The spot of a square field of view, given in degrees across, from a device on these points of the wall: full width at half
/// maximum, metres. One width stands for all points: that at their mean distance.
///
/// # Errors
/// `Kind::Input` for an angle or a place that is none.
pub(super) fn spot_of(name: &str, degrees: f64, device: DVec3, points: &[DVec3]) -> Result<f64> {
    let known = points.iter().filter(|p| p.is_finite());
    let (sum, count) = known.fold((0.0, 0), |(sum, count), p| (sum + p.distance(device), count + 1));
    let distance = sum / f64::from(count.max(1));
    if !(degrees > 0.0 && degrees <= WIDEST && distance.is_finite()) {
        return Err(Error::input(
            format!("{name} is {degrees} degrees across, {distance} m from the wall"),
            format!(
                "store {name} as the angle of one zone in degrees, and device_xyz as the sensor's place in metres"
            ),
        ));
    }
    Ok(OF_SQUARE * 2.0 * distance * (0.5 * degrees.to_radians()).tan())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_view_is_a_spot_on_the_wall() {
        let points = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.1, 0.0, 0.0), DVec3::NAN];
        let device = DVec3::new(0.05, 0.0, -1.0);
        let spot = spot_of("sensor_fov", 11.25, device, &points).unwrap();
        assert!((spot - 0.134).abs() < 1e-3, "{spot}");
        for (degrees, device) in [(0.0, device), (180.0, device), (f64::NAN, device), (5.0, DVec3::NAN)] {
            assert!(spot_of("sensor_fov", degrees, device, &points).is_err());
        }
    }

    #[test]
    fn zones_are_as_wide_as_they_are_apart() {
        let grid: Vec<_> =
            (0..16).map(|p| DVec3::new(0.2 * (p % 4) as f64, 0.1 * (p / 4) as f64, 0.0)).collect();
        assert!((side(&grid).unwrap() - 0.15).abs() < 1e-12);
        assert_eq!((side(&grid[..15]), side(&[DVec3::ZERO; 4])), (None, None));
    }
}
