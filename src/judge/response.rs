//! The impulse response without a shape: samples by non-negative least squares with a prior on their second differences, of the same
//! renderings with sharp paths by which shapes are compared. A surface hides a part of echoes as layers that are not there, so fits
//! with the found response and new renderings follow each other.
//!
//! What no capture can tell: the delay of the whole response, which is time zero, and its strength, which is the albedo. The largest
//! peak is put at the path, and the samples sum to one.

use serde::{Deserialize, Serialize};

use super::pulse::{MOVES, Shape};
use crate::Result;
use crate::capture::{Pulse, PulseTaps};
use crate::surface::{HeldOut, mean_and_error};
use thirdbounce_base::quantile::peak_between;

/// Samples before and behind the path, bins.
const REACH: [i64; 2] = [12, 17];
const COUNT: usize = (REACH[0] + REACH[1] + 1) as usize;
/// Weight of the squared second differences over the mean square of what a sample renders.
const SMOOTH: f64 = 1e-3;
/// Parts of the pairs: each is judged by a response of the others.
const PARTS: usize = 8;
/// Pairs at most.
const PAIRS: usize = 128;
/// Sweeps over the samples at most, and the change relative to the largest sample that ends them.
const SWEEPS: usize = 4000;
const SETTLED: f64 = 1e-7;
/// A response is worth fits if it leaves this share of what the best shape leaves of the same pairs, by these standard errors.
const WORTH: [f64; 2] = [0.93, 4.0];
/// Share that is certainly left beyond noise by a sharp surface, from which a response is tried.
pub const LEFT: f64 = 0.03;
/// Fits of a surface and a response by turns at most; they end where one leaves less by a smaller factor.
pub const ROUNDS: usize = 8;
pub const LESS: f64 = 0.97;
/// What linear binning and bins add to the second moment of a response, squared bins ([`Pulse::taps`]).
const OF_BINS: f64 = 1.0 / 6.0;

/// Least height over that of the largest peak of another one: of a first suggestion, as surfaces explain echoes, and of a response that is
/// taken. A response of one peak is left to shapes.
pub const ECHO: [f64; 2] = [0.1, 0.2];

/// A value, or 0 beside the ends.
fn value(values: &[f64], at: Option<usize>) -> f64 {
    at.and_then(|at| values.get(at)).copied().unwrap_or(0.0)
}

/// An impulse response by samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResponseSamples {
    /// Shares of a path's light; their sum is one.
    pub samples: Vec<f64>,
    /// Width of a sample, metres of path.
    pub width: f64,
    /// Leading edge of the first sample, metres behind the path.
    pub start: f64,
}

impl ResponseSamples {
    /// The impulse response.
    pub fn pulse(&self) -> Pulse {
        Pulse::new(self.samples.clone(), self.width, self.start)
    }

    /// Peaks of at least a tenth of the largest one: metres behind the path, and height over that of the largest one.
    pub fn peaks(&self) -> Vec<[f64; 2]> {
        let most = self.samples.iter().fold(0.0f64, |a, b| a.max(*b));
        let at = |i: Option<usize>| value(&self.samples, i);
        let is_peak = |i: &usize| {
            let own = self.samples[*i];
            own >= 0.1 * most && own > at(i.checked_sub(1)) && own >= at(Some(i + 1))
        };
        let of = |i: usize| [self.start + (i as f64 + 0.5) * self.width, self.samples[i] / most];
        (0..self.samples.len()).filter(is_peak).map(of).collect()
    }
}

/// A response on bins: the share `weights[i]` of a path's light falls `i - REACH[0]` bins behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Response(Vec<f64>);

