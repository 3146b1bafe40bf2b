//! The instrument's pulse by its shape: a Gaussian's width, then whether its detector has a tail. Convolutions of rendered held-out pairs
//! suggest widths; fits of surfaces confirm one by the residual of held-out pairs. Unlike the haze of a volume, a surface can compensate
//! only a part of a wrong pulse.
//!
//! Rendered rows are spread by pulses, and compared with measured ones. Sums of products of the rows, one moved against the other, tell
//! what every pulse leaves, so no row is spread but for the best one.

use rayon::prelude::*;

use crate::Result;
use crate::capture::{Pulse, PulseTaps, Way};

/// A pulse is taken only if it lowers what is left by more than this share.
pub(super) const WORTH: f64 = 0.003;

/// Length in bins of a trial that shows whether there is a pulse.
pub(super) const FIRST: f64 = 2.0;
/// The longest pulse, bins and walls. Pulses of measured captures have up to .11 walls; what seems longer is light of a room.
const WIDEST: f64 = 32.0;
const OF_WALL: f64 = 0.15;

/// The narrowest pulse that is worth its kernels, in bins of the solve.
pub(super) const NARROWEST: f64 = 1.0;

/// Pulses by which the light of a surface with sharp paths is spread: lengths to an octave where tails are open and where they are not,
/// and shares of the tail.
const TO_AN_OCTAVE: [f64; 2] = [8.0, 24.0];
const TAILS: [f64; 5] = [0.0, 0.2, 0.4, 0.6, 0.8];

/// Bins by which light may move, each way: a surface that was fitted with a wrong pulse lies before or behind its place.
pub(super) const MOVES: i64 = 6;

/// Bins by which rows are moved against each other.
const REACH: usize = 96;

/// Lags whose sums are made side by side, so that none waits for its own.
const LAGS: usize = 8;

/// Shares of the length in the tails of fits. The share of a suggestion depends on the one that the surface was fitted with.
pub(super) const SHARES: [f64; 3] = [0.0, 0.4, 0.8];

/// Share of a change of the variance that a suggestion keeps, at most.
const MOST_KEPT: f64 = 0.8;

/// The length of the longest suggestion for bins and a wall of these widths, metres.
pub(super) fn longest(bin_width: f64, wall: f64) -> f64 {
    (WIDEST * bin_width).min(OF_WALL * wall)
}

/// Whether a length is less than the longest, which suggests itself where a residual falls without end.
pub(super) fn is_below(length: f64, longest: f64) -> bool {
    length < longest * (-1.0 / TO_AN_OCTAVE[0]).exp2()
}

/// Lengths of suggestions, bins.
fn lengths(to_an_octave: f64, longest: f64) -> impl Iterator<Item = f64> {
    let octaves = (longest.log2() * to_an_octave).floor() as isize;
    (0..=octaves).map(move |i| (i as f64 / to_an_octave).exp2())
}

/// A pulse of a trial: a Gaussian, convolved with an exponential.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    /// Full width at half maximum of the Gaussian, metres of path; 0 for sharp paths.
    pub fwhm: f64,
    /// Length over which the exponential falls to 1/e, metres of path; 0 for none.
    pub tail: f64,
}

impl Shape {
    pub const SHARP: Shape = Shape { fwhm: 0.0, tail: 0.0 };

    /// A pulse that is `length` long and has this share of it in its tail. Pulses of one length are about as wide at half of
    /// their maximum (benches/NOTES.md).
    pub fn of(length: f64, share: f64) -> Shape {
        let [fwhm, tail] = [1.0 - share, share].map(|part| three_digits(part * length));
        Shape { fwhm, tail }
    }

    /// Pulses of many lengths and tails, in bins of this width, up to a length in metres.
    pub fn all(bin_width: f64, longest: f64) -> Vec<Shape> {
        let lengths = lengths(TO_AN_OCTAVE[0], longest / bin_width).map(|bins| bins * bin_width);
        lengths.flat_map(|length| TAILS.map(|share| Shape::of(length, share))).collect()
    }

    /// The same without tails.
    pub fn plain(bin_width: f64, longest: f64) -> Vec<Shape> {
        let lengths = lengths(TO_AN_OCTAVE[1], longest / bin_width);
        lengths.map(|bins| Shape::of(bins * bin_width, 0.0)).collect()
    }

    /// Width and tail together, metres.
    pub fn length(&self) -> f64 {
        self.fwhm + self.tail
    }

