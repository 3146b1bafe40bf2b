//! A session: made once for a scan, then frame after frame. Here a hidden point moves, and each frame is rendered by hand.
//!
//!     cargo run --release --example session

use std::time::Instant;

use glam::{DVec3, dvec3};
use thirdbounce::surface::SurfaceSettings;
use thirdbounce::{Capture, Gpu, GpuOptions, Result, SessionOptions, Settings, session};

const SIDE: usize = 16;
const BINS: usize = 200;
/// Metres of path.
const BIN_WIDTH: f64 = 0.0125;

fn main() -> Result<()> {
    // Laser and sensor look at the same points: ix along +x, iy along +y, pair = ix * SIDE + iy.
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
    let wall: Vec<DVec3> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    // The scan alone: the counts come later.
    let scan = Capture::new([SIDE, SIDE], wall.clone(), wall.clone(), BINS, BIN_WIDTH, vec![]);

    let gpu = Gpu::open(&GpuOptions::default())?;
    let method = SurfaceSettings { lateral: Some(32), iterations: Some(20), ..SurfaceSettings::default() };
    let settings = Settings { method: method.into(), ..Settings::default() };
    let options = SessionOptions::default();
    let (mut session, _) = session(&gpu, &scan, &settings, options)?;
    for frame in 0..3 {
        let hidden = dvec3(0.15 * frame as f64 - 0.15, 0.1, 0.6);
        let begun = Instant::now();
        session.submit(&rendered(&wall, hidden))?;
        // The program could do something else here, and look with `poll`.
        let maps = &session.wait()?.result.maps;
        let brightest = (0..maps.albedo.len()).max_by(|a, b| maps.albedo[*a].total_cmp(&maps.albedo[*b]));
        let pixel = brightest.expect("maps have pixels");
        let [x0, x1, y0, y1] = maps.extent;
        let x = x0 + (x1 - x0) * ((pixel / maps.ny) as f64 + 0.5) / maps.nx as f64;
        let y = y0 + (y1 - y0) * ((pixel % maps.ny) as f64 + 0.5) / maps.ny as f64;
        println!("hidden at  {:.2} {:.2} {:.2} m", hidden.x, hidden.y, hidden.z);
        println!("found at   {x:.2} {y:.2} {:.2} m   in {:.0?}", maps.depth[pixel], begun.elapsed());
    }
    Ok(())
}

/// The histograms of one hidden point.
fn rendered(wall: &[DVec3], hidden: DVec3) -> Vec<f32> {
    let mut histograms = vec![0.0f32; wall.len() * BINS];
    for (pair, point) in wall.iter().enumerate() {
        let distance = point.distance(hidden);
        histograms[pair * BINS + (2.0 * distance / BIN_WIDTH) as usize] = distance.powi(-4) as f32;
    }
    histograms
}
