//! Reconstructs a capture file as the command does, with progress, and writes maps, pictures, points and a mesh.
//!
//!     cargo run --release --example reconstruct -- capture.npz result

use std::ops::ControlFlow;

use thirdbounce::engine::{Doing, Progress};
use thirdbounce::{Gpu, GpuOptions, Result, Settings, read, reconstruct_with, write};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder] = &arguments[..] else {
        eprintln!("usage: reconstruct CAPTURE FOLDER");
        std::process::exit(2);
    };
    let mut settings = Settings::default();
    settings.set("lateral", "32")?;
    let capture = read(file, &settings)?;
    println!("{}", capture.summary());

    let gpu = Gpu::open(&GpuOptions::default())?;
    println!("on {}", gpu.info.name);
    let mut on_progress = |progress: &Progress| {
        let point = progress.point;
        if progress.doing == Doing::Solve {
            println!("{:4} of {}: loss {:.4}", point.iteration, progress.iterations, point.loss);
        }
        ControlFlow::Continue(())
    };
    let solved = reconstruct_with(&gpu, &capture, &settings, &mut on_progress)?;
    solved.notes.iter().for_each(|note| println!("{note}"));
    for written in write(folder, &solved.maps)? {
        println!("wrote {}", written.display());
    }
    Ok(())
}
