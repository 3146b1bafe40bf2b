//! Finds the instrument's pulse: a Gaussian's width, then the tail of its detector. A trial fits a surface with a pulse. The
//! one that predicts other pairs best is taken. Trials end with a surface: unlike the haze of a volume, it cannot compensate
//! for a wrong pulse.

use serde::{Deserialize, Serialize};

use super::{Begun, Tried};
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
const WORTH: f64 = 0.003;

/// Widths in bins of the trials: the first and the widest.
pub(super) const FIRST: f64 = 2.0;
const WIDEST: f64 = 32.0;

/// The narrowest pulse that is worth its kernels, in bins of the solve.
pub(super) const NARROWEST: f64 = 1.0;

/// Shares of a pulse's length that a tail takes in the first trial and in the next, if that one is better.
const TAILS: [f64; 2] = [0.3, 0.6];

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

    /// The same, with its mean at the path. The surfaces of trials begin with the volume of another pulse: they judge its
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
        // The first model has no others.
        let own = of_model().any(|t| t.begun == Begun::OnItsOwn);
        let trials = of_model().filter(|t| !own || t.begun == Begun::OnItsOwn);
        let of_trial = |t: &Tried| Some([t.pulse.fwhm, t.pulse.tail, t.left.as_ref()?.share()]);
        FoundPulse { fwhm, tail, trials: trials.filter_map(of_trial).collect(), seconds, failed }
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

/// The width in bins with the least `misfit`. Doubles the width while that helps, then fits a parabola. 0 if no width
/// is enough better than sharp paths, if the best is below `narrowest`, or if the misfit falls up to the widest.
pub(super) fn best_width(narrowest: f64, misfit: &mut dyn FnMut(f64) -> Result<Option<f64>>) -> Result<f64> {
    let unknown = || Error::input("a trial found no surface", "give the instrument's pulse");
    let mut at = |width: f64| misfit(width)?.ok_or_else(unknown);
    let sharp = at(0.0)?;
    let mut known = vec![[0.0, sharp], [FIRST, at(FIRST)?]];
    if known[1][1] >= sharp {
        known.insert(1, [FIRST / 2.0, at(FIRST / 2.0)?]);
    } else {
        while let [.., [_, before], [width, last]] = known[..]
            && last < before
            && width < WIDEST
        {
            known.push([2.0 * width, at(2.0 * width)?]);
        }
    }
    // One side of the minimum may be much steeper than the other, so both sides are tried. What is less on the first
    // side has both its neighbours already.
    let least = least_of(&known);
    if least > 0 {
        let [middle, before] = [known[least], known[least - 1]];
        let mut sides = vec![before];
        sides.extend(known.get(least + 1));
        sides.sort_by(|a, b| a[1].total_cmp(&b[1]));
        for side in sides {
            let width = 0.5 * (middle[0] + side[0]);
            let left = at(width)?;
            known.push([width, left]);
            if left < middle[1] {
                break;
            }
        }
        known.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    let least = known[least_of(&known)][1];
    // The vertex of the parabola is more accurate than the best trial.
    let width = vertex(&known).filter(|w| *w >= narrowest && least < (1.0 - WORTH) * sharp);
    Ok(width.unwrap_or(0.0))
}

/// The share of a pulse's length in its tail with the least `misfit`. 0 if no tail is enough better than none, which leaves
/// `without`.
pub(super) fn best_tail(without: f64, misfit: &mut dyn FnMut(f64) -> Result<Option<f64>>) -> Result<f64> {
    // A pulse without a surface is no better one.
    let mut at = |share: f64| Ok::<_, Error>([share, misfit(share)?.unwrap_or(f64::INFINITY)]);
    let mut known = vec![[0.0, without], at(TAILS[0])?];
    if known[1][1] < without {
        known.push(at(TAILS[1])?);
        let [_, [middle, _], [last, left]] = known[..] else { unreachable!("three were tried") };
        if left < known[1][1] {
            known.push(at(0.5 * (last + 1.0))?);
        }
        if least_of(&known) == 2 {
            known.insert(2, at(0.5 * (middle + last))?);
        }
    } else {
        known.insert(1, at(0.5 * TAILS[0])?);
    }
    let [share, left] = known[least_of(&known)];
    if left >= (1.0 - WORTH) * without {
        return Ok(0.0);
    }
    Ok(vertex(&known).unwrap_or(share))
}

/// The vertex of the parabola through the least of `known` and its two neighbours. `known` is in order of width.
fn vertex(known: &[[f64; 2]]) -> Option<f64> {
    let least = least_of(known);
    let [[a, fa], [b, fb], [c, fc]] = known.get(least.checked_sub(1)?..least + 2)?.try_into().ok()?;
    let (left, right) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
    let at = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right);
    at.is_finite().then_some(at.clamp(a, c))
}

