//! The report of a run, with every setting as it was resolved.

use serde_json::{Value, json};

use super::Request;
use super::load::Loaded;
use super::reconstruct::Finished;
use crate::capture::{Gate, Pulse};
use crate::engine::{Level, background};
use crate::export::report;
use crate::gpu::Gpu;
use crate::judge::{CaptureFinding, Estimates, FindingSource};
use crate::methods::SolverOptions;
use crate::settings::CALIBRATION;
use crate::surface;
use crate::transport::Grid;

/// The report, without the time of the export.
pub fn report_of(request: &Request, loaded: &Loaded, gpu: &Gpu, done: &Finished) -> report::Report {
    let result = &done.result;
    report::Report {
        verdict: result.verdict.as_deref().cloned(),
        version: env!("CARGO_PKG_VERSION").into(),
        device: report::Device {
            name: gpu.info.name.clone(),
            driver: gpu.info.driver.clone(),
            kind: plain(&gpu.info.kind),
        },
        settings: settings(request, loaded, done),
        warnings: result.warnings.clone(),
        capture: loaded.summary(),
        plan: report::PlanReport {
            variants: result.plan.variants(),
            left_out: result.plan.left_out.clone(),
            buffers: result.plan.bytes(),
            full: result.full,
        },
        trace: done.trace(),
        totals: report::Totals {
            load_s: loaded.seconds,
            solve_s: result.solve_seconds,
            export_s: 0.0,
            preview_s: None,
            stages: vec![],
            pairs: result.pairs as f64,
            pairs_per_s: result.pairs as f64 / result.solve_seconds.max(1e-9),
            peak_device_bytes: result.device_bytes,
        },
        metrics: done.metrics.clone(),
    }
}

/// Stages of a run in their order, with their seconds; those that did not run are left out.
pub fn stages(loaded: &Loaded, done: &Finished) -> Vec<report::StageSeconds> {
    let of = done.job.estimates.stages;
    let whole = done.result.solve_seconds;
    let estimated = of.search + of.start + of.high_pass + of.model + of.pulse;
    let [start, rounds, fit] = done.result.stages.unwrap_or([0.0, 0.0, whole - estimated]);
    let all = [
        ("read", loaded.seconds),
        ("corrections", of.search),
        ("start", of.start + start),
        ("high-pass", of.high_pass),
        ("model", of.model),
        ("impulse response", of.pulse),
        ("rounds", rounds),
        ("fit", fit),
        // Plans, buffers, mask and verdict.
        ("rest", whole - estimated - start - rounds - fit),
    ];
    let ran = all.into_iter().filter(|(_, seconds)| *seconds > 1e-6);
    ran.map(|(name, seconds)| report::StageSeconds { name: name.into(), seconds }).collect()
}

