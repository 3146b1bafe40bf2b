//! Estimates of what the user leaves open: the high-pass of the objective, how surfaces reflect, and the instrument's impulse
//! response. Short surface fits of 64 lateral pixels compare the hypotheses on pairs that they have not seen, in the domain that
//! the solve minimises. Indistinguishable hypotheses are ranked by a fixed order.

mod constants;
mod device;
mod estimate;
mod found;
mod high_pass;
mod job;
mod model;
mod pulse;
mod search;
mod spread;
mod trial;

pub use crate::solve::surface::{HeldOut, Left};
pub use device::{FoundDevice, divide};
pub use estimate::{estimate, shown};
pub use found::{EstimateSeconds, Estimates, FindPulse, FoundSurface, Origin, Shown};
pub use high_pass::{FoundHighPass, usual_high_pass};
pub use job::{Job, preset_for};
pub use model::{FoundModel, MODELS};
pub use pulse::FoundPulse;
pub(crate) use spread::add_products;
