//! An earlier result against truth.

use std::path::{Path, PathBuf};

use crate::Result;
use crate::export::{self, report};
use crate::measure::{Metrics, metrics};

/// What an evaluation found.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// The figures.
    pub metrics: Metrics,
    /// Solve seconds of the run, if it left a report.
    pub solve_s: Option<f64>,
    /// The picture of the depth errors, if one was drawn.
    pub picture: Option<PathBuf>,
}

/// The maps of an earlier run, a folder or a maps.npz, against truth. With `pictures` and a folder it draws
/// the depth errors into `depth_error.png` there.
///
/// # Errors
/// Files that cannot be read, a mask fraction out of range, a picture that cannot be written.
pub fn evaluate(
    folder: &Path,
    truth: &Path,
    mask_fraction: Option<f64>,
    pictures: bool,
) -> Result<Evaluation> {
    let is_file = folder.is_file();
    let (file, report) = if is_file {
        (folder.to_path_buf(), None)
    } else {
        (folder.join("maps.npz"), report::read(&folder.join("report.json")).ok())
    };
    let maps = export::npz::read_maps(&file)?;
    let truth = export::npz::read_truth(truth)?;
    let fraction = mask_fraction.unwrap_or(maps.mask_fraction);
    let metrics = metrics(&maps, &truth, fraction)?;
    let picture = (pictures && !is_file).then(|| folder.join("depth_error.png"));
    if let Some(path) = &picture {
        export::depth_error::write(path, &maps, &truth, fraction)?;
    }
    Ok(Evaluation { metrics, solve_s: report.map(|r| r.totals.solve_s), picture })
}
