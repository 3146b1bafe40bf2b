//! Captures of CC-SOCR (Liu, Wang, Li and others 2021/2023), three MATLAB v5 files: `C_i` and `C_d` (P, 3), the laser
//! and sensor points as whole numbers (depth, horizontal, vertical), and `sub_Sig` (P, T), the counts of each pair.
//!
//! What a step of the points and a bin are in metres is not in these files: see `socr_units.rs`. The depth coordinate has
//! another unit than the other two (their `bx`, `by`, `bz`).
//!
//! Some `sub_Sig` (their letters N and T) hold the square roots of counts: 1, 1.414, 1.732, and so on. They are squared.
//!
//! Axes: horizontal runs to the left and vertical up, as in the view "from the relay surface" that their `main.m` and
//! `three.m` draw. This way their figure 4 is readable, and the statue holds its disc on the left as in its photograph.

use glam::DVec3;

use super::counts::Counts;
use super::frame;
use super::read_options::ReadOptions;
use super::set::Set;
use super::socr_units::Units;
use crate::Capture;
use crate::error::{Error, Result};

/// A square may be so far from a whole number, relative to it: rounding of single precision.
const WHOLE: f32 = 4e-6;

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Options` where neither the files nor the user say how large the wall is, or what unit its depth has; `Kind::Input`
/// for missing arrays or shapes that do not agree.
pub fn read(set: &mut Set, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    set.add_beside(&["C_i", "C_d", "sub_Sig"].map(|name| format!("{name}.mat")))?;
    // (horizontal, vertical, depth) of every pair, in steps.
    let points = |name: &str| -> Result<Vec<DVec3>> {
        let file = set.holding(name)?.ok_or_else(|| missing(name))?;
        let (shape, values) = file.numbers(name)?.ok_or_else(|| file.missing(name))?;
        let [3, pairs] = shape[..] else {
            return Err(Error::input(
                format!("{name} has shape {shape:?} (MATLAB order reversed), not three coordinates per pair"),
                format!("{name} is (P, 3): depth, horizontal, vertical"),
            ));
        };
        Ok((0..pairs).map(|p| DVec3::new(values[pairs + p], values[2 * pairs + p], values[p])).collect())
    };
    let (mut laser, mut sensor) = (points("C_i")?, points("C_d")?);
    let file = set.holding("sub_Sig")?.ok_or_else(|| missing("sub_Sig"))?;
    let shape = file.counts_shape("sub_Sig")?;
    let pairs = laser.len();
    let [bins, rows] = shape[..] else {
        return Err(Error::input(
            format!("sub_Sig has {} axes, not two", shape.len()),
            "sub_Sig is (P, T): bins of each pair",
        ));
    };
    if rows != pairs || sensor.len() != pairs {
        return Err(Error::input(
            format!("C_i holds {pairs} points, C_d {} and sub_Sig {rows} histograms", sensor.len()),
            "all three hold one row per pair: give the files of one capture",
        ));
    }
    let mut counts = file.counts("sub_Sig")?;
    square(&mut counts, notes);
    let integer_counts = counts.whole();
    let units = Units::of(set, given, [&laser, &sensor], notes)?;
    let all = || laser.iter().chain(&sensor).map(|p| *p * units.step);
    let (low, high) = all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    let middle = DVec3::new(0.5 * (low.x + high.x), 0.5 * (low.y + high.y), 0.0);
    for p in laser.iter_mut().chain(&mut sensor) {
        *p = *p * units.step - middle;
    }
    let bin_width = units.bin_width;
    // The shape of the scan, if its points form a lattice, row after row.
    let row = laser.windows(2).position(|w| w[0].x != w[1].x).map_or(pairs, |p| p + 1);
    let lattice = laser == sensor
        && pairs % row == 0
        && laser.chunks(row).all(|r| r.iter().zip(&laser).all(|(p, first)| p.y == first.y && p.x == r[0].x));
    let scan = if lattice { [pairs / row, row] } else { [pairs, 1] };
    let histograms = crate::files::array::transpose(&counts.values, bins, pairs)?;
    let capture =
        Capture { integer_counts, ..Capture::new(scan, laser, sensor, bins, bin_width, histograms) };
    Ok(if lattice { frame::in_order(capture) } else { capture })
}

/// Squares values that are square roots of whole numbers and not whole themselves, and says so.
fn square(counts: &mut Counts, notes: &mut Vec<String>) {
    if counts.whole() {
        return;
    }
    let root = |v: f32| {
        let square = v * v;
        v >= 0.0 && (v == 0.0 || square > 0.5) && (square - square.round()).abs() <= WHOLE * square
    };
    if counts.values.iter().all(|v| root(*v)) {
        counts.values.iter_mut().for_each(|v| *v = (*v * *v).round());
        notes.push("sub_Sig holds square roots of counts (1, 1.414, 1.732, ...): they are squared".into());
    }
}

fn missing(name: &str) -> Error {
    Error::input(
        format!("there is no file with {name}"),
        "a CC-SOCR capture is a folder with C_i.mat, C_d.mat and sub_Sig.mat: give that folder",
    )
}
