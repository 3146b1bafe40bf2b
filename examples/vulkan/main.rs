//! A program with a Vulkan device of its own. Its pass writes histograms, thirdbounce reconstructs on the same device and
//! queue, and another pass of the program colours the depths. The program copies nothing to the host but the picture.
//!
//!     cargo run --release --example vulkan

mod program;

use std::error::Error;
use std::time::Instant;

use ash::vk;
use glam::{DVec3, dvec3};
use program::{Program, VERSION};
use thirdbounce::surface::SurfaceSettings;
use thirdbounce::{
    Capture, ExternalBuffer, ExternalCounts, ExternalFrame, Format, Gpu, SessionOptions, Settings,
    TimelinePoint, Vulkan,
};

/// Points of the scan, and pixels of the maps, along x and along y.
const SIDE: usize = 16;
const PIXELS: usize = 32;
const BINS: usize = 192;

fn main() -> Result<(), Box<dyn Error>> {
    // SAFETY: handles are used while they live: nothing of the program's is destroyed before it ends.
    unsafe {
        let program = Program::new()?;
        let gpu = Gpu::of_external(&Vulkan {
            get_instance_proc_addr: program.entry.static_fn().get_instance_proc_addr,
            instance: program.instance.handle(),
            api_version: VERSION,
            physical_device: program.physical,
            device: program.device.handle(),
            queue: program.queue,
            family: program.requirements.family,
            enabled: program.requirements.features,
            // This program uses the queue only while no frame is being solved; others lock it.
            lock: None,
            blocks: None,
            pipeline_cache: vk::PipelineCache::null(),
        })?;
        let external = SessionOptions { external: true, ..SessionOptions::default() };
        let method = SurfaceSettings { lateral: Some(PIXELS), ..SurfaceSettings::default() }.into();
        let settings = Settings { method, ..Settings::default() };
        let (mut session, _) = thirdbounce::session(&gpu, &scan(), &settings, external)?;

        let counts = program.buffer((SIDE * SIDE * BINS * 4) as u64, false)?;
        let maps = program.buffer(session.external_maps_bytes(), false)?;
        let picture = program.buffer((PIXELS * PIXELS * 4) as u64, true)?;
        let (written, solved) = (program.semaphore()?, program.semaphore()?);
        let begun = Instant::now();
        let light = include_bytes!(concat!(env!("OUT_DIR"), "/example_light.spv"));
        program.run(light, &[SIDE as u32, BINS as u32], &[&counts], SIDE * SIDE, (written, 1))?;
        session.submit_external(ExternalFrame {
            counts: ExternalCounts {
                counts: ExternalBuffer::new(counts.handle, 0, counts.bytes)?,
                format: Format::U32,
                after: Some(TimelinePoint::new(written, 1)),
                taken: None,
            },
            maps: Some(ExternalBuffer::new(maps.handle, 0, maps.bytes)?),
            done: Some(TimelinePoint::new(solved, 1)),
        })?;
        let frame = session.wait()?;
        println!(
            "{} pixels of surface in {:.0?}",
            frame.result.maps.mask.iter().filter(|m| **m).count(),
            begun.elapsed()
        );

        let colour = include_bytes!(concat!(env!("OUT_DIR"), "/example_colour.spv"));
        program.run(colour, &[PIXELS as u32], &[&maps, &picture], PIXELS * PIXELS, (written, 2))?;
        program.wait((written, 2))?;
        let pixels = std::slice::from_raw_parts(picture.at, picture.bytes as usize);
        let file = std::env::args().nth(1).unwrap_or("letter.ppm".into());
        let rgb = pixels.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
        let head = format!("P6 {PIXELS} {PIXELS} 255\n");
        std::fs::write(&file, head.into_bytes().into_iter().chain(rgb).collect::<Vec<u8>>())?;
        println!("wrote {file}");
    }
    Ok(())
}

/// The scan that the light of `light.comp` belongs to: confocal points on a wall of 1 m, photon counts.
fn scan() -> Capture {
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
    let wall: Vec<DVec3> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    let mut scan = Capture::new([SIDE, SIDE], wall.clone(), wall, BINS, 0.0125, vec![]);
    (scan.t_start, scan.integer_counts) = (0.4, true);
    scan
}
