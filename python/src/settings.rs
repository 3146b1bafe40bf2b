//! Settings as keyword arguments.

use engine::methods::SolverOptions;
use engine::options::rows::SceneTraits;
use engine::{Result, Settings};
use pyo3::prelude::*;

/// Settings as pairs of key and text, which the Python part makes.
pub type Texts = Vec<(String, String)>;

/// The settings of keyword arguments.
///
/// # Errors
/// Those of [`Settings::set`].
pub fn settings(texts: &Texts) -> Result<Settings> {
    let settings = Settings::from_texts(texts.iter().map(|(key, text)| (key.as_str(), text.as_str())))?;
    settings.check().map(|()| settings)
}

/// The options of a solver, with their texts.
#[pyfunction]
pub fn options(solver: &str) -> Vec<(&'static str, String)> {
    let usual = SolverOptions::defaults_for(solver, &SceneTraits::DEFAULT);
    let has = |key: &str| usual.as_ref().is_some_and(|options| options.value(key).is_some());
    let all = Settings::all_rows().into_iter().map(|(row, text)| (row.key, text));
    all.filter(|(key, _)| has(key)).collect()
}
