//! Flat letters A–Z, facing the wall.
//!
//! A letter consists of strokes of one width. Strokes overlap where they meet, and overlapping triangles would reflect
//! twice. So the union of the strokes is computed as a signed distance, and its outline is traced on a fine grid, with
//! inner cells merged into blocks.

use super::Mesh;
use crate::{Error, Result};
use glam::{DVec2, DVec3, dvec2};

/// Stroke width, width of the box and edge of a tracing cell, as shares of the letter's height.
const STROKE: f64 = 0.18;
const WIDTH: f64 = 0.8;
const CELL: f64 = 1.0 / 80.0;
/// Largest block of merged cells (a power of two).
const BLOCK: usize = 8;

/// The letter `name` (A–Z, either case) of the given height in metres, in the plane z = `centre.z`, centred at
/// `centre`, facing -z. Readable from the wall: +x to the left and +y up.
///
/// # Errors
/// A character that is not a letter, or a height that is not a positive number.
pub fn letter(name: char, centre: DVec3, height: f64) -> Result<Mesh> {
    let strokes = strokes(name.to_ascii_uppercase()).ok_or_else(|| {
        Error::options(format!("there is no letter {name:?}"), "choose one of the letters A to Z")
    })?;
    if !(height.is_finite() && height > 0.0 && centre.is_finite()) {
        return Err(Error::options(
            format!("a letter of height {height} at {centre} cannot be built"),
            "give a height above 0 and a finite centre, in metres",
        ));
    }
    let lines = centre_lines(&strokes);
    let distance = |p: DVec2| {
        let inside = lines.iter().map(|&(a, b)| to_segment(p, a, b)).fold(f64::INFINITY, f64::min);
        let clip = (p - dvec2(WIDTH, 1.0) * 0.5).abs() - dvec2(WIDTH, 1.0) * 0.5;
        (inside - 0.5 * STROKE).max(clip.x).max(clip.y)
    };
    // In the letter's box, u runs to the right.
    let place = |p: DVec2| centre + ((p - dvec2(WIDTH, 1.0) * 0.5) * dvec2(-height, height)).extend(0.0);
    Ok(trace(distance, place))
}

/// Triangulates {distance ≤ 0} in the letter's box.
fn trace(distance: impl Fn(DVec2) -> f64, place: impl Fn(DVec2) -> DVec3) -> Mesh {
    let (nx, ny) = ((WIDTH / CELL).round() as usize, (1.0 / CELL).round() as usize);
    let node = |i: usize, j: usize| dvec2(i as f64, j as f64) * CELL;
    let field: Vec<f64> =
        (0..=nx).flat_map(|i| (0..=ny).map(move |j| (i, j))).map(|(i, j)| distance(node(i, j))).collect();
    let at = |i: usize, j: usize| field[i * (ny + 1) + j];
    let full = |i: usize, j: usize, n: usize| {
        i + n <= nx && j + n <= ny && (i..=i + n).all(|a| (j..=j + n).all(|b| at(a, b) <= 0.0))
    };
    let mut mesh = Mesh::default();
    let mut blocks: Vec<(usize, usize, usize)> = Vec::new();
    for i in (0..nx).step_by(BLOCK) {
        blocks.extend((0..ny).step_by(BLOCK).map(|j| (i, j, BLOCK)));
    }
    while let Some((i, j, n)) = blocks.pop() {
        if i >= nx || j >= ny {
            continue;
        }
        if !full(i, j, n) && n > 1 {
            let h = n / 2;
            blocks.extend([(i, j, h), (i + h, j, h), (i, j + h, h), (i + h, j + h, h)]);
            continue;
        }
        let corners = [(i, j), (i + n, j), (i + n, j + n), (i, j + n)].map(|(a, b)| (node(a, b), at(a, b)));
        let outline: Vec<DVec3> = clip(&corners).into_iter().map(&place).collect();
        for k in 2..outline.len() {
            mesh.push([outline[0], outline[k - 1], outline[k]], [-DVec3::Z; 3]);
        }
    }
    mesh
}

/// The part of a cell where the field, linear along its edges, is not positive.
fn clip(corners: &[(DVec2, f64); 4]) -> Vec<DVec2> {
    let mut kept = Vec::with_capacity(6);
    for k in 0..4 {
        let ((a, fa), (b, fb)) = (corners[k], corners[(k + 1) % 4]);
        if fa <= 0.0 {
            kept.push(a);
        }
        if (fa <= 0.0) != (fb <= 0.0) {
            kept.push(a.lerp(b, fa / (fa - fb)));
        }
    }
    kept
}

fn to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let (d, e) = (b - a, p - a);
    let t = (e.dot(d) / d.length_squared().max(1e-300)).clamp(0.0, 1.0);
    (e - d * t).length()
}

/// A stroke in the unit square of the letter's centre lines.
enum Stroke {
    Line([f64; 4]),
    /// Centre, half axes, first and last angle in degrees, counter-clockwise from +u.
    Arc([f64; 2], [f64; 2], [f64; 2]),
}

