//! Physical laws in the kernels and in whole solves: bins, energy, symmetry, shifts.

use std::ops::ControlFlow;

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Solver, default_volume};
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::maps::Maps;
use thirdbounce::methods::{PaperOptions, paper};
use thirdbounce::options::Preset;
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::{Binning, Grid, Model, Sampling};
use thirdbounce_simulate::{Object, RenderOptions, Scene, rectangle, simulate};
use thirdbounce_verify::Sample;

/// Histograms of the given samples on the device.
fn render(gpu: &Gpu, model: &Model, grid: &Grid, samples: &[Sample]) -> Vec<f64> {
    let mut job = job(gpu, model, grid, &options(model, grid));
    write_samples(&mut job, samples);
    set_counts(&mut job, samples.len(), 1.0);
    let mut s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
    s.commands.retain(|c| c.name() == "forward");
    zero_histograms(&mut job);
    job.perform(&s);
    read_rows::<f32>(&mut job, buffer::HISTOGRAMS).into_iter().map(f64::from).collect()
}

fn facing(point: DVec3) -> Sample {
    Sample { point, albedo: 1.0, normal: dvec3(0.0, 0.0, -1.0), length: 1.0 }
}

#[test]
fn a_voxel_at_a_known_distance_peaks_in_the_right_bin() {
    let gpu = host();
    for binning in [Binning::Linear, Binning::Nearest] {
        let mut m = model(4, 200, 1);
        m.binning = binning;
        let g = grid();
        let point = dvec3(0.1, -0.2, 0.7);
        let h = render(&gpu, &m, &g, &[facing(point)]);
        for (pair, wall) in m.wall.scanned.iter().enumerate() {
            let path = 2.0 * (point - *wall).length();
            let bin = ((path - m.t_start) / m.bin_width).floor() as usize;
            let row = &h[pair * m.bins..(pair + 1) * m.bins];
            let peak = (0..m.bins).max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap();
            assert_eq!(peak, bin, "bin b holds paths from t0 + b width up to t0 + (b + 1) width");
            // The centroid of a linear split is the path itself, up to rounding.
            if binning == Binning::Linear {
                let sum: f64 = row.iter().sum();
                let centre: f64 =
                    row.iter().enumerate().map(|(b, v)| (b as f64 + 0.5) * v).sum::<f64>() / sum;
                assert!((m.t_start + centre * m.bin_width - path).abs() < 1e-3 * m.bin_width);
            }
        }
    }
    assert_valid(&gpu);
}

#[test]
fn energy_is_conserved_inside_the_gate_and_dropped_outside() {
    let gpu = host();
    for binning in [Binning::Linear, Binning::Nearest] {
        let mut m = model(4, 100, 2);
        m.binning = binning;
        let g = grid();
        let inside: Vec<Sample> =
            (0..50).map(|i| facing(dvec3(-0.4 + 0.016 * f64::from(i), 0.1, 0.5))).collect();
        let h = render(&gpu, &m, &g, &inside);
        let want = |w: &DVec3, s: &Sample| {
            let d = *w - s.point;
            (-d.z / d.length()) * -s.normal.z * (m.reference / d.length()).powi(4)
        };
        for (pair, wall) in m.wall.scanned.iter().enumerate() {
            let got: f64 = h[pair * m.bins..(pair + 1) * m.bins].iter().sum();
            let total: f64 = inside.iter().map(|s| want(wall, s)).sum();
            assert!((got / total - 1.0).abs() < 1e-5, "{binning:?}: {got} {total}");
        }
        // Paths of 2 x 0.1 m end before the gate opens at 0.3 m; 2 x 2 m lies behind its end at 2.7 m.
        let mut near = m.clone();
        near.wall.scanned.retain(|w| w.length() < 0.2);
        near.measured.truncate(near.wall.pairs() * near.bins);
        let outside = [facing(dvec3(0.0, 0.0, 0.05)), facing(dvec3(0.0, 0.0, 2.0))];
        assert!(render(&gpu, &near, &g, &outside[1..]).iter().all(|v| *v == 0.0));
        let from_near = render(&gpu, &near, &g, &outside[..1]);
        let reach = |w: &DVec3| 2.0 * (*w - outside[0].point).length() > near.t_start - near.bin_width;
        for (pair, wall) in near.wall.scanned.iter().enumerate() {
            let row: f64 = from_near[pair * near.bins..(pair + 1) * near.bins].iter().sum();
            assert_eq!(row > 0.0, reach(wall));
        }
    }
    assert_valid(&gpu);
}

#[test]
fn light_behind_a_surface_and_on_a_wall_point_is_nothing() {
    let gpu = host();
    let m = model(4, 100, 3);
    let g = grid();
    let away = Sample { normal: dvec3(0.0, 0.0, 1.0), ..facing(dvec3(0.0, 0.0, 0.6)) };
    assert!(render(&gpu, &m, &g, &[away]).iter().all(|v| *v == 0.0));
    let h = render(&gpu, &m, &g, &[facing(m.wall.scanned[5])]);
    assert!(h.iter().all(|v| v.is_finite()), "a sample on a wall point has no direction, and no infinity");
    assert!(h[5 * m.bins..6 * m.bins].iter().all(|v| *v == 0.0));
    assert_valid(&gpu);
}

