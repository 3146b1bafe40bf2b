//! What held-out pairs decide: what the settings leave open (the high-pass of the objective, how surfaces reflect, the instrument's
//! impulse response), what is wrong with the capture, and the verdict. Short surface fits of 64 lateral pixels compare the hypotheses on
//! pairs that they have not seen, in the domain that the solve minimises. Indistinguishable hypotheses are ranked by a fixed order.

mod calibrate;
mod calibration;
mod cause;
mod conclude;
mod constants;
mod device;
mod divide;
mod empty;
mod estimate;
mod found;
mod grade;
mod high_pass;
mod job;
mod laws;
mod lines;
mod model;
mod moved;
mod probe;
mod pulse;
mod response;
mod room;
mod samples;
mod scale;
mod search;
mod sense;
mod spread;
mod suspects;
mod trial;
mod verdict;

pub use calibrate::{calibrate, calibrated_scan};
pub use calibration::FoundCalibration;
pub use cause::Cause;
pub use conclude::{conclude, conclude_iterate};
pub use device::FoundDevice;
pub use divide::divide;
pub use empty::subtract;
pub use estimate::{estimate, shown};
pub use found::{EstimateSeconds, Estimates, FindPulse, FoundSurface, Origin, Shown};
pub use grade::{grade, with_maps};
pub use high_pass::{FoundHighPass, usual_high_pass};
pub use job::{Job, preset_for};
pub use lines::LineDelays;
pub use model::{FoundModel, MODELS};
pub use pulse::FoundPulse;
pub use room::FoundEmpty;
pub use samples::ResponseSamples;
pub use scale::Rescaled;
pub use verdict::{Diagnosis, EXPECTED_IOU, diagnose, verdict};
