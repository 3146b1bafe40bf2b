//! File access: atomic writes, results of several files that appear together, arrays in npz archives.

pub mod archive;
pub mod array;
pub mod atomic;
pub mod claim;
pub mod hidden;
pub mod opened;
pub mod staging;
