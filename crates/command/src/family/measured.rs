//! Scenes whose light is that of published captures: their counts, background, scan, bins and impulse response.

use glam::{DVec3, dvec2, dvec3};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use thirdbounce::capture::Pulse;
use thirdbounce_simulate::*;

use super::case::{FamilyCase, Ranges, TO_TRAIN, TRAINING, conditions, seen, things};
use super::dice::Dice;
use super::losses::Losses;

/// How a published capture was measured. Lengths are in walls.
struct MeasuredLight {
    /// Counts of the largest bin of the median pair less background, and background of a bin.
    peak: f64,
    dark: f64,
    /// Scan points per side, bin width, and full width at half maximum of the impulse response.
    scan: usize,
    bin: f64,
    pulse: f64,
}

const fn light(peak: f64, dark: f64, scan: usize, bin: f64, pulse: f64) -> MeasuredLight {
    MeasuredLight { peak, dark, scan, bin, pulse }
}

/// Twelve published confocal captures, as read off their files.
const MEASURED: [MeasuredLight; 12] = [
    // Letters T X; digits 2019; a toy.
    light(43.0, 4.6, 51, 0.019, 0.03),
    light(42.0, 4.7, 51, 0.019, 0.03),
    light(75.0, 5.4, 26, 0.019, 0.03),
    // Dragon; statue.
    light(12.0, 3.4, 64, 0.005, 0.014),
    light(9.0, 1.1, 64, 0.005, 0.01),
    // A and 2 of a curved wall; N T.
    light(33.0, 3.0, 64, 0.006, 0.02),
    light(37.0, 0.1, 64, 0.0096, 0.02),
    // Matt S; S outdoors; letters S U; nine dots.
    light(30.0, 5.0, 64, 0.0135, 0.09),
    light(40.0, 4.6, 32, 0.0096, 0.06),
    light(40.0, 2.0, 64, 0.007, 0.02),
    light(25.0, 2.8, 64, 0.024, 0.04),
    // Mannequin at a distance of kilometres.
    light(14.0, 0.0, 64, 0.011, 0.04),
];

/// How far counts and background of a scene may be from those of the table, and the width of the response.
const COUNTS: [f64; 2] = [0.6, 1.6];
const BACKGROUND: [f64; 2] = [0.5, 1.5];
const WIDTHS: [f64; 2] = [0.7, 1.3];

/// Scans, counts and kinds of pairs that no capture of the table has, of scenes to train on.
const SCANS: [(f64, usize); 7] =
    [(0.1, 8), (0.15, 12), (0.2, 16), (0.2, 24), (0.2, 32), (0.1, 48), (0.05, 64)];
const MORE_COUNTS: [f64; 2] = [0.1, 10.0];

impl FamilyCase {
    /// The case of a seed, measured as a published capture: letters, printed and two-tone plates, or built-in scenes before a wall of 1 m,
    /// without a room. Seeds to train on have these at other places and sizes, also things of the family, and other scans.
    pub fn measured(seed: u64) -> FamilyCase {
        let mut dice = Dice(Pcg64::seed_from_u64(seed ^ 0x6d65_6173_7572_6564));
        let is_training = seed >= TRAINING;
        let (objects, words) = match is_training {
            true => to_train(&mut dice),
            false => as_drawn(&mut dice),
        };
        let MeasuredLight { peak, dark, scan, bin, pulse } =
            &MEASURED[dice.of(0.0, MEASURED.len() as f64) as usize];
        let parts = objects.len();
        let mut scene = Scene::new(format!("measured-{seed}"), objects);
        let more =
            if is_training && dice.so_often(0.5) { dice.log(MORE_COUNTS[0], MORE_COUNTS[1]) } else { 1.0 };
        (scene.seed, scene.scan, scene.bin_width) = (seed, *scan, *bin);
        scene.photons = Some(more * peak * dice.of(COUNTS[0], COUNTS[1]));
        scene.dark = Dark::Counts(dark * dice.of(BACKGROUND[0], BACKGROUND[1]));
        scene.reflectance = dice.one(&[
            (2.0, Reflectance::Lambertian),
            (1.0, Reflectance::Cosine),
            (1.0, Reflectance::Retroreflective),
        ]);
        let response = Pulse::gaussian(pulse * dice.of(WIDTHS[0], WIDTHS[1])).expect("a width");
        let tail = pulse * dice.one(&[(2.0, 0.0), (1.0, 0.5), (1.0, 1.0)]);
        scene.pulse = Some(if tail > 0.0 { response.with_tail(tail).expect("a tail") } else { response });
        if is_training && dice.so_often(0.4) {
            scene.scan = dice.one(&SCANS);
        }
        if is_training && scene.reflectance != Reflectance::Retroreflective && dice.so_often(0.2) {
            scene.scan = scene.scan.min(32);
            scene.layout = Layout::OneLaser { point: dvec2(dice.of(-0.4, 0.4), dice.of(-0.4, 0.4)) };
        }
        scene.bins = Some(scene.bin_count());
        let losses = Losses::drawn(&mut dice);
        let render = RenderOptions { noise: 0.02, max_samples: 1 << 17, seed, coarse: None };
        let mut case = FamilyCase { parts, hide_pulse: true, losses, render, ..FamilyCase::plain(scene) };
        case.words = format!("{}; {words}", conditions(&case));
        case
    }
}