    /// The pulse; `None` if paths are sharp.
    ///
    /// # Errors
    /// It makes no pulse. This does not happen with one that was found.
    pub fn pulse(&self) -> Result<Option<Pulse>> {
        let gaussian = (self.fwhm > 0.0).then(|| Pulse::gaussian(self.fwhm)).transpose()?;
        let tailed = |pulse: Pulse| if self.tail > 0.0 { pulse.with_tail(self.tail) } else { Ok(pulse) };
        gaussian.map(tailed).transpose()
    }

    /// The same, with its mean at the path. The surfaces of trials begin with a fit without it: they judge its
    /// shape, not where the path is.
    pub fn centred(&self) -> Result<Option<Pulse>> {
        let pulse = self.pulse()?;
        Ok(pulse.map(|mut pulse| {
            pulse.start -= self.tail;
            pulse
        }))
    }
}

/// Rounds as the note does, so that a width copied from the note gives the same result.
pub(super) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The length that a surface suggests that was fitted with it, by what a surface of sharp paths and one of the length `first` suggest.
/// The variance that is missing has moved into the surface: it falls in proportion.
pub(super) fn settled(first: f64, second: f64) -> f64 {
    let kept = ((second / first).powi(2) - 1.0).min(MOST_KEPT);
    if kept > 0.0 { first / (1.0 - kept).sqrt() } else { second }
}

/// The share of the tail by residuals with [`SHARES`]: the vertex of their parabola, or the least where it has none.
pub(super) fn best_share(left: [f64; SHARES.len()]) -> f64 {
    let [[a, b, c], [fa, fb, fc]] = [SHARES, left];
    let (first, second) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
    let bent = (second - first) / (c - a);
    if bent > 0.0 && bent.is_finite() {
        return (0.5 * (a + b) - 0.5 * first / bent).clamp(a, c);
    }
    let least = (0..left.len()).min_by(|i, j| left[*i].total_cmp(&left[*j]));
    least.map_or(0.0, |at| SHARES[at])
}

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

/// Of `pulses`, the one that leaves the least squares of rendered and measured rows of `bins` bins: its place, and for each row the squared
/// differences and the squared values. Light may also move along time and change its strength. `None` if nothing is rendered.
pub(super) fn best(
    rows: &[Vec<f64>; 2],
    bins: usize,
    pulses: &[PulseTaps],
) -> Option<(usize, Vec<[f64; 2]>)> {
    let products = Products::of(rows, bins);
    let each = pulses.iter().enumerate().filter_map(|(i, taps)| Some((i, products.suit(taps)?)));
    let (at, (_, moved, factor)) = each.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let of_row = |(rendered, measured): (&[f64], &[f64])| {
        let spread = spread(&pulses[at], moved, factor, rendered);
        let differences = spread.iter().zip(measured).map(|(s, m)| (s - m).powi(2));
        [differences.sum(), measured.iter().map(|m| m * m).sum()]
    };
    let [rendered, measured] = rows.each_ref().map(|rows| rows.chunks(bins));
    Some((at, rendered.zip(measured).map(of_row).collect()))
}

/// A row spread by taps that are moved, times a factor.
fn spread(PulseTaps { before, weights }: &PulseTaps, moved: i64, factor: f64, row: &[f64]) -> Vec<f64> {
    let first = moved - *before as i64;
    let later = vec![0.0; first.max(0) as usize];
    let moved = PulseTaps { before: (-first).max(0) as usize, weights: [&later[..], &weights[..]].concat() };
    moved.through(row, Way::Spread).into_iter().map(|v| factor * v).collect()
}

/// Sums over all rows.
struct Products {
    /// Autocorrelation of rendered values by lag in bins, from 0.
    own: Vec<f64>,
    /// Cross-correlation of rendered and measured values by lag in bins, from minus [`REACH`].
    cross: Vec<f64>,
}

