//! The mathematics of the vector solver in float64: its gradient against finite differences, the bound for its steps,
//! steps that never lead uphill, and its proximal map. `vector.rs` and `vector_domain.rs` compare the kernels with the
//! same functions.

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::transport::twin::{self, Bound, Raw, Sample, Twin};
use thirdbounce::transport::{Grid, Model, Reflectance, Sampling, Volume};

fn scene(seed: u64, cone: f64) -> (Model, Grid, Vec<u32>) {
    let mut m = model(4, 48, seed);
    (m.sampling, m.cone) = (Sampling::Fixed, cone);
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.25), max: dvec3(0.5, 0.5, 0.9) };
    let grid = Grid::new(volume, 8, 0.1).unwrap();
    let (_, domain) = state(&m, &grid, 0.3, seed + 1);
    (m, grid, twin::compact(&domain))
}

/// Vectors in the cone, by storage index; about a fifth of them zero.
fn vectors(grid: &Grid, cone: f64, random: &mut Random) -> Vec<DVec3> {
    let mut one = || {
        let v = dvec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 0.0));
        if random.uniform(0.0, 1.0) < 0.2 { DVec3::ZERO } else { twin::into_cone(cone, v) }
    };
    (0..grid.storage()).map(|_| one()).collect()
}

/// (D, lambda) of the samples, as the solver computes them.
fn bounds(twin: &Twin, samples: &[Sample]) -> Vec<[f64; 2]> {
    let (rendered, _) = twin::residual_weighted(twin, &twin::forward_bound(twin, samples), false);
    let d = twin::bound(twin, samples, &rendered, Bound::Step);
    let lambda = twin::bound(twin, samples, &twin::variance(twin), Bound::Noise);
    d.into_iter().zip(lambda).map(|(d, l)| [d, l]).collect()
}

#[test]
fn the_gradient_is_the_slope_of_the_weighted_objective() {
    // Spots of two sides have many pairs: every other variant of the model has them, with a pulse or without.
    let instruments = |k: usize| {
        let spots = [(k.is_multiple_of(4).then(tail), true), (None, false)];
        [(Some(tail()), false), spots[k % 2].clone()]
    };
    let all = variants().into_iter().enumerate().flat_map(|(k, v)| instruments(k).map(|i| (v, i)));
    for ((geometry, reflectance, curved), (pulse, has_spots)) in all {
        let (base, grid, active) = scene(31, 1.5);
        let m = Model { pulse, ..variant(&base, geometry, reflectance, curved, 35) };
        let m = if has_spots { spotted(&m, spots_for(geometry)) } else { m };
        let twin = Twin { model: &m, grid: &grid };
        let mut random = Random::new(32);
        let raw: Vec<Raw> = (0..grid.storage())
            .map(|_| [random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0), random.uniform(-3.0, 0.0), 0.0])
            .collect();
        let samples = |raw: &[Raw]| {
            let v: Vec<DVec3> = raw.iter().map(|r| dvec3(r[0], r[1], r[2])).collect();
            twin::extrapolate(&twin, &active, &v, &v, 0.0)
        };
        let at = samples(&raw);
        let (residual, [loss, plain]) = twin::residual_weighted(&twin, &twin::forward(&twin, &at), true);
        assert!(loss > 0.0 && loss != plain);
        let mut gradient = vec![[0.0; 4]; grid.storage()];
        for (i, g) in active.iter().zip(twin::gradient_vectors(&twin, &at, &residual)) {
            gradient[*i as usize] = [g.x, g.y, g.z, 0.0];
        }
        let none = vec![0.0; active.len()];
        assert_gradient(&raw, &gradient, |r| twin::objective_vectors(&twin, &samples(r), &none));
    }
}

