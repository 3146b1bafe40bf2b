//! Options of methods as rows: key, range, text and default, declared once for the command, Rust, C, Python and JSON.

pub mod rows;
pub mod units;

pub use rows::{
    ENOUGH_PAIRS, Given, NEAR, OptionValue, Options, Preset, Range, Row, SceneTraits, default_text,
};
pub(crate) use rows::{options, refused, words};
