//! Finds the width of the instrument's pulse. A trial fits a surface with a Gaussian pulse. The width that predicts other
//! pairs best is taken. Trials end with a surface: unlike the haze of a volume, it cannot compensate for a wrong width.

use serde::{Deserialize, Serialize};

use super::{Begun, Tried};
use crate::capture::{METRES_PER_PICOSECOND, Pulse};
use crate::transport::Reflectance;
use crate::{Error, Result};

/// The result of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPulse {
    /// Full width at half maximum, metres of path; 0: no width is better than sharp paths.
    pub fwhm: f64,
    /// Widths that were tried, metres, and the share of other pairs' squares that each leaves.
    pub trials: Vec<[f64; 2]>,
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

impl FoundPulse {
    pub(super) fn of(
        fwhm: f64,
        reflectance: Reflectance,
        tried: &[Tried],
        seconds: f64,
        failed: Option<String>,
    ) -> FoundPulse {
        let of_model = || tried.iter().filter(|t| t.reflectance == reflectance);
        // The first model has no others.
        let own = of_model().any(|t| t.begun == Begun::OnItsOwn);
        let trials = of_model().filter(|t| !own || t.begun == Begun::OnItsOwn);
        let trials = trials.filter_map(|t| Some([t.fwhm, t.left.as_ref()?.share()])).collect();
        FoundPulse { fwhm, trials, seconds, failed }
    }

    /// The pulse; `None` if paths are sharp.
    ///
    /// # Errors
    /// The width makes no pulse. This does not happen with a width that was found.
    pub fn pulse(&self) -> Result<Option<Pulse>> {
        of_width(self.fwhm)
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        if let Some(why) = &self.failed {
            return format!(
                "the instrument's pulse is not known, paths are taken as sharp: {why} (give it if known)"
            );
        }
        let how = format!("of {} widths tried in {:.1} s,", self.trials.len(), self.seconds);
        if self.fwhm == 0.0 {
            return format!("the instrument's pulse: {how} none explains the data better than sharp paths");
        }
        let ps = three_digits(self.fwhm / METRES_PER_PICOSECOND);
        let fwhm = self.fwhm;
        format!(
            "the instrument's pulse: {how} {fwhm} m ({ps} ps) full width at half maximum explains the data best \
             (give this width, or no pulse, to skip the trials)"
        )
    }
}

/// A Gaussian of this width; `None` for width 0.
pub(super) fn of_width(fwhm: f64) -> Result<Option<Pulse>> {
    (fwhm > 0.0).then(|| Pulse::gaussian(fwhm)).transpose()
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