/// Centre lines as segments in units of the letter's height. Ends at the box's edge are extended beyond it, so the
/// clipped letter has flat ends there.
fn centre_lines(strokes: &[Stroke]) -> Vec<(DVec2, DVec2)> {
    let map = |u: f64, v: f64| DVec2::splat(0.5 * STROKE) + dvec2(u * (WIDTH - STROKE), v * (1.0 - STROKE));
    let leaves = |at: f64, way: f64| (at == 0.0 && way < -1e-9) || (at == 1.0 && way > 1e-9);
    let mut lines = Vec::new();
    for stroke in strokes {
        match *stroke {
            Stroke::Line([u0, v0, u1, v1]) => {
                let (mut a, mut b) = (map(u0, v0), map(u1, v1));
                let way = (b - a).normalize_or_zero();
                if leaves(u0, -way.x) || leaves(v0, -way.y) {
                    a -= way * (2.0 * STROKE);
                }
                if leaves(u1, way.x) || leaves(v1, way.y) {
                    b += way * (2.0 * STROKE);
                }
                lines.push((a, b));
            }
            Stroke::Arc([cu, cv], [ru, rv], [from, to]) => {
                let point = |k: usize| {
                    let angle = (from + (to - from) * k as f64 / 32.0).to_radians();
                    map(cu + ru * angle.cos(), cv + rv * angle.sin())
                };
                lines.extend((0..32).map(|k| (point(k), point(k + 1))));
            }
        }
    }
    lines
}

/// Strokes of a capital letter.
fn strokes(name: char) -> Option<Vec<Stroke>> {
    use Stroke::{Arc, Line};
    let line = |u0: f64, v0: f64, u1: f64, v1: f64| Line([u0, v0, u1, v1]);
    let arc = |cu, cv, ru, rv, from, to| Arc([cu, cv], [ru, rv], [from, to]);
    let stem = || line(0.0, 0.0, 0.0, 1.0);
    let bar = |v: f64, to: f64| line(0.0, v, to, v);
    Some(match name {
        'A' => vec![line(0.0, 0.0, 0.5, 0.99), line(0.5, 0.99, 1.0, 0.0), line(0.16, 0.32, 0.84, 0.32)],
        'B' => vec![
            stem(),
            bar(1.0, 0.6),
            bar(0.5, 0.6),
            bar(0.0, 0.6),
            arc(0.6, 0.75, 0.34, 0.25, -90.0, 90.0),
            arc(0.6, 0.25, 0.4, 0.25, -90.0, 90.0),
        ],
        'C' => vec![arc(0.5, 0.5, 0.5, 0.5, 50.0, 310.0)],
        'D' => vec![stem(), bar(1.0, 0.45), bar(0.0, 0.45), arc(0.45, 0.5, 0.55, 0.5, -90.0, 90.0)],
        'E' => vec![stem(), bar(1.0, 1.0), bar(0.5, 0.8), bar(0.0, 1.0)],
        'F' => vec![stem(), bar(1.0, 1.0), bar(0.5, 0.8)],
        'G' => vec![
            arc(0.5, 0.5, 0.5, 0.5, 50.0, 320.0),
            line(0.6, 0.42, 0.95, 0.42),
            line(0.95, 0.42, 0.9, 0.19),
        ],
        'H' => vec![stem(), line(1.0, 0.0, 1.0, 1.0), line(0.0, 0.5, 1.0, 0.5)],
        'I' => vec![line(0.5, 0.0, 0.5, 1.0)],
        'J' => vec![line(0.85, 1.0, 0.85, 0.32), arc(0.45, 0.32, 0.4, 0.32, 190.0, 360.0)],
        'K' => vec![stem(), line(0.0, 0.38, 1.0, 1.0), line(0.35, 0.58, 1.0, 0.0)],
        'L' => vec![stem(), bar(0.0, 1.0)],
        'M' => vec![stem(), line(0.0, 1.0, 0.5, 0.3), line(0.5, 0.3, 1.0, 1.0), line(1.0, 1.0, 1.0, 0.0)],
        'N' => vec![stem(), line(0.0, 1.0, 1.0, 0.0), line(1.0, 0.0, 1.0, 1.0)],
        'O' => vec![arc(0.5, 0.5, 0.5, 0.5, 0.0, 360.0)],
        'P' => vec![stem(), bar(1.0, 0.55), bar(0.44, 0.55), arc(0.55, 0.72, 0.45, 0.28, -90.0, 90.0)],
        'Q' => vec![arc(0.5, 0.5, 0.5, 0.5, 0.0, 360.0), line(0.6, 0.3, 1.0, 0.0)],
        'R' => vec![
            stem(),
            bar(1.0, 0.55),
            bar(0.44, 0.55),
            arc(0.55, 0.72, 0.45, 0.28, -90.0, 90.0),
            line(0.45, 0.44, 1.0, 0.0),
        ],
        'S' => vec![arc(0.5, 0.75, 0.5, 0.25, 25.0, 270.0), arc(0.5, 0.25, 0.5, 0.25, 90.0, -155.0)],
        'T' => vec![bar(1.0, 1.0), line(0.5, 0.0, 0.5, 1.0)],
        'U' => vec![
            line(0.0, 1.0, 0.0, 0.38),
            arc(0.5, 0.38, 0.5, 0.38, 180.0, 360.0),
            line(1.0, 0.38, 1.0, 1.0),
        ],
        'V' => vec![line(0.0, 1.0, 0.5, 0.01), line(0.5, 0.01, 1.0, 1.0)],
        'W' => vec![
            line(0.0, 1.0, 0.24, 0.01),
            line(0.24, 0.01, 0.5, 0.7),
            line(0.5, 0.7, 0.76, 0.01),
            line(0.76, 0.01, 1.0, 1.0),
        ],
        'X' => vec![line(0.0, 0.0, 1.0, 1.0), line(0.0, 1.0, 1.0, 0.0)],
        'Y' => vec![line(0.0, 1.0, 0.5, 0.48), line(1.0, 1.0, 0.5, 0.48), line(0.5, 0.48, 0.5, 0.0)],
        'Z' => vec![bar(1.0, 1.0), line(1.0, 1.0, 0.0, 0.0), bar(0.0, 1.0)],
        _ => return None,
    })
}
