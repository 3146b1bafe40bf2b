//! Finds the width of the instrument's pulse by trials. A trial is a quick solve with a Gaussian pulse; the width that
//! explains the data best is taken. Trials end with a surface: unlike the haze of a volume, it cannot compensate for a
//! wrong width.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::Request;
use super::request::Ready;
use crate::capture::{Capture, METRES_PER_PICOSECOND, Pulse};
use crate::gpu::Gpu;
use crate::solve::{Doing, Progress, Watch, default_volume};
use crate::{Error, Kind, Result};

/// The result of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPulse {
    /// Full width at half maximum, metres of path; 0: no width is better than sharp paths.
    pub fwhm: f64,
    /// Widths that were tried, metres, and the final objective of each.
    pub trials: Vec<[f64; 2]>,
    /// Seconds that the trials took.
    pub seconds: f64,
    /// Why the trials failed, if they did; paths are then taken as sharp.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// Pairs, lateral pixels and iterations of a trial.
const PAIRS: usize = 256;
const LATERAL: usize = 64;
const ITERATIONS: usize = 25;
const SURFACE_ITERATIONS: usize = 40;

/// A pulse is taken only if it lowers the objective by more than this share.
const WORTH: f64 = 0.003;

/// Widths in bins: the first trial, the widest trial, and the narrowest pulse that is worth its kernels.
const FIRST: f64 = 2.0;
const WIDEST: f64 = 32.0;
const NARROWEST: f64 = 1.0;

impl FoundPulse {
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
fn of_width(fwhm: f64) -> Result<Option<Pulse>> {
    (fwhm > 0.0).then(|| Pulse::gaussian(fwhm)).transpose()
}

/// The capture with its pulse. Finds the pulse first if `request` asks for that and it is not `known`.
///
/// # Errors
/// The device fails, or `hear` cancels a trial ([`Kind::Cancelled`]). If a trial fails otherwise, paths stay sharp, and
/// the solve itself reports what is wrong.
pub fn settle<'c>(
    request: &Request,
    capture: &'c Capture,
    gpu: &Gpu,
    known: Option<FoundPulse>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(Cow<'c, Capture>, Option<FoundPulse>)> {
    if !is_unfound(request, capture) {
        return Ok((Cow::Borrowed(capture), None));
    }
    let found = match known {
        Some(known) => known,
        None => find(request, capture, gpu, hear)?,
    };
    let with = match found.pulse()? {
        Some(pulse) => Cow::Owned(Capture { pulse: Some(pulse), ..capture.clone() }),
        None => Cow::Borrowed(capture),
    };
    Ok((with, Some(found)))
}

/// Whether a run finds the pulse first.
pub(super) fn is_unfound(request: &Request, capture: &Capture) -> bool {
    request.find_pulse && capture.pulse.is_none()
}

/// What to plan for: the capture without its counts, which a plan does not need and which may be large. A pulse that is
/// still to be found gets any width: all widths take the same memory.
///
/// # Errors
/// A bin width that makes no pulse, and those of [`Request::ready`].
pub(super) fn to_plan(request: &Request, capture: &Capture) -> Result<Ready<'static>> {
    let pulse = match is_unfound(request, capture) {
        true => Some(Pulse::gaussian(4.0 * capture.bin_width)?),
        false => capture.pulse.clone(),
    };
    let sum = request.sum(&Capture { pulse: pulse.clone(), ..capture.outline() });
    let summed = if sum == 1 { Cow::Borrowed(capture) } else { Cow::Owned(capture.binned(sum)?) };
    let grid = request.grid(&summed)?;
    Ok(Ready { capture: Cow::Owned(Capture { pulse, ..summed.outline() }), grid, sum })
}

