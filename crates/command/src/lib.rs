//! The command of thirdbounce: what its verbs do beyond a reconstruction, and in [`cli`] how they read and print. The engine
//! below, `thirdbounce`, knows neither flags nor progress bars.

#![warn(clippy::too_many_lines)]

pub mod batch;
pub mod benchmark;
pub mod cli;
pub mod compare;
pub mod demo;
pub mod evaluate;
pub mod generate;
pub mod histogram;
pub mod inspect;
pub mod instrument;
pub mod json;
pub mod live;
mod overview;
pub mod profile;
mod record;
pub mod simulated;