/// Each pair's energy is half in either voxel, and none is so stiff that a step of 1 / (share D) would overshoot.
#[test]
fn the_roughness_gradient_is_its_slope_and_its_stiffness_is_within_the_bound() {
    let (mut m, grid, active) = scene(35, 1.5);
    m.roughness = 0.9;
    let twin = Twin { model: &m, grid: &grid };
    let mut random = Random::new(36);
    let bounds: Vec<[f64; 2]> =
        (0..grid.storage()).map(|_| [random.uniform(1.0, 6.0), random.uniform(0.0, 1.0)]).collect();
    let at = |raw: &[Raw]| {
        let v: Vec<DVec3> = raw.iter().map(|r| dvec3(r[0], r[1], r[2])).collect();
        let samples = twin::extrapolate(&twin, &active, &v, &v, 0.0);
        (twin::roughness(&twin, &active, &samples, &bounds, 0.5, 0.7), samples)
    };
    let energy = |raw: &[Raw]| at(raw).0.iter().map(|r| r.energy).sum::<f64>();
    let mut one = || random.uniform(-1.0, 1.0);
    let raw: Vec<Raw> = (0..grid.storage()).map(|_| [one(), one(), one(), 0.0]).collect();
    let (rough, samples) = at(&raw);
    let mut gradient = vec![[0.0; 4]; grid.storage()];
    for (i, r) in active.iter().zip(&rough) {
        gradient[*i as usize] = [r.gradient.x, r.gradient.y, r.gradient.z, 0.0];
    }
    assert_gradient(&raw, &gradient, energy);
    let most = |(i, s): (&u32, &Sample)| 0.5 * bounds[*i as usize][0] * s.normal.length_squared();
    assert!(energy(&raw) <= 0.5 * active.iter().zip(&samples).map(most).sum::<f64>());
    // Equal vectors have no roughness.
    assert_eq!(energy(&vec![[0.3, 0.1, -1.0, 0.0]; grid.storage()]), 0.0);
}

/// De Pierro's bound: x M x <= sum of D |x|^2 with M the normal operator of any of the models, and equal to it
/// for the isotropic one where all x are one.
#[test]
fn the_bound_majorises_the_normal_operator() {
    for (k, (geometry, _, curved)) in
        variants().into_iter().filter(|v| v.1 == Reflectance::Cosine).enumerate()
    {
        let seed = 41 + 10 * k as u64;
        let (base, grid, active) = scene(seed, 2.0);
        let pulse = (k % 2 == 1).then(tail);
        let cosine = Model { pulse, ..variant(&base, geometry, Reflectance::Cosine, curved, seed + 3) };
        let cosine = if k % 3 > 0 { spotted(&cosine, spots_for(geometry)) } else { cosine };
        let with = |reflectance| Model { reflectance, ..cosine.clone() };
        let (lambertian, isotropic) = (with(Reflectance::Lambertian), with(Reflectance::Isotropic));
        let twin = Twin { model: &cosine, grid: &grid };
        let points = twin::points(&twin, &active);
        let d: Vec<f64> = bounds(&twin, &points).iter().map(|b| b[0]).collect();
        assert!(d.iter().all(|d| *d > 0.0));
        // x M x is twice the weighted loss of the rendering alone.
        let energy = |model: &Model, s: &[Sample]| {
            let twin = Twin { model, grid: &grid };
            let (_, loss) = twin::residual_weighted(&twin, &twin::forward(&twin, s), false);
            2.0 * loss[0]
        };
        let with = |field: &mut dyn FnMut(usize) -> (f64, DVec3)| -> Vec<Sample> {
            let one = |(i, s): (usize, &Sample)| {
                let (albedo, normal) = field(i);
                Sample { albedo, normal, ..*s }
            };
            points.iter().enumerate().map(one).collect()
        };
        let total: f64 = d.iter().sum();
        let ones = energy(&isotropic, &points);
        assert!((ones / total - 1.0).abs() < 1e-9, "{ones} {total}");
        // The wall's cosines make the Lambertian bound smaller. It is still a bound: a step may be up to 2 / sqrt(3)
        // times as long as the vector, because the product of two cosines can be that steep.
        let of_lambertian = bounds(&Twin { model: &lambertian, grid: &grid }, &points);
        let of_lambertian: Vec<f64> = of_lambertian.iter().map(|b| b[0]).collect();
        assert!(of_lambertian.iter().zip(&d).all(|(l, d)| *l > 0.0 && l < d));

        // All vectors toward the wall: cosines are below one, but not by much over a wall of 1 m.
        let facing = with(&mut |_| (1.0, DVec3::NEG_Z));
        let share = energy(&cosine, &facing) / total;
        assert!(share < 1.0 && share > 0.3, "{share}");
        assert!(energy(&lambertian, &facing) < energy(&cosine, &facing));

        let mut random = Random::new(seed + 2);
        for _ in 0..20 {
            // Scalars of both signs and of very different size.
            let x: Vec<f64> = (0..d.len()).map(|_| random.uniform(-1.0, 1.0).powi(5)).collect();
            let bound: f64 = d.iter().zip(&x).map(|(d, x)| d * x * x).sum();
            assert!(energy(&isotropic, &with(&mut |i| (x[i], DVec3::ZERO))) <= bound);

            let v = vectors(&grid, 2.0, &mut random);
            let v: Vec<DVec3> = active.iter().map(|i| v[*i as usize]).collect();
            let bound: f64 = d.iter().zip(&v).map(|(d, v)| d * v.length_squared()).sum();
            assert!(energy(&cosine, &with(&mut |i| (1.0, v[i]))) <= bound);
            let bound: f64 = of_lambertian.iter().zip(&v).map(|(d, v)| d * v.length_squared()).sum();
            assert!(energy(&lambertian, &with(&mut |i| (1.0, v[i]))) <= bound);
        }
    }
}

