//! The simulator's pairs, walls, reflectances and occlusion.

use glam::{DVec2, DVec3, dvec2, dvec3};
use std::path::Path;
use thirdbounce::capture::{Capture, PairKind, read};
use thirdbounce_simulate::*;

use fixtures::scenes::*;

fn rendered(scene: &Scene) -> Capture {
    let rendering = simulate(scene, &RenderOptions { noise: 0.02, ..RenderOptions::default() }).unwrap();
    rendering.capture.check().unwrap();
    rendering.capture
}

fn total(capture: &Capture, pair: usize) -> f64 {
    capture.histograms[pair * capture.bins..][..capture.bins].iter().map(|&v| f64::from(v)).sum()
}

#[test]
fn every_layout_is_of_its_kind_and_loses_no_path() {
    let point = dvec2(0.6, -0.1);
    let mut scene = scene(vec![plate(dvec3(0.1, 0.0, 0.6), 0.2)]);
    (scene.scan, scene.wall) = (4, 0.8);
    for (layout, kind, pairs) in [
        (Layout::Confocal, PairKind::Confocal, 16),
        (Layout::OneLaser { point }, PairKind::OneLaser, 16),
        (Layout::OneSensor { point }, PairKind::OneSensor, 16),
        (Layout::Exhaustive { lasers: 3 }, PairKind::Exhaustive { lasers: 9, sensors: 16 }, 144),
        (Layout::Irregular { seed: 5 }, PairKind::Irregular, 16),
    ] {
        for shape in [WallShape::Flat, WallShape::Bump] {
            (scene.layout, scene.wall_shape) = (layout, shape);
            let c = rendered(&scene);
            assert_eq!((c.pair_kind(), c.pair_count()), (kind, pairs), "{layout:?}");
            assert_eq!(c.is_planar(), shape == WallShape::Flat);
            assert_eq!(c.laser_normal.is_some(), shape == WallShape::Bump);
            // Twice the bins contain no more light.
            let more = rendered(&Scene { bins: Some(2 * c.bins), ..scene.clone() });
            (0..pairs).for_each(|p| assert!((total(&c, p) / total(&more, p) - 1.0).abs() < 1e-6));
        }
    }
    assert_eq!(Pairs::new(Layout::OneLaser { point }, 2, 1.0, WallShape::Flat).laser[3], point.extend(0.0));
    let irregular = |seed| Pairs::new(Layout::Irregular { seed }, 4, 1.0, WallShape::Flat);
    assert_eq!(irregular(5), irregular(5));
    assert_ne!(irregular(5), irregular(6));
}

#[test]
fn the_cosine_is_that_of_the_scanned_side() {
    // A patch that faces +x: the farther of two fixed points has the smaller cosine.
    let normal = dvec3(0.6, 0.0, -0.8);
    let mut scene =
        scene(vec![rectangle(dvec3(0.0, 0.0, 0.6), DVec3::Y * 0.002, normal.cross(DVec3::Y) * 0.002)]);
    let facing = scene.objects[0].mesh.geometric_normal(0);
    assert!(facing.dot(normal) > 0.999, "{facing}");
    scene.scan = 3;
    let point = dvec2(0.2, 0.1);
    for (layout, scanned_is_laser) in
        [(Layout::OneSensor { point }, true), (Layout::OneLaser { point }, false)]
    {
        scene.layout = layout;
        let c = rendered(&scene);
        let x = dvec3(0.0, 0.0, 0.6);
        for pair in 0..9 {
            let (l, s) = (c.laser[pair] - x, c.sensor[pair] - x);
            let cosine = normal.dot(if scanned_is_laser { l.normalize() } else { s.normalize() });
            let wanted = 0.5 * 16e-6 * cosine.max(0.0) / (l.length_squared() * s.length_squared());
            if l.dot(normal) > 0.0 && s.dot(normal) > 0.0 {
                assert!((total(&c, pair) / wanted - 1.0).abs() < 0.01, "{} {wanted}", total(&c, pair));
            }
        }
    }
}

#[test]
fn the_wall_cosines_use_the_walls_normals() {
    let x = dvec3(0.1, 0.05, 0.6);
    let mut scene = scene(vec![rectangle(x, DVec3::Y * 0.002, DVec3::X * 0.002)]);
    (scene.reflectance, scene.wall_shape, scene.scan) = (Reflectance::Lambertian, WallShape::Bump, 5);
    scene.layout = Layout::OneSensor { point: dvec2(0.15, 0.0) };
    let c = rendered(&scene);
    let (lasers, sensors) = (c.laser_normal.clone().unwrap(), c.sensor_normal.clone().unwrap());
    for pair in 0..25 {
        let (l, s) = (c.laser[pair] - x, c.sensor[pair] - x);
        let (r_l, r_s) = (l.length(), s.length());
        let wall = (-lasers[pair].dot(l) / r_l).max(0.0) * (-sensors[pair].dot(s) / r_s).max(0.0);
        let wanted = 0.5 * 16e-6 * (-l.z / r_l) * (-s.z / r_s) * wall / (r_l * r_s).powi(2);
        assert!((total(&c, pair) / wanted - 1.0).abs() < 0.01, "{} {wanted}", total(&c, pair));
    }
}

