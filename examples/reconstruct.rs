//! Reconstructs a capture file with the default solver and writes maps, pictures, points and a mesh.
//!
//!     cargo run --release --example reconstruct -- capture.npz result

use std::ops::ControlFlow;
use std::path::Path;

use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::solve::{Progress, Suit, VectorOptions, Watch, default_volume, vector};
use thirdbounce::transport::Grid;
use thirdbounce::{Result, capture, export};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder] = &arguments[..] else {
        eprintln!("usage: reconstruct CAPTURE FOLDER");
        std::process::exit(2);
    };
    let capture = capture::read(Path::new(file))?;
    println!("{}", capture.summary());

    let suit = Suit::of(&capture);
    let options = VectorOptions::suited_to(&suit).with(|o| o.lateral = 32);
    let volume = default_volume(&capture, options.domain.min_depth)?;
    let grid = Grid::new(volume, options.lateral, capture.bin_width)?;

    let gpu = Gpu::open(&GpuOptions::default())?;
    println!("on {}", gpu.info.name);
    let mut hear = |progress: &Progress| {
        let point = progress.point;
        println!("{:4} of {}: loss {:.4}", point.iteration, progress.iterations, point.loss);
        ControlFlow::Continue(())
    };
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let done = vector::reconstruct(&gpu, &capture, grid, &options, None, false, &mut watch)?;
    for written in export::write_maps(Path::new(folder), &done.maps)? {
        println!("wrote {}", written.display());
    }
    Ok(())
}
