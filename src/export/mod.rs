//! Results as files: npz, EXR, PNG, PLY and the report. Every file appears whole or not at all, and equal
//! results give equal bytes.

pub mod atomic;
