//! Scenes, shapes, mesh files, true maps and the simulator's errors.

use glam::{DVec3, dvec3};
use std::f64::consts::PI;
use thirdbounce_simulate::*;

use fixtures::scenes::*;

/// Share of the mask that is set in a window given in fractions of the letter's box, from the left as seen from the wall and
/// from below.
fn filled(name: &str, x: [f64; 2], y: [f64; 2]) -> f64 {
    let t = truth(&Scene::named(name).unwrap(), 100).unwrap();
    let at = |f: f64, side: f64| ((0.5 + (f - 0.5) * side) * 100.0) as usize;
    let (mut hits, mut all) = (0, 0);
    for ix in at(x[0], 0.48)..at(x[1], 0.48) {
        for iy in at(y[0], 0.6)..at(y[1], 0.6) {
            all += 1;
            hits += usize::from(t.mask[(99 - ix) * 100 + iy]);
        }
    }
    hits as f64 / all as f64
}

#[test]
fn an_eye_at_the_wall_reads_letters() {
    // L: stem at the left, foot at the bottom, nothing above the foot.
    assert!(filled("letter-L", [0.02, 0.2], [0.0, 1.0]) > 0.98);
    assert!(filled("letter-L", [0.0, 1.0], [0.02, 0.16]) > 0.98);
    assert_eq!(filled("letter-L", [0.3, 1.0], [0.25, 1.0]), 0.0);
    // Z: the diagonal rises to the right; both other corners of the middle are empty.
    assert!(filled("letter:z", [0.45, 0.55], [0.45, 0.55]) > 0.98);
    assert!(filled("letter:z", [0.62, 0.72], [0.68, 0.78]) > 0.9);
    assert_eq!(filled("letter:z", [0.05, 0.3], [0.6, 0.75]), 0.0);
    // U opens upwards, T has its bar on top, S is not mirrored.
    assert_eq!(filled("letter-U", [0.35, 0.65], [0.5, 1.0]), 0.0);
    assert!(filled("letter-T", [0.0, 1.0], [0.86, 0.98]) > 0.98);
    assert_eq!(filled("letter-S", [0.7, 1.0], [0.58, 0.65]), 0.0);
    assert!(filled("letter-S", [0.02, 0.15], [0.7, 0.78]) > 0.9);
    // All letters differ and none overlaps itself: the mesh's area equals the mask's.
    for name in 'A'..='Z' {
        let mesh = letter(name, dvec3(0.0, 0.0, 0.6), 0.6).unwrap();
        let mut scene = Scene::new("letter", vec![Object { mesh, albedo: 1.0 }]);
        scene.wall = 0.7;
        let seen = truth(&scene, 160).unwrap().mask.iter().filter(|&&m| m).count();
        let area = seen as f64 * (0.7 / 160f64).powi(2);
        assert!((scene.objects[0].mesh.total_area() / area - 1.0).abs() < 0.03, "{name}");
    }
}

#[test]
fn what_lies_beyond_the_wall_is_light_without_truth() {
    let [all, clean] = ["beyond", "within"].map(|name| Scene::named(name).unwrap());
    let [seen, alone] = [&all, &clean].map(|scene| truth(scene, 96).unwrap());
    assert_eq!(seen.mask, alone.mask);
    assert!(seen.mask.iter().filter(|m| **m).count() > 500);
    let bounds =
        |scene: &Scene| -> Vec<_> { scene.objects.iter().map(|o| o.mesh.bounds().unwrap()).collect() };
    // The figure and the wall: x and y up to 0.5 m.
    assert!(bounds(&clean).iter().all(|(low, high)| low.x < 0.5 && low.y > -0.53 && high.y < 0.5));
    let others: Vec<_> = bounds(&all).into_iter().filter(|b| !bounds(&clean).contains(b)).collect();
    let arm: Vec<_> = others.iter().filter(|(low, high)| low.x >= 0.5 && high.y > 0.2).collect();
    assert_eq!(arm.len(), 2, "forearm and hand");
    let floor: Vec<_> = others.iter().filter(|(low, high)| low.y == high.y).collect();
    assert!(
        matches!(floor[..], [(low, high)] if low.y < -0.5 && low.x < -0.6 && high.x > 0.6 && high.z > 1.5)
    );
    assert!(others.iter().all(|(low, high)| low.x >= 0.5 || high.x <= -0.5 || high.y < -0.5));
    // All of it sends light to the wall.
    let light = |scene: &Scene| {
        let scene = Scene { scan: 4, bin_width: 0.05, bins: Some(96), ..scene.clone() };
        let counts =
            render(&scene, &RenderOptions { noise: 0.2, ..Default::default() }).unwrap().capture.histograms;
        counts.iter().map(|v| f64::from(*v)).sum::<f64>()
    };
    let of = |kept: &dyn Fn(&(DVec3, DVec3)) -> bool| {
        let mut part = all.clone();
        part.objects.retain(|o| kept(&o.mesh.bounds().unwrap()));
        light(&part)
    };
    let whole = light(&clean);
    let parts = [of(&|b| b.0.y == b.1.y), of(&|b| b.1.x <= -0.5), of(&|b| b.0.x >= 0.5)];
    println!("{whole} {parts:?}");
    assert!(parts.iter().all(|part| *part > 0.01 * whole), "{parts:?} of {whole}");
}