impl Response {
    /// The response as samples of this width, with its paths where the surface has them.
    pub fn samples(&self, bin_width: f64) -> ResponseSamples {
        let at = |i: Option<usize>| value(&self.0, i);
        // Taps take off what bins add: it is added here.
        let blurred = |i: usize| {
            let second = at(i.checked_sub(1)) + at(Some(i + 1)) - 2.0 * self.0[i];
            self.0[i] + 0.5 * OF_BINS * second
        };
        let sum: f64 = self.0.iter().sum();
        ResponseSamples {
            samples: (0..COUNT).map(|i| (blurred(i) / sum).max(0.0)).collect(),
            width: bin_width,
            start: -(REACH[0] as f64 + 0.5) * bin_width,
        }
    }

    /// The same, with the largest peak at the path.
    pub fn at_peak(&self, bin_width: f64) -> ResponseSamples {
        let samples = self.samples(bin_width);
        ResponseSamples { start: samples.start - self.peak() * bin_width, ..samples }
    }

    /// Whether another peak has this height over that of the largest one, with less than half of its own between both. What is behind the
    /// reach gathers in the samples at its ends.
    pub fn has_echo(&self, least: f64) -> bool {
        let most = (1..COUNT - 1).max_by(|a, b| self.0[*a].total_cmp(&self.0[*b])).unwrap_or(1);
        (1..COUNT - 1).any(|at| {
            let between = &self.0[at.min(most)..=at.max(most)];
            let valley = between.iter().fold(f64::INFINITY, |a, b| a.min(*b));
            self.0[at] >= least * self.0[most] && valley < 0.5 * self.0[at]
        })
    }

    /// Bins of the largest peak behind the path.
    fn peak(&self) -> f64 {
        let most = (0..COUNT).max_by(|a, b| self.0[*a].total_cmp(&self.0[*b])).unwrap_or(0);
        let at = |i: Option<usize>| value(&self.0, i);
        let part = peak_between([at(most.checked_sub(1)), self.0[most], at(Some(most + 1))]);
        most as f64 - REACH[0] as f64 + part
    }
}

/// Sums of products of renderings that are late by each lag.
#[derive(Clone)]
struct Equations {
    products: Vec<f64>,
    sides: Vec<f64>,
}

impl Equations {
    fn none() -> Equations {
        Equations { products: vec![0.0; COUNT * COUNT], sides: vec![0.0; COUNT] }
    }

    fn add(&mut self, late: &[&[f64]], measured: &[f64]) {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for i in 0..COUNT {
            self.sides[i] += product(late[i], measured);
            (0..=i).for_each(|j| self.products[i * COUNT + j] += product(late[i], late[j]));
        }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.products[i.max(j) * COUNT + i.min(j)]
    }

    /// The least squares of these without those.
    fn without(&self, those: &Equations) -> Equations {
        let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        Equations { products: less(&self.products, &those.products), sides: less(&self.sides, &those.sides) }
    }

    /// Non-negative samples of the least squares with the prior, one after the other until none changes.
    fn solved(&self) -> Vec<f64> {
        let prior = SMOOTH * (0..COUNT).map(|i| self.at(i, i)).sum::<f64>() / COUNT as f64;
        // Rows of DᵀD of second differences.
        let bend = |i: usize, j: usize| -> f64 {
            let of = |k: usize, i: usize| match i.wrapping_sub(k) {
                0 | 2 => 1.0,
                1 => -2.0,
                _ => 0.0,
            };
            (0..COUNT - 2).map(|k| of(k, i) * of(k, j)).sum()
        };
        let matrix: Vec<f64> = (0..COUNT * COUNT)
            .map(|at| self.at(at / COUNT, at % COUNT) + prior * bend(at / COUNT, at % COUNT))
            .collect();
        let mut x = vec![0.0; COUNT];
        for _ in 0..SWEEPS {
            let mut change = 0.0f64;
            for i in 0..COUNT {
                let row = &matrix[i * COUNT..(i + 1) * COUNT];
                let others: f64 = row.iter().zip(&x).map(|(m, x)| m * x).sum::<f64>() - row[i] * x[i];
                let next = if row[i] > 0.0 { ((self.sides[i] - others) / row[i]).max(0.0) } else { 0.0 };
                change = change.max((next - x[i]).abs());
                x[i] = next;
            }
            if change <= SETTLED * x.iter().fold(0.0f64, |a, b| a.max(*b)) {
                break;
            }
        }
        x
    }

