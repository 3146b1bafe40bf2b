//! Reconstructs a capture file as the command does, with progress, and writes maps, pictures, points and a mesh.
//!
//!     cargo run --release --example reconstruct -- capture.npz result

use std::ops::ControlFlow;

use thirdbounce::{Doing, Gpu, GpuOptions, Options, Result, read, reconstruct, write};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder] = &arguments[..] else {
        eprintln!("usage: reconstruct CAPTURE FOLDER");
        std::process::exit(2);
    };
    let capture = read(file)?;
    println!("{}", capture.summary());

    let gpu = Gpu::open(&GpuOptions::default())?;
    println!("on {}", gpu.info.name);
    let options = Options::default().set("lateral", 32).watch(|progress| {
        let point = progress.point;
        if progress.doing == Doing::Solve {
            println!("{:4} of {}: loss {:.4}", point.iteration, progress.iterations, point.loss);
        }
        ControlFlow::Continue(())
    });
    let solved = reconstruct(&gpu, &capture, &options)?;
    solved.notes.iter().for_each(|note| println!("{note}"));
    for written in write(folder, &solved.maps)? {
        println!("wrote {}", written.display());
    }
    Ok(())
}
