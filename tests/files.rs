//! Captures, simulated captures and result files. One program: each links as long as all.

mod capture;
mod export;
mod simulate;
