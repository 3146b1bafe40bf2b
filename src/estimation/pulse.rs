//! Estimates the instrument's pulse: a Gaussian's width, then the tail of its detector. A trial fits a surface with a pulse, and the
//! pulse with the least residual of held-out pairs is chosen. Unlike the haze of a volume, a surface cannot compensate for a wrong
//! pulse.

use serde::{Deserialize, Serialize};

use super::Tried;
use crate::capture::{METRES_PER_PICOSECOND, Pulse};
use crate::transport::Reflectance;
use crate::{Error, Result};

/// The result of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPulse {
    /// Full width at half maximum of its Gaussian, metres of path; 0: no width is better than sharp paths.
    pub fwhm: f64,
    /// Length over which its tail falls to 1/e, metres of path; 0: none.
    #[serde(default)]
    pub tail: f64,
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

/// Lengths in bins of the trials: one that shows whether there is a pulse, and the longest.
pub(super) const FIRST: f64 = 2.0;
const WIDEST: f64 = 32.0;

/// Factor between lengths that are tried.
const STEP: f64 = 1.35;

/// The narrowest pulse that is worth its kernels, in bins of the solve.
pub(super) const NARROWEST: f64 = 1.0;

/// Shares of a pulse's length that a tail takes: from one trial to the next, and at most.
const TAIL_STEP: f64 = 0.25;
const LONGEST_TAIL: f64 = 0.8;

/// Pulses by which the light of a surface with sharp paths is spread: lengths to an octave, and shares of the tail.
const TO_AN_OCTAVE: f64 = 4.0;
const TAILS: [f64; 5] = [0.0, 0.2, 0.4, 0.6, 0.8];

