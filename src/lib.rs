//! Non-line-of-sight reconstruction on Vulkan compute.

pub mod capture;
pub mod error;
pub mod export;
pub mod maps;

pub use error::{Error, Kind, Result};

pub mod gpu;
pub mod transport;
