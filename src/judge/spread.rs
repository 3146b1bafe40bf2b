//! The pulse that light with sharp paths asks for: rendered rows are spread by pulses, and compared with measured ones. Sums of
//! products of the rows, one moved against the other, tell what every pulse leaves, so no row is spread but for the best one.

use rayon::prelude::*;

use crate::capture::{PulseTaps, Way};

/// Bins by which light may move, each way: a surface that was fitted with a wrong pulse lies before or behind its place.
const MOVES: i64 = 6;

/// Bins by which rows are moved against each other.
const REACH: usize = 96;

/// Lags whose sums are made side by side, so that none waits for its own.
const LAGS: usize = 8;

/// Adds to `sums[j]` the sum of products of the values of one row and those of another that are `first + j` bins later.
pub(crate) fn add_products(earlier: &[f64], later: &[f64], first: usize, sums: &mut [f64]) {
    for (sums, first) in sums.chunks_mut(LAGS).zip((first..).step_by(LAGS)) {
        let mut parts = [0.0; LAGS];
        // All of these lags end within the row.
        let common = (later.len() + 1).saturating_sub(first + LAGS).min(earlier.len());
        if common > 0 {
            for (value, later) in earlier[..common].iter().zip(later[first..].windows(LAGS)) {
                parts.iter_mut().zip(later).for_each(|(part, later)| *part += value * later);
            }
        }
        for (lag, (sum, mut part)) in (first..).zip(sums.iter_mut().zip(parts)) {
            let rest = earlier.iter().zip(later.get(lag..).unwrap_or_default()).skip(common);
            rest.for_each(|(value, later)| part += value * later);
            *sum += part;
        }
    }
}

/// Rows of `bins` bins: rendered with ideal paths, and measured.
pub(super) struct ComparedRows<'r> {
    pub rendered: &'r [f64],
    pub measured: &'r [f64],
    pub bins: usize,
}

/// Taps with the move and the factor that suit rows best.
struct Suited<'t> {
    taps: &'t PulseTaps,
    moved: i64,
    factor: f64,
}

impl ComparedRows<'_> {
    /// Of `pulses`, the one that leaves the least squares: its place, and for each row the squared differences and the squared
    /// values. Light may also move along time and change its strength. `None` if nothing is rendered.
    pub fn best(&self, pulses: &[PulseTaps]) -> Option<(usize, Vec<[f64; 2]>)> {
        let products = Products::of(self);
        let each = pulses.iter().enumerate().filter_map(|(i, taps)| Some((i, products.suit(taps)?)));
        let (at, (_, suited)) = each.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let of_row = |(rendered, measured): (&[f64], &[f64])| {
            let spread = suited.spread(rendered);
            let differences = spread.iter().zip(measured).map(|(s, m)| (s - m).powi(2));
            [differences.sum(), measured.iter().map(|m| m * m).sum()]
        };
        let [rendered, measured] = [self.rendered, self.measured].map(|rows| rows.chunks(self.bins));
        Some((at, rendered.zip(measured).map(of_row).collect()))
    }
}

impl Suited<'_> {
    fn spread(&self, row: &[f64]) -> Vec<f64> {
        let PulseTaps { before, weights } = self.taps;
        let first = self.moved - *before as i64;
        let later = vec![0.0; first.max(0) as usize];
        let moved =
            PulseTaps { before: (-first).max(0) as usize, weights: [&later[..], &weights[..]].concat() };
        moved.through(row, Way::Spread).into_iter().map(|v| self.factor * v).collect()
    }
}

/// Sums over all rows.
struct Products {
    /// Autocorrelation of rendered values by lag in bins, from 0.
    own: Vec<f64>,
    /// Cross-correlation of rendered and measured values by lag in bins, from minus [`REACH`].
    cross: Vec<f64>,
}

impl Products {
    fn of(rows: &ComparedRows<'_>) -> Products {
        let ComparedRows { rendered, measured, bins } = *rows;
        // Lags of a part are summed side by side.
        let of = |earlier: &[f64], later: &[f64], count: usize| -> Vec<f64> {
            let mut sums = vec![0.0; count];
            sums.par_chunks_mut(LAGS).enumerate().for_each(|(part, sums)| {
                for (earlier, later) in earlier.chunks(bins).zip(later.chunks(bins)) {
                    add_products(earlier, later, part * LAGS, sums);
                }
            });
            sums
        };
        let (own, [after, before]) = rayon::join(
            || of(rendered, rendered, REACH + 1),
            || [of(rendered, measured, REACH + 1), of(measured, rendered, REACH + 1)],
        );
        let cross = before[1..].iter().rev().chain(&after).copied().collect();
        Products { own, cross }
    }

