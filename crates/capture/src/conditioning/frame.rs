//! From the frame of a file to ours: the order of the pairs, walls that do not face +z.

use glam::{DMat3, DVec3};

use super::choose::PairOrder;
use crate::data::Capture;

/// Distances from (0, 0, 1), and from z = 0 in metres, below this are taken as rounding.
#[cfg(feature = "formats")]
const STRAIGHT: f64 = 1e-3;

/// A wall that faces +z but for its shape, or for a tilt, has a larger z in the direction that it faces.
const ROUGHLY: f64 = 0.9;

/// Puts the pairs of a lattice scan in our order: ix along +x, iy along +y.
pub fn in_order(capture: Capture) -> Capture {
    match order_of(&capture) {
        Some(PairOrder { pairs, scan }) => capture.keep(&pairs, scan),
        None => capture,
    }
}

/// The order in which [`in_order`] puts the pairs; `None` if they are in order or no lattice.
pub fn order_of(capture: &Capture) -> Option<PairOrder> {
    let [a, b] = capture.scan;
    let points = capture.scanned_points();
    if a < 2 || b < 2 || points.len() != a * b {
        return None;
    }
    let (along_a, along_b) = (points[b] - points[0], points[1] - points[0]);
    let swapped = along_a.x.abs() + along_b.y.abs() < along_a.y.abs() + along_b.x.abs();
    let (x_step, y_step) = if swapped { (along_b, along_a) } else { (along_a, along_b) };
    let [nx, ny] = if swapped { [b, a] } else { [a, b] };
    let from = |ix: usize, iy: usize| {
        let ix = if x_step.x < 0.0 { nx - 1 - ix } else { ix };
        let iy = if y_step.y < 0.0 { ny - 1 - iy } else { iy };
        if swapped { iy * b + ix } else { ix * b + iy }
    };
    let pairs: Vec<usize> =
        (0..nx).flat_map(|ix| (0..ny).map(move |iy| (ix, iy))).map(|(x, y)| from(x, y)).collect();
    let moved = pairs.iter().enumerate().any(|(to, from)| to != *from);
    moved.then_some(PairOrder { pairs, scan: [nx, ny] })
}

/// Rotates and shifts the capture so that its wall lies near z = 0 and faces +z. `towards` is a point of the hidden
/// scene, if the file holds one. A wall that already does so stays the same bit for bit. So does a wall without normals
/// whose points lie on a line.
#[cfg(feature = "formats")]
pub fn facing_z(mut capture: Capture, towards: Option<DVec3>, notes: &mut Vec<String>) -> Capture {
    let all = || capture.laser.iter().chain(&capture.sensor).filter(|p| p.is_finite());
    let count = all().count().max(1) as f64;
    let centre = all().sum::<DVec3>() / count;
    let known: DVec3 = capture.laser_normal.iter().chain(&capture.sensor_normal).flatten().sum();
    let mut facing = match known.try_normalize() {
        Some(normal) => normal,
        None => match thinnest(all().map(|p| *p - centre)) {
            Some(normal) => normal,
            None => return capture,
        },
    };
    let side = towards.map_or(0.0, |p| (p - centre).dot(facing));
    if side < 0.0 || (side == 0.0 && known == DVec3::ZERO && facing.z < 0.0) {
        facing = -facing;
        if known != DVec3::ZERO {
            notes.push("the wall's normals point away from the hidden scene: they are reversed".into());
            for n in capture.laser_normal.iter_mut().chain(&mut capture.sensor_normal).flatten() {
                *n = -*n;
            }
        }
    }
    if facing.distance(DVec3::Z) < STRAIGHT && centre.z.abs() < STRAIGHT {
        return capture;
    }
    rotated(capture, [centre, facing], notes)
}

/// Rotates and shifts the capture as [`facing_z`] does if its wall clearly faces elsewhere, for captures whose walls may have any
/// shape, tilt and place otherwise. The pairs of a lattice are put in our order then.
pub fn roughly_facing_z(capture: Capture, notes: &mut Vec<String>) -> Capture {
    let Some(facing) = capture.facing().filter(|facing| facing.z < ROUGHLY) else { return capture };
    let points = capture.laser.iter().chain(&capture.sensor);
    let centre = points.sum::<DVec3>() / (2 * capture.pair_count()) as f64;
    let sided = capture.laser_normal.is_some() || capture.sensor_normal.is_some();
    let turned = in_order(rotated(capture, [centre, facing], notes));
    if !sided {
        notes.push(
            "nothing says on which side of this wall the scene is: if the pictures are mirrored, flip the capture in x, or \
             store wall normals"
                .into(),
        );
    }
    turned
}

/// Rotates the capture so that what faces `facing` faces +z, and shifts `centre` to z = 0.
fn rotated(mut capture: Capture, [centre, facing]: [DVec3; 2], notes: &mut Vec<String>) -> Capture {
    // y stays up as far as possible. For a wall that is a floor or a ceiling, z becomes up.
    let up = if facing.y.abs() < 0.9 { DVec3::Y } else { DVec3::Z };
    let across = up.cross(facing).normalize();
    let turn = DMat3::from_cols(across, facing.cross(across), facing).transpose();
    let shift = DVec3::Z * (turn * centre).z;
    let devices = capture.devices.iter_mut().flatten();
    for p in capture.laser.iter_mut().chain(&mut capture.sensor).chain(devices) {
        *p = turn * *p - shift;
    }
    for n in capture.laser_normal.iter_mut().chain(&mut capture.sensor_normal).flatten() {
        *n = turn * *n;
    }
    let up = match (facing.y.abs() < 0.9, facing.x.abs() > 0.9, facing.x > 0.0) {
        // After the turn, z of the file points along -x or +x.
        (true, true, positive) => format!(
            "y of the file is taken as up; if z is (as in ROS), give a rotation of {} degrees",
            if positive { 270 } else { 90 }
        ),
        (true, ..) => "y of the file is taken as up".into(),
        (false, ..) => "z of the file is taken as up".into(),
    };
    notes.push(format!(
        "the wall faces ({:.3}, {:.3}, {:.3}) in the file: it is rotated to face +z and moved to z = 0; {up}",
        facing.x, facing.y, facing.z
    ));
    capture
}

/// The coordinate axis along which the points spread least; `None` if they spread along fewer than two axes, or if no
/// axis is clearly the least.
#[cfg(feature = "formats")]
fn thinnest(points: impl Iterator<Item = DVec3>) -> Option<DVec3> {
    let spread = points.fold(DVec3::ZERO, |s, p| s.max(p.abs()));
    let mut axes = [(spread.x, DVec3::X), (spread.y, DVec3::Y), (spread.z, DVec3::Z)];
    axes.sort_by(|a, b| a.0.total_cmp(&b.0));
    (axes[1].0 > 0.0 && axes[0].0 < 0.5 * axes[1].0).then_some(axes[0].1)
}
