//! Captures of *Non-line-of-sight imaging over 1.43 kilometers* (Wu, Liu, Huang and others 2021), MATLAB v5 or v7.3.
//!
//! `sig_in` (d1, d2, t) counts, path 0 at the wall; `timeRes` seconds of a bin; `width` **half** the wall in metres, as their
//! demo draws it from `-width` to `width`. `pulsewidth` is the full width at half maximum of the instrument's pulse: their notes
//! say seconds, their code takes it as picoseconds (`pulseWidth*(10^-12)` in `sp1400.m`), and the files hold some 800. `radius`
//! is not in their notes: `definebeam` blurs the scan by exp(-r² / (radius / 2)²).
//!
//! Axes: d1 runs to the left and d2 up. Their `draw3D.m` shows depth, d1 and d2 as x, y and z of a right-handed plot; seen from
//! the wall, its y points to the left.

use super::frame::{Axes, WallDirection};
use super::read_options::ReadOptions;
use super::unread::Unread;
use super::variables::Variables;
use crate::error::{Error, Result};
use crate::{METRES_PER_PICOSECOND, Pulse};

const AXES: Axes = Axes { d1: WallDirection::Left, d2: WallDirection::Up };
/// A `pulsewidth` below this is in seconds, as their notes say; no pulse is as long as a millisecond or as short as a
/// femtosecond.
const SECONDS_BELOW: f64 = 1e-3;

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not fit, or numbers that are no lengths or times.
pub(super) fn read<'f>(
    file: &'f Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Unread<'f>> {
    let positive = |name: &str, unit: &str| -> Result<Option<f64>> {
        match file.number(name)? {
            Some(value) if !(value.is_finite() && value > 0.0) => Err(Error::input(
                format!("{name} is {value}"),
                format!("{name} is a number of {unit} above 0"),
            )),
            value => Ok(value),
        }
    };
    let half = positive("width", "metres")?.ok_or_else(|| file.missing("width"))?;
    notes.push(format!(
        "width is half the wall, as the code of its publication draws it: the outermost points are {} m apart",
        2.0 * half
    ));
    let bin_width = match positive("timeRes", "seconds")? {
        Some(seconds) => {
            given.no_bin_width("a 1.43 km capture with timeRes")?;
            seconds * 1e12 * METRES_PER_PICOSECOND
        }
        None => given.bin_width("a 1.43 km capture without timeRes", None, notes)?,
    };
    let mut scanned = Unread::scanned(file, "sig_in", AXES, 2.0 * half, bin_width)?;
    if let Some(stored) = positive("pulsewidth", "picoseconds")? {
        let (picoseconds, why) = match stored < SECONDS_BELOW {
            true => (1e12 * stored, "seconds, as the notes of its publication say"),
            false => (stored, "picoseconds, as in the code of its publication; its notes say seconds"),
        };
        notes.push(format!("pulsewidth {stored:.4} is taken as {why}"));
        scanned.outline.pulse = Some(Pulse::gaussian(picoseconds * METRES_PER_PICOSECOND)?);
    }
    if let Some(radius) = positive("radius", "metres")? {
        // Two equal spots around one point blur by 1 / √2 of the width of either.
        let blur = std::f64::consts::LN_2.sqrt() * radius;
        let spot = std::f64::consts::SQRT_2 * blur;
        notes.push(format!(
            "radius {radius} blurs the scan by a Gaussian {blur:.4} m wide, as in the code of its publication: laser and sensor \
             have spots of {spot:.4} m"
        ));
        [scanned.outline.laser_spot, scanned.outline.sensor_spot] = [Some(spot); 2];
    }
    Ok(scanned)
}
