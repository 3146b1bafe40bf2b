//! Measures an earlier result: against truth, and by what its maps say of themselves.

use std::path::{Path, PathBuf};

use thirdbounce::export::report;
use thirdbounce::job::evaluate_maps;
use thirdbounce::maps::MaskPart;
use thirdbounce::measure::Metrics;
use thirdbounce::{Result, export};

/// The result of an evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Figures against truth, if there is one.
    pub metrics: Option<Metrics>,
    /// Connected parts of the mask, the largest first.
    pub parts: Vec<MaskPart>,
    /// Solve seconds of the run, if it left a report.
    pub solve_s: Option<f64>,
    /// The picture of the depth errors, if one was drawn.
    pub picture: Option<PathBuf>,
}

/// Measures the maps of an earlier run, against truth if there is one. `folder` is the run's folder, or a maps.npz. With `pictures`,
/// truth and a folder, the depth errors are drawn into `depth_difference.png` in this folder.
///
/// # Errors
/// Files that cannot be read, a mask fraction out of range, a picture that cannot be written.
pub fn evaluate(
    folder: &Path,
    truth: Option<&Path>,
    mask_fraction: Option<f64>,
    pictures: bool,
) -> Result<Evaluation> {
    let is_file = folder.is_file();
    let (file, report) = if is_file {
        (folder.to_path_buf(), None)
    } else {
        (folder.join("maps.npz"), report::read(&folder.join("report.json")).ok())
    };
    let mut maps = export::npz::read_maps(&file)?;
    let truth = truth.map(export::npz::read_truth).transpose()?;
    let metrics = truth.as_ref().map(|truth| evaluate_maps(&mut maps, truth, mask_fraction)).transpose()?;
    if mask_fraction.is_some() {
        maps.set_mask(mask_fraction);
    }
    let picture = (pictures && !is_file && truth.is_some()).then(|| folder.join("depth_difference.png"));
    if let (Some(path), Some(truth)) = (&picture, &truth) {
        export::depth_difference::write(path, &maps, truth)?;
    }
    Ok(Evaluation { metrics, parts: maps.parts(), solve_s: report.map(|r| r.totals.solve_s), picture })
}
