//! The empty room: counts of the same pairs and bins without the object, their gain, and their subtraction.
//!
//! Counts of the capture are those of the object and g(pair) times those of the empty room. The power of a laser drifts by some per
//! cent between both, and changes slowly over a scan: g is a polynomial of low degree in the wall points, fitted where the object
//! sends little light.

use glam::DVec3;
use rayon::prelude::*;
use thirdbounce_base::equations::solve_symmetric;

use super::choose::scan_of;
use super::low_rank::low_rank;
use crate::data::Capture;
use crate::error::{Error, Result};

/// Largest difference of wall points of both captures, as a share of the wall.
const SAME_POINT: f64 = 1e-3;
/// Largest difference of both bin widths, as a share, and of both starts, in bins.
const SAME_WIDTH: f64 = 1e-4;
const SAME_START: f64 = 0.02;
/// Least share of the pairs that the empty capture has to hold.
const LEAST_PAIRS: f64 = 0.9;
/// Pairs of the empty capture that are looked through for the next pair of the capture.
const AHEAD: usize = 4096;

/// Most cells of the wall along each coordinate that varies, and least and most windows of time: counts are summed over both for the fit.
/// With fewer photons there are fewer cells.
const CELLS: usize = 8;
const WINDOWS: [f64; 2] = [8.0, 64.0];
const WINDOWS_FOR_CELLS: f64 = 32.0;
/// Photons of the empty room in such a block: at least, and in the mean.
const LEAST_COUNTS: f64 = 10.0;
const MEAN_COUNTS: f64 = 400.0;
/// Width in which the densest ratios of counts are looked for: of their logarithm.
const DENSEST: f64 = 0.04;
/// Error of a smooth gain in a block, as a share.
const SMOOTH: f64 = 0.01;
/// Standard deviation of the gain's terms but the first, as a share: what is expected of drifts.
const DRIFT: f64 = 0.05;
/// Degree of the gain in the coordinates of a wall point.
const DEGREE: u32 = 3;
/// Iterations of the fit; residuals beyond the last of these standard errors are the object's.
const ITERATIONS: usize = 30;
const OUTLIERS: [f64; 2] = [8.0, 3.0];

/// The gain of the empty room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomGain {
    /// That of each pair: counts in the capture for one count of the empty room.
    pub of_pair: Vec<f64>,
    /// Share of the capture's counts that is the room's.
    pub share: f64,
    /// How far the squares of what is left are above those of noise, in standard deviations of these.
    pub evidence: f64,
}

/// What of an empty room serves all captures of its scan.
#[derive(Debug, Clone)]
pub struct RoomLight {
    basis: GainBasis,
    /// The counts with less noise, and the share of it that remains ([`low_rank`]); `None`: as they are.
    smooth: Option<(Vec<f32>, f64)>,
    /// Variance of a bin per count.
    per_count: f64,
}

impl RoomLight {
    /// Takes the variance of a bin of the empty room per count.
    #[doc(hidden)]
    pub fn set_variance(&mut self, per_count: f64) {
        self.per_count = per_count.max(f64::MIN_POSITIVE);
    }
}

#[doc(hidden)]
impl Capture {
    /// The capture of the empty room: its counts in the place of the capture's.
    pub fn emptied(&self) -> Capture {
        let mut room = self.outline();
        room.histograms = self.empty.clone().unwrap_or_default();
        room
    }

    /// What of the empty room serves all captures of the scan; `per_count`: variance of a bin of the room per count. `None` without an
    /// empty room.
    pub fn room_light(&self, per_count: f64) -> Option<RoomLight> {
        let smooth = low_rank(self.empty.as_ref()?, self.bins, per_count);
        Some(RoomLight { basis: GainBasis::of(self), smooth, per_count })
    }

    /// As [`Capture::room_light`] of an empty room that is the mean of many frames: its counts are used as they are. The scan has no counts
    /// of it yet.
    pub fn room_light_of_mean(&self) -> RoomLight {
        RoomLight { basis: GainBasis::of(self), smooth: None, per_count: f64::MIN_POSITIVE }
    }

