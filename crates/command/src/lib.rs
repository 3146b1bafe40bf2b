//! The command of thirdbounce: what its verbs do beyond a reconstruction, and in [`cli`] how they read and print. The engine
//! below, `thirdbounce`, knows neither flags nor progress bars.

#![warn(clippy::too_many_lines)]

pub mod batch;
pub mod cli;
pub mod demo;
pub mod evaluate;
pub mod family;
pub mod found;
pub mod generate;
pub mod inspect;
pub mod json;
pub mod overview;
pub mod profile;
pub mod record;
pub mod simulated;
pub mod virtual_wall;
