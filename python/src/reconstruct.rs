//! A whole reconstruction, as the command does it.

use engine::job::{self, Loaded, Outcome, Request};
use engine::{Error, Kind, Result};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::capture::Arrays;
use crate::devices;
use crate::error::guarded;
use crate::maps;
use crate::settings::{self, Texts};
use crate::tell::Teller;

/// Reconstructs a capture: maps, with `report` as JSON and `notes` as sentences. `progress` is called with (doing,
/// iteration, iterations, seconds, remaining, loss, lateral) and stops the solve with `False`.
#[pyfunction]
pub fn reconstruct<'py>(
    py: Python<'py>,
    arrays: Arrays<'py>,
    settings: Texts,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let capture = guarded(py, None, || arrays.capture())?;
    let teller = Teller::new(progress, true);
    let done = guarded(py, None, || {
        py.detach(|| {
            let settings = settings::settings(&settings)?;
            let device = settings.device.clone();
            let loaded = job::take(capture, &settings)?;
            let gpu = devices::open(&device)?;
            let request = Request::new(settings, "");
            let solved = job::solve(&request, &loaded, &gpu, &mut |p| teller.hear(p));
            if solved.as_ref().is_err_and(|e| e.kind == Kind::Device) {
                devices::forget(&device);
            }
            packed(solved?.outcome, &loaded)
        })
    });
    if let Some(raised) = teller.raised().take() {
        return Err(raised);
    }
    let (found, report, [notes, warnings]) = done?;
    let made = maps::dictionary(py, found)?;
    made.set_item("report", report)?;
    made.set_item("notes", notes)?;
    made.set_item("warnings", warnings)?;
    Ok(made)
}

/// The result with its report as text and all notes.
fn packed(outcome: Outcome, loaded: &Loaded) -> Result<(engine::maps::Maps, String, [Vec<String>; 2])> {
    let report = serde_json::to_string_pretty(&outcome.report)
        .map_err(|e| Error::output(format!("the report cannot be packed: {e}"), "report this as a bug"))?;
    let notes = [&loaded.notes[..], &outcome.notes].concat();
    Ok((outcome.maps, report, [notes, outcome.warnings]))
}