#[test]
fn truth_of_a_sphere_is_analytic() {
    let (centre, radius) = (dvec3(0.1, -0.05, 0.7), 0.2);
    let t = truth(&scene(vec![sphere(centre, radius)]), 64).unwrap();
    assert_eq!((t.nx, t.ny, t.extent), (64, 64, [-0.5, 0.5, -0.5, 0.5]));
    for k in 0..64 * 64 {
        let at = |i: usize| (i as f64 + 0.5) / 64.0 - 0.5;
        let d = dvec3(at(k / 64), at(k % 64), 0.0) - dvec3(centre.x, centre.y, 0.0);
        let inside = d.length() / radius;
        assert_eq!(t.mask[k], t.depth[k].is_finite() && t.normal[k][0].is_finite());
        assert!(t.mask[k] == (inside < 1.0) || (inside - 1.0).abs() < 0.01);
        if inside < 0.95 {
            let z = centre.z - (radius * radius - d.length_squared()).sqrt();
            assert!((t.depth[k] as f64 - z).abs() < 0.002, "{} {z}", t.depth[k]);
            let n = DVec3::from(t.normal[k].map(f64::from));
            assert!((n.length() - 1.0).abs() < 1e-5);
            let expected = (dvec3(at(k / 64), at(k % 64), z) - centre) / radius;
            assert!(n.dot(expected) > (1f64.to_radians()).cos());
        }
    }
}

#[test]
fn truth_has_the_albedo_of_what_is_seen_first() {
    // A dark plate before a bright one.
    let mut scene = Scene::named("plates").unwrap();
    (scene.objects[0].albedo, scene.objects[1].albedo) = (0.25, 0.75);
    let t = truth(&scene, 64).unwrap();
    let albedo = t.albedo.unwrap();
    for (pixel, is_seen) in t.mask.iter().enumerate() {
        let expected = if t.depth[pixel] < 0.6 { 0.25 } else { 0.75 };
        assert!(if *is_seen { albedo[pixel] == expected } else { albedo[pixel].is_nan() }, "{pixel}");
    }
    assert!(albedo.contains(&0.25) && albedo.contains(&0.75));
}

#[test]
fn shapes_are_closed_and_face_outwards() {
    let volume = |m: &Mesh| -> f64 { m.triangles.iter().map(|t| t[0].dot(t[1].cross(t[2])) / 6.0).sum() };
    let at = dvec3(0.3, -0.2, 0.9);
    let close = |mesh: Mesh, expected: f64, area: f64| {
        assert!((volume(&mesh) / expected - 1.0).abs() < 0.02, "{} {expected}", volume(&mesh));
        assert!((mesh.total_area() / area - 1.0).abs() < 0.02, "{} {area}", mesh.total_area());
    };
    close(sphere(at, 0.2), 4.0 / 3.0 * PI * 0.008, 4.0 * PI * 0.04);
    close(torus(at, dvec3(1.0, 2.0, 3.0), 0.2, 0.07), 2.0 * PI * PI * 0.2 * 0.0049, 4.0 * PI * PI * 0.014);
    let to = at + dvec3(0.0, 0.3, 0.4);
    close(
        capsule(at, 0.1, to, 0.1),
        PI * 0.01 * 0.5 + 4.0 / 3.0 * PI * 0.001,
        2.0 * PI * 0.1 * 0.5 + 4.0 * PI * 0.01,
    );
    let (lo, hi) = capsule(at, 0.1, to, 0.05).bounds().unwrap();
    assert!((lo.x - at.x + 0.1).abs() < 0.002 && (hi.z - to.z - 0.05).abs() < 0.002);
}

