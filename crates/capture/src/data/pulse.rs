//! The instrument's pulse: how a histogram shows a single path of light.
//!
//! Laser pulse, detector jitter and electronics together spread every path over several bins. If the pulse is known, it
//! is part of the model of light transport. If it is not, it appears as shape of the scene. Time zero of a pulse is
//! the path itself; for a Gaussian it is the centre.

use crate::error::{Error, Result};

/// Samples of a pulse over path, in any common scale.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Pulse {
    /// Not negative, not all zero.
    pub samples: Vec<f64>,
    /// Width of a sample in metres of path.
    pub width: f64,
    /// Leading edge of the first sample, metres behind the path; negative if it comes before the path.
    pub start: f64,
}

/// A pulse in bins of a histogram: the share `weights[i]` of a path's light falls `i - before` bins behind the path.
/// The weights sum to one.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseTaps {
    /// Number of bins before the path that get some of its light.
    pub before: usize,
    /// Share of the light in each bin; the first is `before` bins before the path.
    pub weights: Vec<f64>,
}

/// The direction of a pass through the instrument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Forward: from sharp paths to the histograms that are measured.
    Spread,
    /// The adjoint: from a residual of the histograms to the paths.
    Back,
}

/// Largest number of samples of a pulse, and of bins that it may reach on either side of its path.
const LONGEST: usize = 4096;

/// Weights at either end that are below this share of the largest are left out.
const LEAST: f64 = 1e-3;

/// Samples of a Gaussian per full width at half maximum, and how many such widths are sampled.
const SAMPLES: usize = 16;
const WIDTHS: usize = 4;

/// What is added to the second moment of a pulse, in squared bins: [`BIN`] by bins themselves, and [`LINEAR`] by linear
/// binning on top of that.
const LINEAR: f64 = 1.0 / 12.0;
const BIN: f64 = 1.0 / 12.0;

impl Pulse {
    /// A pulse of these samples, each `width` metres of path wide; the first begins `start` metres behind the path. The
    /// values are checked when the pulse is used ([`Pulse::taps`]).
    pub fn new(samples: Vec<f64>, width: f64, start: f64) -> Pulse {
        Pulse { samples, width, start }
    }

    /// A Gaussian whose full width at half maximum is `fwhm` metres of path.
    ///
    /// # Errors
    /// `Kind::Options` if `fwhm` is not a positive number.
    pub fn gaussian(fwhm: f64) -> Result<Pulse> {
        if !(fwhm.is_finite() && fwhm > 0.0) {
            return Err(Error::options(
                format!("the pulse is {fwhm} m wide"),
                "give its full width at half maximum in metres of path (picoseconds times 0.000299792458)",
            ));
        }
        let count = SAMPLES * WIDTHS;
        let at = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - WIDTHS as f64 / 2.0;
        let samples = (0..count).map(|i| (-4.0 * std::f64::consts::LN_2 * at(i).powi(2)).exp()).collect();
        Ok(Pulse { samples, width: fwhm / SAMPLES as f64, start: -0.5 * WIDTHS as f64 * fwhm })
    }

    /// This pulse with a tail: convolved with an exponential that falls to 1/e over `decay` metres of path, cut off where
    /// it has fallen to a ten-thousandth.
    ///
    /// # Errors
    /// `Kind::Options` if `decay` is not a positive number, or if the samples of the tail are too many.
    pub fn with_tail(&self, decay: f64) -> Result<Pulse> {
        // Samples fine enough for the tail. e^-9.2 is about a ten-thousandth.
        let parts = (8.0 * self.width / decay).ceil();
        let width = self.width / parts;
        let more = (9.2 * decay / width).ceil();
        let all = self.samples.len() as f64 * parts + more;
        if !(decay.is_finite() && decay > 0.0 && all <= LONGEST as f64) {
            return Err(Error::options(
                format!(
                    "the tail of the pulse is {decay} m long, and a sample of the pulse {} m",
                    self.width
                ),
                "give the length over which it falls to 1/e, in metres of path: from a tenth of the pulse's width to ten times it",
            ));
        }
        let stays = (-width / decay).exp();
        let mut tail = 0.0;
        let finer = self.samples.iter().flat_map(|sample| std::iter::repeat_n(*sample, parts as usize));
        let samples = finer.chain(std::iter::repeat_n(0.0, more as usize));
        let samples = samples.map(|sample| {
            tail = stays * tail + (1.0 - stays) * sample;
            tail
        });
        // The exponential's own samples begin at 0, so their centres are half a sample behind.
        Ok(Pulse { samples: samples.collect(), width, start: self.start + 0.5 * width })
    }

