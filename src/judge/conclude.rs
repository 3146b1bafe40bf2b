//! What follows a solve: which pixels are surface, and how far their depths are off.

use glam::DVec3;

use crate::capture::{Capture, Pulse};
use crate::maps::{Conditions, Maps};
use crate::transport::Reflectance;

use crate::engine::{Reconstruction, background, variances};

/// A residual ratio from here on explains hardly anything of the measurement.
const UNEXPLAINED: f64 = 0.95;
/// If noise has more than this share of the energy of the counts, no surface can explain them.
const NOISY: f64 = 0.8;
/// From this share of the pixels on, the surface is everywhere.
const EVERYWHERE: f64 = 0.99;

/// How much longer a path becomes per metre along a spot: the usual sine of its angle with the wall's normal.
const SLANT: f64 = 0.35;

/// Sets the mask of the result's maps ([`Maps::set_mask`]), unless the method determined it and no share is given; and the
/// expected depth error of all layers. Sets the warnings. Where edges determined a mask, small parts with uncertain depths leave it ([`Maps::leave_out_uncertain_parts`]).
/// `capture` is what was solved.
pub fn conclude(capture: &Capture, mask_fraction: Option<f64>, result: &mut Reconstruction) {
    if mask_fraction.is_some() || !result.has_mask {
        result.maps.set_mask(mask_fraction);
    }
    let all = conditions_of(capture, result.plan.scene.reflectance);
    let last = result.trace.last().map_or(0, |p| p.iteration);
    let is_volume = last <= result.volume_iterations;
    // Maps of the surface's resolution may show the volume's voxels.
    let lateral = result.maps.nx.min(result.lateral);
    let level = result.plan.levels.volume.iter().find(|l| l.grid.n[0] == lateral);
    let pitch = level.unwrap_or(result.plan.finest()).grid.pitch;
    let known = Conditions { voxel: if is_volume { [pitch.x, pitch.z] } else { [0.0; 2] }, ..all };
    let by_edges = mask_fraction.is_none() && result.plan.levels.pixels.is_some();
    tell(&mut result.maps, &known, by_edges);
    let residual = result.trace.last().and_then(|p| result.residual(p.data_loss));
    result.warnings = warnings(&result.maps.mask, residual, all.noise);
}

/// Concludes the maps of an iterate of a surface, which has the mask of its solver, as [`conclude`] does those of a result: small
/// parts with uncertain depths leave the mask.
pub fn conclude_iterate(capture: &Capture, reflectance: Reflectance, maps: &mut Maps) {
    tell(maps, &conditions_of(capture, reflectance), true);
}

/// The conditions of a capture for maps of a surface.
fn conditions_of(capture: &Capture, reflectance: Reflectance) -> Conditions {
    let pulse = capture.pulse.as_ref().map_or(0.0, Pulse::fwhm);
    let spots = [capture.laser_spot, capture.sensor_spot].map(|spot| SLANT * spot.unwrap_or(0.0));
    Conditions {
        noise: noise(capture),
        width: capture.bin_width.hypot(pulse).hypot(spots[0]).hypot(spots[1]),
        aperture: aperture(capture),
        voxel: [0.0; 2],
        two_cosines: reflectance == Reflectance::Lambertian,
    }
}

/// What looks wrong with a result: its mask, its residual ratio if it has one, and the share of the counts' energy that is
/// noise.
fn warnings(mask: &[bool], residual: Option<f64>, noise: f64) -> Vec<String> {
    let check = "check the unit of lengths and times, time zero, the order of the axes and the gate";
    let unexplained = residual.filter(|r| *r > UNEXPLAINED && noise < NOISY).map(|r| {
        format!("the maps explain hardly anything of the measurement: the residual is {r:.3}; {check}")
    });
    let spread = match mask.iter().filter(|m| **m).count() {
        0 => Some(format!("no surface was found, the maps are empty: {check}")),
        n if n as f64 >= EVERYWHERE * mask.len() as f64 => Some(format!(
            "all of the picture counts as surface, which no scene smaller than the wall shows: {check}"
        )),
        _ => None,
    };
    unexplained.into_iter().chain(spread).collect()
}

