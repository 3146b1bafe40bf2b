//! Foundation of all crates of thirdbounce: the [`Error`] type with its [`advice`], memory of the [`host`], linear equations, minimisation.
//!
//! Feature `formats` adds [`files`] (atomic writes).

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

pub mod advice;
#[doc(hidden)]
pub mod equations;
pub mod error;
#[cfg(feature = "formats")]
pub mod files;
pub mod host;
#[doc(hidden)]
pub mod minimise;
#[doc(hidden)]
pub mod quantile;

pub use error::{Error, Kind, Result, panic_message};
