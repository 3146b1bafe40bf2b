//! The simulator.

mod layouts;
mod render;
mod scenes;
