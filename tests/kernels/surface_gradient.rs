//! The mathematics of the surface in float64: its gradient against finite differences. `surface.rs` compares the
//! kernels with the same functions.

use fixtures::device::surfaces::*;
use fixtures::device::*;
use glam::dvec3;
use thirdbounce::transport::twin::{self, Bond, Height, Pull, SurfaceWeights, Twin};
use thirdbounce::transport::{Geometry, Grid, HighPass, Model, Reflectance, Volume};

const NO_PRIOR: SurfaceWeights = SurfaceWeights {
    bend: 0.0,
    jump: 0.0,
    rates: NOTHING,
    iterations: 1.0,
    largest: NOTHING,
    spread: 0.0,
    sparse: 0.0,
    faint: 1.0,
    bend_share: 0.0,
    jump_share: 0.0,
};
const NOTHING: Height = Height { depth: 0.0, albedo: 0.0 };

fn scene() -> (Model, Grid) {
    let volume = Volume { min: dvec3(-0.5, -0.4, 0.2), max: dvec3(0.5, 0.4, 1.0) };
    (surfaces::scene(4, 48, 51), Grid::new(volume, 6, 0.05).unwrap())
}

/// A field with the bonds of other depths, as between two renewals.
fn bent(twin: &Twin, seed: u64) -> (Field, Vec<Vec<Bond>>) {
    let mut field = both(twin.grid, seed);
    let bonds = field.bonds(twin);
    let mut random = Random::new(seed + 1);
    field.heights.iter_mut().for_each(|h| h.depth += random.uniform(-0.01, 0.01));
    (field, bonds)
}

fn gradient(twin: &Twin, field: &Field, bonds: &[Vec<Bond>], weights: &SurfaceWeights) -> Vec<Height> {
    let (slopes, samples) = field.points(twin, bonds);
    let (residual, _) = twin::residual_weighted(twin, &twin::forward(twin, &samples));
    let pulls = twin::surface_gather(twin, &samples, &residual);
    let combined = twin::surface_combine(twin, bonds, &field.heights, &slopes, &pulls, weights);
    twin::surface_gradient(bonds, &combined)
}

/// Compares every derivative of `objective` with central differences: they must agree to 1e-6 of the largest of their
/// kind. Steps on which a path changes its bins or a cosine its sign are left out, as no derivative exists there.
fn check(
    twin: &Twin,
    field: &mut Field,
    bonds: &[Vec<Bond>],
    gradient: &[Height],
    kinks: bool,
    objective: impl Fn(&Field) -> f64,
) {
    let largest = halves(gradient).map(|g| g.iter().fold(0.0f64, |a, b| a.max(b.abs())));
    let (mut tried, mut skipped) = ([0, 0], 0);
    let smooth = |field: &Field| -> Vec<Vec<i64>> {
        field.points(twin, bonds).1.iter().map(|s| choices(twin, s, 0.0).0).collect()
    };
    for (pixel, g) in gradient.iter().enumerate() {
        for (kind, slope, step) in [(0, g.depth, 1e-6), (1, g.albedo, 1e-3)] {
            let mut at = |by: f64| {
                let before = field.heights[pixel];
                let h = &mut field.heights[pixel];
                *[&mut h.depth, &mut h.albedo][kind] += by;
                let found = (objective(field), if kinks && kind == 0 { smooth(field) } else { vec![] });
                field.heights[pixel] = before;
                found
            };
            let (low, high) = (at(-step), at(step));
            if low.1 != high.1 {
                skipped += 1;
                continue;
            }
            let found = (high.0 - low.0) / (2.0 * step);
            let e = (found - slope).abs() / largest[kind];
            let what = ["depth", "albedo"][kind];
            assert!(e < 1e-6, "{what} of pixel {pixel}: gradient {slope}, but the slope is {found} ({e:e})");
            tried[kind] += 1;
        }
    }
    assert_eq!(tried[1], gradient.len());
    assert!(tried[0] > gradient.len() / 2, "{skipped} of {} depths are at kinks", gradient.len());
}