    /// The squares that samples explain with the best factor, and that factor.
    fn explained(&self, x: &[f64]) -> (f64, f64) {
        let cross: f64 = x.iter().zip(&self.sides).map(|(x, s)| x * s).sum();
        let lit = || (0..COUNT).filter(|i| x[*i] != 0.0);
        let own: f64 = lit().map(|i| x[i] * lit().map(|j| self.at(i, j) * x[j]).sum::<f64>()).sum();
        if own > 0.0 { (cross.max(0.0).powi(2) / own, cross.max(0.0) / own) } else { (0.0, 0.0) }
    }
}

/// The response that a rendering with sharp paths suggests. `None` if nothing is rendered.
pub fn suggested(ideal: &HeldOut) -> Option<Response> {
    LateRows::of(ideal).suggested()
}

/// Whether a response with an echo explains clearly more of pairs that it does not see than the best of these shapes does of those that it
/// sees.
///
/// # Errors
/// A shape makes no impulse response.
pub fn is_worth(ideal: &HeldOut, shapes: &[Shape]) -> Result<bool> {
    let rows = LateRows::of(ideal);
    if !rows.suggested().is_some_and(|response| response.has_echo(ECHO[0])) {
        return Ok(false);
    }
    let mut taps = vec![PulseTaps::identity()];
    for shape in shapes {
        taps.extend(shape.centred()?.map(|pulse| pulse.taps(ideal.bin_width())).transpose()?);
    }
    let [shaped, free] = [rows.left_by_best(&taps), rows.left_by_others()];
    let beyond = |left: &[f64]| left.iter().sum::<f64>() - ideal.left().noise * rows.share;
    let [mean, error] = mean_and_error(shaped.iter().zip(&free).map(|(s, f)| s - f));
    Ok(beyond(&free) < WORTH[0] * beyond(&shaped) && mean > WORTH[1] * error)
}

/// Held-out pairs: renderings that are late by each lag, `[lag][pair * bins + bin]`, and measured ones, as the objective weighs them.
struct LateRows {
    late: Vec<Vec<f64>>,
    measured: Vec<f64>,
    bins: usize,
    /// Share of the held-out pairs.
    share: f64,
}

impl LateRows {
    fn of(ideal: &HeldOut) -> LateRows {
        let step = ideal.pairs.len().div_ceil(PAIRS).max(1);
        let (late, measured) = ideal.late(-REACH[0]..=REACH[1], step);
        let bins = ideal.bins();
        let share = (measured.len() / bins) as f64 / ideal.pairs.len().max(1) as f64;
        LateRows { late, measured, bins, share }
    }

    fn pairs(&self) -> usize {
        self.measured.len() / self.bins
    }

    fn equations(&self, pairs: impl Iterator<Item = usize>) -> Equations {
        let mut sums = Equations::none();
        for pair in pairs {
            let row = pair * self.bins..(pair + 1) * self.bins;
            let late: Vec<&[f64]> = self.late.iter().map(|rows| &rows[row.clone()]).collect();
            sums.add(&late, &self.measured[row]);
        }
        sums
    }

    fn suggested(&self) -> Option<Response> {
        let x = self.equations(0..self.pairs()).solved();
        x.iter().any(|x| *x > 0.0).then_some(Response(x))
    }

    /// Squares that samples leave of a pair.
    fn left(&self, x: &[f64], pair: usize) -> f64 {
        let mut rest = self.measured[pair * self.bins..(pair + 1) * self.bins].to_vec();
        for (late, x) in self.late.iter().zip(x).filter(|(_, x)| **x != 0.0) {
            let late = &late[pair * self.bins..(pair + 1) * self.bins];
            rest.iter_mut().zip(late).for_each(|(rest, late)| *rest -= x * late);
        }
        rest.iter().map(|v| v * v).sum()
    }

