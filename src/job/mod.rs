//! Whole jobs, from a capture file to result files: [`load()`] reads and prepares a capture, [`run()`] reconstructs it and writes
//! every result.

mod advice;
mod evaluate;
mod load;
pub mod places;
pub mod planned;
pub mod preview;
pub mod reconstruct;
pub mod report;
mod request;
mod run;

pub use crate::engine::Bins;
pub use crate::judge::{MODELS, preset_for};
pub use crate::methods::{SolverOptions, method};
pub use crate::settings::memory_bytes;

pub use advice::advise;
pub use evaluate::evaluate_maps;
pub use load::{Loaded, load, reading, take, turn};
pub use places::{PREVIEW, check_file, check_inputs, check_not_input, check_results};
pub use report::plain;
pub use request::{Request, usual_pipeline_cache};
pub use run::{Outcome, run, run_on, solve};
