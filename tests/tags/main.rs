//! Time tags: decoders, histograms, an instrument from end to end.

mod histograms;
mod instrument;
mod records;
