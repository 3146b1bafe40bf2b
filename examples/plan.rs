//! Prints what a solve would take before anything is allocated: levels, buffers, what is left out, and one iteration. It uses
//! modules inside the engine, which may change in any release.
//!
//!     cargo run --release --example plan -- capture.npz

use std::path::Path;

use thirdbounce::engine::{Problem, When};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::methods::SolverOptions;
use thirdbounce::options::SceneTraits;
use thirdbounce::transport::Grid;
use thirdbounce::{Result, capture};

fn main() -> Result<()> {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("usage: plan CAPTURE");
        std::process::exit(2);
    };
    let capture = capture::read(Path::new(&file))?;
    let gpu = Gpu::open(&GpuOptions::default())?;
    let suit = SceneTraits::of(&capture);
    for name in SolverOptions::NAMES {
        let solver =
            SolverOptions::defaults_for(name, &suit).expect("a solver of this version").with_lateral(64);
        let volume = solver.default_volume(&capture)?;
        let grid = Grid::new(volume, solver.common().lateral, capture.bin_width)?;
        let plan = solver.plan(&Problem::new(&capture, grid), &gpu.abilities())?;
        let bytes: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
        println!(
            "{name}: {} levels, {} buffers of {} MB",
            plan.levels.volume.len(),
            plan.buffers.len(),
            bytes / 1_000_000
        );
        plan.left_out.iter().for_each(|line| println!("  leaves out {line}"));
        let parts = solver.outline(&plan);
        if let Some(one) = parts.iter().find(|p| matches!(p.when, When::Iterations(..))) {
            println!("{one}");
        }
    }
    Ok(())
}
