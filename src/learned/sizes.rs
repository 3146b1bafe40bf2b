//! Sizes of the network's input, and how its loops run.

use crate::transport::kernels::{LEARNED_BANDS, LEARNED_SAMPLES};

/// Voxels of the box along x and y, and along z.
pub const SIDE: usize = 64;
pub const DEEP: usize = 96;
/// A voxel, and the near end of the box, walls.
pub const PITCH: f64 = 1.0 / SIDE as f64;
pub use crate::options::NEAR;
/// Bands of light, and their samples along the path, each of this many walls.
pub const BANDS: usize = LEARNED_BANDS as usize;
pub const SAMPLES: usize = LEARNED_SAMPLES as usize;
pub const STEP: f64 = 0.5 * PITCH;
/// Kinds of pairs in the input: confocal, one laser or sensor point, other.
pub const KINDS: usize = 3;
/// Channels of the input: bands, kinds, depth.
pub const CHANNELS: usize = BANDS + KINDS + 1;

/// Runs a piece of code, whose loops the compiler makes as wide as the processor allows.
#[inline(always)]
pub fn wide<R>(run: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(run)
}
