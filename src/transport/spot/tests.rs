use glam::{DVec3, dvec3};

use super::*;

fn lattice(n: usize, step: f64) -> Vec<DVec3> {
    (0..n * n).map(|i| dvec3((i / n) as f64 * step, (i % n) as f64 * step, 0.0)).collect()
}

fn scattered(n: usize) -> Vec<DVec3> {
    let one = |i: usize, by: f64| (i as f64 * by).fract();
    (0..n).map(|i| dvec3(one(i, 0.754_877_666), one(i, 0.569_840_291), 0.0)).collect()
}

fn spot(sigma: [f64; 2]) -> Spot {
    Spot { sigma, coarsest: 0.001, path: f64::INFINITY }
}

/// Histograms that hold `value` of every rendered pair, through the stages.
fn summed(rendered: &Rendered, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let of: Vec<f64> = (0..rendered.wall.pairs()).map(value).collect();
    rendered.stages.iter().fold(of, |v, stage| stage.through(&v, 1))
}

/// Checks that sums, means and variances over every pair's spots are those of the Gaussians.
fn check(wall: &Wall, sigma: [f64; 2]) -> Rendered {
    let rendered = Rendered::of(wall, spot(sigma));
    let point = |wall: &Wall, pair: usize, side: usize| wall.point(wall.points_of(pair)[side])[0];
    let moment = |f: &dyn Fn([DVec3; 2]) -> f64| {
        summed(&rendered, |pair| f([0, 1].map(|side| point(&rendered.wall, pair, side))))
    };
    assert!(moment(&|_| 1.0).iter().all(|sum| (sum - 1.0).abs() < 1e-5));
    for side in 0..if wall.others.is_empty() { 1 } else { 2 } {
        for axis in 0..2 {
            let (mean, square) = (moment(&|p| p[side][axis]), moment(&|p| p[side][axis].powi(2)));
            for pair in 0..wall.pairs() {
                let at = point(wall, pair, side)[axis];
                let variance = square[pair] - mean[pair].powi(2);
                let want = sigma[side].powi(2);
                assert!((mean[pair] - at).abs() < 0.01 * sigma[side] + 1e-6, "{} {at}", mean[pair]);
                assert!((variance - want).abs() < 0.01 * want + 1e-6, "side {side}: {variance} {want}");
            }
        }
    }
    rendered
}

#[test]
fn every_pairs_spot_has_the_moments_of_a_gaussian() {
    let step = 0.05;
    // On a lattice: narrower than its step, wider, and far wider.
    for sigma in [0.3, 0.59, 0.61, 1.2, 3.7].map(|s| s * step) {
        let rendered = check(&Wall::confocal(lattice(12, step)), [sigma, 0.0]);
        assert_eq!(rendered.stages.len(), 2);
    }
    let rows = Wall::confocal(lattice(12, step)[..12].to_vec());
    check(&rows, [1.2 * step, 0.0]);
    // Points in any order, as a spread model has them.
    let mut reversed = lattice(12, step);
    reversed.reverse();
    check(&Wall::confocal(reversed), [step, 0.0]);
    for sigma in [0.004, 0.05, 0.2] {
        check(&Wall::confocal(scattered(200)), [sigma, 0.0]);
    }
    let pairs = |geometry, scanned, others| Wall { geometry, scanned, others, normals: None };
    let (a, b) = (lattice(6, step), scattered(36));
    for sigma in [[0.05, 0.0], [0.0, 0.03], [0.05, 0.03]] {
        check(&pairs(Geometry::TwoPoints, a.clone(), b.clone()), sigma);
        check(&pairs(Geometry::Product, a.clone(), b[..5].to_vec()), sigma);
        check(&pairs(Geometry::Product, a.clone(), b[..1].to_vec()), sigma);
    }
}

