//! Time tags: decoders, histograms, an instrument from end to end.

mod arrays;
mod histograms;
mod hostile;
mod info;
mod instrument;
mod recipes;
mod records;
mod wall;
mod zone_logs;