    /// The gain by which the empty room is part of the capture. `per_count`: variance of a bin of the capture per count. `None` without an
    /// empty room, or if no gain fits.
    pub fn room_gain(&self, light: &RoomLight, per_count: f64) -> Option<RoomGain> {
        let (empty, basis) = (self.empty.as_ref()?, &light.basis);
        let blocks = CountBlocks::of(self, empty, basis, [per_count, light.per_count]);
        let coefficients = blocks.fit()?;
        let of_pair: Vec<f64> =
            (0..self.pair_count()).map(|pair| basis.at(pair, &coefficients).max(0.0)).collect();
        let rows = empty.chunks_exact(self.bins).zip(&of_pair);
        let room: f64 = rows.map(|(row, gain)| gain * row.iter().map(|v| f64::from(*v)).sum::<f64>()).sum();
        let all: f64 = self.histograms.iter().map(|v| f64::from(*v)).sum();
        let share = if all > 0.0 { room / all } else { 0.0 };
        Some(RoomGain { of_pair, share, evidence: blocks.evidence(&coefficients) })
    }

    /// The capture less the empty room with little of its noise. `per_count` as for [`Capture::room_gain`]; the noise of both is that of a
    /// bin without light ([`Capture::noise`]), in the mean over all.
    pub fn without_room(&self, light: &RoomLight, gain: &RoomGain, per_count: f64) -> Capture {
        let mut left = self.outline();
        let Some(empty) = &self.empty else { return self.clone() };
        left.histograms = self.histograms.clone();
        let (room, noise) = light.smooth.as_ref().map_or((empty, 1.0), |(room, noise)| (room, *noise));
        let rows = left.histograms.par_chunks_mut(self.bins.max(1)).zip(room.par_chunks(self.bins.max(1)));
        let variances: Vec<f64> = rows
            .zip(&gain.of_pair)
            .map(|((row, room), gain)| {
                let mut sum = 0.0;
                for (count, room) in row.iter_mut().zip(room) {
                    let light_of_room = gain * f64::from(*room);
                    sum += per_count * light_of_room + noise * light.per_count * gain * light_of_room;
                    *count = (f64::from(*count) - light_of_room) as f32;
                }
                sum
            })
            .collect();
        let floor = variances.iter().sum::<f64>() / self.histograms.len().max(1) as f64;
        (left.noise, left.integer_counts) = (Some([per_count, floor]), false);
        left
    }
}

impl Capture {
    /// Takes the counts of `room`, a capture of the same scan without the object: preparing and reconstructing this capture then use
    /// them where held-out pairs prove them. Pairs that the room does not hold are left out. Returns notes.
    ///
    /// # Errors
    /// `Kind::Input`: another scan, other bins, counts that are not finite, or no count at all.
    pub fn set_empty(&mut self, room: &Capture) -> Result<Vec<String>> {
        let wrong = |what: String, hint: &'static str| Err(Error::input(what, hint));
        if room.bins != self.bins || (room.bin_width / self.bin_width - 1.0).abs() > SAME_WIDTH {
            return wrong(
                format!(
                    "the empty capture has {} bins of {:.4} mm, the capture {} of {:.4} mm",
                    room.bins,
                    1e3 * room.bin_width,
                    self.bins,
                    1e3 * self.bin_width
                ),
                "measure and export both with the same bins",
            );
        }
        if (room.t_start - self.t_start).abs() > SAME_START * self.bin_width {
            return wrong(
                format!(
                    "the first bin of the empty capture begins at {:.4} m, that of the capture at {:.4} m",
                    room.t_start, self.t_start
                ),
                "export both with the same time zero",
            );
        }
        if room.histograms.len() != room.pair_count() * room.bins
            || self.histograms.len() != self.pair_count() * self.bins
        {
            return wrong(
                format!(
                    "{} counts for {} pairs of {} bins",
                    room.histograms.len(),
                    room.pair_count(),
                    room.bins
                ),
                "give pairs x bins counts, bin by bin within a pair",
            );
        }
        if room.histograms.iter().any(|v| !v.is_finite()) {
            return wrong("the empty capture has counts that are not finite".into(), "leave such pairs out");
        }
        if room.histograms.iter().all(|v| *v == 0.0) {
            return wrong(
                "the empty capture has no count: there is nothing to subtract".into(),
                "leave it out, or check its file",
            );
        }
        let mut room = room.clone();
        let mut notes = vec![];
        notes.extend(room.take_pile_up_out()?.map(|note| format!("in the empty capture, {note}")));
        let saturated = [(&*self, "the capture"), (&room, "the empty capture")];
        notes.extend(saturated.into_iter().filter_map(|(capture, name)| capture.saturated_note(name)));
        let found = self.pairs_in(&room)?;
        let kept: Vec<usize> = (0..found.len()).filter(|pair| found[*pair].is_some()).collect();
        let of_kept: Vec<usize> = found.iter().flatten().copied().collect();
        let counts = room.histograms_of(&of_kept);
        if kept.len() < found.len() {
            notes.push(format!(
                "{} pairs that the empty capture does not hold are left out",
                found.len() - kept.len()
            ));
            *self = self.keep(&kept, scan_of(&kept, self));
        }
        self.empty = Some(counts);
        Ok(notes)
    }

