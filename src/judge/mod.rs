//! What held-out pairs decide: what the settings leave open (the high-pass of the objective, how surfaces reflect, the instrument's
//! impulse response), what is wrong with the capture, and the verdict. Short surface fits of 64 lateral pixels compare the hypotheses on
//! pairs that they have not seen, in the domain that the solve minimises. Indistinguishable hypotheses are ranked by a fixed order.

mod correction;
mod decide;
mod estimates;
mod gains;
mod given;
mod job;
mod physics;
mod propose;
mod pulse;
mod response;
mod search;
mod trial;
mod verdict;
mod wider;

pub use decide::{CaptureFinding, FindingSource};
pub use estimates::{EstimateSeconds, Estimates, FindPulse, FoundPulse, MODELS};
pub use given::{calibrated_scan, given};
pub use job::{Job, preset_for};
pub use physics::estimate;
pub use search::corrected;
pub use verdict::{as_result, conclude, grade, verdict, with_maps};
pub use wider::widened;
