//! Errors as exceptions.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use engine::advice::{Look, Remedy};
use engine::methods::SolverOptions;
use engine::{Error as EngineError, Kind, panic_message};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    thirdbounce,
    Error,
    PyException,
    "Everything that thirdbounce raises. `what` is wrong, `where`: the file, if one is concerned, `hint`: how to fix it."
);
create_exception!(thirdbounce, InputError, Error, "A capture, truth or scene that cannot be used.");
create_exception!(
    thirdbounce,
    OptionsError,
    Error,
    "An argument that is not valid, alone or with the capture."
);
create_exception!(thirdbounce, DeviceError, Error, "No such device, a missing feature, a lost device.");
create_exception!(thirdbounce, OutOfMemoryError, Error, "Not enough memory on the host or the device.");
create_exception!(thirdbounce, OutputError, Error, "A file that could not be written.");
create_exception!(thirdbounce, CancelledError, Error, "The solve was stopped.");
create_exception!(thirdbounce, DefectError, Error, "A defect of thirdbounce: please report it.");

/// Adds the exceptions to the module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let all = [
        ("Error", py.get_type::<Error>()),
        ("InputError", py.get_type::<InputError>()),
        ("OptionsError", py.get_type::<OptionsError>()),
        ("DeviceError", py.get_type::<DeviceError>()),
        ("OutOfMemoryError", py.get_type::<OutOfMemoryError>()),
        ("OutputError", py.get_type::<OutputError>()),
        ("CancelledError", py.get_type::<CancelledError>()),
        ("DefectError", py.get_type::<DefectError>()),
    ];
    all.into_iter().try_for_each(|(name, class)| module.add(name, class))
}

/// Runs the body of a call. Its error becomes an exception, and so does a panic. `place` is the file that it is about.
pub fn guarded<T>(
    py: Python<'_>,
    place: Option<&str>,
    body: impl FnOnce() -> engine::Result<T>,
) -> PyResult<T> {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(done) => done.map_err(|e| raised(py, &e, place)),
        Err(panic) => Err(defect(py, &*panic)),
    }
}

/// The exception of an error.
pub fn raised(py: Python<'_>, error: &EngineError, place: Option<&str>) -> PyErr {
    let named = place.and_then(|p| error.what.strip_prefix(&format!("{p}: ")));
    // Arrays have another name in files.
    let named_as = |text: &str| match place {
        Some(_) => in_python(text),
        None => in_python(text).replace("delta_t", "bin_width"),
    };
    let what = named_as(named.unwrap_or(&error.what));
    let hint = named_as(&error.hint.say(changed, found));
    let text = match place {
        Some(place) => format!("{place}: {what}\n  {hint}"),
        None => format!("{what}\n  {hint}"),
    };
    let made = match error.kind {
        Kind::Input => InputError::new_err(text),
        Kind::Options => OptionsError::new_err(text),
        Kind::Device => DeviceError::new_err(text),
        Kind::Memory => OutOfMemoryError::new_err(text),
        Kind::Output => OutputError::new_err(text),
        Kind::Cancelled => CancelledError::new_err(text),
    };
    with_parts(py, made, &what, place, &hint)
}

fn with_parts(py: Python<'_>, made: PyErr, what: &str, place: Option<&str>, hint: &str) -> PyErr {
    let value = made.value(py);
    let set = value.setattr("what", what);
    let set = set.and_then(|()| value.setattr("where", place)).and_then(|()| value.setattr("hint", hint));
    set.err().unwrap_or(made)
}

fn defect(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let what = panic_message(panic).unwrap_or("a defect");
    let hint = "report it; do not use the objects of this call again";
    with_parts(py, DefectError::new_err(format!("{what}\n  {hint}")), what, None, hint)
}

fn changed(remedy: Remedy) -> String {
    match remedy {
        Remedy::Set(setting) => format!("`{}`", setting.name()),
        Remedy::SmallerJob { .. } => "a smaller `lateral`, a narrower `gate` or a larger `stride`".into(),
    }
}

fn found(look: Look) -> String {
    match look {
        Look::Devices => "`thirdbounce.devices()`".into(),
        Look::Capture => "`thirdbounce info` on the command line".into(),
        Look::Options => "`thirdbounce.options()`".into(),
    }
}

/// The text with options by the names that they have in Python.
fn in_python(text: &str) -> String {
    let rows = SolverOptions::all_rows();
    let names = rows
        .iter()
        .map(|(row, _)| (row.name(), row.key))
        .chain([("solver".to_string(), "solver"), ("model".to_string(), "model")]);
    let mut names: Vec<_> = names.collect();
    // The longest first: --surface-points before --surface.
    names.sort_by_key(|(name, _)| std::cmp::Reverse(name.len()));
    names.iter().fold(text.to_string(), |text, (name, key)| text.replace(&format!("--{name}"), key))
}
