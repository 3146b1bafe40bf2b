//! The built command, as people run it.

mod batch;
mod commands;
mod device_at;
mod empty;
mod examples;
mod family;
#[cfg(feature = "tags")]
mod first_contact;
mod gpu;
mod high_pass;
mod hostile;
#[cfg(feature = "live")]
mod live;
mod model;
#[cfg(feature = "live")]
mod moving;
mod originals;
mod page;
mod preview;
mod profile;
mod pulse;
mod rig;
mod scans;
mod spot;
#[cfg(feature = "tags")]
mod tags;
mod trace;
mod track;
mod warnings;