/// The same holds for bounds with any positive weights. They are tight where all x equal the weights: bright voxels
/// then take longer steps than with equal weights, dim ones shorter steps.
#[test]
fn a_bound_of_any_weights_majorises_the_normal_operator() {
    let (base, grid, active) = scene(71, 2.0);
    let cosine = Model { reflectance: Reflectance::Cosine, ..base };
    let isotropic = Model { reflectance: Reflectance::Isotropic, ..cosine.clone() };
    let twin = Twin { model: &cosine, grid: &grid };
    let mut random = Random::new(72);
    let mut points = twin::points(&twin, &active);
    let equal = bounds(&twin, &points);
    let shares: Vec<f64> = active.iter().map(|_| random.uniform(0.0, 1.0).powi(4)).collect();
    let weights = twin::expect(&shares, 1.5);
    points.iter_mut().zip(&weights).for_each(|(p, w)| p.albedo = *w);
    let d = bounds(&twin, &points);
    let energy = |model: &Model, s: &[Sample]| {
        let twin = Twin { model, grid: &grid };
        2.0 * twin::residual_weighted(&twin, &twin::forward(&twin, s), false).1[0]
    };
    let total: f64 = d.iter().zip(&weights).map(|(d, w)| d[0] * w * w).sum();
    let tight = energy(&isotropic, &points) / total;
    assert!((tight - 1.0).abs() < 1e-9, "{tight}");
    for ((d, e), w) in d.iter().zip(&equal).zip(&weights) {
        assert!(*w < 0.9 || d[0] < e[0], "{w}: {} {}", d[0], e[0]);
        assert!((d[1] / e[1] - 1.0).abs() < 1e-12);
    }
    for _ in 0..20 {
        let v = vectors(&grid, 2.0, &mut random);
        // Often voxels are bright where the weights are small.
        let samples: Vec<Sample> = points
            .iter()
            .zip(&active)
            .map(|(p, i)| Sample {
                albedo: 1.0,
                normal: random.uniform(0.0, 1.0).powi(5) * v[*i as usize],
                ..*p
            })
            .collect();
        let bound: f64 = d.iter().zip(&samples).map(|(d, s)| d[0] * s.normal.length_squared()).sum();
        assert!(energy(&cosine, &samples) <= bound);
    }
}

/// Largest objective after a plain step (no momentum, the whole bound) over the objective before, and the
/// objective after the last step over the first, in 100 steps from random vectors.
fn plain_steps(seed: u64, cone: f64, reflectance: Reflectance) -> [f64; 2] {
    let (m, grid, active) = scene(seed, cone);
    let mut random = Random::new(seed + 2);
    let m = Model { noise_factor: random.uniform(0.0, 3.0), reflectance, ..m };
    let twin = Twin { model: &m, grid: &grid };
    let scale = random.uniform(0.0, 8.0);
    let mut v: Vec<DVec3> = vectors(&grid, cone, &mut random).into_iter().map(|v| scale * v).collect();
    let mut before = v.clone();
    let by_slot = bounds(&twin, &twin::points(&twin, &active));
    let lambda: Vec<f64> = by_slot.iter().map(|b| b[1]).collect();
    let mut by_voxel = vec![[0.0; 2]; grid.storage()];
    active.iter().zip(&by_slot).for_each(|(i, b)| by_voxel[*i as usize] = *b);
    let mut objectives = vec![];
    for _ in 0..100 {
        let at = twin::extrapolate(&twin, &active, &v, &v, 0.0);
        objectives.push(twin::objective_vectors(&twin, &at, &lambda));
        let (residual, _) = twin::residual_weighted(&twin, &twin::forward(&twin, &at), true);
        let gradient = twin::gradient_vectors(&twin, &at, &residual);
        twin::step(&twin, &active, &at, &gradient, &by_voxel, 1.0, &mut v, &mut before);
    }
    let worst = objectives.windows(2).map(|w| w[1] / w[0]).fold(0.0, f64::max);
    [worst, objectives[99] / objectives[0]]
}