#[test]
fn every_built_in_scene_stays_before_the_wall() {
    let examples = Scene::known().iter().map(|(name, _)| name.replace("XY", "AB").replace('X', "A"));
    for name in examples {
        let scene = Scene::named(&name).unwrap();
        let t = truth(&scene, 64).unwrap();
        let edge = (0..64).flat_map(|i| [i, 63 * 64 + i, i * 64, i * 64 + 63]);
        let cut = ["beyond", "within"].contains(&&name[..]);
        assert_eq!(edge.into_iter().any(|k| t.mask[k]), cut, "{name} is cut off");
        assert!(t.mask.iter().filter(|&&m| m).count() > 150, "{name}");
        assert!(scene.bin_count().is_multiple_of(32) && scene.bin_count() < 1024);
    }
}

#[test]
fn truth_holds_what_lies_behind() {
    let all =
        ["plates", "plates-front", "plates-back"].map(|n| truth(&Scene::named(n).unwrap(), 64).unwrap());
    let [both, front, back] = &all;
    assert!(front.behind.is_none() && back.behind.is_none());
    let behind = both.behind.as_ref().unwrap();
    for c in 0..64 * 64 {
        assert_eq!((both.mask[c], behind.mask[c]), (back.mask[c], front.mask[c]));
        let [first, wanted] = if front.mask[c] { [front, back] } else { [back, front] };
        assert!(!both.mask[c] || both.depth[c] == first.depth[c]);
        let [found, wanted] = [behind.depth[c], wanted.depth[c]];
        assert!(if front.mask[c] { (found - wanted).abs() < 1e-6 } else { found.is_nan() });
        assert!(!behind.mask[c] || behind.normal[c] == back.normal[c] && behind.albedo[c] == 1.0);
    }
    // A ball has a back, which no wall point sees; a limb before its body is one thing with it.
    for name in ["sphere", "figure", "torus"] {
        assert!(truth(&Scene::named(name).unwrap(), 64).unwrap().behind.is_none(), "{name}");
    }
}

#[test]
fn obj_and_ply_meshes_load_and_place() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    // A quad facing +z, three corners without normals, and its twin in PLY.
    let obj = write("quad.obj", "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nf 1 2 3 4\n");
    let ply = write(
        "quad.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0\n2 0 0\n2 1 0\n0 1 0\n4 0 1 2 3\n",
    );
    for path in [&obj, &ply] {
        let mesh = load_mesh(path).unwrap();
        assert_eq!(mesh.triangles.len(), 2);
        assert!((mesh.total_area() - 2.0).abs() < 1e-12);
        assert_eq!(mesh.normals[1][2], DVec3::Z);
        // As a scene: 0.6 m wide, turned to the wall.
        let scene = Scene::named(path.to_str().unwrap()).unwrap();
        let placed = &scene.objects[0].mesh;
        let (lo, hi) = placed.bounds().unwrap();
        // Metres are kept, and scaled where that is asked for.
        assert!(
            (hi - lo - dvec3(2.0, 1.0, 0.0)).length() < 1e-9
                && (lo.midpoint(hi) - dvec3(0.0, 0.0, 0.8)).length() < 1e-9
        );
        assert!((scene.clone().fitted(0.6).unwrap().size().unwrap() - dvec3(0.6, 0.3, 0.0)).length() < 1e-9);
        assert!(scene.clone().fitted(0.0).is_err());
        assert!((placed.geometric_normal(0) + DVec3::Z).length() < 1e-9);
        assert_eq!(scene.name, "quad");
    }
    // In front of the wall it stays, unless it is to be centred.
    let front = write("front.obj", "v 0 0 0.5\nv 0 1 0.5\nv 2 1 0.75\nv 2 0 0.75\nf 1 2 3 4\n");
    let of = |centred| Scene::placed(front.to_str().unwrap(), centred).unwrap();
    let bounds = |scene: &Scene| scene.objects[0].mesh.bounds().unwrap();
    let (kept, place) = of(false);
    assert_eq!(
        (bounds(&kept), place),
        ((dvec3(0.0, 0.0, 0.5), dvec3(2.0, 1.0, 0.75)), Some(MeshPlace::OfFile))
    );
    let (moved, place) = of(true);
    let (lo, hi) = bounds(&moved);
    assert!((lo.midpoint(hi) - dvec3(0.0, 0.0, 0.8)).length() < 1e-9 && place == Some(MeshPlace::Centred));
    // A cube that is wound inside out is turned and keeps its creases.
    let mut cube = String::new();
    for i in 0..8 {
        cube += &format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
    }
    cube += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    let mesh = load_mesh(&write("cube.obj", &cube)).unwrap();
    for (i, normals) in mesh.normals.iter().enumerate() {
        let n = mesh.geometric_normal(i);
        assert!(normals.iter().all(|m| m.distance(n) < 1e-9));
        assert!(n.dot(mesh.triangles[i][0] - DVec3::splat(0.5)) > 0.0);
    }
    // A folded sheet is open: it faces where its faces are wound to, whichever side its fold encloses.
    for fold in [-0.3, 0.3] {
        let sheet =
            format!("v 0 0 0\nv 0 1 0\nv 1 0 {fold}\nv 1 1 {fold}\nv 2 0 0\nv 2 1 0\nf 1 3 4 2\nf 3 5 6 4\n");
        let mesh = load_mesh(&write("sheet.obj", &sheet)).unwrap();
        assert!((0..4).all(|i| mesh.geometric_normal(i).z > 0.9), "{fold}");
    }
    for (name, text, says) in [
        ("empty.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangle"),
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("index.ply", &std::fs::read_to_string(&ply).unwrap().replace("4 0 1 2 3", "4 0 1 2 9"), "vertex 9"),
        (
            "negative.ply",
            &std::fs::read_to_string(&ply).unwrap().replace("4 0 1 2 3", "4 0 1 2 -3"),
            "vertex",
        ),
        ("short.ply", &std::fs::read_to_string(&ply).unwrap().replace("2 1 0\n", ""), "PLY"),
        ("text.obj", "f 1 2 3\n", "OBJ"),
    ] {
        let error = load_mesh(&write(name, text)).unwrap_err();
        assert!(error.what.contains(says) && error.what.contains(name), "{name}: {error}");
    }
}

