//! Course of a scanner along its lines: the time of a line's points and the shift of every second line.

use super::division::Rounds;
use super::{Event, Tags};
use crate::error::Result;
use crate::host;

/// Cells of a point, and points on both sides of a line, that are compared for the shift.
const PER_POINT: usize = 8;
const MARGIN: usize = 2;
/// Largest shift that is tried, cells.
const MOST: i64 = 12;
/// Photons of a point over which a mean delay is compared.
const FEW: f64 = 5.0;
/// Least fall of chi squared that shows a shift.
const CLEAR: f64 = 30.0;
/// A return takes at least this share of a line, and has at most this share of the photons of the line in the same time.
const RETURN: f64 = 0.05;
const DARK: f64 = 0.1;

/// Photons of a cell of a line, and the sums of their delays and of the squares of these.
type Cell = [f64; 3];

/// The laser pulses of the points of a line after which photons cease, if they do; `None` for a line without a dark return.
pub(super) fn duration(tags: &Tags, detector: i32, lines: &Rounds, photons: u64) -> Result<Option<i64>> {
    let all = || lines.iter().flatten();
    let usual = all().map(|[from, to]| to - from).max().unwrap_or(0);
    let cells = (photons / 50).clamp(64, 4096) as usize;
    let mut sums = vec![0.0; cells]; // bounded: 4,096
    let scaled = |sync: i64, from: i64| ((sync - from) as f64 / usual as f64 * cells as f64) as usize;
    profile(tags, detector, lines, 0.0, &mut |_, [from, _], sync, _| {
        if let Some(sum) = sums.get_mut(scaled(sync, from)) {
            *sum += 1.0;
        }
    })?;
    let level = sums.iter().sum::<f64>() / cells as f64;
    let last = sums.iter().rposition(|sum| *sum > DARK * level).map_or(cells, |at| at + 1);
    let share = last as f64 / cells as f64;
    Ok((share < 1.0 - RETURN).then_some((share * usual as f64).round() as i64))
}

/// The shift of every second line in points, by which its photons and their delays agree best with those of the lines beside it; 0 where
/// none is clear.
pub(super) fn shift(tags: &Tags, detector: i32, lines: &Rounds, per_line: usize) -> Result<f64> {
    let rows = lines.iter().map(Vec::len).max().unwrap_or(0);
    let cells = (per_line + 2 * MARGIN) * PER_POINT;
    let mut all: Vec<Cell> =
        host::filled("the photons along the lines", rows.saturating_mul(cells), [0.0; 3])?;
    let scale = (per_line * PER_POINT) as f64;
    let margin = (MARGIN * PER_POINT) as f64;
    profile(tags, detector, lines, MARGIN as f64 / per_line as f64, &mut |row, [from, to], sync, delay| {
        let cell = (sync - from) as f64 / (to - from).max(1) as f64 * scale + margin;
        if let Some(cell) =
            all.get_mut(row * cells + cell as usize).filter(|_| (0.0..cells as f64).contains(&cell))
        {
            let delay = delay as f64;
            [1.0, delay, delay * delay].iter().zip(cell).for_each(|(more, sum)| *sum += more);
        }
    })?;
    let [n, sum, squares] = all.iter().fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
    let variance = (squares / n - (sum / n).powi(2)).max(f64::MIN_POSITIVE);
    let off = |shift: i64| -> f64 {
        let of_row = |row: usize| {
            let at = |row: usize, cell: usize| all[row * cells + cell];
            (MOST as usize..cells - MOST as usize)
                .map(|x| {
                    let [a, b] = [at(row - 1, x), at(row + 1, x)];
                    let odd = at(row, ((cells - 1 - x) as i64 + shift) as usize);
                    let even = a[0] + b[0];
                    let counts = (0.5 * even - odd[0]).powi(2) / (0.25 * even + odd[0]).max(1.0);
                    if a[0].min(b[0]).min(odd[0]) < FEW {
                        return counts;
                    }
                    let mean = 0.5 * (a[1] / a[0] + b[1] / b[0]) - odd[1] / odd[0];
                    let of_mean = variance * (0.25 / a[0] + 0.25 / b[0] + 1.0 / odd[0]);
                    counts + mean * mean / of_mean
                })
                .sum::<f64>()
        };
        (1..rows.saturating_sub(1)).step_by(2).map(of_row).sum()
    };
    let offs: Vec<f64> = (-MOST..=MOST).map(off).collect();
    let best = (0..offs.len()).min_by(|a, b| offs[*a].total_cmp(&offs[*b])).unwrap_or(MOST as usize);
    if offs[MOST as usize] - offs[best] < CLEAR {
        return Ok(0.0);
    }
    let around = |step: i64| offs.get((best as i64 + step) as usize).copied().unwrap_or(f64::INFINITY);
    let (before, after) = (around(-1) - offs[best], around(1) - offs[best]);
    // The bottom of two lines, as the counts change at an edge.
    let part = if before.is_finite() && after.is_finite() {
        0.5 * (before - after) / before.max(after)
    } else {
        0.0
    };
    Ok((best as f64 + part - MOST as f64) / PER_POINT as f64)
}

/// Calls `hear` with the row, the laser pulses of the line, the pulse and the delay of each photon on or near a line. `margin`: share of
/// a line on both of its sides.
fn profile(
    tags: &Tags,
    detector: i32,
    lines: &Rounds,
    margin: f64,
    hear: &mut impl FnMut(usize, [i64; 2], i64, i64),
) -> Result<()> {
    let all: Vec<(usize, [i64; 2])> =
        lines.iter().flat_map(|round| round.iter().copied().enumerate()).collect();
    let mut at = 0;
    tags.events(|event| {
        let Event::Photon { channel, sync, delay } = event else { return };
        // A photon between two lines is that of the nearer one.
        let begins = |line: usize| (all[line - 1].1[1].min(all[line].1[0]) + all[line].1[0]) / 2;
        while at + 1 < all.len() && sync >= begins(at + 1) {
            at += 1;
        }
        while at > 0 && sync < begins(at) {
            at -= 1;
        }
        let Some((row, line)) = all.get(at).copied().filter(|_| channel == detector) else { return };
        let reach = (margin * (line[1] - line[0]) as f64) as i64;
        if (line[0] - reach..line[1] + reach).contains(&sync) {
            hear(row, line, sync, delay);
        }
    })?;
    Ok(())
}
