//! What a step of CC-SOCR's points and a bin are in metres. Their files of points and counts do not say.
//!
//! Found in this order: what the user gives; `setup.mat` beside, the points of the same pairs in metres that General-NLOS made
//! (`laserpoints`, (N, N, 3), its first P rows); `experimental_setup.m` of their code beside or in the folder above, a text with
//! `c`, `delta_t` and the steps `bx` (depth), `by` (horizontal) and `bz` (vertical); for bins, 32 ps.

use std::path::Path;

use glam::DVec3;

use super::read_options::ReadOptions;
use super::set::Set;
use crate::METRES_PER_PICOSECOND;
use crate::error::{Error, Result};

const PICOSECONDS: f64 = 32.0;
const SCRIPT: &str = "experimental_setup.m";
/// Longer scripts are not theirs.
const MOST_BYTES: u64 = 1 << 18;
/// Points of setup.mat are those of the steps within this share of the wall.
const SAME: f64 = 1e-4;

/// Metres of a step, and of a bin.
pub(super) struct Units {
    /// Along the horizontal, the vertical and the depth.
    pub step: DVec3,
    pub bin_width: f64,
}

impl Units {
    /// The units of these laser and sensor points (horizontal, vertical, depth), in steps.
    ///
    /// # Errors
    /// `Kind::Options` if unspecified, or for values that are not lengths; `Kind::Input` if all points are the same, or for a
    /// `setup.mat` of other points.
    pub fn of(
        set: &Set,
        given: &ReadOptions,
        [laser, sensor]: [&[DVec3]; 2],
        notes: &mut Vec<String>,
    ) -> Result<Units> {
        const WHAT: &str = "a CC-SOCR capture";
        let (low, high) = laser
            .iter()
            .chain(sensor)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
        let span = high - low;
        let steps = span.x.max(span.y);
        if !(steps.is_finite() && steps > 0.0) {
            return Err(Error::input(
                "all points of C_i and C_d are the same",
                "check that the files hold the coordinates of a scan",
            ));
        }
        let script = Script::beside(set)?;
        let metres = in_metres(set, laser)?;
        let script_step = script.as_ref().and_then(Script::step);
        let (mut step, source) = match (given.wall, metres, script_step) {
            (Some(_), ..) => (DVec3::splat(given.wall(WHAT)? / steps), None),
            (_, Some(step), _) => (step, Some("setup.mat")),
            (_, _, Some(step)) => (step, Some(SCRIPT)),
            _ => (DVec3::splat(given.wall(WHAT)? / steps), None),
        };
        if let Some(source) = source {
            notes.push(format!(
                "{source} beside the capture says what a step is: {:.5} m across and {:.5} m up",
                step.x, step.y
            ));
        }
        let known = metres.map(|m| m.z).filter(|z| *z > 0.0).or(script_step.map(|s| s.z));
        step.z = match (given.depth_unit, known) {
            // A flat wall: nothing to scale.
            _ if span.z <= 0.0 => 0.0,
            (Some(unit), _) if unit.is_finite() && unit > 0.0 => unit,
            (Some(unit), _) => {
                return Err(Error::options(
                    format!("the unit of the wall's depth is {unit}"),
                    "give a length in metres above zero",
                ));
            }
            (None, Some(unit)) => {
                notes.push(format!("a step of the wall's depth is {unit:.5} m, as the same file says"));
                unit
            }
            (None, None) => {
                return Err(Error::options(
                    format!(
                        "the wall of {WHAT} is {} steps deep, and a step of its depth has a unit of its own",
                        span.z
                    ),
                    "give the unit of the wall's depth, their bx; or lay their experimental_setup.m beside the files",
                ));
            }
        };
        let bin_width = match (given.bin_width, script.and_then(|s| s.bin_width())) {
            (None, Some(width)) => {
                notes.push(format!(
                    "{SCRIPT} beside the capture says that bins are {width:.6} m of path wide"
                ));
                width
            }
            _ => given.bin_width(WHAT, Some(PICOSECONDS), notes)?,
        };
        Ok(Units { step, bin_width })
    }
}

