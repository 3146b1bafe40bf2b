//! The built command, as people run it.

mod batch;
mod benchmark;
mod browser;
mod calibrate;
mod commands;
mod compare;
mod devices;
mod examples;
mod hostile;
mod live;
mod model;
mod originals;
mod page;
mod place;
mod preview;
mod profile;
mod pulse;
mod scans;
mod spot;
mod tuning;