impl Products {
    fn of([rendered, measured]: &[Vec<f64>; 2], bins: usize) -> Products {
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

    /// The squares that rows spread by these taps explain, with the best move and factor, and these. `None` if nothing is rendered.
    fn suit(&self, taps: &PulseTaps) -> Option<(f64, i64, f64)> {
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
        Some((most.max(0.0).powi(2) / own, moved, most.max(0.0) / own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_spread_by_pulses_of_all_lengths_and_tails() {
        assert_eq!([longest(0.01, 4.0), longest(0.01, 1.0)], [0.32, 0.15]);
        assert!(Shape::plain(0.01, 0.009).is_empty());
        let most = Shape::plain(0.01, 0.15).iter().map(Shape::length).fold(0.0, f64::max);
        assert!(!is_below(most, 0.15) && is_below(0.8 * most, 0.15));
        let all = Shape::all(0.01, 0.32);
        let reaches = |of: fn(&Shape) -> f64| {
            let of = || all.iter().map(of);
            [of().fold(f64::INFINITY, f64::min), of().fold(0.0, f64::max)]
        };
        assert_eq!(reaches(Shape::length), [0.01, 0.32]);
        let [least, most] = reaches(|shape| shape.tail / shape.length());
        assert!(least == 0.0 && (most - 0.8).abs() < 1e-3);
        assert!(all.iter().all(|shape| shape.centred().unwrap().unwrap().taps(0.01).is_ok()));
    }

    #[test]
    fn trials_put_the_mean_of_a_pulse_at_the_path() {
        let mean = |pulse: Pulse| {
            let at = |i: usize| pulse.start + (i as f64 + 0.5) * pulse.width;
            let sum: f64 = pulse.samples.iter().sum();
            pulse.samples.iter().enumerate().map(|(i, s)| s * at(i)).sum::<f64>() / sum
        };
        for shape in [Shape { fwhm: 0.03, tail: 0.0 }, Shape { fwhm: 0.01, tail: 0.03 }] {
            assert!(mean(shape.centred().unwrap().unwrap()).abs() < 1e-4, "{shape:?}");
            assert!((mean(shape.pulse().unwrap().unwrap()) - shape.tail).abs() < 1e-4, "{shape:?}");
        }
        assert!(Shape::SHARP.centred().unwrap().is_none());
    }

    #[test]
    fn a_suggestion_settles_where_a_surface_keeps_a_part_of_the_variance() {
        for truth in [1.0f64, 3.0, 20.0] {
            for kept in [0.0, 0.2, 0.5] {
                let suggested = |given: f64| ((1.0 - kept) * truth * truth + kept * given * given).sqrt();
                let first = suggested(0.0);
                let settled = settled(first, suggested(first));
                assert!((settled / truth - 1.0).abs() < 1e-9, "{truth} {kept}: {settled}");
            }
        }
        assert_eq!(settled(3.0, 2.5), 2.5, "a shorter one");
        assert!(settled(1.0, 3.0) < 2.3, "no surface compensates so much");
    }

    #[test]
    fn the_share_of_a_tail_is_at_the_vertex() {
        for at in [0.0, 0.3, 0.55, 0.8] {
            let found = best_share(SHARES.map(|share| 1.0 + 3.0 * (share - at) * (share - at)));
            assert!((found - at).abs() < 1e-9, "{at}: {found}");
        }
        assert_eq!(best_share([3.0, 2.0, 1.5]), 0.8, "falls up to the longest");
        assert_eq!(best_share([3.0, 2.0, 0.5]), 0.8, "bent the other way");
        assert_eq!(best_share([3.0, 2.0, f64::INFINITY]), 0.4, "no surface");
    }

    #[test]
    fn widths_have_three_digits_of_any_size() {
        assert_eq!([0.0321489, 3.21489e-6, 123.456, 0.0].map(three_digits), [0.0321, 3.21e-6, 123.0, 0.0]);
    }

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
            let of_row = |row| spread(&pulses[at], moved, 2.5, row);
            let measured: Vec<f64> = rendered.chunks(120).flat_map(of_row).collect();
            let rows = [rendered.clone(), measured.clone()];
            let (found, left) = best(&rows, 120, &pulses).unwrap();
            assert_eq!(found, at);
            // The tails that leave the rows, and what lies beyond the reach, are little.
            assert!(left.len() == 2 && left.iter().all(|[d, m]| *d < 1e-6 * m && *m > 0.0), "{left:?}");
            let (explained, found, factor) = Products::of(&rows, 120).suit(&pulses[at]).unwrap();
            let all: f64 = measured.iter().map(|m| m * m).sum();
            assert!(found == moved && (factor / 2.5 - 1.0).abs() < 1e-3);
            assert!((explained / all - 1.0).abs() < 1e-3);
        }
        let dark = vec![0.0; 240];
        assert!(best(&[dark, rendered], 120, &pulses).is_none());
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
        let rows = [rendered, measured];
        let (at, left) = best(&rows, 120, &pulses).unwrap();
        let products = Products::of(&rows, 120);
        let explained: Vec<f64> = pulses.iter().map(|taps| products.suit(taps).unwrap().0).collect();
        assert!(explained.iter().all(|e| *e <= explained[at]));
        let [d, m] = [0, 1].map(|k| left.iter().map(|row| row[k]).sum::<f64>());
        assert!((d - (m - explained[at])).abs() < 1e-3 * m, "{d} {m} {explained:?}");
    }
}