/// Metres of a step by the points that `setup.mat` has of the same pairs; the depth is 0 where it does not say. `None` without
/// that file.
fn in_metres(set: &Set, laser: &[DVec3]) -> Result<Option<DVec3>> {
    let path = set.beside("setup.mat");
    if !path.is_file() {
        return Ok(None);
    }
    let place = |e: Error| e.at(path.display());
    let file = super::variables::Variables::open(&path).map_err(place)?;
    let Some((shape, values)) = file.numbers("laserpoints").map_err(place)? else { return Ok(None) };
    let [3, columns, rows] = shape[..] else { return Ok(None) };
    let all = rows * columns;
    // Pair p is row p / columns, column p % columns of (rows, columns, 3) in MATLAB.
    let at = |p: usize, axis: usize| values[axis * all + p % columns * rows + p / columns];
    let mut step = DVec3::ZERO;
    let fits = laser.len() <= all
        && (0..3).all(|axis| {
            let far =
                (0..laser.len()).max_by(|a, b| laser[*a][axis].total_cmp(&laser[*b][axis])).unwrap_or(0);
            if laser.is_empty() || laser[far][axis] <= 0.0 {
                return true;
            }
            step[axis] = at(far, axis) / laser[far][axis];
            let near = |(p, point): (usize, &DVec3)| {
                (at(p, axis) - step[axis] * point[axis]).abs() <= SAME * step[axis] * laser[far][axis]
            };
            laser.iter().enumerate().all(near)
        });
    if !fits {
        return Err(place(Error::input(
            "holds other points than C_i",
            "move it away, or lay the setup.mat of this capture beside it",
        )));
    }
    // A scan of one row or column says one step only.
    let across = step.x.max(step.y);
    for axis in [0, 1] {
        if step[axis] <= 0.0 {
            step[axis] = across;
        }
    }
    Ok((across > 0.0).then_some(step))
}

/// The numbers of `experimental_setup.m`.
struct Script(Vec<(String, f64)>);

impl Script {
    /// That beside the capture, or in the folder above.
    fn beside(set: &Set) -> Result<Option<Script>> {
        let here = set.beside(SCRIPT);
        let above = here.parent().and_then(Path::parent).map(|folder| folder.join(SCRIPT));
        let Some(path) = [Some(here), above].into_iter().flatten().find(|path| path.is_file()) else {
            return Ok(None);
        };
        let small = std::fs::metadata(&path).is_ok_and(|about| about.len() <= MOST_BYTES);
        let bytes = small.then(|| std::fs::read(&path).ok()).flatten().ok_or_else(|| {
            // bounded: by MOST_BYTES
            Error::input("cannot be read as a script", "move it away, or make it readable").at(path.display())
        })?;
        Ok(Some(Script::of(&String::from_utf8_lossy(&bytes))))
    }

    /// The first assignment of each name, where it is a product or quotient of numbers and earlier names.
    fn of(text: &str) -> Script {
        let mut known: Vec<(String, f64)> = vec![];
        let lines = text.lines().map(|line| line.split('%').next().unwrap_or_default());
        for statement in lines.flat_map(|line| line.split([';', ','])) {
            let Some((name, expression)) = statement.split_once('=') else { continue };
            let name = name.trim();
            if known.iter().all(|(n, _)| n != name)
                && let Some(value) = value(expression, &known)
            {
                known.push((name.into(), value));
            }
        }
        Script(known)
    }

    fn get(&self, name: &str) -> Option<f64> {
        let value = self.0.iter().find(|(n, _)| n == name)?.1;
        (value.is_finite() && value > 0.0).then_some(value)
    }

    /// Metres of a step (horizontal, vertical, depth).
    fn step(&self) -> Option<DVec3> {
        Some(DVec3::new(self.get("by")?, self.get("bz")?, self.get("bx")?))
    }

    /// Metres of path in a bin: times the speed of light if `c` is that, rounded or not; else in the units of `c`.
    fn bin_width(&self) -> Option<f64> {
        let (c, time) = (self.get("c")?, self.get("delta_t")?);
        let light = METRES_PER_PICOSECOND * 1e12;
        Some(time * if (c / light - 1.0).abs() < 1e-2 { light } else { c })
    }
}

/// The value of numbers and names with `*` and `/` between them.
fn value(expression: &str, known: &[(String, f64)]) -> Option<f64> {
    let number = |word: &str| {
        let word = word.trim();
        let value = word.parse().ok().filter(|v: &f64| v.is_finite());
        value.or_else(|| known.iter().find(|(name, _)| name == word).map(|(_, value)| *value))
    };
    expression.split('*').try_fold(1.0, |product, factor| {
        let mut parts = factor.split('/').map(number);
        let first = parts.next()??;
        parts.try_fold(product * first, |quotient, part| Some(quotient / part?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_says_steps_and_bins() {
        let script = Script::of(
            "% c = 1;\nc = 3E8; % light\ndelta_t = 32E-12;\nbx = c * delta_t; by = 2/63; bz = 1/3/21;\nbx = bx - 1;",
        );
        let step = script.step().unwrap();
        assert!((step - DVec3::new(2.0 / 63.0, 1.0 / 63.0, 9.6e-3)).length() < 1e-12, "{step}");
        assert!((script.bin_width().unwrap() - 32.0 * METRES_PER_PICOSECOND).abs() < 1e-12);
        let rendered = Script::of("c = 1; delta_t = 0.0025; by = 0.6/63; bz = zeros(3);");
        assert_eq!((rendered.bin_width(), rendered.step()), (Some(0.0025), None));
        assert_eq!(Script::of("c = 0; delta_t = x").bin_width(), None);
    }
}