/// A small solve without randomness: fixed sampling from an empty volume.
fn solve(gpu: &Gpu, capture: &Capture, lateral: usize, iterations: usize) -> Maps {
    let o = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = lateral;
        o.iterations = iterations;
        o.sampling = Sampling::Fixed;
        o.binning = Binning::Linear;
        o.initial_albedo = 0.0;
        o.domain.reduce_every = 25;
        o.domain.smooth_sigma = 1.0;
        o.domain.keep_above = 0.2;
        o.domain.coarse_to_fine = false;
    });
    let grid =
        Grid::new(default_volume(capture, o.domain.min_depth).unwrap(), lateral, capture.bin_width).unwrap();
    o.solve(gpu, &Problem::new(capture, grid), &mut unwatched(&mut |_| ControlFlow::Continue(())))
        .unwrap()
        .maps
}

/// A plate of 15 cm in front of a 0.8 m wall.
fn plate(x: f64, y: f64) -> Capture {
    let mesh = rectangle(dvec3(x, y, 0.5), dvec3(-0.075, 0.0, 0.0), dvec3(0.0, 0.075, 0.0));
    let object = Object { mesh, albedo: 1.0 };
    let mut scene = Scene::new("plate", vec![object]);
    (scene.wall, scene.scan, scene.bin_width) = (0.8, 16, 0.02);
    simulate(&scene, &RenderOptions { noise: 0.005, ..Default::default() }).unwrap().capture
}

/// Albedo-weighted mean of (x, y, depth) over the brighter pixels.
fn centroid(maps: &Maps) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut weight = 0.0;
    let bright = Maps::mask_of(&maps.albedo, 0.5);
    for i in (0..maps.albedo.len()).filter(|i| bright[*i]) {
        let [x, y] = maps.centre(i / maps.ny, i % maps.ny);
        let a = f64::from(maps.albedo[i]);
        sum += a * dvec3(x, y, f64::from(maps.depth[i]));
        weight += a;
    }
    sum / weight
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_result() {
    let gpu = host();
    let capture = plate(0.125, -0.075);
    let mut mirrored = capture.clone();
    let [nx, ny] = capture.scan;
    for pair in 0..nx * ny {
        let from = (nx - 1 - pair / ny) * ny + pair % ny;
        let bins = capture.bins;
        mirrored.histograms[pair * bins..(pair + 1) * bins]
            .copy_from_slice(&capture.histograms[from * bins..(from + 1) * bins]);
    }
    let (a, b) = (solve(&gpu, &capture, 16, 100), solve(&gpu, &mirrored, 16, 100));
    let largest = a.albedo.iter().fold(0.0f32, |m, v| m.max(*v));
    let mut angles = vec![];
    for i in 0..a.albedo.len() {
        let j = (a.nx - 1 - i / a.ny) * a.ny + i % a.ny;
        assert!(
            (a.albedo[i] - b.albedo[j]).abs() < 0.01 * largest,
            "pixel {i}: {} {}",
            a.albedo[i],
            b.albedo[j]
        );
        if a.mask[i] {
            assert!((a.depth[i] - b.depth[j]).abs() < 1e-6);
            let (n, m) = (a.normal[i], b.normal[j]);
            angles.push((m[1] * n[1] + m[2] * n[2] - m[0] * n[0]).min(1.0).acos().to_degrees());
        }
    }
    // Where a normal's slope is zero, Adam at its full rate follows the sign of rounding errors: hence the mean.
    assert!(angles.iter().sum::<f32>() / (angles.len() as f32) < 3.0, "{angles:?}");
    let (c, d) = (centroid(&a), centroid(&b));
    assert!(c.x > 0.08 && d.x < -0.08 && c.y < -0.05, "the plate is where it was put: {c} {d}");
    assert_valid(&gpu);
}

#[test]
fn a_scene_shifted_by_one_voxel_gives_the_result_shifted_by_one_voxel() {
    let gpu = host();
    let pitch = 0.8 / 16.0;
    let a = centroid(&solve(&gpu, &plate(-0.025, 0.025), 16, 100));
    let b = centroid(&solve(&gpu, &plate(-0.025 + pitch, 0.025), 16, 100));
    let c = centroid(&solve(&gpu, &plate(-0.025, 0.025 + pitch), 16, 100));
    assert!((b - a - dvec3(pitch, 0.0, 0.0)).abs().max_element() < 0.1 * pitch, "{a} {b}");
    assert!((c - a - dvec3(0.0, pitch, 0.0)).abs().max_element() < 0.1 * pitch, "{a} {c}");
    assert!((a.z - 0.5).abs() < 0.01, "the plate stands at 0.5 m: {a}");
    assert_valid(&gpu);
}
