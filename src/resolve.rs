//! A reconstruction that is resolved: nothing is left to defaults or estimates.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use crate::Result;
use crate::capture::Capture;
use crate::diagnosis;
use crate::estimation::{self, EstimateRequest, Estimates};
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::settings::{Calibrate, DevicePosition, ImpulseResponse, ReflectanceSetting, Settings};
use crate::solve::{
    Method, Preset, Problem, Progress, Ready, Reconstruction, SolverOptions, Watch, conclude,
};
use crate::transport::Grid;
use crate::{Grade, Verdict};

/// A capture with everything that its reconstruction needs: [`Settings`], where they are set, else defaults and estimates.
#[derive(Debug, Clone)]
pub struct Job<'c> {
    /// The capture in the bins of the solver, with the impulse response.
    pub capture: Cow<'c, Capture>,
    /// The preset in force.
    pub preset: Preset,
    /// The reason for the preset, if it is not set.
    pub why: Option<&'static str>,
    /// The solver with all its options.
    pub solver: SolverOptions,
    /// The grid whose lateral cells are the pixels of the maps.
    pub grid: Grid,
    /// Number of neighbouring bins of the capture that are one of the solver's.
    pub sum: usize,
    /// Estimates, with their evidence.
    pub estimates: Estimates,
    /// The verdict by estimates and held-out pairs, without what the maps say.
    pub verdict: Arc<Verdict>,
    /// A pixel is surface above this share of the brightest albedo; `None`: the mask of the method.
    pub mask_fraction: Option<f64>,
    /// Largest amount of device memory to use, bytes.
    pub memory: Option<u64>,
    /// Whether the volume is returned.
    pub keep_volume: bool,
    /// Whether what is known of every pixel is returned.
    pub keep_layers: bool,
}

impl<'c> Job<'c> {
    /// Resolves the settings for a capture: by short fits on the device where an estimate is needed and the capture has light.
    /// `hear` is called with the progress of the fits and may cancel.
    ///
    /// # Errors
    /// Settings out of range, or that the capture does not allow; the device fails; `hear` cancels.
    pub fn resolve(
        settings: &Settings,
        capture: &'c Capture,
        gpu: &Gpu,
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Job<'c>> {
        settings.check()?;
        let mut request = EstimateRequest::new(settings, capture);
        // Errors of the box come before any fit.
        request.discretisation.grid(&request.solver, capture)?;
        let has_light = capture.histograms.iter().any(|v| *v > 0.0);
        let clock = Instant::now();
        let device = match has_light {
            true => estimation::device(&request, capture, settings.device_at, gpu, hear)?,
            false => None,
        };
        let of_device = if device.is_some() { clock.elapsed().as_secs_f64() } else { 0.0 };
        let (device, divided) = device.map_or((None, None), |(found, divided)| (Some(found), divided));
        let capture = match divided {
            Some(divided) => {
                request = EstimateRequest::new(settings, &divided);
                Cow::Owned(divided)
            }
            None => Cow::Borrowed(capture),
        };
        let mut estimates = match has_light {
            true => estimation::estimate(&request, &capture, gpu, hear)?,
            false => Estimates::default(),
        };
        let calibrates = settings.calibrate.unwrap_or_default() == Calibrate::Auto;
        let mut diagnosis = diagnosis::diagnose(&request, &capture, &estimates, calibrates, gpu, hear)?;
        let (solver, capture) = match diagnosis.calibrated.take() {
            Some(calibrated) => {
                let before = estimates.seconds;
                request = EstimateRequest::new(settings, &calibrated);
                estimates = estimation::estimate(&request, &calibrated, gpu, hear)?;
                estimates.seconds += before;
                let (solver, capture) = estimates.settle(&request.solver, &request.models, &calibrated)?;
                (solver, Cow::Owned(capture.into_owned()))
            }
            None => {
                let (solver, settled) = estimates.settle(&request.solver, &request.models, &capture)?;
                let settled = match settled {
                    Cow::Owned(settled) => Some(settled),
                    Cow::Borrowed(_) => None,
                };
                (solver, settled.map_or(capture, Cow::Owned))
            }
        };
        estimates.seconds += of_device;
        estimates.device = device;
        let verdict = Arc::new(diagnosis::verdict(&estimates, &diagnosis));
        let Ready { capture, grid, sum } = request.discretisation.ready(&solver, capture)?;
        Ok(Job {
            capture,
            preset: request.preset,
            why: request.why,
            mask_fraction: settings.mask_fraction.or(solver.usual_mask()),
            solver,
            grid,
            sum,
            estimates,
            verdict,
            memory: settings.memory,
            keep_volume: settings.keep_volume == Some(true),
            keep_layers: false,
        })
    }

