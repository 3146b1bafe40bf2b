//! Live frames, by the built command: `make build` first.

mod frames;
mod moving;
