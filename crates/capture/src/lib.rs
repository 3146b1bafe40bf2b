//! A capture: transient histograms of pairs of points on a relay wall.
//!
//! All lengths are in metres, and times are given as path (c = 1). A pair is a laser point and a sensor point on the
//! wall. Its histogram counts light by the length of the path laser point → hidden point → sensor point. Bin b of width
//! Δ collects paths in [t0 + bΔ, t0 + (b+1)Δ). The wall is near z = 0, the hidden scene at z > 0, y is up.
//!
//! [`data`] is the capture itself, `readers` make captures of files (feature `formats`), and [`conditioning`] is the list of
//! steps between a capture as recorded and one that a solver takes.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

pub mod conditioning;
pub mod data;
#[cfg(feature = "formats")]
pub mod readers;

pub use conditioning::{
    AutoGate, Background, Flip, Gate, Keep, RoomGain, RoomLight, Turn, auto_gate, light_gate, published_gate,
    recorded_gate,
};
#[doc(hidden)]
pub use conditioning::{gate, negative};
pub use data::{
    AxisOrder, Bounce, Capture, GainLaw, METRES_PER_PICOSECOND, PairKind, Product, Pulse, PulseTaps,
    Reflectance, Summary, Way,
};
#[doc(hidden)]
pub use data::{check, gain, lattice, median, nearest, pairs, pulse, rows, scan, summary};
#[cfg(feature = "formats")]
#[doc(hidden)]
pub use readers as formats;
#[cfg(feature = "formats")]
pub use readers::{Opened, ReadOptions, read, read_given, read_kept, read_with_notes, write};

use thirdbounce_base::error;
#[cfg(feature = "formats")]
use thirdbounce_base::{advice, files, host};
