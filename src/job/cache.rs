//! Folders in which the command keeps files between runs.

use std::path::PathBuf;

/// The folder in which the command keeps compiled kernels; `None` if no cache folder is known.
pub fn usual_pipeline_cache() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let folder = absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))?;
    Some(folder.join("thirdbounce/kernels"))
}
