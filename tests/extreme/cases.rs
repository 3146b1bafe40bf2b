//! The scenes of METHOD section 7, small enough for the float64 twins.

use glam::{DVec3, dvec3};
use thirdbounce::capture::{Pulse, PulseTaps};
use thirdbounce::transport::twin::{self, Twin, Way};
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance, Wall};

use super::super::device::vectors::scene;
use super::super::device::{Random, state, variant};
use super::Case;

/// Lateral voxels and depth of the ordinary grid, metres in front of the wall.
pub fn grid_of(lateral: usize, deep: usize, near: f64, pitch_z: f64) -> Grid {
    let pitch = 1.0 / lateral as f64;
    let corner = -0.5 + 0.5 * pitch;
    Grid {
        n: [lateral, lateral, deep],
        origin: dvec3(corner, corner, near),
        pitch: dvec3(pitch, pitch, pitch_z),
    }
}

/// `bins` bins that end at `end` metres of path, for `n` x `n` confocal pairs on a 1 m wall.
pub fn model_of(n: usize, bins: usize, t_start: f64, end: f64) -> Model {
    let m = scene(n, bins, 51);
    Model { t_start, bin_width: (end - t_start) / bins as f64, reference: 0.25 * end, min_depth: 0.0, ..m }
}

/// Vectors in the cone on a share of the voxels, `size` times as long at a position; what they show is measured,
/// scaled to a peak of 10.
pub fn made(name: &str, model: Model, grid: Grid, share: f64, size: impl Fn(DVec3) -> f64) -> Case {
    let mut model = model;
    let active = twin::compact(&state(&model, &grid, share, 52).1);
    let mut random = Random::new(53);
    let mut vectors = || -> Vec<DVec3> {
        let one = |i: usize| {
            let v = dvec3(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), random.uniform(-1.0, -0.5));
            let v = if model.reflectance.has_normals() { v } else { v.z * DVec3::Z };
            let c = DVec3::from_array(grid.voxel(i).map(|c| c as f64));
            (v * size(grid.position(c))).as_vec3().as_dvec3()
        };
        (0..grid.storage()).map(one).collect()
    };
    let (truth, at) = (vectors(), vectors());
    let mut case = Case { name: name.into(), model: model.clone(), grid, active, truth, at };
    let render = f64::from(model.scene(&grid).render_scale);
    let twin = Twin { model: &model, grid: &grid };
    let sharp = twin::forward(&twin, &case.samples(&case.truth));
    let light: Vec<f64> = twin::pulse(&twin, &sharp, Way::Spread).iter().map(|v| v * render).collect();
    let peak = light.iter().fold(0.0f64, |a, b| a.max(*b));
    let scale = if peak > 0.0 { 10.0 / peak } else { 1.0 };
    model.measured = light.iter().map(|v| (v * scale) as f32).collect();
    model.counts_per_unit = 1.0;
    case.truth.iter_mut().chain(&mut case.at).for_each(|v| *v = (*v * scale).as_vec3().as_dvec3());
    case.model = model;
    case
}

fn one(_: DVec3) -> f64 {
    1.0
}

/// Every voxel in front of the wall from 0.05 m to 3 m.
pub fn near_far(geometry: Geometry, reflectance: Reflectance, curved: bool) -> Case {
    let model = model_of(4, 320, 0.0, 6.4);
    let model = variant(&Model { min_depth: 0.02, ..model }, geometry, reflectance, curved, 54);
    let name = format!("near and far, {geometry:?} {reflectance:?}{}", if curved { ", curved" } else { "" });
    // Curved walls come up to 0.05 m forward.
    let near = if curved { 0.1 } else { 0.05 };
    let two = |x: DVec3| if x.z < near + 0.06 || x.z > 2.9 { 1.0 } else { 0.0 };
    made(&name, model, grid_of(8, 60, near, 0.05), 0.3, two)
}

/// The same without the group term, so that the far ones live, whose light is 1e-7 of the near ones'.
pub fn near_far_free() -> Case {
    let case = without_threshold(near_far(Geometry::Confocal, Reflectance::Cosine, false));
    Case { name: "near and far, no group term".into(), ..case }
}

/// A retroreflector: one small patch so many times brighter than the rest.
pub fn retroreflector(times: f64) -> Case {
    let size = move |x: DVec3| if (x - dvec3(0.1, 0.1, 0.6)).length() < 0.08 { times } else { 1.0 };
    let name = format!("retroreflector {times:.0e}");
    without_threshold(made(&name, model_of(4, 160, 0.3, 2.7), grid_of(10, 20, 0.3, 0.04), 0.3, size))
}

/// A scene through an instrument whose pulse is a Gaussian of so many bins.
fn through(base: &Case, bins: f64) -> Case {
    let pulse = Pulse::gaussian(bins * base.model.bin_width).and_then(|p| p.taps(base.model.bin_width));
    let model = Model { pulse: Some(pulse.expect("a pulse")), ..base.model.clone() };
    made(&format!("{}, a pulse of {bins} bins", base.name), model, base.grid, 0.3, one)
}