    /// Checks the samples and their scale.
    ///
    /// # Errors
    /// `Kind::Input`, naming what is wrong.
    pub fn check(&self) -> Result<()> {
        let bad = |what: String, hint: &'static str| Err(Error::input(what, hint));
        if self.samples.is_empty() || self.samples.len() > LONGEST {
            return bad(
                format!("the pulse has {} samples", self.samples.len()),
                "give 1 to 4096 samples around the path",
            );
        }
        if let Some(at) = self.samples.iter().position(|s| !(s.is_finite() && *s >= 0.0)) {
            return bad(
                format!("sample {at} of the pulse is {}", self.samples[at]),
                "samples must be finite and not negative: subtract the background and clamp at 0",
            );
        }
        let sum: f64 = self.samples.iter().sum();
        if !(sum.is_finite() && sum > 0.0) {
            return bad(format!("the pulse's samples add up to {sum}"), "give samples with a positive sum");
        }
        if !(self.width.is_finite() && self.width > 0.0 && self.start.is_finite()) {
            return bad(
                format!("the pulse's samples are {} m wide, the first at {} m", self.width, self.start),
                "give both in metres of path",
            );
        }
        Ok(())
    }

    /// Trailing edge of the last sample, metres behind the path.
    pub fn end(&self) -> f64 {
        self.start + self.samples.len() as f64 * self.width
    }

    /// Full width at half maximum of a Gaussian with the standard deviation of the response, metres.
    pub fn fwhm(&self) -> f64 {
        (8.0 * std::f64::consts::LN_2).sqrt() * self.deviation()
    }

    /// Standard deviation of what bins must resolve, metres: of a response with echoes, that of the Gaussian with its square integral.
    pub fn deviation(&self) -> f64 {
        let sum: f64 = self.samples.iter().sum();
        let squares: f64 = self.samples.iter().map(|s| s * s).sum::<f64>() / (sum * sum * self.width);
        resolved(self.moments()[1], squares)
    }

    /// Mean and standard deviation, metres.
    #[doc(hidden)]
    pub fn moments(&self) -> [f64; 2] {
        let sum: f64 = self.samples.iter().sum();
        let at = |i: usize| self.start + (i as f64 + 0.5) * self.width;
        let mean = self.samples.iter().enumerate().map(|(i, s)| s * at(i)).sum::<f64>() / sum;
        let square = |(i, s): (usize, &f64)| s * (at(i) - mean).powi(2);
        [mean, (self.samples.iter().enumerate().map(square).sum::<f64>() / sum).sqrt()]
    }

    /// Taps for a model that divides a path linearly between two bins of this width. Their second moment is smaller by
    /// what this division adds, so that both together have the second moment of the pulse.
    ///
    /// # Errors
    /// `Kind::Input` if the pulse reaches more than 4096 bins from its path.
    #[doc(hidden)]
    pub fn taps(&self, bin_width: f64) -> Result<PulseTaps> {
        self.over(bin_width, BIN + LINEAR)
    }

    /// Taps for histograms whose paths are already in bins.
    ///
    /// # Errors
    /// As [`Pulse::taps`].
    #[doc(hidden)]
    pub fn taps_of_bins(&self, bin_width: f64) -> Result<PulseTaps> {
        self.over(bin_width, BIN)
    }

    /// Integrals of the pulse over bins, with their second moment reduced by `less` squared bins.
    fn over(&self, bin_width: f64, less: f64) -> Result<PulseTaps> {
        let [first, last] = [self.start, self.end()].map(|edge| (edge / bin_width).round());
        if first.abs().max(last.abs()) > LONGEST as f64 {
            return Err(Error::input(
                format!("the pulse reaches from {first} to {last} bins around its path"),
                format!("at most {LONGEST} are supported: cut the pulse, or sum neighbouring bins"),
            ));
        }
        // One more bin at either end, for the second difference.
        let (first, last) = (first as i64 - 1, last as i64 + 1);
        let mut whole = vec![0.0; (last - first + 1) as usize];
        for (i, sample) in self.samples.iter().enumerate() {
            let edge = |i: usize| (self.start + i as f64 * self.width) / bin_width + 0.5 - first as f64;
            let (from, to) = (edge(i), edge(i + 1));
            for (bin, sum) in whole.iter_mut().enumerate().take(to.ceil() as usize).skip(from as usize) {
                let shared = (to.min(bin as f64 + 1.0) - from.max(bin as f64)).max(0.0);
                *sum += sample * shared / (to - from);
            }
        }
        let at = |i: Option<usize>| i.and_then(|i| whole.get(i)).copied().unwrap_or(0.0);
        let sharp = |i: usize| {
            let second = at(i.checked_sub(1)) + at(Some(i + 1)) - 2.0 * whole[i];
            (whole[i] - 0.5 * less * second).max(0.0)
        };
        let mut weights: Vec<f64> = (0..whole.len()).map(sharp).collect();
        let least = LEAST * weights.iter().fold(0.0f64, |a, b| a.max(*b));
        let kept = |w: &f64| *w > least;
        let (low, high) =
            (weights.iter().position(kept).unwrap_or(0), weights.iter().rposition(kept).unwrap_or(0));
        weights.truncate(high + 1);
        weights.drain(..low);
        // The kernels walk from the first tap to the last, and expect the path's own bin among them.
        let (low, high) = (first + low as i64, first + high as i64);
        let before = (-low).max(0) as usize;
        weights.splice(0..0, std::iter::repeat_n(0.0, low.max(0) as usize));
        weights.extend(std::iter::repeat_n(0.0, (-high).max(0) as usize));
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        Ok(PulseTaps { before, weights })
    }
}

