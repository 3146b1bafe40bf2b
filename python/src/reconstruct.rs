//! A whole reconstruction, as the command does it.

use std::path::PathBuf;

use engine::engine::VolumeMap;
use engine::job::{self, Request};
use engine::{Error, Kind};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::capture::Arrays;
use crate::devices;
use crate::error::guarded;
use crate::maps::{self, PageContent};
use crate::settings::{self, Texts};
use crate::tell::Teller;

/// Reconstructs a capture of arrays or of a file, and measures it against the truth of a file: maps, with `report` as JSON and
/// `notes` as sentences. `progress` is called with (doing, iteration, iterations, seconds, remaining, loss, lateral, fraction) and
/// stops the solve with `False`.
#[pyfunction]
pub fn reconstruct<'py>(
    py: Python<'py>,
    arrays: Option<Arrays<'py>>,
    path: Option<PathBuf>,
    truth: Option<PathBuf>,
    settings: Texts,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let place = path.as_ref().map(|path| path.display().to_string());
    let capture = guarded(py, None, || arrays.map(|arrays| arrays.capture()).transpose())?;
    let teller = Teller::new(progress, true);
    let done = guarded(py, place.as_deref(), || {
        py.detach(|| {
            let settings = settings::settings(&settings)?;
            let device = settings.device.clone();
            let loaded = match (capture, path) {
                (Some(capture), _) => job::take(capture, &settings)?,
                (None, path) => job::load(&path.unwrap_or_default(), &settings)?,
            };
            let gpu = devices::open(&device)?;
            let request = Request { truth, ..Request::new(settings, "") };
            let solved = job::solve(&request, &loaded, &gpu, &mut |p| teller.hear(p));
            if solved.as_ref().is_err_and(|e| e.kind == Kind::Device) {
                devices::forget(&device);
            }
            let outcome = solved?;
            let report = maps::packed(serde_json::to_string_pretty(&outcome.report))?;
            teller.finish();
            Ok((outcome, report, loaded))
        })
    });
    if let Some(raised) = teller.raised().take() {
        return Err(raised);
    }
    let (outcome, report, loaded) = done?;
    let made = maps::dictionary(py, outcome.maps)?;
    made.set_item("report", report)?;
    made.set_item("notes", [loaded.notes, outcome.notes].concat())?;
    made.set_item("warnings", outcome.warnings)?;
    made.set_item("verdict", outcome.verdict.grade.name())?;
    made.set_item("page", Bound::new(py, PageContent { title: loaded.capture.name, light: outcome.light })?)?;
    set_volume(&made, outcome.volume)?;
    Ok(made)
}

/// Adds a volume and its box.
pub fn set_volume(made: &Bound<'_, PyDict>, volume: Option<VolumeMap>) -> PyResult<()> {
    let Some(VolumeMap { grid, albedo }) = volume else { return Ok(()) };
    let ([x0, x1, y0, y1], [z0, z1]) = (grid.extent(), grid.depth_range());
    made.set_item("volume", PyArray1::from_vec(made.py(), albedo).reshape(grid.n)?)?;
    made.set_item("volume_extent", (x0, x1, y0, y1, z0, z1))
}

/// The metres of a length, or of a path if it `is_path`, with a unit.
#[pyfunction]
pub fn metres(py: Python<'_>, name: &str, text: &str, is_path: bool) -> PyResult<f64> {
    let read = if is_path { engine::options::units::path } else { engine::options::units::length };
    guarded(py, None, || read(text).map_err(|hint| Error::options(format!("{name} is {text:?}"), hint)))
}
