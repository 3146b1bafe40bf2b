//! Curved walls: normals from neighbours, and the volume that a capture can see.

use fixtures::captures::{angles, assert_error, capture, place};
use glam::{DMat3, DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, read_with_notes, write};
use thirdbounce::engine::default_volume;
use thirdbounce_simulate::{Layout, Pairs, WallShape};

/// A capture with the points of these pairs, which keeps the true normals beside it.
fn bare(pairs: Pairs) -> (Capture, [Option<Vec<DVec3>>; 2]) {
    let mut made = capture(pairs.scan, 4, |_, _| 1.0);
    (made.laser, made.sensor) = (pairs.laser, pairs.sensor);
    (made, [pairs.laser_normal, pairs.sensor_normal])
}

#[test]
fn normals_of_a_bump_are_estimated_from_its_points() {
    for (layout, scan, mean, most) in [
        (Layout::Confocal, 32, 0.5, 2.5),
        (Layout::Exhaustive { lasers: 8 }, 16, 1.5, 8.0),
        (Layout::Irregular { seed: 4 }, 32, 2.0, 10.0),
    ] {
        let (c, [laser, sensor]) = bare(Pairs::new(layout, scan, 1.0, WallShape::Bump));
        assert!(!c.is_planar());
        let (with, note) = c.with_normals().unwrap();
        assert!(note.is_some_and(|n| n.contains("estimated from neighbouring points")));
        for (found, real) in [(&with.laser_normal, laser), (&with.sensor_normal, sensor)] {
            let (a, b) = angles(found.as_ref().unwrap(), real.as_ref().unwrap());
            assert!(a < mean && b < most, "{layout:?}: mean {a:.2}, most {b:.2} degrees");
        }
        with.check().unwrap();
    }
}

#[test]
fn a_tilted_wall_has_its_plane_and_faces_the_scene() {
    let mut c = capture([6, 5], 2, |_, _| 1.0);
    let normal = dvec3(0.4, -0.3, 1.0).normalize();
    for p in c.laser.iter_mut().chain(&mut c.sensor) {
        p.z = -(normal.x * p.x + normal.y * p.y) / normal.z;
    }
    let (with, _) = c.with_normals().unwrap();
    let (_, most) = angles(&with.sensor_normal.unwrap(), &[normal; 30]);
    assert!(most < 1e-5, "{most}");
}

#[test]
fn a_wall_that_faces_elsewhere_is_rotated() {
    let upright = capture([6, 5], 3, |p, b| (1 + p + b) as f32);
    // From our frame to the file's: the wall faces these directions there.
    let frames = [
        ("along x", DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X)),
        ("along -z", DMat3::from_cols(-DVec3::X, DVec3::Y, -DVec3::Z)),
        ("aslant", DMat3::from_rotation_y(1.0)),
    ];
    for (name, frame) in frames {
        for with_normals in [true, false] {
            let shift = dvec3(0.3, -0.2, 2.0);
            let mut turned = upright.clone();
            turned.laser.iter_mut().chain(&mut turned.sensor).for_each(|p| *p = frame * *p + shift);
            let normals = with_normals.then(|| vec![frame * DVec3::Z; 30]);
            (turned.laser_normal, turned.sensor_normal) = (normals.clone(), normals);
            let (_folder, path) = place("turned.npz");
            write(&turned, &path).unwrap();
            let opened = read_with_notes(&path).unwrap();
            let (found, notes) = (opened.capture, opened.notes.join("; "));
            if name == "along -z" && !with_normals {
                // What lies along z without normals faces +z: points and scan stay.
                assert_eq!((found.laser, notes.as_str()), (turned.laser, ""));
                continue;
            }
            assert!(notes.contains("rotated to face +z"), "{name}: {notes}");
            assert_eq!(notes.contains("mirrored"), !with_normals, "{name}: {notes}");
            assert_eq!((found.scan, &found.histograms), (upright.scan, &upright.histograms), "{name}");
            assert!(found.is_planar(), "{name}");
            let moved = found.laser[0] - upright.laser[0];
            let off = |(a, b): (&DVec3, &DVec3)| a.distance(*b + moved);
            let most = found.laser.iter().zip(&upright.laser).map(off).fold(0.0, f64::max);
            assert!(most < 1e-12 && found.laser.iter().all(|p| p.z.abs() < 1e-12), "{name}: {most}");
            // Without a reader nothing is rotated, and there are no depths to look at.
            if name != "aslant" {
                assert_error(default_volume(&turned, 0.1), Kind::Input, &["the wall faces", "faces +z"]);
            }
        }
    }
    // A tilted wall and one at any height stay as they are.
    let mut tilted = upright;
    let lean = DMat3::from_rotation_x(0.3);
    tilted.laser.iter_mut().chain(&mut tilted.sensor).for_each(|p| *p = lean * *p + DVec3::Z);
    let (_folder, path) = place("tilted.npz");
    write(&tilted, &path).unwrap();
    assert_eq!(read_with_notes(&path).unwrap().capture.laser, tilted.laser);
}

