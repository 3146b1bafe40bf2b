//! Estimates wall normals from neighbouring points, for captures without normals.

use glam::{DMat3, DVec3};

use crate::data::Capture;
use crate::data::nearest::Tree;
use crate::data::pairs::Distinct;
use crate::error::{Error, Result};

/// Number of neighbours that the tangent plane of a point is fitted to; on a lattice all that surround it.
const NEIGHBOURS: usize = 8;
/// Points whose second principal variance is below this share of the first lie on a line.
const COLLINEAR: f64 = 1e-6;
/// Points whose least principal variance is above this share of the second have no plane.
const THICK: f64 = 0.1;

#[doc(hidden)]
impl Capture {
    /// The capture with wall normals on both sides, if the wall needs them. A capture with a planar wall, or with known
    /// normals, does not change. Otherwise an unknown normal is that of a known one at the same point. If there is
    /// none, it is the normal of the plane through the nearest eight distinct wall points of both sides (weighted by
    /// distance), facing the hidden side (+z). The note says what was assumed; `None` if nothing was.
    ///
    /// # Errors
    /// `Kind::Input` if the wall points all lie on a line, so that they have no plane.
    pub fn with_normals(&self) -> Result<(Capture, Option<String>)> {
        let mut with = self.clone();
        let note = with.set_normals()?;
        Ok((with, note))
    }

    /// The direction that the wall faces: that of its normals in the mean or, where none is known, the one along which its
    /// points spread least, toward positive coordinates. `None` if the points lie on a line or around no plane.
    pub fn facing(&self) -> Option<DVec3> {
        let known: DVec3 = self.laser_normal.iter().chain(&self.sensor_normal).flatten().sum();
        known.try_normalize().or_else(|| {
            let points = self.laser.iter().chain(&self.sensor);
            let (variances, normal) = principal(points.map(|p| (1.0, *p)))?;
            let toward = [normal.z, normal.y, normal.x].into_iter().find(|c| c.abs() > 1e-6);
            let flat = variances[0] <= THICK * variances[1];
            flat.then(|| normal * toward.map_or(1.0, f64::signum))
        })
    }

    /// Whether all wall points of both sides lie on a line.
    pub(super) fn is_a_line(&self) -> bool {
        let points = self.laser.iter().chain(&self.sensor);
        self.pair_count() >= 3 && self.outermost() > 0.0 && principal(points.map(|p| (1.0, *p))).is_none()
    }

    /// Adds wall normals in place, as [`Capture::with_normals`] does, without a copy of the histograms.
    ///
    /// # Errors
    /// Those of [`Capture::with_normals`]; the capture is then as it was.
    pub fn set_normals(&mut self) -> Result<Option<String>> {
        let known = self.laser_normal.is_some() && self.sensor_normal.is_some();
        if known || self.is_planar() {
            return Ok(None);
        }
        let all: Vec<DVec3> = self.laser.iter().chain(&self.sensor).copied().collect();
        let distinct = Distinct::of(&all, self.point_tolerance());
        let points = distinct.pick(&all);
        let mut normals: Vec<Option<DVec3>> = vec![None; points.len()];
        let pairs = self.pair_count();
        let given = [(self.laser_normal.as_ref(), 0), (self.sensor_normal.as_ref(), pairs)];
        for (side, offset) in given {
            for (pair, n) in side.into_iter().flatten().enumerate() {
                normals[distinct.index[offset + pair]] = Some(*n);
            }
        }
        let tree = Tree::new(&points);
        let mut estimated = 0;
        for (point, normal) in points.iter().zip(&mut normals).filter(|(_, n)| n.is_none()) {
            *normal = Some(tangent(&points, &tree, *point).ok_or_else(|| {
                Error::input(
                    format!(
                        "the wall is not flat, has no normals, and its {} points lie on a line, which \
                         determines no plane",
                        points.len()
                    ),
                    "store sensor_normal and laser_normal in the capture",
                )
            })?);
            estimated += 1;
        }
        let of = |offset: usize| -> Vec<DVec3> {
            (0..pairs).map(|p| normals[distinct.index[offset + p]].unwrap_or(DVec3::Z)).collect()
        };
        let (of_laser, of_sensor) = (of(0), of(pairs));
        self.laser_normal.get_or_insert(of_laser);
        self.sensor_normal.get_or_insert(of_sensor);
        Ok(Some(match estimated {
            0 => "wall normals were taken from the other side at the same points".to_string(),
            n if n == points.len() => "wall normals were estimated from neighbouring points".to_string(),
            n => format!(
                "wall normals of {n} of {} points were estimated from neighbouring points",
                points.len()
            ),
        }))
    }
}