    /// For each pair, the pair of `other` at the same points. Both lists have the same order.
    fn pairs_in(&self, other: &Capture) -> Result<Vec<Option<usize>>> {
        let points = || self.laser.iter().chain(&self.sensor).filter(|p| p.is_finite());
        let low = points().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = points().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let near = SAME_POINT * (high - low).length().max(1e-6);
        let is_same = |a: usize, b: usize| {
            self.laser[a].distance(other.laser[b]) <= near && self.sensor[a].distance(other.sensor[b]) <= near
        };
        let mut next = 0;
        let found: Vec<Option<usize>> = (0..self.pair_count())
            .map(|pair| {
                let at = (next..other.pair_count().min(next + AHEAD)).find(|at| is_same(pair, *at))?;
                next = at + 1;
                Some(at)
            })
            .collect();
        let held = found.iter().flatten().count();
        if (held as f64) < LEAST_PAIRS * self.pair_count() as f64 {
            let pair = found.iter().position(Option::is_none).unwrap_or(0);
            let [laser, sensor] = [self.laser[pair], self.sensor[pair]];
            return Err(Error::input(
                format!(
                    "the empty capture is of another scan: it holds {held} of the {} pairs of the capture, of {} pairs in all; pair {pair} \
                     (laser {laser:.3}, sensor {sensor:.3}) is not among them",
                    self.pair_count(),
                    other.pair_count()
                ),
                "give a capture of the same wall points in the same order",
            ));
        }
        Ok(found)
    }

    /// What to tell about counts that end at the largest number, and in which bins.
    fn saturated_note(&self, name: &str) -> Option<String> {
        let note = self.clipped_note()?;
        let most = self.histograms.iter().copied().fold(0.0, f32::max);
        let full = |row: &[f32], bin: usize| row[bin] == most;
        let is_full: Vec<bool> = (0..self.bins)
            .map(|bin| self.histograms.chunks_exact(self.bins).any(|row| full(row, bin)))
            .collect();
        let [first, last] = [is_full.iter().position(|f| *f)?, is_full.iter().rposition(|f| *f)?];
        Some(format!("{name} is saturated in bins {first} to {last}, where the difference is wrong: {note}"))
    }
}

/// Polynomials in the wall points, for each pair.
#[derive(Debug, Clone)]
struct GainBasis {
    /// `[pair][term]`; the first is 1.
    terms: Vec<Vec<f64>>,
    /// The coordinates that vary, from 0 to 1, `[pair][coordinate]`.
    places: Vec<Vec<f64>>,
}

impl GainBasis {
    fn of(capture: &Capture) -> GainBasis {
        let pairs = capture.pair_count();
        let (mut terms, mut places) = (vec![vec![1.0]; pairs], vec![vec![]; pairs]); // bounded: the pairs
        let is_confocal = capture.laser == capture.sensor;
        let sides = [&capture.laser, &capture.sensor];
        for points in sides.into_iter().take(if is_confocal { 1 } else { 2 }) {
            let low = points.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
            let high = points.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
            let (middle, half) = (low.midpoint(high), 0.5 * (high - low).truncate().max_element());
            let axes: Vec<usize> =
                (0..2).filter(|axis| high[*axis] - low[*axis] > 1e-6 * half.max(1e-9)).collect();
            for (pair, point) in points.iter().enumerate() {
                let at: Vec<f64> = axes.iter().map(|axis| (point[*axis] - middle[*axis]) / half).collect();
                let powers = (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| [i, j]));
                let is_new = |p: &[u32; 2]| !at.is_empty() && p[0] + p[1] > 0 && (at.len() == 2 || p[1] == 0);
                let of = |p: [u32; 2]| at.iter().zip(p).map(|(v, p)| v.powi(p as i32)).product::<f64>();
                terms[pair].extend(powers.filter(is_new).map(of));
                let place = |axis: &usize| (point[*axis] - low[*axis]) / (high[*axis] - low[*axis]);
                places[pair].extend(axes.iter().map(place));
            }
        }
        GainBasis { terms, places }
    }

    fn at(&self, pair: usize, coefficients: &[f64]) -> f64 {
        sum_of(&self.terms[pair], coefficients)
    }
}