/// If every vector of the cone is seen by every pair, the model is linear and the proof of the bound is complete. In a
/// wide cone a step may cross the edge where a cosine starts, and add to a bin that is too bright already. The bound
/// does not cover this: near the minimum the objective may rise by less than a thousandth. finish.comp restarts then.
#[test]
fn a_plain_step_never_raises_the_objective() {
    let cases = [
        (0.2, Reflectance::Cosine, 1e-13),
        (2.0, Reflectance::Cosine, 1e-3),
        (2.0, Reflectance::Lambertian, 1e-3),
        (2.0, Reflectance::Isotropic, 1e-13),
    ];
    for (cone, reflectance, rise) in cases {
        let all: Vec<[f64; 2]> = (0..20).map(|s| plain_steps(1000 + 10 * s, cone, reflectance)).collect();
        assert!(all.iter().all(|r| r[0] <= 1.0 + rise), "cone {cone}, {reflectance:?}: {all:?}");
        assert!(all.iter().all(|r| r[1] < 0.95), "cone {cone}, {reflectance:?}: {all:?}");
    }
}

#[test]
fn the_cone_takes_the_nearest_of_its_points() {
    let mut random = Random::new(71);
    for cone in [0.0, 0.3, 1.0, 2.0, 30.0] {
        let inside = |v: DVec3| v.z <= 0.0 && v.truncate().length() <= cone * -v.z + 1e-12;
        for _ in 0..60 {
            let v = dvec3(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0));
            let p = twin::into_cone(cone, v);
            assert!(inside(p), "{v} to {p}");
            assert!((twin::into_cone(cone, p) - p).length() < 1e-12, "a point of the cone stays");
            assert!(!inside(v) || p == v);
            // No other point of the cone is nearer: random points, points near the answer, the apex.
            let near = (v - p).length();
            assert!(near <= v.length());
            for i in 0..400 {
                let size = if i % 2 == 0 { 3.0 } else { 0.05 };
                let q =
                    dvec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
                let q = size * q + if i % 2 == 0 { DVec3::ZERO } else { p };
                assert!(!inside(q) || (v - q).length() >= near - 1e-9, "{v}: {q} is nearer than {p}");
            }
        }
    }
    assert_eq!(twin::into_cone(2.0, DVec3::Z), DVec3::ZERO);
    assert_eq!(twin::into_cone(2.0, DVec3::ZERO), DVec3::ZERO);
}

/// shrink is the proximal map of the length. Applied after the cone, it is the proximal map of the length on the cone.
/// Applied before, it is not: the cone shortens the vector, and too little would be removed.
#[test]
fn shrink_is_the_proximal_map_of_the_length() {
    let mut random = Random::new(72);
    let cone = 1.5;
    for _ in 0..200 {
        let v = dvec3(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0), random.uniform(-2.0, 1.0));
        let by = random.uniform(0.0, 2.0);
        let cost = |x: DVec3| 0.5 * (x - v).length_squared() + by * x.length();
        let free = twin::shrink(v, by);
        let held = twin::shrink(twin::into_cone(cone, v), by);
        for i in 0..400 {
            let near = dvec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
            let size = [2.0, 0.1][i % 2];
            assert!(cost(free) <= cost(free + size * near) + 1e-12);
            let other = twin::into_cone(cone, held + size * near);
            assert!(cost(held) <= cost(other) + 1e-12, "{v} by {by}: {other} is better than {held}");
        }
        assert!(cost(free) <= cost(DVec3::ZERO) && cost(held) <= cost(DVec3::ZERO));
    }
    assert_eq!(twin::shrink(DVec3::ZERO, 0.5), DVec3::ZERO);
    assert_eq!(twin::shrink(DVec3::Y, 1.0), DVec3::ZERO);
}