    /// The squares that rows spread by these taps explain, with the best move. `None` if nothing is rendered.
    fn suit<'t>(&self, taps: &'t PulseTaps) -> Option<(f64, Suited<'t>)> {
        let weights = || taps.weights.iter().enumerate();
        let own_at = |by: usize| self.own.get(by).copied().unwrap_or(0.0);
        let own: f64 =
            weights().map(|(i, a)| weights().map(|(j, b)| a * b * own_at(i.abs_diff(j))).sum::<f64>()).sum();
        let cross = |moved: i64| -> f64 {
            let at = |tap: usize| REACH as i64 + tap as i64 - taps.before as i64 + moved;
            let of = |tap: usize| usize::try_from(at(tap)).ok().and_then(|at| self.cross.get(at)).copied();
            weights().map(|(tap, weight)| weight * of(tap).unwrap_or(0.0)).sum()
        };
        let moves = (-MOVES..=MOVES).map(|moved| (moved, cross(moved)));
        let (moved, most) = moves.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| own > 0.0)?;
        Some((most.max(0.0).powi(2) / own, Suited { taps, moved, factor: most.max(0.0) / own }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Pulse;

    /// Two rows with two echoes each.
    fn sharp() -> Vec<f64> {
        let mut rows = vec![0.0; 2 * 120];
        [(30, 1.0), (52, 0.6), (120 + 41, 0.8), (120 + 70, 1.0)].into_iter().for_each(|(at, v)| rows[at] = v);
        rows
    }

    #[test]
    fn the_pulse_that_spread_the_light_leaves_nothing() {
        let taps = |fwhm: f64, tail: f64| {
            let gaussian = Pulse::gaussian(fwhm).unwrap();
            gaussian.with_tail(tail).unwrap().taps(1.0).unwrap()
        };
        let pulses = [taps(2.0, 1.0), taps(4.0, 2.0), taps(4.0, 5.0), taps(9.0, 1.0)];
        let rendered = sharp();
        for (at, moved) in [(0, 0), (1, -4), (2, 3), (3, 6)] {
            let truth = Suited { taps: &pulses[at], moved, factor: 2.5 };
            let measured: Vec<f64> = rendered.chunks(120).flat_map(|row| truth.spread(row)).collect();
            let rows = ComparedRows { rendered: &rendered, measured: &measured, bins: 120 };
            let (found, left) = rows.best(&pulses).unwrap();
            assert_eq!(found, at);
            // The tails that leave the rows, and what lies beyond the reach, are little.
            assert!(left.len() == 2 && left.iter().all(|[d, m]| *d < 1e-6 * m && *m > 0.0), "{left:?}");
            let (explained, suited) = Products::of(&rows).suit(&pulses[at]).unwrap();
            let all: f64 = measured.iter().map(|m| m * m).sum();
            assert!(suited.moved == moved && (suited.factor / 2.5 - 1.0).abs() < 1e-3);
            assert!((explained / all - 1.0).abs() < 1e-3);
        }
        let dark = vec![0.0; 240];
        assert!(ComparedRows { rendered: &dark, measured: &rendered, bins: 120 }.best(&pulses).is_none());
    }

    #[test]
    fn products_of_all_lags_are_sums_by_definition() {
        let [a, b] = [0.3, 0.7].map(|step| (0..21).map(|i| (f64::from(i) * step).sin()).collect::<Vec<_>>());
        let mut sums = vec![0.0; 25];
        add_products(&a, &b, 3, &mut sums);
        for (j, sum) in sums.into_iter().enumerate() {
            let wanted: f64 = a.iter().zip(b.iter().skip(3 + j)).map(|(a, b)| a * b).fold(0.0, |s, v| s + v);
            assert_eq!(sum, wanted, "{j}");
        }
    }

    #[test]
    fn what_is_left_is_what_the_products_say() {
        let pulses: Vec<PulseTaps> =
            [2.0, 3.0, 6.0].iter().map(|w| Pulse::gaussian(*w).unwrap().taps(1.0).unwrap()).collect();
        let rendered = sharp();
        // No pulse explains this.
        let measured: Vec<f64> =
            rendered.iter().enumerate().map(|(i, v)| v + 0.2 * (i as f64).sin().abs()).collect();
        let rows = ComparedRows { rendered: &rendered, measured: &measured, bins: 120 };
        let (at, left) = rows.best(&pulses).unwrap();
        let products = Products::of(&rows);
        let explained: Vec<f64> = pulses.iter().map(|taps| products.suit(taps).unwrap().0).collect();
        assert!(explained.iter().all(|e| *e <= explained[at]));
        let [d, m] = [0, 1].map(|k| left.iter().map(|row| row[k]).sum::<f64>());
        assert!((d - (m - explained[at])).abs() < 1e-3 * m, "{d} {m} {explained:?}");
    }
}