fn find(
    request: &Request,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<FoundPulse> {
    let _span = gpu.span("pulse");
    let start = Instant::now();
    let mut trials = vec![];
    let best = trial_of(request, capture, gpu, hear).and_then(|(mut misfit, bin_width)| {
        let bins = best_width(&mut |bins| {
            let width = bins * bin_width;
            let left = misfit(width)?;
            trials.extend(left.map(|left| [width, left]));
            Ok(left)
        })?;
        Ok(bins * bin_width)
    });
    let (width, failed) = match best {
        Ok(width) => (width, None),
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => return Err(e),
        Err(e) => (0.0, Some(e.what)),
    };
    let fwhm = three_digits(width);
    Ok(FoundPulse { fwhm, trials, seconds: start.elapsed().as_secs_f64(), failed })
}

/// Rounds as the note does, so that a width copied from the note gives the same result.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

type Misfit<'a> = Box<dyn FnMut(f64) -> Result<Option<f64>> + 'a>;

/// Prepares trials. The first part of the result maps a width in metres to the final objective, or to `None` if no
/// surface is found. The second is the width of the trials' bins, metres: as narrow as their pixels can tell.
fn trial_of<'a>(
    request: &Request,
    capture: &Capture,
    gpu: &'a Gpu,
    hear: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(Misfit<'a>, f64)> {
    let options = request.solver.as_vector(capture.is_confocal());
    let fine = options.lateral >= LATERAL;
    let options = options.with(|o| {
        o.lateral = o.lateral.min(LATERAL);
        o.iterations = ITERATIONS;
        o.surface.iterations = SURFACE_ITERATIONS;
        o.surface.pixels_per_voxel = fine.then_some(2);
        o.surface.points = None;
        o.surface.blur = 0.0;
        o.surface.sparsity = 0.0;
        o.domain.room = None;
    });
    let volume = request.volume.map_or_else(|| default_volume(capture, options.domain.min_depth), Ok)?;
    let trial = Request {
        volume: Some(volume),
        memory: request.memory,
        bins: request.bins,
        ..Request::new(options, "")
    };
    let thin = capture.subset(PAIRS.min(capture.pair_count()), 0)?;
    let Ready { capture: thin, grid, .. } = trial.ready(Cow::Owned(thin))?;
    let mut thin = thin.into_owned();
    let bin_width = thin.bin_width;
    let misfit: Misfit<'a> = Box::new(move |width| {
        thin.pulse = of_width(width)?;
        let mut told = |p: &Progress| hear(&Progress { doing: Doing::Trial, ..p.clone() });
        let mut watch = Watch { hear: &mut told, maps_every: None, maps_at: &[] };
        let done = trial.solver.solve(gpu, &thin, grid, trial.memory, false, &mut watch)?;
        let last = done.trace.last().filter(|p| p.iteration > done.volume_iterations);
        Ok(last.map(|p| p.loss))
    });
    Ok((misfit, bin_width))
}

/// The width in bins with the least `misfit`. Doubles the width while that helps, then fits a parabola. 0 if no width
/// is enough better than sharp paths, or if the misfit falls up to the widest.
fn best_width(misfit: &mut dyn FnMut(f64) -> Result<Option<f64>>) -> Result<f64> {
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
        // One side of the minimum may be much steeper than the other, so both sides are tried.
        let least = least_of(&known);
        let halves: Vec<f64> = known[least.saturating_sub(1)..(least + 2).min(known.len())]
            .windows(2)
            .map(|pair| 0.5 * (pair[0][0] + pair[1][0]))
            .collect();
        for width in halves {
            known.push([width, at(width)?]);
        }
        known.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    let least = known[least_of(&known)][1];
    // The vertex of the parabola is more accurate than the best trial.
    let width = vertex(&known).filter(|w| *w >= NARROWEST && least < (1.0 - WORTH) * sharp);
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
        let width = best_width(&mut |w| {
            calls += 1;
            Ok(Some(left(w)))
        });
        (width.unwrap(), calls)
    }

    #[test]
    fn the_least_misfit_is_found_in_a_few_trials() {
        for true_width in [1.3, 2.0, 3.4, 5.0, 9.0, 20.0] {
            let (width, calls) = found(|w| 1.0 + ((w - true_width) / (3.0 + true_width)).powi(2));
            assert!((width / true_width - 1.0).abs() < 0.03 && calls <= 8, "{true_width}: {width}, {calls}");
        }
        // Twice as steep above the true width.
        for true_width in [2.0, 3.4, 5.0, 9.0, 20.0] {
            let steep = |w: f64| if w < true_width { 1.0 } else { 4.0 };
            let (width, _) = found(|w| 1.0 + steep(w) * ((w - true_width) / (3.0 + true_width)).powi(2));
            assert!((width / true_width - 1.0).abs() < 0.2, "{true_width}: {width}");
        }
    }

    #[test]
    fn what_is_as_good_as_sharp_is_sharp() {
        assert_eq!(found(|w| 1.0 + w).0, 0.0);
        assert_eq!(found(|_| 1.0).0, 0.0);
        // The gain is too small.
        assert_eq!(found(|w| 1.0 + 1e-4 * (w - 3.0) * (w - 3.0)).0, 0.0);
        assert!(best_width(&mut |_| Ok(None)).is_err());
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
