//! The capture as plain data: pairs, bins, counts, and measures of them. Nothing here changes a capture or reads a file.

mod capture;
pub mod check;
pub mod gain;
pub(crate) mod histogram_figures;
pub mod lattice;
mod layout;
pub mod median;
pub mod nearest;
pub mod pairs;
pub mod pulse;
pub(crate) mod reflectance;
#[doc(hidden)]
pub mod rows;
pub mod scan;
pub mod summary;

pub use capture::{Capture, METRES_PER_PICOSECOND};
pub use gain::GainLaw;
pub use layout::{AxisOrder, Bounce};
pub use pairs::{PairKind, Product};
pub use pulse::{Pulse, PulseTaps, Way};
pub use reflectance::Reflectance;
pub use summary::Summary;