fn least_of(known: &[[f64; 2]]) -> usize {
    (0..known.len()).min_by(|a, b| known[*a][1].total_cmp(&known[*b][1])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(left: impl Fn(f64) -> f64) -> (f64, usize) {
        let mut calls = 0;
        let width = best_width(0.5, &mut |w| {
            calls += 1;
            Ok(Some(left(w)))
        });
        (width.unwrap(), calls)
    }

    #[test]
    fn the_least_misfit_is_found_in_a_few_trials() {
        for true_width in [0.7, 1.0, 1.3, 2.0, 3.4, 5.0, 9.0, 20.0] {
            let (width, calls) = found(|w| 1.0 + ((w - true_width) / (3.0 + true_width)).powi(2));
            assert!((width / true_width - 1.0).abs() < 0.03 && calls <= 8, "{true_width}: {width}, {calls}");
        }
        // Twice as steep above the true width.
        for true_width in [1.0, 2.0, 3.4, 5.0, 9.0, 20.0] {
            let steep = |w: f64| if w < true_width { 1.0 } else { 4.0 };
            let (width, _) = found(|w| 1.0 + steep(w) * ((w - true_width) / (3.0 + true_width)).powi(2));
            assert!((width / true_width - 1.0).abs() < 0.2, "{true_width}: {width}");
        }
    }

    #[test]
    fn a_tail_is_found_only_where_it_is_worth_it() {
        let found = |left: &dyn Fn(f64) -> f64| {
            let mut calls = 0;
            let share = best_tail(left(0.0), &mut |share| {
                calls += 1;
                Ok(Some(left(share)))
            });
            (share.unwrap(), calls)
        };
        for share in [0.15, 0.2, 0.3, 0.45, 0.6] {
            let (tail, calls) = found(&|s| 1.0 + 10.0 * (s - share) * (s - share));
            assert!((tail - share).abs() < 1e-9 && calls <= 4, "{share}: {tail}, {calls}");
        }
        assert_eq!(found(&|s| 1.0 - s), (0.8, 3), "the longest tail");
        assert_eq!(found(&|s| 1.0 + (s - 0.78) * (s - 0.78)), (0.8, 3), "nothing longer is tried");
        assert_eq!(found(&|s| 1.0 + s), (0.0, 2), "none");
        assert_eq!(found(&|s| 1.0 - 0.002 * s), (0.0, 3), "too little is gained");
        let without_surface = |s: f64| if s > 0.0 { None } else { Some(1.0) };
        assert_eq!(best_tail(1.0, &mut |s| Ok(without_surface(s))).unwrap(), 0.0);
        assert_eq!(Shape::of(0.04, 0.25), Shape { fwhm: 0.03, tail: 0.01 });
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
    fn a_half_that_is_less_needs_no_other_half() {
        let tried = |least: f64| {
            let mut widths = vec![];
            best_width(0.5, &mut |w| {
                widths.push(w);
                Ok(Some(1.0 + (w - least) * (w - least)))
            })
            .unwrap();
            widths
        };
        assert_eq!(tried(3.1), [0.0, 2.0, 4.0, 8.0, 3.0], "2 leaves less than 8, and 3 less than 4");
        assert_eq!(tried(3.9), [0.0, 2.0, 4.0, 8.0, 3.0, 6.0], "3 leaves more than 4");
        assert_eq!(tried(4.6), [0.0, 2.0, 4.0, 8.0, 3.0, 6.0]);
    }

    #[test]
    fn what_is_as_good_as_sharp_is_sharp() {
        assert_eq!(found(|w| 1.0 + w).0, 0.0);
        assert_eq!(found(|_| 1.0).0, 0.0);
        // The gain is too small.
        assert_eq!(found(|w| 1.0 + 1e-4 * (w - 3.0) * (w - 3.0)).0, 0.0);
        assert!(best_width(0.5, &mut |_| Ok(None)).is_err());
        // A pulse is there, but the solve's bins are too wide to show it.
        let narrow =
            |narrowest| best_width(narrowest, &mut |w| Ok(Some(1.0 + (w - 0.7) * (w - 0.7)))).unwrap();
        assert!(narrow(1.0) == 0.0 && (narrow(0.5) - 0.7).abs() < 1e-9);
    }

    #[test]
    fn widths_have_three_digits_of_any_size() {
        assert_eq!([0.0321489, 3.21489e-6, 123.456, 0.0].map(three_digits), [0.0321, 3.21e-6, 123.0, 0.0]);
    }

    #[test]
    fn what_has_no_least_misfit_is_no_pulse() {
        let (width, calls) = found(|w| 1.0 - 0.01 * w);
        assert!(width == 0.0 && calls <= 8, "{width} {calls}");
    }
}
