//! The bins that an instrument recorded. Gated detectors open and close behind the laser pulse, and files hold zeros for the
//! time when they were closed. These zeros say nothing of the scene: taken as measured, they are light that ends at once.

use super::gate::{AutoGate, Gate};
use super::mean::MeanOnce;
use crate::data::Capture;
use crate::data::scan::decimals;

/// Fewer pairs and fewer bins tell no gate from chance.
const LEAST_PAIRS: usize = 16;
const LEAST_BINS: usize = 32;

/// The ends of nearly all pairs must lie within this share of the bins, and the rest does not count.
const TOGETHER: f64 = 0.04;
const REST: f64 = 0.03;

/// Counts beside an end must be at least this share of those of the strongest bin: what ends by itself fades.
const LEVEL: f64 = 0.01;

/// Bins beside an end whose counts are compared.
const BESIDE: usize = 8;

/// A detector that opens shows its light at once. A pulse of light rises: its first bins hold less than this share of the next
/// ones.
const AT_ONCE: f64 = 0.5;

/// Counts of neighbours where a pair has none that mark it as not recorded: by chance once in e^16 pairs.
const LACKS: f32 = 16.0;

/// The first and the last bin with counts, of every pair that has any: sorted.
fn ends(capture: &Capture) -> [Vec<usize>; 2] {
    let lit = |h: &[f32]| Some([h.iter().position(|v| *v != 0.0)?, h.iter().rposition(|v| *v != 0.0)?]);
    let pairs = capture.of_rows(lit);
    let mut ends = [0, 1].map(|end| pairs.iter().flatten().map(|ends| ends[end]).collect::<Vec<_>>());
    ends.iter_mut().for_each(|of| of.sort_unstable());
    ends
}

/// Looks for a gate of the instrument: after a bin that is nearly the same for all pairs there are zeros only, although the
/// light has not faded. Where it closes so, it may also open so. Returns the paths that nearly all pairs recorded, or
/// `None` if nothing shows a gate. Whole counts of pairs that were not recorded, or not as long as the others, become the
/// mean of their neighbours in the scan first; the number is how many.
pub fn recorded_gate(capture: &mut Capture) -> Option<(AutoGate, usize)> {
    gate(capture, &mut MeanOnce::default())
}

/// [`recorded_gate`] with the mean histogram.
pub(super) fn gate(capture: &mut Capture, mean: &mut MeanOnce) -> Option<(AutoGate, usize)> {
    let bins = capture.bins;
    let [_, last] = ends(capture);
    if last.len() < LEAST_PAIRS || bins < LEAST_BINS {
        return None;
    }
    let rest = (REST * last.len() as f64) as usize;
    let near = (TOGETHER * bins as f64).max(4.0) as usize;
    let (closes, latest) = (last[rest] + 1, last[last.len() - 1] + 1);
    if latest == bins
        || latest - closes > near
        || !is_light(mean.of(capture), closes.saturating_sub(BESIDE), closes)
    {
        return None;
    }
    let filled = capture.fill_unrecorded();
    if filled > 0 {
        mean.changed();
    }
    let [first, _] = ends(capture);
    let (opens, earliest) = (first[first.len() - 1 - rest], first[0]);
    let opened = earliest > 0
        && opens - earliest <= near
        && is_light(mean.of(capture), opens, (opens + BESIDE).min(bins))
        && opens_at_once(capture);
    let from = if opened { capture.edge(opens) } else { f64::NEG_INFINITY };
    let to = capture.edge(closes);
    let d = decimals(3, capture.unit());
    let begin = if opened { format!("from path {from:.d$} m ") } else { String::new() };
    let reason = format!("the instrument recorded {begin}to path {to:.d$} m, all counts outside are zero");
    (from < to).then_some((AutoGate { gate: Gate { from, to }, reason }, filled))
}

/// Whether these bins hold more than what fades.
fn is_light(mean: &[f64], from: usize, to: usize) -> bool {
    let peak = mean.iter().copied().fold(0.0, f64::max);
    from < to && mean[from..to].iter().sum::<f64>() >= LEVEL * peak * (to - from) as f64
}

/// Whether the first counts of the pairs are as many as those behind them.
fn opens_at_once(capture: &Capture) -> bool {
    let mut sums = [0.0f64; 2];
    for histogram in capture.histograms.chunks_exact(capture.bins) {
        let Some(first) = histogram.iter().position(|v| *v != 0.0) else { continue };
        // The bin in which the detector opens may be a part of one, and the first count makes it one with a count.
        let behind = histogram[first + 1..].chunks_exact(BESIDE / 2).take(2);
        behind.zip(&mut sums).for_each(|(part, sum)| *sum += part.iter().map(|v| f64::from(*v)).sum::<f64>());
    }
    sums[0] >= AT_ONCE * sums[1] && sums[0] > 0.0
}

impl Capture {
    /// Fills pairs that were not recorded, or not as long as the others, with the mean of their neighbours in the scan, and
    /// returns how many: as of a detector that was dead, or opened late. Needs whole counts and a scan of rows and
    /// columns; else there are none.
    pub(crate) fn fill_unrecorded(&mut self) -> usize {
        let [nx, ny] = self.scan;
        if !self.integer_counts || nx < 3 || ny < 3 {
            return 0;
        }
        let mut missing: Vec<bool> = (0..self.pair_count()).map(|pair| self.is_unrecorded(pair)).collect();
        let mut filled = 0;
        // From the rims inward, where several lie beside each other.
        loop {
            let known = |other: &usize| !missing[*other];
            let next: Vec<(usize, Vec<usize>)> = (0..missing.len())
                .filter(|pair| missing[*pair])
                .map(|pair| (pair, self.around(pair).filter(known).collect::<Vec<_>>()))
                .filter(|(_, others)| !others.is_empty())
                .collect();
            if next.is_empty() {
                return filled;
            }
            for (pair, others) in next {
                for bin in 0..self.bins {
                    let sum: f32 = others.iter().map(|o| self.histograms[o * self.bins + bin]).sum();
                    self.histograms[pair * self.bins + bin] = (sum / others.len() as f32).round();
                }
                missing[pair] = false;
                filled += 1;
            }
        }
    }

