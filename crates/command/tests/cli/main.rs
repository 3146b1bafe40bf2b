//! The built command, as people run it.

mod batch;
mod commands;
mod device_at;
mod empty;
mod examples;
mod family;
mod first_contact;
mod gpu;
mod high_pass;
mod hostile;
mod model;
mod originals;
mod page;
mod preview;
mod profile;
mod pulse;
mod rig;
mod scans;
mod spot;
mod trace;
mod warnings;