/// Unit normal of the plane through the points around `at`, facing +z. If these lie on a line, farther points are
/// added. `None` if all points lie on a line.
fn tangent(points: &[DVec3], tree: &Tree, at: DVec3) -> Option<DVec3> {
    let mut count = NEIGHBOURS + 1;
    loop {
        let near = tree.nearest(at, count);
        let reach = near.last().map_or(0.0, |f| f.0);
        if reach > 0.0 {
            // The weight is a Gaussian that falls to a seventh at the farthest point.
            let weighted: Vec<(f64, DVec3)> =
                near.iter().map(|&(d, i)| ((-2.0 * d / reach).exp(), points[i])).collect();
            if let Some(normal) = plane_normal(&weighted) {
                return Some(if normal.z < 0.0 { -normal } else { normal });
            }
        }
        if near.len() < count {
            return None;
        }
        count = count.saturating_mul(2);
    }
}

/// Direction of the least variance of weighted points; `None` if they lie on a line.
fn plane_normal(weighted: &[(f64, DVec3)]) -> Option<DVec3> {
    principal(weighted.iter().copied()).map(|(_, normal)| normal)
}

/// The least and the second principal variance of weighted points, and the direction of the least; `None` if the points lie
/// on a line.
fn principal(weighted: impl Iterator<Item = (f64, DVec3)> + Clone) -> Option<([f64; 2], DVec3)> {
    let total: f64 = weighted.clone().map(|w| w.0).sum();
    let mean: DVec3 = weighted.clone().map(|(w, p)| p * (w / total)).sum();
    let mut moments = DMat3::ZERO;
    for (w, p) in weighted {
        let d = p - mean;
        moments += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * (w / total);
    }
    let (values, vectors) = eigen(moments);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let [least, middle, most] = order;
    let is_plane = values[middle] > COLLINEAR * values[most];
    is_plane.then(|| ([values[least], values[middle]], vectors.col(least).normalize()))
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
fn eigen(symmetric: DMat3) -> (DVec3, DMat3) {
    let (mut m, mut vectors) = (symmetric, DMat3::IDENTITY);
    for _ in 0..16 {
        let mut off = 0.0;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = m.col(q)[p];
            off += apq * apq;
            if apq == 0.0 {
                continue;
            }
            let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            m = rotation.transpose() * m * rotation;
            vectors *= rotation;
        }
        let scale = m.col(0)[0].abs().max(m.col(1)[1].abs()).max(m.col(2)[2].abs());
        if off.sqrt() <= 1e-15 * scale {
            break;
        }
    }
    (DVec3::new(m.col(0)[0], m.col(1)[1], m.col(2)[2]), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn eigenvectors_of_a_symmetric_matrix() {
        let m = DMat3::from_cols(dvec3(2.0, -1.0, 0.3), dvec3(-1.0, 5.0, 0.7), dvec3(0.3, 0.7, 1e-3));
        let (values, vectors) = eigen(m);
        for k in 0..3 {
            let v = vectors.col(k);
            assert!((m * v - v * values[k]).length() < 1e-12, "{k}");
            assert!((v.length() - 1.0).abs() < 1e-12);
        }
        assert!((values.element_sum() - 7.001).abs() < 1e-12);
    }
}
