//! Captures: formats, scans, walls, conversions, damaged files.

mod arrays;
mod convert;
mod formats;
mod hostile;
mod inputs;
mod kept;
mod libraries;
mod publications;
mod sampling;
mod schemas;
mod walls;
mod ytal;
