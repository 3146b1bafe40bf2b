//! File access: atomic writes, results of several files that appear together, arrays in npz archives.

pub mod archive;
pub mod array;
pub mod atomic;
#[cfg(feature = "formats")]
pub(crate) mod claim;
pub(crate) mod opened;
pub mod staging;