    /// Squares that are left of each pair by the response of the other parts.
    fn left_by_others(&self) -> Vec<f64> {
        let parts: Vec<Equations> =
            (0..PARTS).map(|part| self.equations((part..self.pairs()).step_by(PARTS))).collect();
        let mut all = Equations::none();
        for part in &parts {
            all.products.iter_mut().zip(&part.products).for_each(|(a, p)| *a += p);
            all.sides.iter_mut().zip(&part.sides).for_each(|(a, p)| *a += p);
        }
        let of_others: Vec<Vec<f64>> = parts.iter().map(|part| all.without(part).solved()).collect();
        (0..self.pairs()).map(|pair| self.left(&of_others[pair % PARTS], pair)).collect()
    }

    /// Squares that are left of each pair by the best of these responses with the best move and factor.
    fn left_by_best(&self, taps: &[PulseTaps]) -> Vec<f64> {
        let all = self.equations(0..self.pairs());
        let moved = |taps: &PulseTaps, by: i64| -> Vec<f64> {
            let of = |lag: i64| usize::try_from(lag + taps.before as i64 - by).ok();
            let weight = |lag: i64| of(lag).and_then(|at| taps.weights.get(at)).copied().unwrap_or(0.0);
            (-REACH[0]..=REACH[1]).map(weight).collect()
        };
        let each = taps.iter().flat_map(|taps| (-MOVES..=MOVES).map(move |by| (taps, by)));
        let suited = each.map(|(taps, by)| {
            let x = moved(taps, by);
            (all.explained(&x), x)
        });
        let best = suited.max_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let best: Vec<f64> =
            best.map_or_else(Vec::new, |((_, factor), x)| x.into_iter().map(|x| factor * x).collect());
        (0..self.pairs()).map(|pair| self.left(&best, pair)).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64;

    use super::*;

    const BINS: usize = 90;

    /// 64 rows of three lines, their measurement by a response of these lags and shares, and noise.
    fn rows(truth: &[(i64, f64)], noise: f64) -> LateRows {
        let sharp = |pair: usize, bin: i64| -> f64 {
            let lines =
                [(25 + pair as i64 % 13, 1.0), (37 + pair as i64 % 7, 0.5), (55 - pair as i64 % 11, 0.8)];
            lines.iter().filter(|line| line.0 == bin).map(|line| line.1).sum()
        };
        let all = |of: &dyn Fn(usize, i64) -> f64| -> Vec<f64> {
            (0..64 * BINS).map(|at| of(at / BINS, (at % BINS) as i64)).collect()
        };
        let mut random = Pcg64::seed_from_u64(7);
        let normal = Normal::new(0.0, noise).unwrap();
        let mut measured =
            all(&|pair, bin| truth.iter().map(|(lag, share)| share * sharp(pair, bin - lag)).sum());
        measured.iter_mut().for_each(|v| *v += normal.sample(&mut random));
        let late = (-REACH[0]..=REACH[1]).map(|lag| all(&|pair, bin| sharp(pair, bin - lag))).collect();
        LateRows { late, measured, bins: BINS, share: 1.0 }
    }

    const ECHOES: [(i64, f64); 4] = [(0, 0.5), (1, 0.3), (5, 0.15), (-10, 0.05)];

    #[test]
    fn a_response_is_found_with_and_without_noise() {
        for (noise, tolerance) in [(0.0, 0.01), (0.03, 0.02)] {
            let Response(found) = rows(&ECHOES, noise).suggested().unwrap();
            for (at, found) in found.iter().enumerate() {
                let lag = at as i64 - REACH[0];
                let truth = ECHOES.iter().find(|echo| echo.0 == lag).map_or(0.0, |echo| echo.1);
                assert!((found - truth).abs() < tolerance, "lag {lag}: {found} {truth}");
            }
        }
    }

    /// The conditions of Karush, Kuhn and Tucker are those of the least alone.
    #[test]
    fn samples_are_the_least_squares_that_are_not_negative() {
        let rows = rows(&ECHOES, 0.1);
        let equations = rows.equations(0..64);
        let x = equations.solved();
        let cost = |x: &[f64]| -> f64 {
            let prior = SMOOTH * (0..COUNT).map(|i| equations.at(i, i)).sum::<f64>() / COUNT as f64;
            let squares: f64 = (0..64).map(|pair| rows.left(x, pair)).sum();
            squares + prior * x.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2)).sum::<f64>()
        };
        let mut bounded = 0;
        for i in 0..COUNT {
            let slope = [-1e-4, 1e-4].map(|step| {
                let mut there = x.clone();
                there[i] += step;
                cost(&there)
            });
            let slope = (slope[1] - slope[0]) / 2e-4 / equations.at(i, i);
            if x[i] > 0.0 {
                assert!(slope.abs() < 1e-4, "{i}: {slope}");
            } else {
                bounded += 1;
                assert!(slope > -1e-4, "{i}: {slope}");
            }
        }
        assert!((1..COUNT).contains(&bounded), "{bounded}");
    }

    #[test]
    fn a_shape_explains_a_shape_and_no_echo() {
        let shapes: Vec<PulseTaps> = [1.5, 2.0, 3.0, 4.0, 6.0]
            .into_iter()
            .map(|fwhm| Shape::of(fwhm, 0.0).centred().unwrap().unwrap().taps(1.0).unwrap())
            .collect();
        let PulseTaps { before, weights } = &shapes[2];
        let gaussian: Vec<(i64, f64)> =
            weights.iter().enumerate().map(|(i, w)| (i as i64 - *before as i64, *w)).collect();
        let ratio = |truth: &[(i64, f64)]| {
            let rows = rows(truth, 0.01);
            let [free, shaped] =
                [rows.left_by_others(), rows.left_by_best(&shapes)].map(|left| left.iter().sum::<f64>());
            free / shaped
        };
        assert!(ratio(&gaussian) > 0.95 && ratio(&ECHOES) < 0.2, "{} {}", ratio(&gaussian), ratio(&ECHOES));
    }

    #[test]
    fn the_largest_peak_is_at_the_path_and_taps_are_the_response() {
        let mut weights = vec![0.0; COUNT];
        [(14, 0.3), (15, 0.6), (16, 0.3), (22, 0.2)].into_iter().for_each(|(at, w)| weights[at] = w);
        let response = Response(weights.clone());
        assert!((response.peak() - 3.0).abs() < 1e-9);
        let samples = response.at_peak(0.01);
        let peaks = samples.peaks();
        assert!(
            peaks.len() == 2 && peaks[0][0].abs() < 1e-9 && (peaks[1][0] - 0.07).abs() < 1e-9,
            "{peaks:?}"
        );
        let taps = response.samples(0.01).pulse().taps(0.01).unwrap();
        for (at, weight) in taps.weights.iter().enumerate() {
            let truth = weights[at + REACH[0] as usize - taps.before] / 1.4;
            assert!((weight - truth).abs() < 0.02, "{at}: {weight} {truth}");
        }
    }

    #[test]
    fn an_echo_is_a_peak_of_its_own_within_the_reach() {
        let has_echo = |of: &[(usize, f64)]| {
            let mut weights = vec![0.0; COUNT];
            of.iter().for_each(|(at, weight)| weights[*at] = *weight);
            Response(weights).has_echo(ECHO[1])
        };
        assert!(has_echo(&[(12, 1.0), (17, 0.3)]) && has_echo(&[(2, 0.3), (12, 1.0)]));
        assert!(!has_echo(&[(12, 1.0), (17, 0.15)]), "a low one");
        assert!(!has_echo(&[(12, 1.0), (13, 0.7), (14, 0.5), (15, 0.35), (16, 0.25)]), "a tail");
        assert!(!has_echo(&[(12, 1.0), (COUNT - 1, 0.4)]), "behind the reach");
    }
}
