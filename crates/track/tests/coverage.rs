//! Shares of true positions within one and two standard deviations.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use thirdbounce_capture::{Capture, Reflectance};
use thirdbounce_simulate::{Object, RenderOptions, Scene, rectangle, simulate, sphere};
use thirdbounce_track::{LocateOptions, Position, Sight, locate};

/// What is seen.
#[derive(Debug, Clone, Copy)]
enum Thing {
    /// A ball, or a plate that faces the wall.
    Small,
    /// A figure, 0.6 m high.
    Figure,
}

/// A thing somewhere in front of a wall of 1 m, and its middle.
fn scene(seed: u64, thing: Thing, scan: usize, bin_width: f64, photons: f64) -> (Scene, DVec3) {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut within = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let at = DVec3::new(within(-0.4, 0.4), within(-0.4, 0.4), within(0.5, 1.2));
    let radius = within(0.04, 0.12);
    let objects = match thing {
        Thing::Small if seed.is_multiple_of(2) => vec![sphere(at, radius)],
        Thing::Small => vec![rectangle(at, DVec3::Y * radius, DVec3::X * radius)],
        Thing::Figure => {
            let figure = Scene::named("figure").unwrap().fitted(0.6).unwrap();
            let bounds = figure.objects.iter().filter_map(|o| o.mesh.bounds());
            let (low, high) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap();
            let shift = at - low.midpoint(high);
            figure.objects.into_iter().map(|o| o.mesh.translated(shift)).collect()
        }
    };
    let objects = objects.into_iter().map(|mesh| Object { mesh, albedo: 1.0 }).collect();
    let mut scene = Scene::new("thing", objects);
    (scene.scan, scene.bin_width, scene.photons, scene.seed) = (scan, bin_width, Some(photons), seed);
    scene.bins = Some((3.6 / bin_width) as usize);
    (scene, at)
}

fn capture(scene: &Scene) -> Capture {
    let options = RenderOptions { noise: 0.02, seed: scene.seed, ..RenderOptions::default() };
    simulate(scene, &options).unwrap().capture
}

/// Errors of the coordinates and of the distance, in standard deviations, and squared, in metres; and seconds.
fn errors(
    seeds: std::ops::Range<u64>,
    thing: Thing,
    scan: usize,
    bin_width: f64,
    photons: f64,
) -> Vec<[[f64; 2]; 4]> {
    let one = |seed: u64| {
        let (scene, at) = scene(seed, thing, scan, bin_width, photons);
        let sight = Sight::of(&capture(&scene), Reflectance::Cosine, [1.0, 0.0]).unwrap();
        let found =
            locate(&sight, &LocateOptions { blobs: Some(1), ..LocateOptions::default() }, &[]).unwrap();
        let position = &found.positions[0];
        let (off, deviations) = (position.at - at, position.deviations());
        let [distance, deviation] = position.distance;
        let far = distance - at.length();
        let of = |k: usize| [off[k] / deviations[k], off[k] * off[k]];
        [of(0), of(1), of(2), [far / deviation, far * far]]
    };
    seeds.into_par_iter().map(one).collect()
}

/// Shares of coordinates within one and two standard deviations, times a scale.
fn shares<'e>(errors: impl Iterator<Item = &'e [f64; 2]> + Clone, scale: f64) -> [f64; 2] {
    let within = |limit: f64| {
        errors.clone().filter(|e| e[0].abs() <= limit * scale).count() as f64 / errors.clone().count() as f64
    };
    [within(1.0), within(2.0)]
}