    /// The pair's neighbours in the scan.
    fn around(&self, pair: usize) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny] = self.scan.map(|n| n as i64);
        let (x, y) = (pair as i64 / ny, pair as i64 % ny);
        let beside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
        let inside = beside.into_iter().filter(move |(x, y)| (0..nx).contains(x) && (0..ny).contains(y));
        inside.map(move |(x, y)| (x * ny + y) as usize)
    }

    /// Whether two neighbours have counts where this pair has none, at paths that it would see if it saw the same things: no
    /// path to a neighbour is longer or shorter by more than their points are apart.
    fn is_unrecorded(&self, pair: usize) -> bool {
        let of = |pair: usize| &self.histograms[pair * self.bins..][..self.bins];
        let own = of(pair);
        let first = own.iter().position(|v| *v != 0.0).unwrap_or(self.bins);
        let last = own.iter().rposition(|v| *v != 0.0).map_or(0, |last| last + 1);
        let lacks = |other: &usize| {
            let apart = self.laser[pair].distance(self.laser[*other])
                + self.sensor[pair].distance(self.sensor[*other]);
            let apart = (apart / self.bin_width).ceil() as usize + BESIDE;
            let counts = of(*other);
            let before: f32 = counts[..first.saturating_sub(apart)].iter().sum();
            let behind: f32 = counts[(last + apart).min(self.bins)..].iter().sum();
            before.max(behind) >= LACKS
        };
        self.around(pair).filter(lacks).count() >= 2
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    const BINS: usize = 200;

    /// Points 1 cm apart, bins of 1 cm; light around bin 90 and a background. What the instrument records
    /// is from bin `opens(ix)` to `closes`.
    fn capture(opens: impl Fn(usize) -> usize, closes: usize) -> Capture {
        let side = 8;
        let points: Vec<_> = (0..side * side)
            .map(|p| dvec3(0.01 * (p / side) as f64, 0.01 * (p % side) as f64, 0.0))
            .collect();
        let light = |bin: usize| (400.0 * (-(bin as f32 - 90.0).powi(2) / 800.0).exp()).round() + 20.0;
        let counts = (0..side * side).flat_map(|pair| {
            let open = opens(pair / side);
            (0..BINS).map(move |bin| if (open..closes).contains(&bin) { light(bin) } else { 0.0 })
        });
        let counts = counts.collect();
        let mut capture = Capture::new([side, side], points.clone(), points, BINS, 0.01, counts);
        capture.integer_counts = true;
        capture
    }

    fn found(capture: &Capture) -> Option<[i64; 2]> {
        let bin = |t: f64| if t.is_finite() { (t / 0.01).round() as i64 } else { -1 };
        recorded_gate(&mut capture.clone()).map(|(found, _)| [bin(found.gate.from), bin(found.gate.to)])
    }

    #[test]
    fn a_gate_of_the_instrument_is_found_where_light_ends_at_once() {
        assert_eq!(found(&capture(|_| 50, 180)), Some([50, 180]));
        assert_eq!(found(&capture(|ix| 50 + ix % 3, 180)), Some([52, 180]));
        // It opens before all light, and has no counts there.
        let mut dark = capture(|_| 0, 180);
        dark.histograms.iter_mut().for_each(|v| *v = (*v - 20.0).max(0.0));
        assert_eq!(found(&dark), None, "the light fades before the end");
        let rises = |bin: usize| (bin as f32 - 20.0).max(0.0);
        let mut rising = capture(|_| 0, 180);
        rising.histograms.iter_mut().enumerate().for_each(|(i, v)| {
            *v = if i % BINS < 180 { rises(i % BINS) } else { 0.0 };
        });
        assert_eq!(found(&rising), Some([-1, 180]), "light that rises is no gate that opens");
        assert_eq!(found(&capture(|_| 50, BINS)), None, "counts up to the last bin");
    }

    #[test]
    fn what_ends_at_paths_of_its_own_is_the_scene() {
        let mut scene = capture(|_| 0, BINS);
        for (pair, counts) in scene.histograms.chunks_exact_mut(BINS).enumerate() {
            counts[100 + pair..].fill(0.0);
        }
        assert_eq!(found(&scene), None);
    }

    #[test]
    fn pairs_that_were_not_recorded_get_the_mean_of_their_neighbours() {
        let whole = capture(|_| 50, 180);
        let mut late = capture(|ix| if ix == 3 { 110 } else { 50 }, 180);
        late.histograms[..BINS].fill(0.0);
        assert_eq!(found(&late), Some([50, 180]));
        assert_eq!(late.fill_unrecorded(), 9);
        assert_eq!(late, whole);
        // Where all see what the scene is, nothing is filled.
        let mut slanted = capture(|ix| 50 + 2 * ix, 180);
        let before = slanted.clone();
        assert_eq!(slanted.fill_unrecorded(), 0);
        assert_eq!(slanted, before);
        let mut real = capture(|ix| if ix == 3 { 110 } else { 50 }, 180);
        real.integer_counts = false;
        assert_eq!(real.fill_unrecorded(), 0);
    }
}
