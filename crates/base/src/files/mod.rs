//! File access: atomic writes, results of several files committed together, arrays in npz archives.

pub mod archive;
pub mod array;
pub mod atomic;
pub mod hidden;
pub mod staging;
pub mod stamp;
