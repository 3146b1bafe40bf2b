//! Which kernels are passes over pairs, what reports call them, and how many pairs they evaluate.

/// The voxels that a pass holds against every laser-sensor pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Voxels {
    Active,
    /// All of the grid that are not too near.
    Grid,
}

/// A kernel that evaluates pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// As schedules have it.
    pub kernel: &'static str,
    /// As reports have it: every rendering begins with `forward`, every gather with `backward`.
    pub name: &'static str,
    pub voxels: Voxels,
    /// Pairs in one turn of the kernel's loop over them.
    pub pairs_per_turn: u32,
}

const fn pass(kernel: &'static str, name: &'static str, voxels: Voxels) -> Pass {
    Pass { kernel, name, voxels, pairs_per_turn: 1 }
}

/// Every one; a kernel that is not here evaluates no pairs and keeps its name.
pub const PASSES: &[Pass] = &[
    pass("forward", "forward", Voxels::Active),
    pass("forward_bound", "forward_bound", Voxels::Active),
    pass("backward", "backward", Voxels::Active),
    pass("step", "backward_step", Voxels::Active),
    pass("surface_gather", "backward_surface", Voxels::Active),
    pass("bound_step", "backward_bound_step", Voxels::Active),
    pass("bound_noise", "backward_bound_noise", Voxels::Active),
    pass("backproject", "backward_project", Voxels::Grid),
];

/// The pass that a kernel is, if it is one.
pub fn pass_of(kernel: &str) -> Option<&'static Pass> {
    PASSES.iter().find(|p| p.kernel == kernel)
}
