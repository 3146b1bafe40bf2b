//! The surface χ = 0 as triangles (surface nets). Every crossed cell has a vertex at the mean of the crossings of its
//! edges; two triangles surround every crossed edge.

use glam::{DVec3, IVec3};

use super::poisson::{AXES, CORNERS, Field, gradient};

/// Vertices in metres with their outward unit normals, and triangles counter-clockwise as seen from outside.
pub struct SurfaceMesh {
    pub vertices: Vec<(DVec3, DVec3)>,
    pub triangles: Vec<[usize; 3]>,
}

pub fn surface(field: &Field) -> SurfaceMesh {
    let mut vertices = Vec::new();
    // Of the cell whose lowest corner is each node.
    let mut of_cell: Vec<Option<usize>> = vec![None; field.nodes.len()];
    for (low, node) in field.nodes.iter().enumerate() {
        let Some(values) = field.cell(low) else { continue };
        let Some(into) = middle(&values) else { continue };
        let outward = -gradient(&values, into).normalize_or_zero();
        of_cell[low] = Some(vertices.len());
        vertices.push((field.position(node.as_dvec3() + into), outward));
    }
    let mut triangles = Vec::new();
    for (low, node) in field.nodes.iter().enumerate() {
        for axis in 0..3 {
            let Some(high) = field.next(low, axis) else { continue };
            let (before, after) = (field.chi[low] > 0.0, field.chi[high] > 0.0);
            if before == after {
                continue;
            }
            let (u, v) = (AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]);
            let around = [IVec3::ZERO, u, u + v, v]
                .map(|back| field.node(*node - back).and_then(|cell| of_cell[cell]));
            let [Some(a), Some(b), Some(c), Some(d)] = around else { continue };
            // These four are counter-clockwise about the axis; χ is positive inside.
            let [a, b, c, d] = if before { [a, b, c, d] } else { [d, c, b, a] };
            let length = |a: usize, b: usize| {
                let (a, b): (&(DVec3, DVec3), &(DVec3, DVec3)) = (&vertices[a], &vertices[b]);
                a.0.distance_squared(b.0)
            };
            let halves =
                if length(a, c) <= length(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            triangles.extend(halves);
        }
    }
    SurfaceMesh { vertices, triangles }
}

/// Mean of the crossings of a cell's edges, from the cell's lowest corner. `None` without crossings.
fn middle(values: &[f64; 8]) -> Option<DVec3> {
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for (i, low) in CORNERS.iter().enumerate() {
        for (j, high) in CORNERS.iter().enumerate().skip(i + 1) {
            let apart = *high - *low;
            if apart.abs().element_sum() == 1 && (values[i] > 0.0) != (values[j] > 0.0) {
                sum += low.as_dvec3() + apart.as_dvec3() * (values[i] / (values[i] - values[j]));
                count += 1;
            }
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}