#[test]
fn errors_say_what_is_wrong_and_how_to_mend_it() {
    let unknown = Scene::named("teapot").unwrap_err();
    assert!(
        unknown.what.contains("teapot")
            && ["figure", "letter"].iter().all(|w| unknown.hint.to_string().contains(w))
    );
    assert!(Scene::named("letter-7").unwrap_err().hint.to_string().contains("A to Z"));
    assert!(Scene::named("letters-ABCD").unwrap_err().what.contains("abcd"));
    assert!(Scene::named("no/such.obj").unwrap_err().what.contains("no/such.obj"));

    let good = scene(vec![plate(dvec3(0.0, 0.0, 0.5), 0.1)]);
    let options = RenderOptions::default();
    let refuse = |change: &dyn Fn(&mut Scene), says: &str| {
        let mut bad = good.clone();
        change(&mut bad);
        let error = render(&bad, &options).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    };
    refuse(&|s| s.wall = -1.0, "wall size");
    refuse(&|s| s.bin_width = f64::NAN, "bin width");
    refuse(&|s| s.scan = 0, "scan point");
    refuse(&|s| s.bins = Some(0), "bin");
    refuse(&|s| s.scan = 100_000, "GiB");
    refuse(&|s| s.set_albedo(-0.1), "albedo");
    refuse(&|s| s.objects.clear(), "no triangles");
    refuse(&|s| s.objects[0].mesh = plate(dvec3(0.0, 0.0, -0.1), 0.1), "wall");
    refuse(&|s| s.dark = Dark::Fraction(0.1), "photons");
    refuse(&|s| s.photons = Some(0.0), "photons");
    refuse(&|s| s.pile_up = Some(-1.0), "laser pulse");
    refuse(&|s| s.bin_width = 1e-12, "GiB");
    refuse(&|s| s.bin_width = 1e-300, "GiB");
    assert!(render(&good, &RenderOptions { noise: 0.0, ..options }).is_err());
    assert!(truth(&good, 0).is_err());
    let mut dark = good.clone();
    (dark.photons, dark.t_start) = (Some(10.0), 90.0);
    assert!(simulate(&dark, &options).unwrap_err().what.contains("no light"));
    let short = Pairs { sensor: Vec::new(), ..Pairs::confocal(2, 1.0) };
    assert!(render_pairs(&good, &short, &options).is_err());
}

#[test]
fn a_scene_that_faces_away_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("away.obj");
    std::fs::write(&path, "v 0 0 0\nv 2 0 0\nv 2 1 0\nf 1 3 2\n").unwrap();
    let scene = Scene::named(path.to_str().unwrap()).unwrap();
    let error = simulate(&scene, &RenderOptions::default()).unwrap_err();
    assert!(error.what.contains("away") && error.hint.to_string().contains("face the wall"), "{error}");
}
