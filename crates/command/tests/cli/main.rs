//! The built command, as people run it.

mod batch;
mod benchmark;
mod browser;
mod commands;
mod device_at;
mod examples;
mod family;
mod first_contact;
mod gpu;
mod high_pass;
mod hostile;
mod live;
mod methods;
mod model;
mod originals;
mod page;
mod preview;
mod profile;
mod pulse;
mod scans;
mod spot;
mod warnings;
