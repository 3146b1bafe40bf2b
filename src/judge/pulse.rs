//! Estimates the instrument's pulse: a Gaussian's width, then whether its detector has a tail. Convolutions of rendered held-out pairs
//! suggest widths; fits of surfaces confirm one by the residual of held-out pairs. Unlike the haze of a volume, a surface can compensate
//! only a part of a wrong pulse.

use serde::{Deserialize, Serialize};

use super::samples::ResponseSamples;
use crate::Result;
use crate::capture::{METRES_PER_PICOSECOND, Pulse};
use crate::surface::Left;
use crate::transport::Reflectance;

/// A hypothesis, and the residual of its fit on the hold-out set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tried {
    pub reflectance: Reflectance,
    pub pulse: Shape,
    pub left: Option<Left>,
}

/// The result of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPulse {
    /// Full width at half maximum of its Gaussian, metres of path; 0: no width is better than sharp paths.
    pub fwhm: f64,
    /// Length over which its tail falls to 1/e, metres of path; 0: none.
    #[serde(default)]
    pub tail: f64,
    /// Its samples, if no such shape is right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<ResponseSamples>,
    /// What was tried: width and tail, metres, and the share of other pairs' squares that was left.
    pub trials: Vec<[f64; 3]>,
    /// Seconds that the trials took.
    pub seconds: f64,
    /// Why the trials failed, if they did; paths are then taken as sharp.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

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

impl FoundPulse {
    pub(super) fn of(
        Shape { fwhm, tail }: Shape,
        reflectance: Reflectance,
        tried: &[Tried],
        seconds: f64,
        failed: Option<String>,
    ) -> FoundPulse {
        let of_model = || tried.iter().filter(|t| t.reflectance == reflectance);
        let of_trial = |t: &Tried| Some([t.pulse.fwhm, t.pulse.tail, t.left.as_ref()?.share()]);
        let trials = of_model().filter_map(of_trial).collect();
        FoundPulse { fwhm, tail, samples: None, trials, seconds, failed }
    }

    /// The same with samples in place of its shape.
    pub(super) fn with(self, samples: ResponseSamples) -> FoundPulse {
        let fwhm = samples.pulse().fwhm();
        FoundPulse { fwhm, tail: 0.0, samples: Some(samples), ..self }
    }

    /// The pulse; `None` if paths are sharp.
    ///
    /// # Errors
    /// The width makes no pulse. This does not happen with a width that was found.
    pub fn pulse(&self) -> Result<Option<Pulse>> {
        match &self.samples {
            Some(samples) => Ok(Some(samples.pulse())),
            None => Shape { fwhm: self.fwhm, tail: self.tail }.pulse(),
        }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        if let Some(why) = &self.failed {
            return format!(
                "the instrument's pulse is not known, paths are taken as sharp: {why} (give it if known)"
            );
        }
        let how = format!("of {} shapes tried in {:.1} s,", self.trials.len(), self.seconds);
        if let Some(samples) = &self.samples {
            let peak = |[at, height]: &[f64; 2]| format!("{height:.2} at {:.0} mm", 1e3 * at);
            let peaks: Vec<String> = samples.peaks().iter().map(peak).collect();
            return format!(
                "the instrument's pulse: {how} none explains the data as {} samples do, whose peaks over the largest one are {} of path \
                 (measure the impulse response, and give it as a file)",
                samples.samples.len(),
                peaks.join(", ")
            );
        }
        if self.fwhm == 0.0 {
            return format!("the instrument's pulse: {how} none explains the data better than sharp paths");
        }
        let of = |metres: f64| format!("{metres} m ({} ps)", three_digits(metres / METRES_PER_PICOSECOND));
        let tail = match self.tail {
            0.0 => String::new(),
            tail => format!(" and a tail of {}", of(tail)),
        };
        format!(
            "the instrument's pulse: {how} {} full width at half maximum{tail} explains the data best \
             (give this pulse, or none, to skip the trials)",
            of(self.fwhm)
        )
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
}