/// A pulse of a trial: a Gaussian, convolved with an exponential.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
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

    /// Pulses of many lengths and tails, in bins of this width.
    pub fn all(bin_width: f64) -> Vec<Shape> {
        let octaves = WIDEST.log2() * TO_AN_OCTAVE;
        let lengths = (0..=octaves as usize).map(|i| bin_width * (i as f64 / TO_AN_OCTAVE).exp2());
        lengths.flat_map(|length| TAILS.map(|share| Shape::of(length, share))).collect()
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
        FoundPulse { fwhm, tail, trials: of_model().filter_map(of_trial).collect(), seconds, failed }
    }

    /// The pulse; `None` if paths are sharp.
    ///
    /// # Errors
    /// The width makes no pulse. This does not happen with a width that was found.
    pub fn pulse(&self) -> Result<Option<Pulse>> {
        Shape { fwhm: self.fwhm, tail: self.tail }.pulse()
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        if let Some(why) = &self.failed {
            return format!(
                "the instrument's pulse is not known, paths are taken as sharp: {why} (give it if known)"
            );
        }
        let how = format!("of {} shapes tried in {:.1} s,", self.trials.len(), self.seconds);
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

/// The length in bins with the least `misfit` and what that is, from a guess on: of a pulse whose tail has a known share. Lengths
/// go up while that helps, else down, and a parabola ends it. `None` if no length is better than sharp paths, which leave `sharp`,
/// if the best is below `narrowest`, or if the misfit falls up to the longest.
pub(super) fn best_length(
    guess: f64,
    narrowest: f64,
    sharp: f64,
    misfit: &mut dyn FnMut(f64) -> Result<Option<f64>>,
) -> Result<Option<[f64; 2]>> {
    // A pulse without a surface is no better one.
    let mut at = |length: f64| Ok::<_, Error>([length, misfit(length)?.unwrap_or(f64::INFINITY)]);
    let mut known = vec![at(guess.clamp(narrowest, WIDEST))?];
    if known[0][1] >= sharp {
        known = vec![at((0.5 * known[0][0]).max(narrowest))?];
        if known[0][1] >= sharp {
            return Ok(None);
        }
    }
    for factor in [STEP, 1.0 / STEP] {
        let mut end = known[0];
        while (narrowest..=WIDEST).contains(&(factor * end[0])) {
            let next = at(factor * end[0])?;
            known.push(next);
            if next[1] >= end[1] {
                break;
            }
            end = next;
        }
        // The first one and the last one are the neighbours of what is between them.
        if known.len() > 2 {
            break;
        }
    }
    known.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let least = least_of(&known);
    let Some(found) = vertex(&known) else {
        return Ok((least == 0 && known[0][0] > narrowest).then_some(known[0]));
    };
    Ok(Some(found))
}

/// The share of a pulse's length in its tail with the least `misfit`, from one on that leaves `left`.
pub(super) fn best_tail(
    share: f64,
    left: f64,
    misfit: &mut dyn FnMut(f64) -> Result<Option<f64>>,
) -> Result<f64> {
    let mut at = |share: f64| Ok::<_, Error>([share, misfit(share)?.unwrap_or(f64::INFINITY)]);
    let mut known = vec![[share, left]];
    while let [.., [longest, _]] = known[..]
        && longest < LONGEST_TAIL
        && least_of(&known) + 1 == known.len()
    {
        known.push(at((longest + TAIL_STEP).min(LONGEST_TAIL))?);
    }
    if least_of(&known) == 0 {
        let [at_least, shorter] = if share > 0.0 { [0.0, share - TAIL_STEP] } else { [0.5 * TAIL_STEP; 2] };
        known.push(at(shorter.max(at_least))?);
        known.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    Ok(vertex(&known).map_or(known[least_of(&known)][0], |found| found[0]))
}

/// The vertex of the parabola through the least of `known` and its two neighbours, and its value. `known` is in order.
fn vertex(known: &[[f64; 2]]) -> Option<[f64; 2]> {
    let least = least_of(known);
    let [[a, fa], [b, fb], [c, fc]] = known.get(least.checked_sub(1)?..least + 2)?.try_into().ok()?;
    let (left, right) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
    let at = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right);
    let at = at.is_finite().then(|| at.clamp(a, c))?;
    // Newton's form of the parabola.
    let (first, second) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
    let value = fa + (at - a) * (first + (at - b) * (second - first) / (c - a));
    Some([at, value])
}

fn least_of(known: &[[f64; 2]]) -> usize {
    (0..known.len()).min_by(|a, b| known[*a][1].total_cmp(&known[*b][1])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The length with the least `left` from a guess on, where sharp paths leave what a length of 0 does, and how many were tried.
    fn found(guess: f64, left: impl Fn(f64) -> f64) -> (Option<f64>, usize) {
        let mut calls = 0;
        let length = best_length(guess, 0.5, left(0.0), &mut |length| {
            calls += 1;
            Ok(Some(left(length)))
        });
        (length.unwrap().map(|found| found[0]), calls)
    }

    #[test]
    fn the_least_misfit_is_found_in_a_few_trials() {
        for truth in [1.0, 1.3, 2.0, 3.4, 5.0, 9.0, 20.0] {
            for guess in [0.7, 0.8, 1.0, 1.2] {
                let left = |w: f64| 1.0 + ((w - truth) / (3.0 + truth)).powi(2);
                let (length, calls) = found(guess * truth, left);
                let length = length.unwrap();
                assert!((length / truth - 1.0).abs() < 0.03 && calls <= 4, "{truth}: {length}, {calls}");
            }
            // Twice as steep above the true length.
            let steep = |w: f64| if w < truth { 1.0 } else { 4.0 };
            let (length, _) = found(0.8 * truth, |w| 1.0 + steep(w) * ((w - truth) / (3.0 + truth)).powi(2));
            let length = length.unwrap();
            assert!((length / truth - 1.0).abs() < 0.2, "{truth}: {length}");
            // A guess that is far off takes longer.
            for guess in [0.25, 3.0] {
                let (length, calls) = found((guess * truth).max(0.5), |w| 1.0 + (w - truth).powi(2));
                let length = length.unwrap();
                assert!((length / truth - 1.0).abs() < 0.03 && calls <= 8, "{truth}: {length}, {calls}");
            }
        }
    }

    #[test]
    fn the_value_of_the_least_is_that_of_its_parabola() {
        let [length, left] =
            best_length(3.0, 0.5, 10.0, &mut |w| Ok(Some(2.0 + 0.3 * (w - 4.0).powi(2)))).unwrap().unwrap();
        assert!((length - 4.0).abs() < 1e-9 && (left - 2.0).abs() < 1e-9);
        assert_eq!(vertex(&[[0.0, 2.0], [1.0, 3.0], [2.0, 5.0]]), None, "the least has one neighbour");
        assert_eq!(vertex(&[[0.0, 2.0], [1.0, 1.0], [2.0, f64::INFINITY]]), None, "no surface");
    }

    #[test]
    fn the_share_of_a_tail_is_found_in_a_few_trials() {
        let found = |from: f64, left: &dyn Fn(f64) -> f64| {
            let mut calls = 0;
            let share = best_tail(from, left(from), &mut |share| {
                calls += 1;
                Ok(Some(left(share)))
            });
            (share.unwrap(), calls)
        };
        for share in [0.15, 0.2, 0.3, 0.45, 0.6] {
            for from in [0.0, share - 0.1, share + 0.1] {
                let (tail, calls) = found(from, &|s| 1.0 + 10.0 * (s - share) * (s - share));
                assert!((tail - share).abs() < 1e-9 && calls <= 3, "{share}: {tail}, {calls}");
            }
        }
        assert_eq!(found(0.0, &|s| 1.0 - s), (0.8, 4));
        assert_eq!(found(0.6, &|s| 1.0 - s), (0.8, 1), "the longest tail");
        assert_eq!(found(0.0, &|s| 1.0 + s), (0.0, 2), "none");
        assert_eq!(best_tail(0.0, 1.0, &mut |_| Ok(None)).unwrap(), 0.0, "no surface");
        assert_eq!(Shape::of(0.04, 0.25), Shape { fwhm: 0.03, tail: 0.01 });
    }

    #[test]
    fn light_is_spread_by_pulses_of_all_lengths_and_tails() {
        let all = Shape::all(0.01);
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
    fn lengths_go_up_first() {
        let tried = |guess: f64, least: f64| {
            let mut lengths = vec![];
            best_length(guess, 0.5, 1e3, &mut |w| {
                lengths.push((100.0 * w).round() / 100.0);
                Ok(Some((w - least) * (w - least)))
            })
            .unwrap();
            lengths
        };
        assert_eq!(tried(2.0, 2.6), [2.0, 2.7, 3.65], "what is between has both its neighbours");
        assert_eq!(tried(2.0, 2.1), [2.0, 2.7, 1.48]);
        assert_eq!(tried(2.0, 1.5), [2.0, 2.7, 1.48, 1.1]);
    }

    #[test]
    fn what_is_as_good_as_sharp_is_sharp() {
        assert_eq!(found(4.0, |w| 1.0 + w), (None, 2));
        assert_eq!(found(2.0, |_| 1.0), (None, 2));
        assert_eq!(found(0.1, |w| 1.0 + w), (None, 2), "a guess is not shorter than the resolvable length");
        assert_eq!(best_length(4.0, 0.5, 1.0, &mut |_| Ok(None)).unwrap(), None);
        // A pulse is there, but the solve's bins are too wide to show it.
        let narrow = |narrowest| {
            let left = |w: f64| 1.0 + (w - 0.7) * (w - 0.7);
            let found = best_length(1.6, narrowest, left(0.0), &mut |w| Ok(Some(left(w))));
            found.unwrap().map(|found| found[0])
        };
        assert!(narrow(1.0).is_none() && (narrow(0.4).unwrap() - 0.7).abs() < 1e-9);
    }

    #[test]
    fn widths_have_three_digits_of_any_size() {
        assert_eq!([0.0321489, 3.21489e-6, 123.456, 0.0].map(three_digits), [0.0321, 3.21e-6, 123.0, 0.0]);
    }

    #[test]
    fn what_has_no_least_misfit_is_no_pulse() {
        let (length, calls) = found(8.0, |w| 1.0 - 0.01 * w);
        assert!(length.is_none() && calls <= 8, "{length:?} {calls}");
    }
}