/// Sets the expected depth error. If the mask is `by_edges`, small parts with uncertain depths leave it.
fn tell(maps: &mut Maps, known: &Conditions, by_edges: bool) {
    // What a network says of mask and errors of the first layer stays.
    let said = maps.probability.as_ref().and_then(|_| maps.depth_error.take());
    maps.set_depth_error(known);
    if said.is_some() {
        maps.depth_error = said;
    } else if by_edges && maps.leave_out_uncertain_parts() {
        // The brightness of the mask counts.
        maps.set_depth_error(known);
    }
}

/// The variance of all bins over their squared counts without background; 1 without light.
fn noise(capture: &Capture) -> f64 {
    let background = background(capture);
    let [per_count, empty] = variances(capture, background);
    let light = || capture.histograms.iter().map(|v| f64::from(*v) - background);
    let variance: f64 = light().map(|v| per_count * v + empty).sum();
    let energy: f64 = light().map(|v| v * v).sum();
    if energy > 0.0 { (variance / energy).clamp(0.0, 1.0) } else { 1.0 }
}

/// The mean extent of laser and sensor points over that of all points; 1 for a single point.
fn aperture(capture: &Capture) -> f64 {
    let extent = |points: &mut dyn Iterator<Item = &DVec3>| {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        points.for_each(|p| (low, high) = (low.min(*p), high.max(*p)));
        (high - low).length()
    };
    let [laser, sensor] = [&capture.laser, &capture.sensor].map(|points| extent(&mut points.iter()));
    let all = extent(&mut capture.laser.iter().chain(&capture.sensor));
    if all > 0.0 { 0.5 * (laser + sensor) / all } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of nine pairs with these laser points, and sensor points from -1 to 1 m.
    fn row(laser: impl Fn(f64) -> f64, histogram: &[f32]) -> Capture {
        let at = |x: f64| DVec3::new(x, 0.0, 0.0);
        let sensor: Vec<f64> = (0..9).map(|i| f64::from(i) / 4.0 - 1.0).collect();
        let laser = sensor.iter().map(|x| at(laser(*x))).collect();
        let sensor = sensor.iter().map(|x| at(*x)).collect();
        Capture::new([9, 1], laser, sensor, histogram.len(), 0.01, histogram.repeat(9))
    }

    #[test]
    fn one_laser_point_is_half_an_aperture() {
        let of = |laser: &dyn Fn(f64) -> f64| aperture(&row(laser, &[1.0]));
        assert_eq!([of(&|x| x), of(&|_| 0.0), of(&|x| 0.5 * x)], [1.0, 0.5, 0.75]);
        let mut single = row(|_| 0.0, &[1.0]);
        single.sensor = single.laser.clone();
        assert_eq!(aperture(&single), 1.0);
    }

    #[test]
    fn a_residual_near_one_and_surface_everywhere_or_nowhere_are_warned_of() {
        let of = |surface: usize, residual, noise| {
            let mask: Vec<bool> = (0..400).map(|p| p < surface).collect();
            warnings(&mask, residual, noise).join("; ")
        };
        assert_eq!(of(100, Some(0.7), 0.1), "");
        assert_eq!(of(100, None, 0.1), "");
        assert!(of(100, Some(0.987), 0.1).contains("residual is 0.987"));
        assert_eq!(of(100, Some(0.987), 0.9), "", "noise that no surface explains");
        assert!(of(0, Some(0.7), 0.1).contains("no surface was found"));
        assert!(
            of(400, Some(0.99), 0.1).contains("0.990") && of(400, None, 0.1).contains("all of the picture")
        );
        assert!(of(397, None, 0.1).contains("all of the picture") && of(390, None, 0.1).is_empty());
    }

    #[test]
    fn noise_is_the_variance_over_the_energy() {
        let mut photons = row(|x| x, &[0.0, 4.0, 2.0, 0.0]);
        photons.integer_counts = true;
        // Nothing is behind the light, so there is no background: 6 over 16 + 4.
        assert!((noise(&photons) - 0.3).abs() < 1e-9, "{}", noise(&photons));
        assert_eq!(noise(&row(|x| x, &[0.0; 4])), 1.0);
    }
}
