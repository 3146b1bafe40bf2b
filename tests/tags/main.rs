//! Time tags: decoders, histograms, an instrument from end to end.

mod histograms;
mod hostile;
mod instrument;
mod records;