/// The gain by terms and their coefficients.
fn sum_of(terms: &[f64], coefficients: &[f64]) -> f64 {
    terms.iter().zip(coefficients).map(|(term, c)| term * c).sum()
}

/// Counts of capture and empty room, summed over cells of the wall and windows of time.
struct CountBlocks {
    /// Mean of the basis over the pairs of each cell.
    terms: Vec<Vec<f64>>,
    /// Cell, counts of the capture, and counts of the empty room.
    counts: Vec<(usize, f64, f64)>,
    /// The same with too few counts of the empty room for a gain.
    dark: Vec<(usize, f64, f64)>,
    /// Variance per count of both.
    per_count: [f64; 2],
}

impl CountBlocks {
    fn of(capture: &Capture, empty: &[f32], basis: &GainBasis, per_count: [f64; 2]) -> CountBlocks {
        let varies = basis.places.first().map_or(0, Vec::len);
        let photons = empty.iter().map(|v| f64::from(*v)).sum::<f64>() / per_count[1].max(f64::MIN_POSITIVE);
        let most = (photons / MEAN_COUNTS).max(WINDOWS[0]);
        let cells_of = |side: usize| (side as f64).powi(varies as i32);
        let side = (1..=CELLS).rev().find(|side| cells_of(*side) * WINDOWS_FOR_CELLS <= most).unwrap_or(1);
        let cell_of = |place: &Vec<f64>| {
            place.iter().fold(0, |cell, at| cell * side + ((at * side as f64) as usize).min(side - 1))
        };
        let cells: Vec<usize> = basis.places.iter().map(cell_of).collect();
        let count = side.pow(varies as u32);
        let width = capture.bins.div_ceil((most / cells_of(side)).clamp(WINDOWS[0], WINDOWS[1]) as usize);
        let windows = capture.bins.div_ceil(width);
        let mut sums = vec![[0.0f64; 2]; count * windows];
        let mut terms = vec![vec![0.0; basis.terms.first().map_or(1, Vec::len)]; count];
        let mut pairs = vec![0usize; count];
        for (pair, cell) in cells.iter().enumerate() {
            pairs[*cell] += 1;
            terms[*cell].iter_mut().zip(&basis.terms[pair]).for_each(|(sum, term)| *sum += term);
            for (side, counts) in [&capture.histograms[..], empty].into_iter().enumerate() {
                let row = &counts[pair * capture.bins..(pair + 1) * capture.bins];
                for (window, part) in row.chunks(width).enumerate() {
                    sums[cell * windows + window][side] += part.iter().map(|v| f64::from(*v)).sum::<f64>();
                }
            }
        }
        for (terms, pairs) in terms.iter_mut().zip(&pairs) {
            terms.iter_mut().for_each(|term| *term /= (*pairs).max(1) as f64);
        }
        let blocks = sums.into_iter().enumerate().map(|(at, [count, room])| (at / windows, count, room));
        let (counts, dark) = blocks.partition(|(_, _, room)| *room > LEAST_COUNTS * per_count[1]);
        CountBlocks { terms, counts, dark, per_count }
    }

    /// Coefficients of the gain by reweighted least squares from the densest ratio of both counts. Light of the object lies above, and
    /// what it shades below.
    fn fit(&self) -> Option<Vec<f64>> {
        let count = self.terms.first()?.len();
        let start = self.densest()?;
        let mut coefficients = vec![0.0; count];
        coefficients[0] = start;
        for iteration in 0..ITERATIONS {
            let done = iteration as f64 / (ITERATIONS / 2) as f64;
            let limit = OUTLIERS[1] + (OUTLIERS[0] - OUTLIERS[1]) * (1.0 - done).max(0.0);
            let mut matrix = vec![vec![0.0; count]; count];
            let mut right = vec![0.0; count];
            let drift = (DRIFT * start).powi(-2);
            (1..count).for_each(|i| matrix[i][i] = drift);
            for (cell, n, e) in &self.counts {
                let terms = &self.terms[*cell];
                let gain = sum_of(terms, &coefficients);
                let room = gain.max(0.0) * e;
                let variance = self.variance(room, gain * gain * e);
                let off = (n - gain * e) / variance.sqrt();
                if off.abs() >= limit {
                    continue;
                }
                let weight = (1.0 - (off / limit).powi(2)).powi(2) / variance;
                for i in 0..count {
                    right[i] += weight * terms[i] * e * n;
                    (0..count).for_each(|j| matrix[i][j] += weight * terms[i] * terms[j] * e * e);
                }
            }
            if !solve_symmetric(&mut matrix, &mut right, 0.0) || right.iter().any(|v| !v.is_finite()) {
                return None;
            }
            coefficients = right;
        }
        Some(coefficients)
    }

