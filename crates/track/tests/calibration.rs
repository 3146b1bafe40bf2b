//! A calibration finds the pairs that made the counts; positions by it are those of the truth, within their errors.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use thirdbounce_capture::Capture;
use thirdbounce_track::Calibration;

const BINS: usize = 24;
const WIDTH: f64 = 0.4;
const DEVIATION: f64 = 0.3;
/// Powers of distances and cosines.
const POWERS: [f64; 2] = [1.2, 2.5];
const NOISE: f64 = 12.0;

/// Wall points as they are, and as they are given; delays; amounts of light.
const PAIRS: [([f64; 2], [f64; 2], f64, f64); 4] = [
    ([-0.55, -0.30], [-0.50, -0.20], 3.1, 900.0),
    ([0.50, -0.35], [0.50, -0.20], 4.2, 700.0),
    ([-0.45, 0.30], [-0.50, 0.30], 2.9, 500.0),
    ([0.55, 0.45], [0.50, 0.30], 4.4, 1500.0),
];

/// Approximately normal: the sum of twelve uniform ones.
fn normal(random: &mut Pcg64) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Counts of an object: rooms with direct light, levels that drift, noise.
fn capture(at: DVec3, random: &mut Pcg64) -> Capture {
    let mut counts = vec![];
    for (point, _, delay, light) in PAIRS {
        let way = at - DVec3::new(point[0], point[1], 0.0);
        let (distance, cosine) = (way.length(), way.z / way.length());
        let path = 2.0 * distance + delay;
        let light = light * distance.powf(-2.0 * POWERS[0]) * cosine.powf(2.0 * POWERS[1]);
        let level = 80.0 + 10.0 * normal(random);
        let direct = 20_000.0 * (1.0 + 0.05 * normal(random));
        let share = |path: f64, bin: usize| {
            let edge = |bin: usize| {
                0.5 * libm::erfc(-(bin as f64 * WIDTH - path) / DEVIATION * std::f64::consts::FRAC_1_SQRT_2)
            };
            edge(bin + 1) - edge(bin)
        };
        for bin in 0..BINS {
            let mean = level + direct * share(delay, bin) + light * share(path, bin);
            counts.push((mean + NOISE * normal(random)) as f32);
        }
    }
    let points: Vec<DVec3> = PAIRS.iter().map(|(_, given, ..)| DVec3::new(given[0], given[1], 0.0)).collect();
    Capture::new([2, 2], points.clone(), points, BINS, WIDTH, counts)
}

fn places(count: usize, random: &mut Pcg64) -> Vec<DVec3> {
    let mut within = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    (0..count).map(|_| DVec3::new(within(-0.4, 0.5), within(-0.6, 0.6), within(0.6, 1.6))).collect()
}

#[test]
fn known_positions_calibrate_pairs_and_further_ones_lie_within_their_errors() {
    let mut random = Pcg64::seed_from_u64(7);
    let at = places(200, &mut random);
    let captures: Vec<Capture> = at.iter().map(|at| capture(*at, &mut random)).collect();
    let found = Calibration::of(&captures, &at, true).unwrap();
    for (pair, (point, given, delay, _)) in found.pairs.iter().zip(PAIRS) {
        let off = |p: [f64; 2]| pair.points[1].truncate().distance(p.into());
        assert!(off(point) < 0.06 && off(point) < off(given), "{:?} of {point:?}", pair.points);
        assert!((pair.delay - delay).abs() < 0.05, "{} of {delay}", pair.delay);
    }
    assert!((found.deviation - DEVIATION).abs() < 0.03, "{}", found.deviation);
    assert!((found.powers[1] - POWERS[1]).abs() < 0.4, "{:?}", found.powers);
    let further = places(100, &mut random);
    let (mut squares, mut within) = (0.0, [0.0; 2]);
    for at in &further {
        let position = &found.locate(&capture(*at, &mut random), None, true).unwrap().positions[0];
        let (off, deviations) = (position.at - *at, position.deviations());
        squares += off.length_squared();
        for axis in 0..3 {
            let sizes = off[axis].abs() / deviations[axis];
            (0..2).for_each(|k| within[k] += f64::from(u8::from(sizes < (k + 1) as f64)));
        }
    }
    let error = (squares / 300.0).sqrt();
    let shares = within.map(|w| w / 300.0);
    assert!(error < 0.16, "{error}");
    assert!((0.58..0.80).contains(&shares[0]) && shares[1] > 0.9, "{shares:?}");
}

#[test]
fn nothing_is_found_without_an_object_and_bad_input_is_named() {
    let mut random = Pcg64::seed_from_u64(8);
    let at = places(60, &mut random);
    let captures: Vec<Capture> = at.iter().map(|at| capture(*at, &mut random)).collect();
    let found = Calibration::of(&captures, &at, true).unwrap();
    let dark = capture(DVec3::new(0.0, 0.0, 50.0), &mut random);
    assert!(found.locate(&dark, None, false).unwrap().positions.is_empty());
    let bright = capture(DVec3::new(0.0, 0.0, 0.8), &mut random);
    assert_eq!(found.locate(&bright, None, false).unwrap().positions.len(), 1);
    let few = Calibration::of(&captures[..5], &at[..5], true).unwrap_err().to_string();
    assert!(few.contains("5 captures"), "{few}");
    let mut other = dark.clone();
    other.bin_width = 0.3;
    assert!(found.locate(&other, None, true).unwrap_err().to_string().contains("0.4"));
    let corner = DVec3::splat(0.5);
    assert!(found.locate(&dark, Some([corner, corner]), true).is_err());
}