#[test]
fn known_and_needless_normals_are_left_alone() {
    let flat = capture([4, 4], 1, |_, _| 1.0);
    assert_eq!(flat.with_normals().unwrap(), (flat, None));
    // Normals of one side serve the other at the same points.
    let (mut c, [laser, _]) = bare(Pairs::new(Layout::Confocal, 6, 1.0, WallShape::Bump));
    c.laser_normal = laser.clone();
    let (with, note) = c.with_normals().unwrap();
    assert_eq!(with.sensor_normal, laser);
    assert!(note.unwrap().contains("other side"));
}

#[test]
fn points_on_a_line_have_no_plane() {
    let mut c = capture([7, 1], 1, |_, _| 1.0);
    c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| p.z = 0.5 * p.x);
    assert_error(c.with_normals(), Kind::Input, &["7 points lie on a line", "sensor_normal"]);
    // A row whose neighbours lie on a line, and one point beside it, has one.
    c.laser[6].y += 0.3;
    c.sensor[6].y += 0.3;
    let (with, _) = c.with_normals().unwrap();
    let (_, most) = angles(&with.laser_normal.unwrap(), &[dvec3(-0.5, 0.0, 1.0).normalize(); 7]);
    assert!(most < 1e-4, "{most}");
}

#[test]
fn the_volume_ends_where_the_longest_path_can_come_from() {
    // Paths 0.5 to 0.9 m; signal in all bins.
    let base = || capture([4, 4], 40, |_, _| 1.0);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} is not {b}");
    let confocal = default_volume(&base(), 0.1).unwrap();
    close(confocal.max.z, 0.45);
    // The sensor in one corner: the nearest laser point has the deepest ellipsoid, none is deeper.
    let mut one_sensor = base();
    one_sensor.sensor.fill(one_sensor.laser[0] + dvec3(0.0, -0.1, 0.0));
    let volume = default_volume(&one_sensor, 0.1).unwrap();
    close(volume.max.z, 0.5 * (0.81f64 - 0.01).sqrt());
    assert_eq!(
        (volume.min.x, volume.max.x),
        (confocal.min.x, confocal.max.x),
        "the laser's side was scanned"
    );
    // Only the last signal counts, pair by pair.
    let mut dark = one_sensor.clone();
    dark.histograms.chunks_exact_mut(40).for_each(|h| h[20..].fill(0.0));
    dark.histograms[15 * 40 + 39] = 1.0;
    let far = (dark.laser[15] - dark.sensor[15]).length_squared();
    close(
        default_volume(&dark, 0.1).unwrap().max.z,
        0.5 * (0.81 - far).sqrt().max((0.71f64.powi(2) - 0.01).sqrt()),
    );
    // The volume moves with the wall; a bump pushes the near end forward.
    let mut moved = base();
    moved.laser.iter_mut().chain(&mut moved.sensor).for_each(|p| p.z += 2.0);
    let volume = default_volume(&moved, 0.1).unwrap();
    close(volume.min.z, 2.1);
    close(volume.max.z, 2.45);
    let mut bump = base();
    (bump.laser[5].z, bump.sensor[5].z) = (0.08, 0.08);
    let volume = default_volume(&bump, 0.1).unwrap();
    close(volume.min.z, 0.18);
    close(volume.max.z, 0.53);
    // Nothing is left between.
    assert_error(default_volume(&base(), 0.5), Kind::Options, &["0.900 m", "bin width", "`volume`"]);
}

#[test]
fn the_volume_begins_where_no_path_is_too_short() {
    let mut c = capture([3, 3], 40, |_, _| 1.0);
    c.t_start = 3.0;
    let low = default_volume(&c, 0.1).unwrap().min.z;
    // From every wall point to every corner of the volume's near face the path is below the gate's.
    let aside = 0.25f64.hypot(0.25);
    assert!((low - (1.5f64.powi(2) - aside.powi(2)).sqrt()).abs() < 1e-9, "{low}");
}
