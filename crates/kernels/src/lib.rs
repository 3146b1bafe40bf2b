//! The kernels of `glsl/` as functions on host memory, one file per kernel, of the same name. A function takes the buffers
//! of a dispatch in the order of their bindings and changes what the kernel writes.
//!
//! All are generic over the float type ([`Real`]). In f32 they are the kernels of the host: parallel over chunks that depend on
//! sizes alone, so that the bits are the same in every run and for any number of threads. In f64 they are the reference
//! of tests and of `profile --check`. Independent of Vulkan.

#![forbid(unsafe_code)]

#[macro_use]
mod call;
#[macro_use]
mod light;
mod adam;
mod domain;
mod gather;
mod grid;
mod learned;
mod pixels;
mod real;
mod sampling;
mod surface;
mod surroundings;
mod trace;
mod vector;
mod weight;

/// Structs and numbers that kernels share with their callers: `glsl/shared.rs`.
pub mod shared {
    include!(concat!(env!("OUT_DIR"), "/shared.rs"));
}

use rayon::prelude::*;

pub use adam::unbias;
pub use call::{Call, Cells, Function};
pub use grid::{BRICK_VOXELS, SceneGrid, index, voxel};
pub use real::Real;
pub use vector::{V2, V3};

/// A kernel by name, for both float types.
#[derive(Debug, Clone, Copy)]
pub struct HostKernelRow {
    /// Name of its source in `glsl/`.
    pub name: &'static str,
    /// On the host.
    pub host: Function<f32>,
    /// As reference.
    pub reference: Function<f64>,
}

/// Declares the files, and lists their functions by name.
macro_rules! kernels {
    ($($name:ident)*) => {
        $(mod $name; pub use $name::$name;)*

        /// Every kernel.
        pub static KERNELS: &[HostKernelRow] = &[$(HostKernelRow {
            name: stringify!($name),
            host: $name::$name::<f32>,
            reference: $name::$name::<f64>,
        }),*];
    };
}

kernels! {
    arguments backproject backward carry compact_count compact_scan compact_scatter double_domain extract filter finish
    forward forward_owned forward_product gaussian initialise initialise_raw learned_activate learned_bands
    learned_convolve learned_head learned_moments learned_project learned_resize levels noise places pulse residual
    residual_rows residual_scan rim room rounding sample spot surface_bonds surface_combine surface_extract
    surface_gather surface_judge surface_keep surface_points surface_pull surface_step threshold update
}

/// The kernel of a module: the one of the longest name with which the module's begins.
pub fn kernel_of(module: &str) -> Option<&'static HostKernelRow> {
    let of =
        |name: &str| module.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    KERNELS.iter().filter(|row| of(row.name)).max_by_key(|row| row.name.len())
}

/// Sets a fault bit if a number is not finite.
fn watch<F: Real>(counts: &mut [u32], fault: u32, all: &[F]) {
    let is_finite = |chunk: &[F]| chunk.iter().fold(true, |is_finite, v| is_finite & v.is_finite());
    if !all.par_chunks(1 << 14).all(is_finite) {
        counts[shared::COUNT_FAULTS as usize] |= fault;
    }
}

/// Bits of the larger of a float by its bits and of a number.
fn larger<F: Real>(bits: u32, value: F) -> u32 {
    bits.max((value.at_least(F::zero()).wide() as f32).to_bits())
}

/// Name of the widest vectors that the processor has and kernels use.
pub fn vectors() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    match pulp::Arch::new() {
        pulp::x86::Arch::V4(_) => return "AVX-512",
        pulp::x86::Arch::V3(_) => return "AVX2",
        _ => {}
    }
    if cfg!(target_arch = "aarch64") { "NEON" } else { "scalar code" }
}
