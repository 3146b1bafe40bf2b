//! A person-like statue of rounded solids.

use super::{Mesh, capsule, ellipsoid};
use glam::{DVec3, dvec3};

/// A standing figure with one arm (toward +x) raised, as convex solids that overlap at the joints.
///
/// `centre` is the middle of the figure and `height` its height from the feet to the raised hand, both in metres. It
/// faces the wall. Each part is a separate mesh, so shadow rays skip the part that they start from.
pub fn figure(centre: DVec3, height: f64) -> Vec<Mesh> {
    // Coordinates in units of the height: x to the left as seen from the wall, y up from the middle, z away from the
    // wall.
    let at = |x: f64, y: f64, z: f64| centre + dvec3(x, y, z) * height;
    let limb = |a: DVec3, ra: f64, b: DVec3, rb: f64| capsule(a, ra * height, b, rb * height);
    let hip = -0.06;
    vec![
        // Head, neck, chest, belly.
        ellipsoid(at(0.0, 0.370, -0.02), dvec3(0.068, 0.088, 0.078) * height),
        limb(at(0.0, 0.24, 0.0), 0.042, at(0.0, 0.32, -0.005), 0.038),
        ellipsoid(at(0.0, 0.155, 0.0), dvec3(0.135, 0.125, 0.085) * height),
        limb(at(0.0, 0.10, 0.0), 0.095, at(0.0, hip + 0.02, 0.0), 0.088),
        // Raised arm: shoulder, elbow out, hand up.
        limb(at(0.115, 0.215, 0.0), 0.050, at(0.250, 0.235, -0.03), 0.040),
        limb(at(0.250, 0.235, -0.03), 0.040, at(0.285, 0.440, -0.06), 0.030),
        ellipsoid(at(0.287, 0.465, -0.062), dvec3(0.034, 0.035, 0.030) * height),
        // The other arm, hanging, forearm a little forward.
        limb(at(-0.115, 0.215, 0.0), 0.050, at(-0.205, 0.055, 0.01), 0.040),
        limb(at(-0.205, 0.055, 0.01), 0.040, at(-0.225, -0.105, -0.07), 0.030),
        ellipsoid(at(-0.227, -0.125, -0.078), dvec3(0.030, 0.036, 0.034) * height),
        // Legs, a step apart, and feet toward the wall.
        limb(at(0.060, hip, 0.0), 0.075, at(0.090, -0.270, -0.015), 0.052),
        limb(at(0.090, -0.270, -0.015), 0.052, at(0.105, -0.460, 0.0), 0.036),
        limb(at(0.105, -0.470, 0.0), 0.030, at(0.120, -0.474, -0.075), 0.026),
        limb(at(-0.060, hip, 0.0), 0.075, at(-0.085, -0.270, 0.02), 0.052),
        limb(at(-0.085, -0.270, 0.02), 0.052, at(-0.095, -0.460, 0.05), 0.036),
        limb(at(-0.095, -0.470, 0.05), 0.030, at(-0.112, -0.474, -0.025), 0.026),
    ]
}
