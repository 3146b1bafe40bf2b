//! An upright edge between scanned surface and scene: a wall that ends in a corner hides a part of the scene from each point.

use glam::{DVec2, DVec3};

use crate::constants::ACROSS;
use crate::normal;

/// Share of the light that passes where nothing does, so that its logarithm is finite.
const LEAST: f64 = 1e-6;
/// Least softness of a shadow, metres.
const SHARP: f64 = 1e-4;

/// A wall that stands on the scanned surface, ends in an upright edge and has no gaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Foot of the edge, metres: x and y.
    corner: DVec2,
    /// Unit vector along the wall, away from it.
    open: DVec2,
}

/// What passes an edge: logarithm of the share, and its derivatives by the position and by the logarithm of the radius of an object.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct PassedLight {
    pub light: f64,
    pub by_at: DVec3,
    pub by_extent: f64,
}

impl Edge {
    /// An edge at x and y, metres, of a wall that runs from there in this direction, degrees from +x toward +y.
    pub fn new(corner: [f64; 2], degrees: f64) -> Edge {
        Edge { corner: DVec2::from_array(corner), open: -DVec2::from_angle(degrees.to_radians()) }
    }

    /// The light between a point of the surface, seen with this variance of its spot, squared metres, and an object of this radius.
    pub(crate) fn passed(&self, point: DVec3, spot: f64, at: DVec3, radius: f64) -> PassedLight {
        let across = self.open.perp();
        let frame = |p: DVec3| {
            let way = p.truncate() - self.corner;
            [way.dot(self.open), way.dot(across)]
        };
        let ([along_point, behind], [along, before]) = (frame(point), frame(at));
        if behind * before >= 0.0 {
            return PassedLight::default();
        }
        // Where the ray meets the plane of the wall, as a share of its way, and how far beside the wall.
        let share = behind / (behind - before);
        let beside = along_point + (along - along_point) * share;
        let wide = (ACROSS * radius).powi(2);
        let soft = (wide * share * share + spot * (1.0 - share).powi(2) + SHARP * SHARP).sqrt();
        let reach = beside / soft;
        let passed = LEAST + normal::share_below(reach);
        let slope = normal::density(reach) / passed / soft;
        let share_by_before = share / (behind - before);
        let soft_by_share = (wide * share - spot * (1.0 - share)) / soft;
        let by_before = ((along - along_point) - reach * soft_by_share) * share_by_before;
        PassedLight {
            light: passed.ln(),
            by_at: (slope * (share * self.open + by_before * across)).extend(0.0),
            by_extent: -slope * reach * wide * share * share / soft,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_hides_what_is_behind_it_and_its_shadow_is_as_soft_as_object_and_spot() {
        // The wall runs along −x.
        let edge = Edge::new([0.0, 0.0], 180.0);
        let seen = |x: f64, at: DVec3, radius: f64| {
            edge.passed(DVec3::new(x, -0.1, 0.0), 1e-6, at, radius).light.exp()
        };
        let at = DVec3::new(0.0, 1.0, 0.4);
        assert!(seen(0.05, at, 0.01) > 0.999 && seen(-0.05, at, 0.01) < 0.001);
        assert!((seen(0.0, at, 0.01) - 0.5).abs() < 1e-3);
        // A ray 3 mm beside the edge: half the object of 7 cm is seen past it.
        assert!((0.7..0.95).contains(&seen(0.0033, at, 0.07)), "{}", seen(0.0033, at, 0.07));
        // No wall is between points of one side.
        assert!(seen(-0.5, DVec3::new(-0.5, -1.0, 0.4), 0.1) == 1.0);
    }

    #[test]
    fn derivatives_are_finite_differences() {
        let edge = Edge::new([0.1, -0.05], 165.0);
        let (point, at, radius) = (DVec3::new(0.06, -0.2, 0.0), DVec3::new(0.3, 0.8, 0.5), 0.09_f64);
        let found = edge.passed(point, 4e-4, at, radius);
        assert!(found.light < -0.05, "{found:?}");
        let small = 1e-6;
        for axis in 0..3 {
            let side = |sign: f64| {
                let mut moved = at;
                moved[axis] += sign * small;
                edge.passed(point, 4e-4, moved, radius).light
            };
            let slope = (side(1.0) - side(-1.0)) / (2.0 * small);
            assert!((found.by_at[axis] - slope).abs() < 1e-6, "{axis}: {found:?} {slope}");
        }
        let side = |sign: f64| edge.passed(point, 4e-4, at, radius * (sign * small).exp()).light;
        assert!((found.by_extent - (side(1.0) - side(-1.0)) / (2.0 * small)).abs() < 1e-6, "{found:?}");
    }
}
