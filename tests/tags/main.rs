//! Time tags: decoders, histograms, an instrument from end to end.

mod records;