/// Below this share of the standard deviation, the Gaussian with the square integral of a response is that of a peak among others. A
/// Gaussian with a tail of any length has .56 and more.
const OF_PEAKS: f64 = 0.5;

/// The standard deviation of a response, or where that is the distance of its peaks, that of the Gaussian with its square integral.
fn resolved(deviation: f64, squares: f64) -> f64 {
    let of_peak = 1.0 / (2.0 * std::f64::consts::PI.sqrt() * squares);
    if of_peak < OF_PEAKS * deviation { of_peak } else { deviation }
}

impl PulseTaps {
    /// Standard deviation of what bins must resolve, bins ([`Pulse::deviation`]).
    pub fn deviation(&self) -> f64 {
        let moment = |power| -> f64 {
            self.weights
                .iter()
                .enumerate()
                .map(|(i, w)| w * (i as f64 - self.before as f64).powi(power))
                .sum()
        };
        let squares: f64 = self.weights.iter().map(|w| w * w).sum();
        resolved((moment(2) - moment(1).powi(2)).max(0.0).sqrt(), squares)
    }

    /// Taps that change nothing: a single one of weight 1.
    pub fn identity() -> PulseTaps {
        PulseTaps { before: 0, weights: vec![1.0] }
    }

    /// These taps convolved with a Gaussian of `sigma` bins that is cut off at `reach` sigmas on each side. Unchanged
    /// if `sigma` is not positive.
    pub fn blurred(&self, sigma: f64, reach: f64) -> PulseTaps {
        if sigma <= 0.0 {
            return self.clone();
        }
        let radius = (reach * sigma) as usize;
        let gaussian = |i: usize| (-0.5 * ((i as f64 - radius as f64) / sigma).powi(2)).exp();
        let whole: f64 = (0..=2 * radius).map(gaussian).sum();
        let mut weights = vec![0.0; self.weights.len() + 2 * radius];
        for (at, weight) in self.weights.iter().enumerate() {
            (0..=2 * radius).for_each(|i| weights[at + i] += weight * gaussian(i) / whole);
        }
        PulseTaps { before: self.before + radius, weights }
    }

    /// The layout that kernels read: `before`, the number of weights, the weights.
    pub fn words(&self) -> Vec<f32> {
        let head = [self.before as f32, self.weights.len() as f32];
        head.into_iter().chain(self.weights.iter().map(|w| *w as f32)).collect()
    }

    /// Applies the pulse to histograms of sharp paths. Light that leaves the bins is lost.
    pub fn spread(&self, histograms: &mut [f32], bins: usize) {
        for histogram in histograms.chunks_exact_mut(bins) {
            let sharp: Vec<f64> = histogram.iter().map(|v| f64::from(*v)).collect();
            for (value, shown) in histogram.iter_mut().zip(self.through(&sharp, Way::Spread)) {
                *value = shown as f32;
            }
        }
    }