    /// How far the squares of what a gain leaves are above those of noise, in standard deviations of these.
    fn evidence(&self, coefficients: &[f64]) -> f64 {
        let [own, empty] = self.per_count;
        let (mut above, mut variance) = (0.0, 0.0);
        for (cell, n, e) in self.counts.iter().chain(&self.dark) {
            let gain = sum_of(&self.terms[*cell], coefficients).max(0.0);
            // A block of the empty room may have a count more.
            let (room, scaled) = (gain * (e + empty), gain * gain * (e + empty));
            let expected = own * room + empty * scaled + (SMOOTH * room).powi(2);
            let weight = self.variance(room, scaled).recip();
            above += weight * ((n - gain * e).powi(2) - expected);
            // That of a squared Poisson number.
            variance += weight * weight * (2.0 * expected * expected + own.powi(3) * room);
        }
        above / variance.sqrt().max(f64::MIN_POSITIVE)
    }

    /// The variance of a block's difference, with that of photons and of a smooth gain.
    fn variance(&self, room: f64, scaled: f64) -> f64 {
        let [own, empty] = self.per_count;
        let photons = own * room.max(own) + empty * scaled;
        (photons + (SMOOTH * room).powi(2)).max(f64::MIN_POSITIVE)
    }

    /// The ratio of counts with the most information beside it: what a block says of a gain, not what it says of its own ratio, which
    /// grows without limit as that falls to zero.
    fn densest(&self) -> Option<f64> {
        let all = |of: fn(&(usize, f64, f64)) -> f64| self.counts.iter().map(of).sum::<f64>();
        let usual = all(|(_, n, _)| *n) / all(|(_, _, e)| *e);
        let mut ratios: Vec<[f64; 2]> = self
            .counts
            .iter()
            .filter(|(_, n, _)| *n > 0.0)
            .map(|(_, n, e)| [n / e, e * e / self.variance(usual * e, usual * usual * e)])
            .collect();
        ratios.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let (mut to, mut weight, mut best) = (0, 0.0, (0.0, None));
        for from in 0..ratios.len() {
            while to < ratios.len() && ratios[to][0] <= ratios[from][0] * (1.0 + DENSEST) {
                weight += ratios[to][1];
                to += 1;
            }
            if weight > best.0 {
                let sum: f64 = ratios[from..to].iter().map(|[ratio, weight]| ratio * weight).sum();
                best = (weight, Some(sum / weight));
            }
            weight -= ratios[from][1];
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    const SIDE: usize = 16;
    const BINS: usize = 100;

    fn wall() -> Vec<DVec3> {
        let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
        (0..SIDE * SIDE).map(|i| DVec3::new(at(i / SIDE), at(i % SIDE), 0.0)).collect()
    }

    /// Counts of means by pair and bin.
    fn counted(mean: impl Fn(usize, usize) -> f64, seed: u64) -> Capture {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut draw = |i: usize| match Poisson::new(mean(i / BINS, i % BINS)) {
            Ok(counts) => counts.sample(&mut random) as f32,
            Err(_) => 0.0,
        };
        let histograms = (0..SIDE * SIDE * BINS).map(&mut draw).collect();
        let mut made = Capture::new([SIDE, SIDE], wall(), wall(), BINS, 0.02, histograms);
        made.integer_counts = true;
        made
    }

    /// A room that fades, and a gain of 3 % less power that changes by 5 % over the wall.
    fn room(pair: usize, bin: usize) -> f64 {
        if bin < 20 { 0.0 } else { (240.0 + 80.0 * wall()[pair].y) * (-(bin as f64 - 20.0) / 25.0).exp() }
    }

    fn gain(at: DVec3) -> f64 {
        0.97 * (1.0 + 0.05 * (2.0 * at.x - at.y).sin())
    }

    fn object(pair: usize, bin: usize) -> f64 {
        let path = 40.0 + 20.0 * wall()[pair].x;
        320.0 * (-((bin as f64 - path) / 4.0).powi(2)).exp()
    }

    fn both() -> Capture {
        let gains: Vec<f64> = wall().into_iter().map(gain).collect();
        let rooms: Vec<f64> = (0..SIDE * SIDE * BINS).map(|i| room(i / BINS, i % BINS)).collect();
        let mut capture = counted(|pair, bin| object(pair, bin) + gains[pair] * rooms[pair * BINS + bin], 1);
        assert!(capture.set_empty(&counted(|pair, bin| rooms[pair * BINS + bin], 2)).unwrap().is_empty());
        capture
    }

    #[test]
    fn the_gain_is_that_of_the_room_beside_the_light_of_an_object() {
        let capture = both();
        let light = capture.room_light(1.0).unwrap();
        let found = capture.room_gain(&light, 1.0).unwrap();
        let off =
            found.of_pair.iter().zip(wall()).map(|(found, at)| (found / gain(at) - 1.0).powi(2)).sum::<f64>();
        let off = (off / (SIDE * SIDE) as f64).sqrt();
        assert!(off < 0.01, "{off}");
        let left = capture.without_room(&light, &found, 1.0);
        // What is left is the object, with the noise that it says.
        let [per_count, floor] = left.noise.unwrap();
        let squares = |i: usize| {
            let mean = object(i / BINS, i % BINS);
            ((f64::from(left.histograms[i]) - mean).powi(2), per_count * mean + floor)
        };
        let (square, said) =
            (0..left.histograms.len()).map(squares).fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
        assert!((square / said - 1.0).abs() < 0.05, "{square} {said}");
        assert!(!left.integer_counts && left.empty.is_none());
        // A plain difference leaves light of the room.
        let mean = |capture: &Capture, gain: f64| {
            let of = |i: usize| {
                f64::from(capture.histograms[i]) - gain * f64::from(capture.empty.as_ref().unwrap()[i])
            };
            (0..BINS)
                .filter(|bin| (20..24).contains(bin))
                .flat_map(|bin| (0..SIDE * SIDE).map(move |p| p * BINS + bin))
                .map(of)
                .sum::<f64>()
                / (4 * SIDE * SIDE) as f64
        };
        assert!(mean(&capture, 1.0) < -4.0 && mean(&capture, 0.97).abs() < 2.0);
    }

    #[test]
    fn the_empty_room_follows_pairs_bins_and_gates() {
        let capture = both();
        let all = |c: &Capture| c.empty.as_ref().unwrap().iter().map(|v| f64::from(*v)).sum::<f64>();
        let summed = capture.binned(3).unwrap();
        assert_eq!((all(&summed), summed.bins), (all(&capture), 34));
        assert_eq!(all(&capture.summed(2).unwrap()), all(&capture));
        let mut gated = capture.clone();
        gated.set_gate(crate::Gate::parse("0.4:1.0").unwrap()).unwrap();
        assert_eq!(gated.empty, capture.gated(crate::Gate::parse("0.4:1.0").unwrap()).unwrap().empty);
        assert_eq!(gated.empty.as_ref().map(Vec::len), Some(gated.histograms.len()));
        assert_eq!(
            gated.empty.as_ref().unwrap()[..gated.bins],
            capture.empty.as_ref().unwrap()[20..20 + gated.bins]
        );
        let some = capture.keep(&[7, 3], [2, 1]);
        assert_eq!(some.empty.unwrap()[..BINS], capture.empty.as_ref().unwrap()[7 * BINS..8 * BINS]);
    }

    #[test]
    fn an_empty_capture_without_a_count_is_refused() {
        let (mut capture, before) = (both(), both());
        let mut room = capture.emptied();
        room.histograms.fill(0.0);
        let error = capture.set_empty(&room).unwrap_err();
        assert!(error.what.contains("the empty capture has no count"), "{error}");
        assert!(capture == before, "a refused one changes nothing");
    }

    #[test]
    fn saturated_bins_of_either_are_named() {
        let mut capture = both();
        let mut room = capture.emptied();
        room.histograms.iter_mut().for_each(|v| *v = v.min(120.0));
        let notes = capture.set_empty(&room).unwrap();
        assert!(
            notes.len() == 1 && notes[0].starts_with("the empty capture is saturated in bins 20 to "),
            "{notes:?}"
        );
    }
}
