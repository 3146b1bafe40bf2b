//! Non-line-of-sight reconstruction on Vulkan compute.

pub mod capture;
pub mod error;
pub mod export;
pub mod gpu;
pub mod job;
pub mod maps;
pub mod measure;
pub mod simulate;
pub mod solve;
pub mod transport;

pub use error::{Error, Kind, Result};
