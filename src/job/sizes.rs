//! Keeps sizes of workgroups that were found for a device and a kind of scene, for later runs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::SolverOptions;
use super::words::{plain, write_json};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::{Accumulation, Sizes};

/// The key under which sizes are kept: device, driver, solver, kind of pairs and reflectance.
pub fn class_of(gpu: &Gpu, solver: &SolverOptions, capture: &Capture) -> String {
    let kind = capture.pair_kind();
    let model = solver.common().reflectance;
    let (name, driver) = (gpu.info.name.trim(), gpu.info.driver.trim());
    format!("{name} | {driver} | {} | {} | {}", solver.name(), plain(&kind), plain(&model))
}

/// The solver with the sizes that [`super::profile::tune`] found for it. Options that set sizes are unchanged, as are those for
/// the same bits on every run, because private columns change the bits.
pub fn with_kept(solver: &SolverOptions, gpu: &Gpu, capture: &Capture) -> SolverOptions {
    let repeats = matches!(
        solver.common().accumulation,
        Accumulation::Repeatable | Accumulation::Fixed | Accumulation::Fixed32
    );
    if repeats || !solver.common().sizes.is_default() {
        return solver.clone();
    }
    match kept().get(&class_of(gpu, solver, capture)) {
        Some(sizes) => solver.with_sizes(*sizes),
        None => solver.clone(),
    }
}

/// `thirdbounce` in the user's cache folder.
fn cache() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let folder = absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))?;
    Some(folder.join("thirdbounce"))
}

/// The folder in which the command keeps compiled kernels; `None` if no cache folder is known.
pub fn usual_pipeline_cache() -> Option<PathBuf> {
    Some(cache()?.join("kernels"))
}

fn file() -> Option<PathBuf> {
    Some(cache()?.join("sizes.json"))
}

/// All sizes that are kept. A file that cannot be read counts as empty: it is only a cache.
fn kept() -> BTreeMap<String, Sizes> {
    let text = file().and_then(|file| std::fs::read_to_string(file).ok());
    text.and_then(|t| serde_json::from_str(&t).ok()).unwrap_or_default()
}

/// Keeps the sizes for later runs. Returns the file; `None` if no cache folder is known.
pub fn keep(class: &str, sizes: Sizes) -> Result<Option<PathBuf>> {
    let Some(file) = file() else { return Ok(None) };
    let mut all = kept();
    all.insert(class.into(), sizes);
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder).map_err(|e| {
            crate::Error::output(
                format!("{}: the folder cannot be made: {e}", folder.display()),
                "set XDG_CACHE_HOME to a folder that you may write to",
            )
        })?;
    }
    write_json(&file, &all, true)?;
    Ok(Some(file))
}
