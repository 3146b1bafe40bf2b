//! The compiled kernels, and the structs and numbers that they share with the host (`glsl/shared.rs`).

use crate::gpu::{Binding, Buffer, Constant, KernelCode, View};

pub use thirdbounce_kernels::shared::*;

include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

#[cfg(test)]
mod operations;
#[cfg(test)]
mod tests;