/// All settings as they were resolved. They suffice to repeat the run.
pub fn settings(request: &Request, loaded: &Loaded, done: &Finished) -> Value {
    let (result, grid) = (&done.result, &done.result.plan.levels.maps);
    let found = |source| done.job.estimates.finding(source);
    let mut all = json!({
        "solver": done.job.solver.name(),
        "model": result.plan.scene.reflectance,
        "preset": done.job.preset,
        "capture": loaded.path.to_string_lossy(),
        "empty": request.settings.empty,
        "wall": request.settings.wall,
        "stride": request.settings.stride.unwrap_or(1),
        "subset": request.settings.subset,
        "seed": request.settings.seed(),
        "gate": gate_json(loaded.gate),
        "pulse_fwhm": match &done.job.estimates.pulse {
            Some(found) => Some(found.fwhm),
            None => loaded.capture.pulse.as_ref().map(Pulse::fwhm),
        },
        "spots": [loaded.capture.laser_spot, loaded.capture.sensor_spot],
        "pulse_found": done.job.estimates.pulse,
        "device_found": found(FindingSource::Set).or(found(FindingSource::Named)),
        "empty_found": found(FindingSource::Empty),
        "model_found": done.job.estimates.model,
        "high_pass_found": done.job.estimates.high_pass,
        "sharpness_found": result.sharpness,
        "background_taken_off": background_of(loaded, done),
        "expected_iou": done.job.estimates.expected_iou,
        "candidates": done.job.estimates.candidates,
        "trials_s": done.job.estimates.seconds,
        "gate_was_found": loaded.gate.is_some() && request.settings.gate.is_none(),
        "bins": request.settings.bins.unwrap_or_default(),
        "bins_summed": done.job.sum,
        "levels": result.plan.levels.volume.iter().map(level_json).collect::<Vec<_>>(),
        "grid": grid.n,
        "grid_reached": [result.maps.nx, result.maps.ny, grid.n[2]],
        "volume_reached": [result.lateral, result.lateral, grid.n[2]],
        "volume_iterations": result.volume_iterations,
        "points_per_pixel": result.plan.levels.pixels.is_some().then(|| surface::points_of(&result.plan)),
        "voxel": grid.pitch.to_array(),
        "depth_pitch": grid.pitch.z,
        "box": box_of(grid),
        "device": request.settings.device,
        "memory": request.settings.memory,
        "truth": request.truth.as_ref().map(|path| path.to_string_lossy()),
        "mask_fraction": done.job.mask_fraction(),
        "trace_every": request.trace_step(),
        "accumulation_used": result.plan.division.accumulation,
        "notes": loaded.notes,
    });
    if let (Value::Object(all), Ok(Value::Object(options))) =
        (&mut all, serde_json::to_value(&done.job.solver))
    {
        all.extend(options);
        all.insert(CALIBRATION.into(), calibration_of(&done.job.estimates));
        // A setting that the solver chose.
        if let Some(chosen) = result.sharpness {
            all.insert(chosen.setting.into(), chosen.value.into());
        }
    }
    all
}

/// Every correction in its order, those of a file first, with what was found; null for a proper capture without a file.
fn calibration_of(estimates: &Estimates) -> Value {
    let of = |source| estimates.findings.iter().filter(move |found| found.source == source);
    let corrections = |source| of(source).flat_map(|found: &CaptureFinding| &found.corrections);
    let (file, given) = (of(FindingSource::File).next(), corrections(FindingSource::File).count());
    let all: Vec<_> = corrections(FindingSource::File).chain(corrections(FindingSource::Searched)).collect();
    match (&all[..], file) {
        ([], None) => Value::Null,
        _ => json!({
            "corrections": all,
            "file": file.and_then(|found| found.file.as_ref()),
            "given": given,
            "left_out": file.map_or(&[][..], |found| &found.left_out),
            "findings": estimates.findings,
        }),
    }
}

/// Counts per bin of every histogram that the solver took off as background; `None` if it takes none off.
fn background_of(loaded: &Loaded, done: &Finished) -> Option<f64> {
    match &done.job.solver {
        SolverOptions::Surface(o) if o.background => Some(background(&loaded.capture)),
        _ => None,
    }
}

/// A level of the volume.
fn level_json(level: &Level) -> Value {
    json!({
        "voxel": level.grid.pitch.to_array(),
        "pairs": level.pairs,
    })
}

/// (xmin, xmax, ymin, ymax, zmin, zmax) in metres, outer faces of the voxels.
pub fn box_of(grid: &Grid) -> Vec<f64> {
    grid.extent().into_iter().chain(grid.depth_range()).collect()
}

/// `[from, to]` in metres of path, null at an open end.
fn gate_json(gate: Option<Gate>) -> Value {
    gate.map_or(Value::Null, |g| {
        json!([g.from.is_finite().then_some(g.from), g.to.is_finite().then_some(g.to)])
    })
}

/// The word for a value in files ("cpu", "captured").
pub fn plain(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(word)) => word,
        _ => String::new(),
    }
}
