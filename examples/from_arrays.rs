//! Reconstructs histograms that a program has in memory: here one hidden point in front of a 1 m wall, rendered by hand.
//!
//!     cargo run --release --example from_arrays

use glam::{DVec3, dvec3};
use thirdbounce::surface::SurfaceSettings;
use thirdbounce::{Capture, Gpu, GpuOptions, Result, Settings, reconstruct};

const SIDE: usize = 16;
const BINS: usize = 200;
/// Metres of path.
const BIN_WIDTH: f64 = 0.01;

fn main() -> Result<()> {
    // Laser and sensor look at the same points: ix along +x, iy along +y, pair = ix * SIDE + iy.
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
    let wall: Vec<DVec3> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    let hidden = dvec3(0.1, -0.15, 0.6);
    let mut histograms = vec![0.0f32; wall.len() * BINS];
    for (pair, point) in wall.iter().enumerate() {
        let distance = point.distance(hidden);
        let bin = (2.0 * distance / BIN_WIDTH) as usize;
        histograms[pair * BINS + bin] = (1.0 / distance.powi(4)) as f32;
    }
    let capture = Capture::new([SIDE, SIDE], wall.clone(), wall, BINS, BIN_WIDTH, histograms);

    let gpu = Gpu::open(&GpuOptions::default())?;
    let method = SurfaceSettings { lateral: Some(32), ..SurfaceSettings::default() }.into();
    let maps = reconstruct(&gpu, &capture, &Settings { method, ..Settings::default() })?.maps;

    let brightest = (0..maps.albedo.len()).max_by(|a, b| maps.albedo[*a].total_cmp(&maps.albedo[*b]));
    let pixel = brightest.expect("maps have pixels");
    let [x0, x1, y0, y1] = maps.extent;
    let x = x0 + (x1 - x0) * ((pixel / maps.ny) as f64 + 0.5) / maps.nx as f64;
    let y = y0 + (y1 - y0) * ((pixel % maps.ny) as f64 + 0.5) / maps.ny as f64;
    println!("hidden at  {:.2} {:.2} {:.2} m", hidden.x, hidden.y, hidden.z);
    println!("found at   {x:.2} {y:.2} {:.2} m", maps.depth[pixel]);
    Ok(())
}
