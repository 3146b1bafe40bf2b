//! A whole run: what is checked first, the solve, and the files.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::load::Loaded;
use super::places::{PAGE, PREVIEW};
use super::preview::Preview;
use super::{Request, reconstruct, report};
use crate::engine::{Evidence, Progress, Reconstruction, VolumeMap};
use crate::export::page::PageHistograms;
use crate::export::report::Report;
use crate::files::archive::npz_bytes;
use crate::files::array::Array;
use crate::files::atomic;
use crate::files::staging::Staging;
use crate::gpu::{Gpu, KernelTime};
use crate::judge::Job;
use crate::maps::{Maps, Truth};
use crate::methods::SolverOptions;
use crate::{Error, Result, Verdict, export};

/// The result of a run.
#[derive(Debug)]
pub struct Outcome {
    /// The report, as `report.json` has it; without the time of the export until that is done.
    pub report: Report,
    /// Albedo, depth, normals and mask.
    pub maps: Maps,
    /// The volume, if the settings keep it or the request names a file for it; `None` once it is written.
    pub volume: Option<VolumeMap>,
    /// Histograms for the page of the result.
    pub light: PageHistograms,
    /// The truth, if its file was given.
    pub truth: Option<Truth>,
    /// Time per kernel, if it was asked for.
    pub kernels: Vec<(&'static str, KernelTime)>,
    /// Messages of the validation layer, if it was on.
    pub validation: Vec<String>,
    /// What was assumed and estimated, as sentences.
    pub notes: Vec<String>,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
    /// The verdict on the result.
    pub verdict: Verdict,
    /// Every file that was written, the report last; none before [`Outcome::write`].
    pub files: Vec<PathBuf>,
    /// What is known of every pixel, if the request names a file for it.
    evidence: Option<Arc<Evidence>>,
    /// The capture's name.
    title: String,
    /// Deleted once results are written.
    preview: Option<Preview>,
}

/// Reconstructs a capture. Writes maps, pictures, points, the volume if the request names a file for it, and last the
/// report: a folder with a report holds a whole result. `hear` is called with the progress and may cancel.
///
/// # Errors
/// Before anything is computed: options out of range, a truth that cannot be read, or a place that cannot be written.
/// Later: the errors of [`crate::engine::Solver::solve`], or a file that cannot be written. No report
/// is written then.
pub fn run(
    request: &Request,
    loaded: &Loaded,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    run_on(request, loaded, || request.open(), hear)
}

/// As [`run`], on the device that `open` returns.
///
/// # Errors
/// Those of [`run`] and of `open`.
pub fn run_on(
    request: &Request,
    loaded: &Loaded,
    open: impl FnOnce() -> Result<Gpu>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    let job = request.job(&loaded.capture);
    let truth = request.check()?;
    request.check_places()?;
    // Memory is checked before a device is needed.
    job.grid()?;
    let gpu = open()?;
    solve_checked(request, job, loaded, &gpu, truth, hear)?.write(request)
}

/// Reconstructs a capture on a device that is open. Writes nothing but the preview, if the request asks for one.
///
/// # Errors
/// Options out of range, a truth that cannot be read, and the errors of
/// [`crate::engine::Solver::solve`].
pub fn solve(
    request: &Request,
    loaded: &Loaded,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    let job = request.job(&loaded.capture);
    let truth = request.check()?;
    job.grid()?;
    solve_checked(request, job, loaded, gpu, truth, hear)
}

fn solve_checked(
    request: &Request,
    job: Job<'_>,
    loaded: &Loaded,
    gpu: &Gpu,
    truth: Option<Truth>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    // A closed-form method is there as soon as a preview.
    let preview = match request.preview && !job.solver.is_closed_form() {
        true => Some(Preview::new(&request.out)),
        false => None,
    };
    let done = reconstruct::solve(request, (job, loaded), gpu, truth.as_ref(), preview.as_ref(), hear)?;
    let mut notes: Vec<String> = done.job.notes();
    notes.extend(notes_on(&done.job.solver, &done.result));
    let mut report = report::report_of(request, loaded, gpu, &done);
    // Copies the notes into the report.
    report.settings["notes"] = loaded.notes.iter().chain(&notes).cloned().collect();
    report.totals.preview_s = preview.as_ref().and_then(Preview::seconds);
    report.totals.stages = report::stages(loaded, &done);
    let result = done.result;
    Ok(Outcome {
        report,
        maps: result.maps,
        volume: result.volume,
        light: PageHistograms::of(&loaded.capture),
        truth,
        kernels: if request.timings { result.kernels } else { vec![] },
        validation: gpu.validation_messages(),
        notes,
        warnings: result.warnings,
        verdict: result.verdict.map_or(Verdict::GOOD, Arc::unwrap_or_clone),
        files: vec![],
        evidence: result.evidence,
        title: title(&loaded.path),
        preview,
    })
}

impl Outcome {
    /// Writes every file that `request` asks for, the report last.
    ///
    /// # Errors
    /// A file that cannot be written. No report is written then.
    pub fn write(mut self, request: &Request) -> Result<Outcome> {
        let start = Instant::now();
        // An older result stays whole until the new one is complete.
        let staging = Staging::new(&request.out)?;
        let mut staged = export::write_maps(staging.path(), &self.maps)?;
        if let (Some(file), Some(volume)) = (&request.volume_file, self.volume.take()) {
            export::volume::write(file, &export_volume(volume))?;
            self.files.push(file.clone());
        }
        if let Some(file) = &request.layers_file {
            write_layers(file, self.evidence.as_deref(), &self.maps)?;
            self.files.push(file.clone());
        }
        // The page is written before the report, with the time of all files but these two.
        let stage = |seconds| export::report::StageSeconds { name: "export".into(), seconds };
        self.report.totals.stages.push(stage(start.elapsed().as_secs_f64()));
        let page = staging.path().join(PAGE);
        export::page::write(&page, &self.title, &self.maps, &self.light, &self.report, self.truth.as_ref())?;
        staged.push(page);
        self.report.totals.export_s = start.elapsed().as_secs_f64();
        self.report.totals.stages.pop();
        self.report.totals.stages.push(stage(self.report.totals.export_s));
        let path = staging.path().join("report.json");
        export::report::write(&path, &self.report)?;
        staged.push(path);
        self.files.splice(0..0, staging.commit(&staged)?);
        // The result shows more. One that a killed run left goes, too.
        drop(self.preview.take());
        let _ = std::fs::remove_file(request.out.join(PREVIEW));
        Ok(self)
    }
}

/// Writes what is known of every pixel, the depths that it is known at, and where they lie (`learn/README.md`).
fn write_layers(file: &Path, evidence: Option<&Evidence>, maps: &Maps) -> Result<()> {
    let Some(evidence) = evidence else {
        return Err(Error::input(
            "the result has no layers: it began without the network, shows nothing, or has not 128 x 128 pixels",
            "leave out --layers, or reconstruct at least 7 x 7 points with the default solver and pixels",
        ));
    };
    let shape = [maps.nx, maps.ny];
    let channels: Vec<f32> = evidence.channels.iter().flatten().copied().collect();
    let arrays = [
        ("channels", Array::from_f16(&[evidence.channels.len(), maps.nx, maps.ny], &channels)),
        ("depth", Array::from_f32(&shape, &evidence.depth)),
        ("mask", Array::from_bool(&shape, &evidence.mask)),
        ("wall", Array::from_f64(&[2], &evidence.wall)),
        ("extent", Array::from_f64(&[4], &maps.extent)),
    ];
    atomic::write(file, &npz_bytes(&arrays)?)
}

/// The name of a capture's file.
fn title(capture: &Path) -> String {
    capture.file_name().map_or_else(|| "capture".into(), |name| name.to_string_lossy().into_owned())
}

/// Notes: an end before the last doubling, a second surface, filled places, what lies at the border.
fn notes_on(solver: &SolverOptions, solved: &Reconstruction) -> Vec<String> {
    let mut notes = Vec::new();
    let (reached, wanted) = (solved.lateral, solved.plan.finest().grid.n[0]);
    if reached < wanted {
        notes.push(format!(
            "{} iterations end at {reached} lateral voxels, not at {wanted}: give more iterations, double the grid \
             earlier, or start with the finest grid",
            solver.common().iterations[0]
        ));
    }
    if let Some(behind) = &solved.maps.behind {
        notes.push(format!(
            "{} pixels have a second surface behind the first: the maps hold the nearer one, layers_* of maps.npz, \
             points and mesh hold both",
            behind.mask.iter().filter(|m| **m).count()
        ));
    }
    if solved.filled > 0 {
        notes.push(format!(
            "{} places of the scan have no pair: each has the mean of the pairs around it, as Fourier methods need them all",
            solved.filled
        ));
    }
    if let Some(chosen) = solved.sharpness.filter(|chosen| chosen.value != chosen.sharpest) {
        notes.push(format!(
            "the image is less sharp than usual, so that noise is not taken for surface: --{} is {} in place of {}",
            chosen.setting.replace('_', "-"),
            chosen.value,
            chosen.sharpest
        ));
    }
    if is_at_border(&solved.maps) {
        notes.push(
            "most of what was found lies at the border of the box: the scene may lie beyond it, beside the scanned part of \
             the wall (give a wider volume)"
                .into(),
        );
    }
    notes
}

/// Whether more than half of the mask is within a sixteenth of the picture from its border: of a surface that fills the
/// picture it is a quarter.
fn is_at_border(maps: &Maps) -> bool {
    let near = |i: usize, n: usize| i < n / 16 || i >= n - n / 16;
    let shown = || (0..maps.mask.len()).filter(|p| maps.mask[*p]);
    let border = shown().filter(|p| near(p / maps.ny, maps.nx) || near(p % maps.ny, maps.ny)).count();
    2 * border > shown().count()
}

fn export_volume(volume: VolumeMap) -> export::volume::VolumeArrays {
    let ([x0, x1, y0, y1], [z0, z1]) = (volume.grid.extent(), volume.grid.depth_range());
    export::volume::VolumeArrays {
        size: volume.grid.n,
        extent: [x0, x1, y0, y1, z0, z1],
        albedo: volume.albedo,
        normal: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maps of 64 x 48 pixels whose mask holds these.
    fn shown(mask: impl Fn(usize, usize) -> bool) -> bool {
        let [nx, ny] = [64, 48];
        let mut maps = Maps {
            albedo: vec![1.0; nx * ny],
            depth: vec![1.0; nx * ny],
            normal: vec![[0.0, 0.0, -1.0]; nx * ny],
            ..Maps::empty([nx, ny], [0.0, 1.0, 0.0, 1.0])
        };
        maps.mask = (0..nx * ny).map(|p| mask(p / ny, p % ny)).collect();
        is_at_border(&maps)
    }

    #[test]
    fn what_lies_at_the_border_is_told_from_what_fills_the_picture() {
        assert!(shown(|x, _| x >= 60) && shown(|_, y| y < 5), "one border");
        assert!(!shown(|_, _| true) && !shown(|_, _| false));
        // A thing in the middle, and one that reaches the border.
        assert!(!shown(|x, y| (20..40).contains(&x) && y > 10) && !shown(|x, _| x >= 50));
    }
}
