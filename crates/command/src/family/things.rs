//! Random things with limbs, ears, thin and steep parts. x is right, y up, -z toward the wall; about 1 m large. Every part is
//! a convex mesh of its own, but for rings and letters.

use std::f64::consts::TAU;

use glam::{DVec3, dvec2, dvec3};
use thirdbounce_simulate::{Mesh, Placement, capsule, ellipsoid, letter, rectangle, torus};

use super::dice::Dice;

/// Weight; name; what builds it; the largest tilt about x and z, and the largest turn about y, degrees.
type Kind = (f64, (&'static str, fn(&mut Dice) -> Vec<Mesh>, f64, f64));

/// A plate or a letter.
pub fn flat(dice: &mut Dice) -> (&'static str, Vec<Mesh>) {
    built(dice, &[(0.5, ("plate", plate, 35.0, 60.0)), (0.5, ("letter", one_letter, 10.0, 30.0))])
}

/// A plate with patches of other albedos in front of it, turned at random: its name, and the plate before its patches.
pub fn sign(dice: &mut Dice) -> (&'static str, Vec<Mesh>) {
    built(dice, &[(1.0, ("sign", painted, 35.0, 60.0))])
}

/// Any thing, turned at random: its name and parts.
pub fn any(dice: &mut Dice) -> (&'static str, Vec<Mesh>) {
    const KINDS: [Kind; 10] = [
        (0.22, ("animal", animal, 10.0, 180.0)),
        (0.22, ("figure", figure, 10.0, 70.0)),
        (0.09, ("hand", hand, 40.0, 50.0)),
        (0.09, ("plant", plant, 10.0, 180.0)),
        (0.08, ("ring", ring, 60.0, 60.0)),
        (0.08, ("plate", plate, 35.0, 60.0)),
        (0.08, ("box", block, 25.0, 60.0)),
        (0.06, ("chair", chair, 10.0, 180.0)),
        (0.04, ("letter", one_letter, 10.0, 30.0)),
        (0.04, ("star", star, 60.0, 60.0)),
    ];
    built(dice, &KINDS)
}

fn built(dice: &mut Dice, kinds: &[Kind]) -> (&'static str, Vec<Mesh>) {
    let (name, build, tilt, turn) = dice.one(kinds);
    let parts = build(dice);
    let rotate = [tilt, turn, tilt].map(|most| dice.of(-most, most));
    (name, parts.into_iter().map(|mesh| turned(mesh, rotate, 1.0, DVec3::ZERO)).collect())
}

/// The parts scaled together until the larger of width and height is `size`, around `centre`, at least `clear` before the
/// wall.
pub fn placed(parts: &[Mesh], size: f64, centre: DVec3, clear: f64) -> Vec<Mesh> {
    let bounds = || parts.iter().filter_map(Mesh::bounds);
    let low = bounds().fold(DVec3::MAX, |all, b| all.min(b.0));
    let high = bounds().fold(DVec3::MIN, |all, b| all.max(b.1));
    let scale = size / (high - low).truncate().max_element();
    let mut to = centre - scale * 0.5 * (low + high);
    to.z = to.z.max(clear - scale * low.z);
    parts.iter().map(|mesh| turned(mesh.clone(), [0.0; 3], scale, to)).collect()
}

fn turned(mesh: Mesh, rotate: [f64; 3], scale: f64, translate: DVec3) -> Mesh {
    mesh.placed(&Placement { fit: None, scale, rotate, translate }).expect("a mesh of plain numbers")
}

/// Tapered capsules from joint to joint: place and radius of each.
fn limb(joints: &[(DVec3, f64)]) -> Vec<Mesh> {
    joints.windows(2).map(|j| capsule(j[0].0, j[0].1, j[1].0, j[1].1)).collect()
}

/// A step of this length, at random about `way`; 0: exactly there, 1: half across.
fn step(dice: &mut Dice, way: DVec3, length: f64, astray: f64) -> DVec3 {
    let aside = dvec3(dice.of(-1.0, 1.0), dice.of(-1.0, 1.0), dice.of(-1.0, 1.0));
    (way.normalize() + astray * aside).normalize() * length
}

/// Four legs, a head with ears, a tail; it looks along +x.
fn animal(dice: &mut Dice) -> Vec<Mesh> {
    let (thick, legs, neck) = (dice.of(0.11, 0.2), dice.of(0.2, 0.5), dice.of(0.05, 0.35));
    let (rump, chest) = (dvec3(-0.32, 0.0, 0.0), dvec3(0.3, dice.of(-0.03, 0.06), 0.0));
    let head = chest + dvec3(0.16 + 0.3 * neck, 0.1 + neck, dice.of(-0.1, 0.1));
    let skull = dice.of(0.09, 0.14);
    let mut parts = vec![capsule(rump, thick, chest, 0.95 * thick)];
    parts.extend(limb(&[(chest, 0.6 * thick), (head, 0.45 * thick)]));
    parts.push(turned(ellipsoid(DVec3::ZERO, dvec3(1.25, 0.95, 0.9) * skull), [0.0; 3], 1.0, head));
    let snout = dvec3(dice.of(1.3, 2.0), -0.4, 0.0) * skull;
    parts.push(capsule(head, 0.6 * skull, head + snout, 0.35 * skull));
    let (ear, lean) = (skull * dice.of(0.8, 3.2), dice.of(0.2, 0.9));
    for side in [-1.0, 1.0] {
        let root = head + dvec3(-0.3, 0.7, 0.45 * side) * skull;
        let tip = root + dvec3(-0.3, 1.0, lean * side).normalize() * ear;
        parts.push(capsule(root, 0.28 * skull, tip, 0.08 * skull));
        for (hip, way) in [(rump, -0.05), (chest, 0.05)] {
            let top = hip + dvec3(way, -0.4 * thick, 0.6 * thick * side);
            let knee = top + dvec3(dice.of(-0.12, 0.12), -0.5 * legs - 0.5 * thick, 0.0);
            let foot = knee + dvec3(dice.of(-0.1, 0.1), -0.5 * legs, 0.0);
            parts.extend(limb(&[(top, 0.42 * thick), (knee, 0.045), (foot, 0.032)]));
        }
    }
    let mut tail = vec![(rump - DVec3::X * 0.8 * thick, 0.045)];
    for _ in 0..2 {
        let last = tail[tail.len() - 1];
        tail.push((last.0 + step(dice, dvec3(-1.0, 0.3, 0.0), 0.08 + 0.25 * legs, 0.7), 0.7 * last.1));
    }
    parts.extend(limb(&tail));
    parts
}

/// A person in any posture.
fn figure(dice: &mut Dice) -> Vec<Mesh> {
    let wide = dice.of(0.75, 1.2);
    let (neck, hips) = (dvec3(0.0, 0.26, 0.0), dvec3(dice.of(-0.05, 0.05), -0.06, 0.0));
    let mut parts = vec![
        turned(
            ellipsoid(DVec3::ZERO, dvec3(0.07, 0.09, 0.08)),
            [0.0; 3],
            1.0,
            neck + dvec3(dice.of(-0.04, 0.04), 0.12, -0.02),
        ),
        capsule(neck - DVec3::Y * 0.02, 0.04, neck + DVec3::Y * 0.05, 0.036),
        turned(
            ellipsoid(DVec3::ZERO, dvec3(0.135 * wide, 0.13, 0.085)),
            [0.0; 3],
            1.0,
            neck - DVec3::Y * 0.1,
        ),
        capsule(neck - DVec3::Y * 0.14, 0.09 * wide, hips, 0.09 * wide),
    ];
    for side in [-1.0, 1.0] {
        let shoulder = neck + dvec3(0.115 * wide * side, -0.04, 0.0);
        let (lift, bend) = (dice.of(-1.4, 1.2), dice.of(-0.3, 1.6));
        let arm = |angle: f64, ahead: f64| dvec3(side * angle.cos(), angle.sin(), -ahead).normalize();
        let elbow = shoulder + 0.16 * arm(lift, dice.of(-0.2, 0.8));
        let hand = elbow + 0.19 * arm(lift + bend, dice.of(-0.2, 1.0));
        parts.extend(limb(&[(shoulder, 0.048), (elbow, 0.038), (hand, 0.028)]));
        parts.push(capsule(hand, 0.032, hand + 0.04 * (hand - elbow).normalize(), 0.02));
        let hip = hips + dvec3(0.055 * wide * side, -0.02, 0.0);
        let (apart, ahead) = (dice.of(0.0, 0.5), dice.of(-0.5, 0.6));
        let knee = hip + 0.22 * dvec3(side * apart, -1.0, -ahead).normalize();
        let foot = knee + 0.22 * dvec3(side * apart * dice.of(0.0, 1.0), -1.0, dice.of(0.0, 0.5)).normalize();
        parts.extend(limb(&[
            (hip, 0.072),
            (knee, 0.05),
            (foot, 0.034),
            (foot + dvec3(0.01 * side, -0.01, -0.09), 0.025),
        ]));
    }
    parts
}

/// A palm and five fingers, more or less spread.
fn hand(dice: &mut Dice) -> Vec<Mesh> {
    let mut parts = vec![cuboid(dvec3(0.2, 0.22, 0.06)), capsule(DVec3::ZERO, 0.11, DVec3::Y * -0.5, 0.1)];
    let spread = dice.of(0.1, 0.5);
    for finger in 0..5 {
        let from = f64::from(finger) - 2.0;
        let (root, long) = if finger == 0 {
            (dvec3(-0.2, -0.02, 0.0), 0.2)
        } else {
            (dvec3(0.1 * from - 0.03, 0.2, 0.0), 0.24)
        };
        let angle = if finger == 0 { -1.0 } else { spread * 0.5 * from };
        let way = dvec3(angle.sin(), angle.cos(), -dice.of(0.0, 0.5)).normalize();
        let joint = root + way * long;
        let tip = joint + (way - DVec3::Z * dice.of(0.0, 0.8)).normalize() * 0.8 * long;
        parts.extend(limb(&[(root, 0.05), (joint, 0.043), (tip, 0.033)]));
    }
    parts
}

/// A stem with branches, some with a leaf or a fruit.
fn plant(dice: &mut Dice) -> Vec<Mesh> {
    let mut stem = vec![(DVec3::ZERO, 0.045)];
    let mut parts = vec![capsule(DVec3::Y * -0.12, 0.12, DVec3::ZERO, 0.15)];
    for _ in 0..4 {
        let (at, radius) = stem[stem.len() - 1];
        let next = at + step(dice, DVec3::Y, 0.22, 0.25);
        let angle = dice.of(0.0, TAU);
        let length = dice.of(0.15, 0.4);
        let tip = next + step(dice, dvec3(angle.cos(), 0.7, angle.sin()), length, 0.2);
        parts.push(capsule(next, 0.6 * radius, tip, 0.4 * radius));
        let leaf = dvec3(dice.of(0.05, 0.13), dice.of(0.02, 0.13), dice.of(0.05, 0.13));
        let rotate = [dice.of(-60.0, 60.0), 0.0, dice.of(-60.0, 60.0)];
        if dice.so_often(0.7) {
            parts.push(turned(ellipsoid(DVec3::ZERO, leaf), rotate, 1.0, tip));
        }
        stem.push((next, 0.85 * radius));
    }
    parts.extend(limb(&stem));
    parts
}

fn ring(dice: &mut Dice) -> Vec<Mesh> {
    vec![torus(DVec3::ZERO, -DVec3::Z, 0.4, dice.of(0.05, 0.16))]
}

fn plate(dice: &mut Dice) -> Vec<Mesh> {
    vec![rectangle(DVec3::ZERO, DVec3::Y * 0.5, DVec3::X * dice.of(0.12, 0.5))]
}

fn painted(dice: &mut Dice) -> Vec<Mesh> {
    let half = dvec2(0.5, dice.of(0.25, 0.5));
    let mut parts = vec![rectangle(DVec3::ZERO, DVec3::Y * half.y, DVec3::X * half.x)];
    for _ in 0..dice.one(&[(0.4, 1), (0.3, 2), (0.2, 3), (0.1, 5)]) {
        let size = half * dvec2(dice.of(0.1, 0.6), dice.of(0.1, 0.6));
        let at = (half - size) * dvec2(dice.of(-1.0, 1.0), dice.of(-1.0, 1.0));
        parts.push(rectangle(at.extend(-0.005), DVec3::Y * size.y, DVec3::X * size.x));
    }
    parts
}

fn block(dice: &mut Dice) -> Vec<Mesh> {
    vec![cuboid(dvec3(dice.of(0.15, 0.5), dice.of(0.15, 0.5), dice.of(0.05, 0.4)))]
}

/// Seat, back and four thin legs.
fn chair(dice: &mut Dice) -> Vec<Mesh> {
    let (half, legs, back) = (dice.of(0.2, 0.28), dice.of(0.3, 0.5), dice.of(0.3, 0.6));
    let moved = |mesh: Mesh, to: DVec3| turned(mesh, [0.0; 3], 1.0, to);
    let mut parts = vec![
        cuboid(dvec3(half, 0.03, half)),
        moved(cuboid(dvec3(half, 0.5 * back, 0.025)), dvec3(0.0, 0.5 * back, half)),
    ];
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let top = dvec3(x, 0.0, z) * (half - 0.03);
        parts.push(capsule(top, 0.03, top * 1.15 - DVec3::Y * legs, 0.025));
    }
    parts
}

fn one_letter(dice: &mut Dice) -> Vec<Mesh> {
    let name = char::from(b'A' + dice.of(0.0, 25.99) as u8);
    vec![letter(name, DVec3::ZERO, 1.0).expect("a letter")]
}

/// Spikes in all directions.
fn star(dice: &mut Dice) -> Vec<Mesh> {
    let (count, thick) = (dice.of(5.0, 9.0) as usize, dice.of(0.05, 0.11));
    let spike = |i: usize, dice: &mut Dice| {
        let angle = TAU * i as f64 / count as f64;
        let way = dvec3(angle.cos(), angle.sin(), dice.of(-0.7, 0.3)).normalize();
        capsule(DVec3::ZERO, thick, way * dice.of(0.3, 0.5), 0.2 * thick)
    };
    (0..count).map(|i| spike(i, dice)).collect()
}

/// A box with these half sides.
fn cuboid(half: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        let [out, u, v] = [0, 1, 2].map(|k| {
            let mut side = DVec3::ZERO;
            side[(axis + k) % 3] = half[(axis + k) % 3];
            side
        });
        mesh.extend(rectangle(out, u, v));
        mesh.extend(rectangle(-out, v, u));
    }
    mesh
}
