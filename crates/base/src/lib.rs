//! What every crate of thirdbounce stands on: one kind of [`Error`], and the [`advice`] in it on how to mend what is wrong.
//!
//! Feature `formats` adds [`files`], which appear whole or not at all, and [`host`], the memory that their arrays may take.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

pub mod advice;
pub mod error;
#[cfg(feature = "formats")]
pub mod files;
#[cfg(feature = "formats")]
pub mod host;

pub use error::{Error, Kind, Result, panic_message};