#[test]
fn the_bump_is_a_gaussian_with_its_own_normals() {
    let shape = WallShape::Bump;
    assert!((shape.point(0.0, 0.0, 2.0).z - 0.2).abs() < 1e-12 && shape.front(2.0) == 0.2);
    assert!((shape.point(0.4, 0.0, 2.0).z - 0.2 * (-0.5f64).exp()).abs() < 1e-12);
    for at in [DVec2::ZERO, dvec2(0.1, -0.3), dvec2(-0.4, 0.2)] {
        let point = |dx: f64, dy: f64| shape.point(at.x + dx, at.y + dy, 1.0);
        let along = |d: DVec2| (point(d.x, d.y) - point(-d.x, -d.y)).normalize();
        let normal = shape.normal(at.x, at.y, 1.0).unwrap();
        assert!(normal.dot(along(dvec2(1e-5, 0.0))).abs() < 1e-8 && normal.z > 0.0);
        assert!(normal.dot(along(dvec2(0.0, 1e-5))).abs() < 1e-8);
    }
    assert_eq!(WallShape::Flat.normal(0.1, 0.2, 1.0), None);
    // An object inside the bump is refused.
    let mut scene = scene(vec![plate(dvec3(0.0, 0.0, 0.05), 0.01)]);
    scene.check().unwrap();
    scene.wall_shape = WallShape::Bump;
    assert!(scene.check().unwrap_err().to_string().contains("into the wall at z = 0.1"));
}

#[test]
fn without_occlusion_the_sum_is_that_of_the_parts() {
    let mut scene = Scene::named("occluder").unwrap();
    (scene.scan, scene.bin_width) = (4, 0.02);
    let sum = |c: &Capture| c.histograms.iter().map(|&v| f64::from(v)).sum::<f64>();
    let hidden = sum(&rendered(&scene));
    scene.occlusion = false;
    let through = sum(&rendered(&scene));
    let part = |k: usize| sum(&rendered(&Scene { objects: vec![scene.objects[k].clone()], ..scene.clone() }));
    let (back, front) = (part(0), part(1));
    assert!((through / (back + front) - 1.0).abs() < 0.02, "{through} {back} {front}");
    let lost = (through - hidden) / back;
    assert!((0.05..0.9).contains(&lost), "the plate hides {lost} of the square");
    // Seen from the wall the plate covers part of the square, not all.
    let maps = truth(&scene, 64).unwrap();
    let near = maps.depth.iter().filter(|z| (**z - 0.5).abs() < 1e-3).count();
    let far = maps.depth.iter().filter(|z| (**z - 0.9).abs() < 1e-3).count();
    assert!(near > 100 && far > 3 * near, "{near} {far}");
}

#[test]
#[ignore = "needs THIRDBOUNCE_DATA: make soak"]
fn the_bump_agrees_with_an_independent_renderer() {
    let Some(data) = std::env::var_os("THIRDBOUNCE_DATA") else {
        println!("skipped: THIRDBOUNCE_DATA names no folder of captures");
        return;
    };
    let at = |name: &str| Path::new(&data).join(name);
    let other = read(&at("z_bumpwall_confocal_32.npz")).unwrap();
    // The other renderer's letter, pixel by pixel.
    let truth = thirdbounce::export::npz::read_truth(&at("truth_z_bumpwall_confocal_32.npz")).unwrap();
    let mut letter = Mesh::default();
    for k in (0..truth.mask.len()).filter(|k| truth.mask[*k]) {
        let n = truth.nx as f64;
        let side = |i: usize| (i as f64 + 0.5) / n - 0.5;
        let pixel = plate(dvec3(side(k / truth.ny), side(k % truth.ny), 0.6), 0.5 / n);
        letter.triangles.extend(pixel.triangles);
        letter.normals.extend(pixel.normals);
    }
    let mut scene = Scene::new("Z", vec![Object { mesh: letter, albedo: 1.0 }]);
    (scene.wall_shape, scene.reflectance) = (WallShape::Bump, Reflectance::Lambertian);
    let ours = scene.pairs();
    let off = other.laser.iter().zip(&ours.laser).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off < 2e-4, "the walls differ by {off} m");
    let normals = other.laser_normal.as_ref().unwrap().iter().zip(ours.laser_normal.as_ref().unwrap());
    let off = normals.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    // The other renderer's normals come from a mesh.
    assert!(off < 0.02, "the normals differ by {off}");
    (scene.bin_width, scene.bins) = (other.bin_width, Some(other.bins));
    let ours = rendered(&scene);
    let ratios: Vec<f64> = (0..1024).map(|p| total(&ours, p) / total(&other, p)).collect();
    let mean = ratios.iter().sum::<f64>() / 1024.0;
    let spread = (ratios.iter().map(|r| (r / mean - 1.0).powi(2)).sum::<f64>() / 1024.0).sqrt();
    println!("mean ratio {mean:.3}, spread {spread:.4}");
    assert!((mean - 1.0).abs() < 0.03 && spread < 0.02, "mean {mean:.3}, spread {spread:.4}");
}
