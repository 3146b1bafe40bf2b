//! Stiff and extreme cases. Writes docs/stability.md and its plots.
//!
//!     cargo bench --bench stability        THIRDBOUNCE_DEVICE names another device

mod plots;
mod stiffness;
mod tables;

use std::path::Path;

use thirdbounce::gpu::{Gpu, GpuOptions};

/// The parts of the page that are written by hand.
const ABOUT: [&str; 2] = [include_str!("about.md"), include_str!("findings.md")];

fn main() {
    let name = std::env::var("THIRDBOUNCE_DEVICE").ok();
    let options = GpuOptions { device: name, validation: false, timings: true, ..Default::default() };
    let gpu = Gpu::open(&options).unwrap_or_else(|e| panic!("{e}"));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    std::fs::create_dir_all(folder.join("stability")).expect("a folder for the plots");
    let parts = [
        ABOUT[0].into(),
        format!("\nMeasured on {} ({}).\n", gpu.info.name.trim(), gpu.info.driver.trim()),
        tables::cases(&gpu),
        tables::crowded(&gpu),
        tables::stiff(),
        tables::long(&gpu),
        tables::cost(&gpu),
        plots::all(&gpu, &folder.join("stability")),
        ABOUT[1].into(),
    ];
    std::fs::write(folder.join("stability.md"), parts.join("\n")).expect("docs/stability.md is written");
}
