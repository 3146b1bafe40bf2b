//! Files of time tags, and hostile files for every reader.

pub mod hostile;
pub mod tags;
