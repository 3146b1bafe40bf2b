//! Captures: formats, scans, walls, conversions, damaged files.

mod arrays;
mod convert;
mod formats;
mod hostile;
mod kept;
mod sampling;
mod schemas;
mod walls;
mod ytal;