#[test]
fn the_gradient_is_the_slope_of_the_objective() {
    let (base, grid) = scene();
    for (i, (geometry, reflectance, curved)) in variants().into_iter().enumerate() {
        let model =
            Model { pulse: (i % 2 == 0).then(tail), ..variant(&base, geometry, reflectance, curved, 60) };
        let high_pass = (i % 4 < 2).then_some(HighPass { length: [0.2, 0.6][i % 2], floor: 0.1 });
        let model = Model { high_pass, ..model };
        let model = if i % 3 == 0 { spotted(&model, spots_for(geometry)) } else { model };
        let model = measured(&model, &grid, &both(&grid, 61), 62);
        let twin = Twin { model: &model, grid: &grid };
        let (mut field, bonds) = bent(&twin, 61);
        field.each = [4, 1][i % 2];
        // For one case in three, as large as the data term's share.
        let weights =
            SurfaceWeights { bend: [0.0, 1e-3, 0.0][i % 3], jump: [0.0, 0.0, 1e-7][i % 3], ..NO_PRIOR };
        let weights = SurfaceWeights { sparse: [0.0, 1e-6, 1e-5][i % 3], faint: 20.0, ..weights };
        let gradient = gradient(&twin, &field, &bonds, &weights);
        check(&twin, &mut field, &bonds, &gradient, true, |f| {
            twin::surface_objective(&twin, &f.columns, &bonds, &f.heights, f.each, &weights)
        });
    }
}

#[test]
fn the_prior_alone_has_its_gradient_and_both_halves_of_its_energy() {
    let (base, grid) = scene();
    let model = variant(&base, Geometry::Confocal, Reflectance::Cosine, false, 60);
    let twin = Twin { model: &model, grid: &grid };
    let (mut field, bonds) = bent(&twin, 63);
    let weights = SurfaceWeights { bend: 3e4, jump: 7.0, sparse: 100.0, faint: 5.0, ..NO_PRIOR };
    let (slopes, samples) = field.points(&twin, &bonds);
    let none = vec![Pull::default(); samples.len()];
    let combined = twin::surface_combine(&twin, &bonds, &field.heights, &slopes, &none, &weights);
    let gradient = twin::surface_gradient(&bonds, &combined);
    let prior = |f: &Field| {
        let of = |w| twin::surface_objective(&twin, &f.columns, &bonds, &f.heights, f.each, w);
        of(&weights) - of(&NO_PRIOR)
    };
    let energy: f64 = combined.iter().map(|c| c.energy).sum();
    assert!((energy / prior(&field) - 1.0).abs() < 1e-12);
    check(&twin, &mut field, &bonds, &gradient, false, prior);
}

/// The prior is zero for planes of one albedo at any tilt, and the slopes of a plane are the plane's.
#[test]
fn a_plane_is_its_own_fit() {
    let (model, grid) = scene();
    let twin = Twin { model: &model, grid: &grid };
    let mut field = field(&grid, 64);
    let tilt = [0.3, -0.2];
    for (h, c) in field.heights.iter_mut().zip(&field.columns) {
        let [x, y] = [c / grid.n[1] as u32, c % grid.n[1] as u32].map(f64::from);
        let depth = 0.5 + tilt[0] * x * grid.pitch.x + tilt[1] * y * grid.pitch.y;
        *h = Height { depth, albedo: 3.0 };
    }
    let bonds = field.bonds(&twin);
    let (slopes, samples) = field.points(&twin, &bonds);
    // The weight of zero slope changes them by a thousandth.
    let fitted = slopes.iter().zip(&bonds).filter(|(_, b)| b.len() > 3);
    assert!(fitted.clone().count() > 20);
    for (s, _) in fitted {
        assert!((s.x - tilt[0]).abs() < 2e-3 && (s.y - tilt[1]).abs() < 2e-3, "{s}");
    }
    let weights = SurfaceWeights { bend: 1.0, jump: 1.0, ..NO_PRIOR };
    let none = vec![Pull::default(); samples.len()];
    let energy = |field: &Field| -> f64 {
        let slopes = field.points(&twin, &bonds).0;
        let all = twin::surface_combine(&twin, &bonds, &field.heights, &slopes, &none, &weights);
        all.iter().map(|c| c.energy).sum()
    };
    let flat = energy(&field);
    field.heights[9].depth += 0.01;
    assert!(flat < 1e-3 * energy(&field), "{flat} {}", energy(&field));
}