/// Without the group term, which would leave nothing of what is dim.
fn without_threshold(mut case: Case) -> Case {
    case.model.noise_factor = 0.0;
    case
}

/// All lengths times `scale`.
pub fn wall_of(scale: f64) -> Case {
    let base = plain();
    let mut grid = base.grid;
    (grid.origin, grid.pitch) = (grid.origin * scale, grid.pitch * scale);
    let m = &base.model;
    let model = Model {
        wall: Wall::confocal(m.wall.scanned.iter().map(|p| *p * scale).collect()),
        bin_width: m.bin_width * scale,
        t_start: m.t_start * scale,
        reference: m.reference * scale,
        ..m.clone()
    };
    made(&format!("wall of {scale} m"), model, grid, 0.3, one)
}

pub fn plain() -> Case {
    made("ordinary", model_of(4, 160, 0.3, 2.7), grid_of(10, 20, 0.3, 0.04), 0.3, one)
}

/// Bins so narrow that the longest path is so many of them; the gate holds what the thin volume reaches.
pub fn narrow(bins_of_path: f64) -> Case {
    let width = 2.7 / bins_of_path;
    let bins = 4096.min(bins_of_path as usize);
    let t_start = 2.7 - bins as f64 * width;
    let model = Model { bin_width: width, reference: 0.675, ..model_of(4, bins, t_start, 2.7) };
    // As many bins as there are reach over so much depth.
    let deep = (bins as f64 * width / 2.0).min(0.6);
    let mut grid = grid_of(6, 12, 1.2 - deep, deep / 12.0);
    // Near the axis, so that off-axis paths stay in the gate.
    let lateral = (deep * 0.5).min(1.0);
    grid.pitch = dvec3(lateral / 6.0, lateral / 6.0, grid.pitch.z);
    (grid.origin.x, grid.origin.y) =
        (-0.5 * lateral + 0.5 * grid.pitch.x, -0.5 * lateral + 0.5 * grid.pitch.y);
    made(&format!("{bins_of_path:.0e} bins of path"), model, grid, 0.5, one)
}

/// Many voxels in many pairs' narrow bins, to time.
pub fn dense_narrow() -> Case {
    let model = Model { bin_width: 2.4 / 1e4, reference: 0.6, ..model_of(8, 4000, 1.44, 2.4) };
    let grid = grid_of(16, 32, 0.8, 0.01);
    made("1e4 bins of path, 64 pairs", model, grid, 1.1, one)
}

/// A scene 50 m behind the wall in bins of 5 mm.
pub fn late() -> Case {
    let model = Model { reference: 25.5, ..model_of(4, 400, 100.0, 102.0) };
    made("gate from 100 m, bins of 5 mm", model, grid_of(10, 20, 50.0, 0.04), 0.3, one)
}

/// `lateral` squared times `deep` voxels, all alike and so near together that every contribution rounds as the last
/// one did; all in one of two bins.
pub fn crowded(lateral: usize, deep: usize) -> Case {
    let model = Model { reflectance: Reflectance::Isotropic, ..model_of(1, 2, 0.0, 6.0) };
    let mut grid = grid_of(lateral, deep, 0.9, 0.01 / deep as f64);
    (grid.pitch.x, grid.pitch.y) = (0.01 * grid.pitch.x, 0.01 * grid.pitch.y);
    (grid.origin.x, grid.origin.y) = (0.01 * grid.origin.x, 0.01 * grid.origin.y);
    let mut case = made(&format!("{} additions in a bin", lateral * lateral * deep), model, grid, 1.1, one);
    let alike =
        DVec3::Z * f64::from((case.truth.iter().map(|v| v.z).sum::<f64>() / case.truth.len() as f64) as f32);
    case.at.fill(0.7 * alike);
    case
}

/// The same scene of albedos alone, without a group term: what is measured is linear in them.
pub fn as_albedos(base: &Case) -> Case {
    let reflectance = match base.model.reflectance {
        Reflectance::Retroreflective => Reflectance::Retroreflective,
        _ => Reflectance::Isotropic,
    };
    let mut case = without_threshold(base.clone());
    case.model.reflectance = reflectance;
    case.truth.iter_mut().chain(&mut case.at).for_each(|v| *v = v.z * DVec3::Z);
    let render = f64::from(case.model.scene(&case.grid).render_scale);
    let light = twin::forward(&case.twin(), &case.samples(&case.truth));
    case.model.measured = light.iter().map(|v| (v * render) as f32).collect();
    case
}