#[test]
fn a_wide_spot_takes_fewer_points_where_the_pulse_hides_it() {
    let wall = Wall::confocal(lattice(32, 0.01));
    let sharp = Rendered::of(&wall, spot([0.04, 0.0]));
    let blurred = Rendered::of(&wall, Spot { coarsest: 0.1, ..spot([0.04, 0.0]) });
    assert_eq!(sharp.wall.pairs(), 56 * 56);
    assert!(blurred.wall.pairs() < 15 * 15, "{}", blurred.wall.pairs());
    // Light that changes slowly over the wall comes out the same.
    let value = |p: DVec3| (9.0 * p.x).sin() + (7.0 * p.y).cos();
    let of = |r: &Rendered| summed(r, |pair| value(r.wall.scanned[pair]));
    for (a, b) in of(&sharp).iter().zip(of(&blurred)) {
        assert!((a - b).abs() < 2e-3, "{a} {b}");
    }
}

#[test]
fn rendered_points_lie_on_a_curved_wall() {
    let height = |p: DVec3| 0.1 - 0.2 * p.x * p.x + 0.1 * p.y;
    let points: Vec<DVec3> = lattice(16, 0.05).into_iter().map(|p| p.with_z(height(p))).collect();
    let normals = points.iter().map(|p| dvec3(0.4 * p.x, -0.1, 1.0).normalize()).collect();
    let wall = Wall { normals: Some(normals), ..Wall::confocal(points) };
    let rendered = Rendered::of(&wall, spot([0.05, 0.0]));
    let beyond = rendered.wall.scanned.iter().filter(|p| p.x < -0.01).count();
    assert!(beyond > 20);
    for (p, n) in rendered.wall.scanned.iter().zip(rendered.wall.normals.as_ref().unwrap()) {
        assert!((p.z - height(*p)).abs() < 0.01, "{p}");
        assert!(n.distance(dvec3(0.4 * p.x, -0.1, 1.0).normalize()) < 0.1 && (n.length() - 1.0).abs() < 1e-9);
    }
}

/// The second moment of a confocal pair's path: the mean over both points' offsets against the one shifted point.
#[test]
fn confocal_points_are_moved_by_what_two_points_add_to_a_path() {
    let sigma = 0.05f64;
    let hidden = dvec3(0.25, 0.2, 1.0);
    let wall = Wall::confocal(lattice(11, 0.05));
    // A pair's spots of sigma each are one of sigma / sqrt 2.
    let own = Spot { sigma: [sigma / 2f64.sqrt(), 0.0], coarsest: 0.001, path: 2.0 };
    let paths = |spot: Spot| {
        let r = Rendered::of(&wall, spot);
        summed(&r, |pair| r.wall.path(pair, hidden))
    };
    let two = Wall { geometry: Geometry::TwoPoints, others: wall.scanned.clone(), ..wall.clone() };
    let r = Rendered::of(&two, Spot { sigma: [sigma; 2], ..own });
    let exact = summed(&r, |pair| r.wall.path(pair, hidden));
    let (moved, still) = (paths(own), paths(Spot { path: f64::INFINITY, ..own }));
    for pair in 0..wall.pairs() {
        let [off, before] = [moved[pair], still[pair]].map(|p| (p - exact[pair]).abs());
        assert!(off < 3e-4 && before > 2e-3, "{off} {before}");
    }
}

#[test]
fn points_have_no_spot() {
    let points = lattice(4, 0.1);
    let of = |laser, sensor| {
        let capture = Capture::new([4, 4], points.clone(), points.clone(), 8, 0.01, vec![1.0; 128]);
        let capture = capture.with(|c| (c.laser_spot, c.sensor_spot) = (laser, sensor));
        Spot::of(&capture, Geometry::Confocal, false)
    };
    assert_eq!(of(None, None), None);
    assert_eq!(of(Some(0.0), Some(1e-4)), None);
    let both = of(Some(0.05), Some(0.05)).unwrap();
    assert!((both.sigma[0] * 2.3548 - 0.05 / 2f64.sqrt()).abs() < 1e-6 && both.sigma[1] == 0.0);
    assert!((both.path - 0.04).abs() < 1e-9, "the mean of even histograms");
}
