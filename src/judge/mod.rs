//! What held-out pairs decide: what the settings leave open (the high-pass of the objective, how surfaces reflect, the instrument's
//! impulse response), what is wrong with the capture, and the verdict. Short surface fits of 64 lateral pixels compare the hypotheses on
//! pairs that they have not seen, in the domain that the solve minimises. Indistinguishable hypotheses are ranked by a fixed order.

mod conclude;
mod constants;
mod correction;
mod decide;
mod estimate;
mod estimates;
mod finding;
mod gains;
mod given;
mod grade;
mod high_pass;
mod job;
mod model;
mod motion;
mod physics;
mod propose;
mod pulse;
mod response;
mod samples;
mod search;
mod spread;
mod trial;
mod trials;
mod verdict;

pub use conclude::{conclude, conclude_iterate};
pub use estimate::estimate;
pub use estimates::{EstimateSeconds, Estimates, FindPulse, FoundSurface, Origin};
pub use finding::{CaptureFinding, FindingSource};
pub use given::{calibrated_scan, given};
pub use grade::{grade, with_maps};
pub use high_pass::{FoundHighPass, usual_high_pass};
pub use job::{Job, preset_for};
pub use model::{FoundModel, MODELS};
pub use pulse::FoundPulse;
pub use samples::ResponseSamples;
pub use search::corrected;
pub use verdict::{EXPECTED_IOU, verdict};