    /// These settings with the estimates in their places: they need no fits.
    pub fn settings(&self, settings: &Settings) -> Settings {
        Settings {
            preset: Some(self.preset),
            model: Some(ReflectanceSetting::Known(self.solver.common().reflectance)),
            pulse: Some(ImpulseResponse::None),
            device_at: Some(DevicePosition::None),
            method: Method::of(&self.solver),
            ..settings.clone()
        }
    }

    /// The problem that the solver takes.
    pub fn problem(&self) -> Problem<'_> {
        Problem {
            memory: self.memory,
            with_volume: self.keep_volume,
            with_layers: self.keep_layers,
            begin: self.estimates.begun.as_ref(),
            ..Problem::new(&self.capture, self.grid)
        }
    }

    /// Solves. Times of the result include those of the estimates.
    ///
    /// # Errors
    /// See [`crate::solve::Solver::solve`].
    pub fn solve(&self, gpu: &Gpu, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let mut result = self.solver.solve(gpu, &self.problem(), watch)?;
        result.solve_seconds += self.estimates.seconds;
        result.trace.iter_mut().for_each(|point| point.seconds += self.estimates.seconds);
        Ok(result)
    }

    /// Decides on the pixels that are surface, and on the depth errors: of the result, and of the maps after earlier
    /// iterations. Gives the verdict, with what looks wrong with the capture (`warnings`) and what is wrong for certain (`faults`).
    pub fn conclude(
        &self,
        result: &mut Reconstruction,
        snapshots: &mut [(usize, Maps)],
        [warnings, faults]: [&[String]; 2],
    ) {
        conclude(&self.capture, self.mask_fraction, result, snapshots);
        let mut verdict = with_warnings(&self.verdict, &result.warnings);
        with_capture(Arc::make_mut(&mut verdict), warnings, faults);
        result.warnings.splice(0..0, warnings.iter().cloned());
        // A poor result is never without a warning.
        let first = verdict.reasons.first().filter(|_| verdict.grade == Grade::Poor);
        result.warnings.extend(first.filter(|reason| !result.warnings.contains(reason)).cloned());
        result.verdict = Some(verdict);
    }

    /// The estimates, and the bins that are summed, as sentences.
    pub fn notes(&self) -> Vec<String> {
        let preset = self.why.map(|why| preset_note(self.preset, why));
        let summed = summed_note(self.sum, self.capture.bin_width);
        preset.into_iter().chain(self.estimates.notes()).chain(summed).collect()
    }
}

/// The verdict with what the maps say: it is poor if they have warnings, and fair if the network sees the scene well all the same, as
/// before a wall that sends most of the light.
pub fn with_warnings(verdict: &Arc<Verdict>, warnings: &[String]) -> Arc<Verdict> {
    let mut verdict = verdict.clone();
    let is_seen = verdict.expected_iou.is_some_and(|iou| iou >= diagnosis::EXPECTED_IOU);
    for warning in warnings {
        Arc::make_mut(&mut verdict).add(if is_seen { Grade::Fair } else { Grade::Poor }, warning);
    }
    verdict
}

/// Adds what is known of the capture: faults that are certain make a verdict poor, what looks wrong fair.
fn with_capture(verdict: &mut Verdict, warnings: &[String], faults: &[String]) {
    warnings.iter().for_each(|warning| verdict.add(Grade::Fair, warning));
    faults.iter().for_each(|fault| verdict.add(Grade::Poor, fault));
}

/// The note on a preset that is not set.
pub fn preset_note(preset: Preset, why: &str) -> String {
    format!("{why}: the preset {} is used", preset.name())
}

/// The note on `sum` bins that are one of `width` metres of path; `None` if none were summed.
pub fn summed_note(sum: usize, width: f64) -> Option<String> {
    (sum > 1).then(|| {
        format!(
            "{sum} bins are summed into one of {:.3} mm, as pixels and impulse response blur more",
            1e3 * width
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspicious_capture_is_fair_and_a_certain_fault_poor() {
        let [odd, broken] = ["odd", "broken"].map(|text| vec![text.to_owned()]);
        let graded = |warnings: &[String], faults: &[String]| {
            let mut verdict = Verdict::GOOD;
            with_capture(&mut verdict, warnings, faults);
            (verdict.grade, verdict.reasons)
        };
        assert_eq!(graded(&odd, &[]), (Grade::Fair, odd.clone()));
        let (grade, reasons) = graded(&odd, &broken);
        assert_eq!(grade, Grade::Poor);
        assert!(reasons.contains(&broken[0]));
    }
}
