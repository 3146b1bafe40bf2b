//! The kernels in float64 on the CPU: one file per kernel of `glsl/`, of the same name. Its function takes the buffers of
//! a dispatch in the order of their bindings and changes what the kernel writes. Kernels are tested against these
//! functions, which are written for clarity, not speed. What several share is in one file.

#![expect(clippy::needless_range_loop, reason = "an index is an invocation of the kernel")]

#[macro_use]
mod call;
mod shared;

pub use call::{Call, Cells, TwinFn};
pub use shared::*;

/// Declares the files, and lists their functions by name.
macro_rules! twins {
    ($($name:ident)*) => {
        $(mod $name;)*

        /// Every kernel that has a twin, with its function.
        pub static TWINS: &[(&str, TwinFn)] = &[$((stringify!($name), $name::$name)),*];
    };
}

twins! {
    arguments backproject backward carry compact_count compact_scan compact_scatter double_domain extract filter finish
    forward forward_owned forward_product gaussian initialise initialise_raw learned_activate learned_bands learned_convolve
    learned_head learned_moments learned_project learned_resize levels noise places pulse residual residual_rows
    residual_scan rim room rounding sample spot surface_bonds surface_combine surface_extract surface_gather surface_points surface_pull
    surface_step threshold update
}

/// The twin of a module: that of the longest name with which the module's begins.
pub fn twin_of(module: &str) -> Option<(&'static str, TwinFn)> {
    let of =
        |name: &str| module.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    TWINS.iter().filter(|t| of(t.0)).max_by_key(|t| t.0.len()).copied()
}
