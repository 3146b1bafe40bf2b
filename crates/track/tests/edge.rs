//! An upright plate on a floor, of which a wall hides a part from each point: with the edge it is found where it stands.

use glam::DVec3;
use rand::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;
use thirdbounce_capture::{Capture, Reflectance};
use thirdbounce_track::{BlobShape, Edge, Finding, LocateOptions, Sight, locate};

const SIDE: usize = 6;
const BINS: usize = 40;
const WIDTH: f64 = 0.1;
/// Foot of the plate, its width and height, metres.
const WIDE: f64 = 0.2;
const HIGH: f64 = 1.0;

/// Photons of a plate that turns toward the corner, past a wall along −x that ends there.
fn capture(foot: DVec3) -> Capture {
    let laser = DVec3::new(-0.06, 0.1, 0.0);
    let sensor = |pair: usize| {
        let place = |at: usize| (at as f64 + 0.5) / SIDE as f64 * 0.25;
        DVec3::new(place(pair / SIDE) - 0.125, place(pair % SIDE) - 0.25, 0.0)
    };
    let (normal, along) = (-foot.normalize(), DVec3::new(-foot.y, foot.x, 0.0).normalize());
    let mut means = vec![0.5; SIDE * SIDE * BINS];
    for (pair, means) in means.chunks_exact_mut(BINS).enumerate() {
        for (i, j) in (0..20).flat_map(|i| (0..50).map(move |j| (i, j))) {
            let side = (f64::from(i) + 0.5) / 20.0 - 0.5;
            let at = foot + along * (WIDE * side) + DVec3::Z * (HIGH * (f64::from(j) + 0.5) / 50.0);
            let mut light = 1.0;
            for point in [laser, sensor(pair)] {
                let way = at - point;
                let hides = point.y < 0.0 && point.x - way.x * point.y / way.y < 0.0;
                let cosines = way.z * -normal.dot(way) / way.length_squared();
                light *= if hides { 0.0 } else { cosines / way.length_squared() };
            }
            let bin = (at.distance(laser) + at.distance(sensor(pair))) / WIDTH;
            means[bin as usize] += 3.0 * light;
        }
    }
    let mut random = Pcg64::seed_from_u64(5);
    let counts = means.iter().map(|mean| Poisson::new(*mean).unwrap().sample(&mut random) as f32).collect();
    let pairs = SIDE * SIDE;
    let mut capture =
        Capture::new([SIDE, SIDE], vec![laser; pairs], (0..pairs).map(sensor).collect(), BINS, WIDTH, counts);
    (capture.integer_counts, capture.sensor_spot) = (true, Some(0.04));
    capture
}

fn found(capture: &Capture, edge: Option<Edge>, shape: BlobShape) -> Finding {
    let sight = Sight::of(capture, Reflectance::Lambertian, [1.0, 0.0]).unwrap().past(edge);
    locate(&sight, &LocateOptions { blobs: Some(1), shape, ..LocateOptions::default() }, &[]).unwrap()
}

#[test]
fn an_edge_gives_the_angle_and_the_floor_the_range() {
    let edge = Some(Edge::new([0.0, 0.0], 180.0));
    for degrees in [60.0_f64, 90.0, 115.0] {
        let foot = DVec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0) * 1.25;
        let capture = capture(foot);
        let off = |edge, shape| {
            let at = found(&capture, edge, shape).positions[0].at;
            [at.truncate().length() - 1.25, at.y.atan2(at.x).to_degrees() - degrees]
        };
        let [range, angle] = off(edge, BlobShape::Upright);
        assert!(range.abs() < 0.05 && angle.abs() < 4.0, "{degrees}: {range} {angle}");
        assert!(off(None, BlobShape::Upright)[1].abs() > 8.0, "{degrees}: the angle comes from the edge");
        assert!(off(edge, BlobShape::Flat)[0].abs() > 0.1, "{degrees}: the range comes from the shape");
    }
    let position = &found(&capture(DVec3::Y * 1.25), edge, BlobShape::Upright).positions[0];
    assert!((position.at.z - 0.5 * HIGH).abs() < 0.06, "{position:?}");
    assert!(position.deviations().max_element() < 0.1, "{position:?}");
}