/// Three of five are flat.
fn as_drawn(dice: &mut Dice) -> (Vec<Object>, String) {
    let letter = |dice: &mut Dice| LETTERS[dice.of(0.0, LETTERS.len() as f64) as usize];
    let flat = [(0.44, Flat::Letter), (0.22, Flat::Letters), (0.17, Flat::Printed), (0.17, Flat::Tones)];
    let name = if dice.so_often(0.6) {
        match dice.one(&flat) {
            Flat::Letter => format!("letter-{}", letter(dice)),
            Flat::Letters => {
                let first = letter(dice);
                let second = std::iter::repeat_with(|| letter(dice)).find(|other| *other != first);
                format!("letters-{first}{}", second.expect("another letter"))
            }
            Flat::Printed => return printed(dice, letter),
            Flat::Tones => return tones(dice),
        }
    } else {
        dice.one(&[(2.0, "figure"), (1.0, "torus"), (1.0, "spheres"), (1.0, "plates"), (1.0, "sphere")])
            .into()
    };
    (Scene::named(&name).expect("a built-in scene").objects, name)
}

/// Letters of which each differs from the others when it is turned or mirrored a little: no I and O, which are plain bars and rings.
const LETTERS: [char; 18] =
    ['A', 'C', 'E', 'F', 'G', 'H', 'K', 'L', 'M', 'N', 'P', 'R', 'S', 'T', 'U', 'X', 'Y', 'Z'];

#[derive(Clone, Copy)]
enum Flat {
    Letter,
    Letters,
    Printed,
    Tones,
}

/// A letter on a plate of another albedo.
fn printed(dice: &mut Dice, name: impl Fn(&mut Dice) -> char) -> (Vec<Object>, String) {
    let (name, depth) = (name(dice), dice.of(0.55, 0.75));
    let half = dvec2(dice.of(0.2, 0.36), dice.of(0.24, 0.36));
    let plate = rectangle(dvec3(0.0, 0.0, depth), DVec3::Y * half.y, DVec3::X * half.x);
    let height = (2.0 * half.y).min(2.5 * half.x) * dice.of(0.6, 0.9);
    let print = letter(name, dvec3(0.0, 0.0, depth - 0.002), height).expect("a letter");
    let (bright, dark) = (dice.of(0.6, 1.0), dice.log(0.05, 0.4));
    let (of_plate, of_print, how) =
        if dice.so_often(0.7) { (bright, dark, "dark") } else { (dark, bright, "bright") };
    let objects = vec![Object { mesh: plate, albedo: of_plate }, Object { mesh: print, albedo: of_print }];
    (objects, format!("{how} letter {name} on a plate"))
}

/// A plate of two halves of different albedos.
fn tones(dice: &mut Dice) -> (Vec<Object>, String) {
    let (half, depth) = (dvec2(dice.of(0.15, 0.36), dice.of(0.15, 0.36)), dice.of(0.55, 0.75));
    let (bright, share) = (dice.of(0.6, 1.0), dice.log(0.2, 0.8));
    let is_upright = dice.so_often(0.5);
    let side = |sign: f64, albedo: f64| {
        let (centre, size) = match is_upright {
            true => (dvec3(0.5 * sign * half.x, 0.0, depth), dvec2(0.5 * half.x, half.y)),
            false => (dvec3(0.0, 0.5 * sign * half.y, depth), dvec2(half.x, 0.5 * half.y)),
        };
        Object { mesh: rectangle(centre, DVec3::Y * size.y, DVec3::X * size.x), albedo }
    };
    let sign = dice.sign();
    (vec![side(sign, bright), side(-sign, bright * share)], format!("plate of two tones, {share:.2}"))
}