#[test]
#[ignore = "the table of docs/track.md"]
fn table() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (first, count) = (number("SEED", 0), number("COUNT", 40));
    let rows = [(0.012, 1000.0), (0.012, 100.0), (0.012, 10.0), (0.003, 100.0), (0.04, 100.0)];
    for thing in [Thing::Small, Thing::Figure] {
        for scan in [1, 2, 3, 4, 7] {
            for (bin_width, photons) in rows {
                let found = errors(first..first + count, thing, scan, bin_width, photons);
                let rms = |axis: usize| {
                    1e3 * (found.iter().map(|e| e[axis][1]).sum::<f64>() / found.len() as f64).sqrt()
                };
                let [one, two] = shares(found.iter().flat_map(|e| &e[..3]), 1.0).map(|v| 100.0 * v);
                let [far, twice] = shares(found.iter().map(|e| &e[3]), 1.0).map(|v| 100.0 * v);
                println!(
                    "| {thing:?} | {scan} × {scan} | {:.0} | {photons} | {:.0} | {:.0} | {:.0} | {one:.0}, {two:.0} | {:.0} | {far:.0}, {twice:.0} |",
                    1e3 * bin_width,
                    rms(0),
                    rms(1),
                    rms(2),
                    rms(3)
                );
            }
        }
    }
}

#[test]
fn errors_are_as_large_as_they_say() {
    let found = errors(100..160, Thing::Small, 3, 0.012, 20.0);
    let all = || found.iter().flat_map(|e| &e[..3]);
    let [one, two] = shares(all(), 1.0);
    assert!((0.6..0.85).contains(&one) && two >= 0.9, "{one} {two}");
    // Half of the covariance would not do.
    let [one, two] = shares(all(), 0.5f64.sqrt());
    assert!(one < 0.6 || two < 0.9, "{one} {two}");
}

#[test]
fn as_many_objects_are_found_as_there_are() {
    let find = |scene: &Scene| {
        let sight = Sight::of(&capture(scene), Reflectance::Cosine, [1.0, 0.0]).unwrap();
        locate(&sight, &LocateOptions::default(), &[]).unwrap().positions
    };
    for seed in 0..6 {
        let (mut scene, _) = scene(seed, Thing::Small, 3, 0.012, 100.0);
        assert_eq!(find(&scene).len(), 1, "{seed}");
        let places = [DVec3::new(-0.3, 0.1, 0.6), DVec3::new(0.3, 0.0, 1.0)];
        scene.objects = places.map(|at| Object { mesh: sphere(at, 0.07), albedo: 1.0 }).into();
        scene.objects[1].albedo = 4.0;
        let found = find(&scene);
        assert_eq!(found.len(), 2, "{seed}");
        for place in places {
            let near = |p: &Position| ((p.at - place) / p.deviations()).abs().max_element() < 4.0;
            assert!(found.iter().any(near), "{seed}: {place} {found:?}");
        }
    }
    // Dark counts are no object.
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut random = Pcg64::seed_from_u64(3);
    let counts = (0..3 * 100).map(|_| f32::from(random.random::<f64>() < 0.3)).collect();
    let mut dark = Capture::new([3, 1], points.clone(), points, 100, 0.02, counts);
    dark.integer_counts = true;
    let sight = Sight::of(&dark, Reflectance::Cosine, [1.0, 0.0]).unwrap();
    assert!(locate(&sight, &LocateOptions::default(), &[]).unwrap().positions.is_empty());
}

#[test]
#[ignore = "the rates of docs/track.md"]
fn rates() {
    for (scan, bins) in [(2, 24), (16, 64)] {
        let (mut scene, _) = scene(1, Thing::Small, scan, 3.6 / bins as f64, 100.0);
        scene.bins = Some(bins);
        let sight = Sight::of(&capture(&scene), Reflectance::Cosine, [1.0, 0.0]).unwrap();
        for blobs in [Some(1), None] {
            let clock = std::time::Instant::now();
            let count = 20;
            for _ in 0..count {
                locate(&sight, &LocateOptions { blobs, ..LocateOptions::default() }, &[]).unwrap();
            }
            println!(
                "{scan} × {scan} × {bins}, {blobs:?}: {:.0} a second",
                f64::from(count) / clock.elapsed().as_secs_f64()
            );
        }
    }
}