    /// Passes one histogram, or one residual, through the instrument. Light that leaves the bins is lost.
    pub fn through(&self, histogram: &[f64], way: Way) -> Vec<f64> {
        let (bins, mut through) = (histogram.len(), vec![0.0; histogram.len()]);
        // Tap by tap: the sum of a bin is in the order of the taps.
        for (tap, weight) in self.weights.iter().enumerate() {
            let ahead = match way {
                Way::Spread => tap as isize - self.before as isize,
                Way::Back => self.before as isize - tap as isize,
            };
            let (to, from) = (ahead.max(0) as usize, (-ahead).max(0) as usize);
            if to.max(from) < bins {
                through[to..].iter_mut().zip(&histogram[from..]).for_each(|(to, v)| *to += weight * v);
            }
        }
        through
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(taps: &PulseTaps) -> [f64; 2] {
        let at = |i: usize| i as f64 - taps.before as f64;
        let mean: f64 = taps.weights.iter().enumerate().map(|(i, w)| w * at(i)).sum();
        let square = |(i, w): (usize, &f64)| w * (at(i) - mean).powi(2);
        [mean, taps.weights.iter().enumerate().map(square).sum::<f64>()]
    }

    #[test]
    fn taps_have_the_moments_of_their_pulse() {
        for (fwhm, bin) in [(0.02, 0.006), (0.012, 0.006), (0.1, 0.004)] {
            let pulse = Pulse::gaussian(fwhm).unwrap();
            let [mean, deviation] = pulse.moments();
            assert!(mean.abs() < 1e-12 && (deviation / (fwhm / 2.3548) - 1.0).abs() < 0.01, "{deviation}");
            let square = (deviation / bin).powi(2);
            let [mean, of_taps] = moments(&pulse.taps(bin).unwrap());
            // Without what linear binning adds to that of bins: 1 / 6 - 1 / 12.
            assert!(mean.abs() < 1e-12 && (of_taps / (square - 1.0 / 12.0) - 1.0).abs() < 0.04, "{of_taps}");
            let [_, of_bins] = moments(&pulse.taps_of_bins(bin).unwrap());
            assert!((of_bins / square - 1.0).abs() < 0.02, "{of_bins} {square}");
        }
    }

    #[test]
    fn a_tail_has_the_moments_of_its_exponential() {
        let sharp = Pulse::gaussian(0.03).unwrap();
        let [mean, deviation] = sharp.moments();
        for decay in [0.005, 0.03, 0.2] {
            let pulse = sharp.with_tail(decay).unwrap();
            pulse.check().unwrap();
            // An exponential has its decay as mean and as standard deviation; both variances add up.
            let [with_mean, with_deviation] = pulse.moments();
            let (late, wide) = (with_mean - mean, (with_deviation.powi(2) - deviation.powi(2)).sqrt());
            assert!((late / decay - 1.0).abs() < 0.01 && (wide / decay - 1.0).abs() < 0.02, "{late} {wide}");
            let sum = |p: &Pulse| p.samples.iter().sum::<f64>() * p.width;
            assert!((sum(&pulse) / sum(&sharp) - 1.0).abs() < 2e-4);
            // Far behind, it falls to 1/e over its decay.
            let at = |path: f64| pulse.samples[((path - pulse.start) / pulse.width) as usize];
            let (near, far) = (0.06 + decay, 0.06 + 3.0 * decay);
            assert!(((at(near) / at(far)).ln() / (far - near) * decay - 1.0).abs() < 0.25, "{decay}");
        }
        for bad in [0.0, -1.0, f64::NAN, 1e3] {
            assert!(sharp.with_tail(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_late_pulse_stays_late() {
        // A tail that begins three and a half bins behind the path.
        let pulse = Pulse { samples: vec![4.0, 2.0, 1.0], width: 0.01, start: 0.035 };
        let taps = pulse.taps_of_bins(0.01).unwrap();
        let [mean, _] = moments(&taps);
        assert!((mean - pulse.moments()[0] / 0.01).abs() < 0.05, "{taps:?}");
        assert!(
            taps.before == 0
                && taps.weights[0] == 0.0
                && (taps.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12
        );
        // A pulse far before the path.
        let early = Pulse { start: -0.065, ..pulse }.taps_of_bins(0.01).unwrap();
        assert!(early.before >= 6 && early.weights.len() > early.before, "{early:?}");
        assert!((moments(&early)[0] + 10.0 - mean).abs() < 0.05);
    }

    #[test]
    fn spreading_keeps_the_light_and_its_place() {
        let taps = Pulse::gaussian(0.03).unwrap().taps_of_bins(0.01).unwrap();
        let mut histograms = vec![0.0f32; 64];
        histograms[16] = 2.0;
        histograms[32 + 1] = 1.0;
        taps.spread(&mut histograms, 32);
        assert!((histograms[..32].iter().sum::<f32>() - 2.0).abs() < 1e-5);
        assert_eq!(histograms[..32].iter().copied().fold(0.0, f32::max), histograms[16]);
        // Light before the first bin is lost, and goes to no other pair.
        assert!(histograms[32..].iter().sum::<f32>() < 0.99 && histograms[31] == 0.0);
        let mut same = vec![1.0, 2.0, 3.0];
        PulseTaps::identity().spread(&mut same, 3);
        assert_eq!(same, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn what_is_no_pulse_is_refused() {
        assert!(Pulse::gaussian(0.0).is_err() && Pulse::gaussian(f64::NAN).is_err());
        let good = Pulse::gaussian(0.01).unwrap();
        for bad in [
            Pulse { samples: vec![], ..good.clone() },
            Pulse { samples: vec![0.0; 3], ..good.clone() },
            Pulse { samples: vec![1.0, -1.0], ..good.clone() },
            Pulse { samples: vec![1.0, f64::NAN], ..good.clone() },
            Pulse { width: 0.0, ..good.clone() },
            Pulse { start: f64::INFINITY, ..good.clone() },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
        assert!(good.taps(1e-7).is_err() && Pulse { start: 1e6, ..good }.taps(0.01).is_err());
    }
}