/// What is measured with, moved, turned and scaled, or things of the family.
fn to_train(dice: &mut Dice) -> (Vec<Object>, String) {
    loop {
        let (objects, words) = if dice.so_often(0.35) {
            things(dice, &Ranges { counts: &[(0.7, 1), (0.3, 2)], ..TO_TRAIN })
        } else {
            let (objects, words) = as_drawn(dice);
            (moved(dice, objects), words)
        };
        if seen(&objects) >= TO_TRAIN.least_seen {
            return (objects, words);
        }
    }
}

fn moved(dice: &mut Dice, mut objects: Vec<Object>) -> Vec<Object> {
    let bounds = || objects.iter().filter_map(|o| o.mesh.bounds());
    let middle = bounds()
        .fold(DVec3::MAX, |all, b| all.min(b.0))
        .midpoint(bounds().fold(DVec3::MIN, |all, b| all.max(b.1)));
    let (scale, aside) = (dice.of(0.5, 1.15), dvec2(dice.of(-0.2, 0.2), dice.of(-0.2, 0.2)));
    let rotate = [12.0, 25.0, 12.0].map(|most| dice.of(-most, most));
    let to = (middle.truncate() + aside).extend(dice.of(0.45, 1.1));
    for object in &mut objects {
        let about = object.mesh.clone().translated(-middle);
        let placement = Placement { fit: None, scale, rotate, translate: DVec3::ZERO };
        object.mesh = about.placed(&placement).expect("a mesh of plain numbers").translated(to);
    }
    objects
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    use thirdbounce::capture::Capture;

    /// Few points, as rendering takes the time.
    fn small(seed: u64) -> FamilyCase {
        FamilyCase::measured(seed).scanned(8).coarse()
    }

    #[test]
    fn a_seed_is_one_capture_and_seeds_have_all_kinds() {
        let [one, again] = [small(17), small(17)].map(|case| case.capture().unwrap());
        assert!(one.histograms == again.histograms && one.integer_counts && one.pulse.is_none());
        let cases: Vec<FamilyCase> = (0..200).map(FamilyCase::measured).collect();
        let kinds: BTreeSet<&str> =
            cases.iter().filter_map(|case| case.words.split_once("; ")?.1.split([' ', '-']).next()).collect();
        let all = [
            "bright", "dark", "figure", "letter", "letters", "plate", "plates", "sphere", "spheres", "torus",
        ];
        assert_eq!(kinds.into_iter().collect::<Vec<_>>(), all);
        let scans: BTreeSet<usize> = cases.iter().map(|case| case.scene.scan).collect();
        assert_eq!(scans.into_iter().collect::<Vec<_>>(), [26, 32, 51, 64]);
        for seed in (0..200).step_by(25).chain(TRAINING..TRAINING + 8) {
            let case = small(seed);
            case.capture().unwrap().check().unwrap();
            assert!(case.truth().unwrap().mask.contains(&true), "{seed}: {}", case.words);
        }
    }

    #[test]
    fn losses_are_those_that_are_asked_for() {
        // Gains are of the light, not of dark counts.
        let mut case = small(3);
        (case.scene.photons, case.scene.dark) = (Some(1000.0), Dark::Counts(0.0));
        let with = |losses: Losses| FamilyCase { losses, ..case.clone() }.capture().unwrap();
        let plain = with(Losses::default());
        let of = |capture: &Capture| -> Vec<f32> {
            capture.histograms.chunks(capture.bins).map(|h| h.iter().sum()).collect()
        };
        let all = |capture: &Capture| of(capture).iter().sum::<f32>();
        let empty = |capture: &Capture| of(capture).iter().filter(|sum| **sum == 0.0).count();
        let masked = with(Losses { masked: 0.3, ..Losses::default() });
        assert!(empty(&plain) == 0 && (8..32).contains(&empty(&masked)), "{}", empty(&masked));
        // Half of what the worst bin misses, on average; no bin gains counts.
        let missing = with(Losses { missing: 0.2, ..Losses::default() });
        assert!((all(&missing) / all(&plain) - 0.9).abs() < 0.02);
        assert!(missing.histograms.iter().zip(&plain.histograms).all(|(less, more)| less <= more));
        let gains = with(Losses { gains: 0.5, ..Losses::default() });
        let ratios =
            of(&gains).iter().zip(of(&plain)).map(|(a, b)| f64::from((a / b).ln())).collect::<Vec<_>>();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let spread = (ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / ratios.len() as f64).sqrt();
        assert!((0.3..0.7).contains(&spread), "{spread}");
    }
}
