//! Files, whatever they hold: written whole or not at all, moved in together, and arrays in npz archives.

pub mod archive;
pub mod array;
pub mod atomic;
pub mod staging;
