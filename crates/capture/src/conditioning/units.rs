//! Units of lengths and times: whether arrival times, wall and bins fit each other, and which unit is likely where they do not.

use crate::data::median::median;
use crate::data::{Capture, METRES_PER_PICOSECOND};
use crate::error::{Error, Result};

/// Path over wall size. A scene is a fraction of the wall to some tens of walls away; beyond these ratios the wall cannot
/// resolve it, or the bins end before light has crossed a small part of the wall.
const WIDEST_BIN: f64 = 2.0;
const LONGEST_RECORD: [f64; 2] = [1000.0, 3000.0];
const LATEST_LIGHT: [f64; 2] = [40.0, 300.0];
const SHORTEST_RECORD: [f64; 2] = [0.2, 1.0 / 30.0];
/// Walls of more metres are unlikely, or impossible.
const WIDEST_WALL: [f64; 2] = [50.0, 500.0];
/// A usual path over the size of the wall.
const USUAL: f64 = 2.0;
/// Units whose paths differ from the usual by up to e to this more than those of the best one are named, too.
const ALIKE: f64 = 1.2;

/// A unit and its metres.
type Unit = (&'static str, f64);

const METRES: Unit = ("metres", 1.0);
const LENGTHS: [Unit; 3] = [METRES, ("millimetres", 1e-3), ("centimetres", 1e-2)];
const TIMES: [Unit; 7] = [
    METRES,
    ("picoseconds", METRES_PER_PICOSECOND),
    ("seconds", 1e12 * METRES_PER_PICOSECOND),
    ("nanoseconds", 1e3 * METRES_PER_PICOSECOND),
    ("microseconds", 1e6 * METRES_PER_PICOSECOND),
    ("millimetres", 1e-3),
    ("centimetres", 1e-2),
];

/// What does not fit: a sentence, and whether it is beyond reason.
struct Misfit {
    what: String,
    refused: bool,
}

/// Refuses times and lengths that cannot belong together; a warning where they are unlikely to.
pub(super) fn check(capture: &Capture) -> Result<Option<String>> {
    let Some(sizes) = ComparedLengths::of(capture) else { return Ok(None) };
    let Some(misfit) = sizes.misfit() else { return Ok(None) };
    let likely = sizes.likely();
    let hint = "store points in metres, and delta_t and t_start in metres of path (seconds times 299792458)";
    if misfit.refused {
        let hint = if likely.is_empty() { hint.into() } else { format!("{likely}; {hint}") };
        return Err(Error::input(misfit.what, hint));
    }
    let likely = if likely.is_empty() { String::new() } else { format!(": {likely}") };
    Ok(Some(format!("{}{likely}", misfit.what)))
}

/// What is compared, metres.
struct ComparedLengths {
    /// Longest side of the box around all points.
    wall: f64,
    bin: f64,
    start: f64,
    end: f64,
    /// Medians over the pairs.
    first: f64,
    strongest: f64,
}

impl ComparedLengths {
    /// `None` for a capture whose points are all one, or whose counts hold no signal. Without counts, times of light are NaN.
    fn of(capture: &Capture) -> Option<ComparedLengths> {
        let points = || capture.laser.iter().chain(&capture.sensor);
        let low = points().copied().reduce(|a, b| a.min(b))?;
        let high = points().copied().reduce(|a, b| a.max(b))?;
        let wall = (high - low).max_element();
        let (first, strongest) = match capture.histograms.is_empty() {
            true => (f64::NAN, f64::NAN),
            false => {
                let light = |row: &[f32]| (super::warnings::first_light(row), super::gate::peak_bin(row));
                let (first, strongest): (Vec<_>, Vec<_>) = capture.of_rows(light).into_iter().unzip();
                let middle = |b: usize| capture.edge(b) + 0.5 * capture.bin_width;
                let of_pairs = |bins: Vec<Option<usize>>| median(bins.into_iter().flatten().map(middle));
                (of_pairs(first)?, of_pairs(strongest)?)
            }
        };
        let [bin, start, end] = [capture.bin_width, capture.t_start, capture.t_end()];
        (wall > 0.0).then_some(ComparedLengths { wall, bin, start, end, first, strongest })
    }

    fn misfit(&self) -> Option<Misfit> {
        let ComparedLengths { wall, bin, start, end, first, .. } = *self;
        let misfit = |what: String, refused: bool| Some(Misfit { what, refused });
        let record = end - start;
        if bin > WIDEST_BIN * wall {
            return misfit(format!("a bin is {:.5} m of path, wider than the wall of {wall} m", bin), true);
        }
        if record > LONGEST_RECORD[0] * wall {
            let what = format!(
                "the bins reach over {record:.5} m of path, {:.0} times the wall of {wall} m",
                record / wall
            );
            return misfit(what, record > LONGEST_RECORD[1] * wall);
        }
        if first > LATEST_LIGHT[0] * wall {
            let what = format!(
                "the first light comes at {first:.5} m of path, {:.0} times the wall of {wall} m",
                first / wall
            );
            return misfit(what, first > LATEST_LIGHT[1] * wall);
        }
        if end < SHORTEST_RECORD[0] * wall {
            let what = format!("the bins end at {end:.3e} m of path, on a wall of {wall} m");
            return misfit(what, end < SHORTEST_RECORD[1] * wall);
        }
        if wall > WIDEST_WALL[0] {
            return misfit(format!("the wall is {wall} m wide"), wall > WIDEST_WALL[1]);
        }
        None
    }

    /// The units of points and bins that are likely, as text; empty if none is.
    fn likely(&self) -> String {
        // Direct light is at path 0 and holds no information on the scene.
        let path = if self.strongest > 4.0 * self.bin { self.strongest } else { 0.25 * self.end };
        let only_start = self.start > LATEST_LIGHT[0] * self.wall
            && self.end - self.start < LONGEST_RECORD[0] * self.wall
            && self.bin < WIDEST_BIN * self.wall;
        if only_start {
            let fits = |(_, metres): &&Unit| self.start * metres < 20.0 * self.wall;
            let unit = TIMES.iter().skip(1).filter(fits).max_by(|a, b| a.1.total_cmp(&b.1));
            return unit.map_or_else(String::new, |(name, metres)| {
                format!(
                    "t_start {} looks like {name}: metres of path would be {:.4}",
                    self.start,
                    self.start * metres
                )
            });
        }
        let off = |length: Unit, time: Unit| {
            let fit = (path * time.1 / (USUAL * self.wall * length.1)).ln().abs();
            let usual = |value: f64, from: f64, to: f64| if (from..=to).contains(&value) { 0.0 } else { 3.0 };
            // Both in one unit are one mistake, in two units somewhat more.
            let mistakes = match (length.1 == 1.0, time.1 == 1.0) {
                (true, true) => 0.0,
                (false, false) if length.0 != time.0 => 1.5,
                _ => 1.0,
            };
            fit + usual(self.wall * length.1, 0.03, 30.0)
                + usual(self.bin * time.1, 2e-4, 0.5)
                + 2.0 * mistakes
        };
        let pairs = LENGTHS.iter().flat_map(|length| TIMES.iter().map(move |time| (*length, *time)));
        let mut all: Vec<(f64, Unit, Unit)> =
            pairs.map(|(length, time)| (off(length, time), length, time)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let best = all[0];
        let as_stored = |(_, length, time): &(f64, Unit, Unit)| length.1 == 1.0 && time.1 == 1.0;
        if as_stored(&best) || best.0 > 6.0 {
            return String::new();
        }
        let name = |(_, length, time): &(f64, Unit, Unit)| {
            let points =
                format!("the points look like {} (a wall of {:.4} m)", length.0, self.wall * length.1);
            let bins = format!(
                "delta_t {} looks like {}: metres of path would be {:.4}",
                self.bin as f32,
                time.0,
                self.bin * time.1
            );
            match (length.1 == 1.0, time.1 == 1.0) {
                (true, _) => bins,
                (_, true) => points,
                _ => format!("{points}, and {bins}"),
            }
        };
        let near = |found: &&(f64, Unit, Unit)| found.0 <= best.0 + ALIKE && !as_stored(found);
        all.iter().filter(near).take(2).map(name).collect::<Vec<_>>().join(", or ")
    }
}
