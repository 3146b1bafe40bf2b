//! Non-line-of-sight reconstruction on Vulkan compute.

pub mod capture;
pub mod error;
pub mod maps;
pub mod simulate;

pub use error::{Error, Kind, Result};
