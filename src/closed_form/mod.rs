//! Closed-form methods: a volume in one step, without iterations. docs/methods.md tells what each assumes.
//!
//! Each has a folder with its options and its mathematics. Fourier methods run on the cores of the host. They take a
//! regular scan of a flat wall ([`RegularScan`]) and refuse others. Their plan lists the arrays that they hold at once.

mod backproject;
mod dlct;
mod fk;
pub mod fourier;
pub mod image;
mod lct;
mod light_cone;
mod method;
mod on_host;
mod one_step;
mod options;
mod phasor;
#[cfg(test)]
mod reference;
mod resample;
mod scan;
mod sharpness;
mod upsample;

pub use backproject::{
    BpOptions, BpSettings, FbpOptions, FbpSettings, Filter, PhasorBpOptions, PhasorBpSettings, hat, passes,
    plan_of as plan_of_projection,
};
pub use dlct::{DlctOptions, DlctSettings};
pub use fk::{FkOptions, FkSettings};
pub use image::AlbedoVolume;
pub use lct::{LctOptions, LctSettings};
pub use method::ClosedForm;
pub use options::{Between, ImageOptions, ImageSettings};
pub use phasor::{PhasorOptions, PhasorSettings};
pub use scan::RegularScan;
