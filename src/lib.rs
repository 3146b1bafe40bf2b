//! Non-line-of-sight reconstruction on Vulkan compute.

pub mod capture;
pub mod error;
pub mod export;
pub mod maps;
pub mod measure;

pub use error::{Error, Kind, Result};