/// The same domain and bins seen by other pairs, off another wall or surface.
pub fn of_pairs(base: &Case, geometry: Geometry, reflectance: Reflectance, curved: bool) -> Case {
    let mut model = variant(&base.model, geometry, reflectance, curved, 56);
    // Pairs close to the axis, so that their paths stay in a narrow gate; three scanned points at least.
    if geometry == Geometry::Product && model.wall.scanned.is_empty() {
        model = variant(&model_like(&base.model, 2), geometry, reflectance, curved, 56);
    }
    let near = |p: &mut DVec3| *p = (0.02 * *p).as_vec3().as_dvec3();
    model.wall.scanned.iter_mut().chain(&mut model.wall.others).for_each(near);
    let name = format!("{}, {geometry:?} {reflectance:?}{}", base.name, if curved { ", curved" } else { "" });
    let mut case = made(&name, model, base.grid, if base.active.len() > 10_000 { 1.1 } else { 0.5 }, one);
    // Of many voxels any two sums are nearly alike: residuals must not be their rounding errors.
    case.at.iter_mut().for_each(|v| *v = (0.6 * *v).as_vec3().as_dvec3());
    case
}

/// The same bins for `n` x `n` pairs.
fn model_like(m: &Model, n: usize) -> Model {
    let new = model_of(n, m.bins, m.t_start, m.t_start + m.bins as f64 * m.bin_width);
    Model { bin_width: m.bin_width, reference: m.reference, ..new }
}

/// The cases on which passes and solves are held against the twins.
pub fn all() -> Vec<Case> {
    let gated =
        |name: &str, from: f64, to: f64| made(name, model_of(4, 80, from, to), plain().grid, 0.3, one);
    let with = |name: &str, change: &dyn Fn(&mut Case)| {
        let mut case = plain();
        case.name = name.into();
        change(&mut case);
        case
    };
    let mut all = vec![
        plain(),
        near_far(Geometry::Confocal, Reflectance::Cosine, false),
        near_far(Geometry::TwoPoints, Reflectance::Cosine, false),
        near_far(Geometry::Product, Reflectance::Lambertian, true),
        near_far(Geometry::Confocal, Reflectance::Retroreflective, false),
        near_far(Geometry::TwoPoints, Reflectance::Isotropic, false),
        near_far_free(),
        retroreflector(1e3),
        retroreflector(1e6),
        with("one photon", &|c| {
            let most = c.model.measured.iter().position(|v| *v == 10.0).expect("a peak");
            let set = |(i, v): (usize, &mut f32)| *v = if i == most { 10.0 } else { 0.0 };
            c.model.measured.iter_mut().enumerate().for_each(set);
        }),
        with("nothing measured", &|c| c.model.measured.fill(0.0)),
        with("saturated bins", &|c| c.model.measured.iter_mut().for_each(|v| *v = v.min(2.0))),
        with("negative input", &|c| c.model.measured.iter_mut().for_each(|v| *v -= 3.0)),
        with("every voxel pruned", &|c| c.active.clear()),
        made("none pruned", model_of(4, 160, 0.3, 2.7), grid_of(8, 16, 0.3, 0.05), 1.1, one),
        made("one pair", model_of(1, 160, 0.3, 2.7), plain().grid, 0.3, one),
        made("one bin", model_of(4, 1, 0.3, 2.7), plain().grid, 0.3, one),
        gated("volume partly outside the gate", 1.2, 1.6),
        gated("volume wholly outside the gate", 9.0, 9.5),
        wall_of(1e-3),
        wall_of(100.0),
        made("voxels 100:1 across", model_of(4, 600, 0.5, 1.7), grid_of(4, 250, 0.3, 0.0025), 0.2, one),
        made("voxels 1:100 deep", model_of(4, 20, 0.0, 8.0), grid_of(16, 3, 0.3, 0.0625 * 16.0), 0.5, one),
        narrow(650.0),
        narrow(1e3),
        narrow(1e4),
        narrow(1e5),
        late(),
    ];
    all.push(through(&near_far(Geometry::Confocal, Reflectance::Cosine, false), 8.0));
    all.push(through(&plain(), 40.0));
    let even = PulseTaps { before: 100, weights: vec![1.0 / 400.0; 400] };
    let smeared = Model { pulse: Some(even), ..plain().model };
    all.push(made("a pulse longer than the histograms", smeared, plain().grid, 0.3, one));
    // Voxel (i, j, 0) lies on a scanned point.
    let mut touching = model_of(4, 160, 0.0, 2.4);
    let grid = grid_of(8, 16, 0.0, 0.05);
    touching.wall.scanned =
        (0..16).map(|i| grid.position(dvec3((i % 4) as f64 * 2.0, (i / 4) as f64 * 2.0, 0.0))).collect();
    all.push(made("voxels on wall points", touching, grid, 0.6, one));
    // Four times the same four points, the second arm as the first.
    let mut same = variant(&model_of(4, 160, 0.3, 2.7), Geometry::TwoPoints, Reflectance::Cosine, false, 55);
    let first: Vec<DVec3> = same.wall.scanned[..4].to_vec();
    same.wall.scanned = (0..16).map(|i| first[i % 4]).collect();
    same.wall.others = same.wall.scanned.clone();
    all.push(made("coincident pairs", same, plain().grid, 0.3, one));
    all
}
