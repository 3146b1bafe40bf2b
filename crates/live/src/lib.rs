//! Reconstructs frames as they come, and shows them on a page: the program `thirdbounce-live`.

#![warn(clippy::too_many_lines)]

mod arguments;
mod folder;
mod motion;
mod page;
mod run;
mod stream;

pub use arguments::{command, main};
pub use stream::write;
