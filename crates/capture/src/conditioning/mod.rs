//! Steps between a capture as recorded and one that a solver takes, each capture → capture with a note.

pub(crate) mod background;
pub mod calibrate;
pub(crate) mod choose;
mod clipped;
mod doubts;
pub(crate) mod frame;
pub mod gate;
mod hot;
mod keep;
pub mod legs;
pub mod negative;
mod normals;
mod pile_up;
mod recorded;
mod sum;
mod turn;

pub use background::Background;
pub use gate::{AutoGate, Gate, auto_gate, published_gate};
pub use keep::Keep;
pub use recorded::recorded_gate;
pub use turn::Turn;
