//! Lateral maps: the result of a reconstruction, and the truth.
//!
//! All maps are stored `[ix * ny + iy]`, ix along +x, iy along +y. A pixel is a cell of the extent; its value belongs
//! to the cell's centre. NaN means no surface.

mod depth_error;
mod lateral;
mod parts;
mod smooth;

pub use depth_error::Conditions;
pub use lateral::{Layer, Maps, Truth, percentile};
pub use parts::MaskPart;
