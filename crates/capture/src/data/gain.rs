//! Gains of pairs: how strongly their counts are weighted apart from the hidden scene, as laws of few numbers.
//!
//! | law | meaning | numbers | gauge freedom |
//! |---|---|---|---|
//! | [`GainLaw::Laser`] | the laser's light on the wall falls as cos / distance² from a device, as of a renderer's point light | position of the laser | a common factor of all gains: the albedo |
//! | [`GainLaw::Detector`] | the detector's light from the wall falls likewise | position of the detector | the same |
//! | [`GainLaw::Both`] | both do | both positions | the same |
//!
//! The common factor is chosen so that photon noise keeps its size: counts of the gain g have the variance n / g² where their mean is
//! n / g, and both sums over all pairs agree.

use glam::DVec3;
use rayon::prelude::*;

use super::Capture;
use crate::error::{Error, Result};

/// A law of gains by the positions of the devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GainLaw {
    /// By the laser's position.
    Laser,
    /// By the detector's position.
    Detector,
    /// The product of both.
    Both,
}

impl GainLaw {
    /// All laws, the most usual first.
    pub const ALL: [GainLaw; 3] = [GainLaw::Laser, GainLaw::Detector, GainLaw::Both];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            GainLaw::Laser => "laser",
            GainLaw::Detector => "detector",
            GainLaw::Both => "both",
        }
    }

    /// Whose light weakens, in words.
    pub fn light(self) -> &'static str {
        match self {
            GainLaw::Laser => "the laser's light on the wall",
            GainLaw::Detector => "the detector's light from the wall",
            GainLaw::Both => "the light of laser and detector",
        }
    }

    /// Whether it depends on the laser, and on the detector.
    fn sides(self) -> [bool; 2] {
        [self != GainLaw::Detector, self != GainLaw::Laser]
    }
}

/// cos / metres² of a device at a wall point with this normal.
pub fn falloff(device: DVec3, point: DVec3, normal: DVec3) -> f64 {
    let towards = device - point;
    towards.dot(normal) / towards.length().powi(3)
}

impl Capture {
    /// The gain of each pair by a law of its devices, cos / metres². `None` if a device of the law is not known, or does not lie in front
    /// of every wall point.
    pub fn gains(&self, law: GainLaw) -> Option<Vec<f64>> {
        let mut gains = vec![1.0; self.pair_count()]; // bounded: the pairs
        let sides = [(&self.laser, &self.laser_normal), (&self.sensor, &self.sensor_normal)];
        for ((points, normals), device) in sides
            .into_iter()
            .zip(self.devices)
            .zip(law.sides())
            .filter(|(_, is_used)| *is_used)
            .map(|(side, _)| side)
        {
            let device = device?;
            for (pair, gain) in gains.iter_mut().enumerate() {
                let normal = normals.as_ref().map_or(DVec3::Z, |normals| normals[pair]);
                *gain *= falloff(device, points[pair], normal);
            }
        }
        gains.iter().all(|gain| gain.is_finite() && *gain > 0.0).then_some(gains)
    }

    /// The capture with its counts divided by the gains of a law; `None` as for [`Capture::gains`]. Its devices are left out.
    pub fn without_gains(&self, law: GainLaw) -> Option<Capture> {
        let gains = self.gains(law)?;
        let mut divided = self.clone();
        divided.devices = [None; 2];
        divided.divide(gains);
        Some(divided)
    }

    /// Divides the counts of each pair by its gain, with the common factor that keeps the size of photon noise.
    pub fn divide(&mut self, mut gains: Vec<f64>) {
        let totals = self.of_rows(|h| h.iter().map(|v| f64::from(*v)).sum::<f64>().max(0.0));
        let sum = |power: i32| totals.iter().zip(&gains).map(|(n, gain)| n / gain.powi(power)).sum::<f64>();
        let [once, twice] = [1, 2].map(sum);
        let common = if once > 0.0 { twice / once } else { 1.0 };
        gains.iter_mut().for_each(|gain| *gain *= common);
        let rows = self.histograms.par_chunks_mut(self.bins.max(1));
        rows.zip(&gains)
            .for_each(|(row, gain)| row.iter_mut().for_each(|v| *v = (f64::from(*v) / gain) as f32));
    }

    /// Multiplies the counts by the gains of a law.
    ///
    /// # Errors
    /// A device that does not lie in front of every wall point.
    pub fn apply_gains(&mut self, law: GainLaw) -> Result<()> {
        let gains = self.gains(law).ok_or_else(|| self.behind(law))?;
        let rows = self.histograms.par_chunks_mut(self.bins.max(1));
        rows.zip(&gains)
            .for_each(|(row, gain)| row.iter_mut().for_each(|v| *v = (f64::from(*v) * gain) as f32));
        Ok(())
    }

    /// The error of a device for which a law has no gains.
    pub fn behind(&self, law: GainLaw) -> Error {
        let [laser, sensor] = self.devices;
        let device = if law == GainLaw::Detector { sensor } else { laser };
        let place = device.map_or_else(|| "unknown".into(), place);
        Error::options(
            format!("the device's position is {place}, which is not in front of every wall point"),
            "give x, y, z in metres in the frame of the wall points: the hidden scene is at z > 0, and so is the device",
        )
    }
}

/// A position as text.
pub fn place(p: DVec3) -> String {
    format!("({}, {}, {})", p.x, p.y, p.z)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    /// Pairs along x with the laser at x and the sensor at -x, and 1, 2, ... counts in the first of two bins.
    fn capture() -> Capture {
        let laser: Vec<DVec3> = (0..5).map(|i| dvec3(0.2 * f64::from(i) - 0.3, 0.1, 0.0)).collect();
        let sensor = laser.iter().map(|p| dvec3(-p.x, p.y, 0.0)).collect();
        let counts = (0..5).flat_map(|i| [100.0 * (i + 1) as f32, 0.0]).collect();
        let device = dvec3(-0.5, 0.0, 0.25);
        Capture::new([5, 1], laser, sensor, 2, 0.01, counts).with(|c| {
            c.devices = [Some(device), Some(dvec3(0.5, 0.0, 0.5))];
            c.integer_counts = true;
        })
    }

    #[test]
    fn gains_are_those_of_a_point_light() {
        let capture = capture();
        let of = |law| capture.gains(law).unwrap();
        let (laser, detector, both) = (of(GainLaw::Laser), of(GainLaw::Detector), of(GainLaw::Both));
        for pair in 0..5 {
            let d = capture.laser[pair].distance(dvec3(-0.5, 0.0, 0.25));
            assert!((laser[pair] - 0.25 / d.powi(3)).abs() < 1e-12);
            assert!((both[pair] - laser[pair] * detector[pair]).abs() < 1e-12 * both[pair]);
        }
        assert_ne!(laser, detector);
        // A wall that leans away sees the device at another angle.
        let leaning = capture.clone().with(|c| c.laser_normal = Some(vec![dvec3(0.6, 0.0, 0.8); 5]));
        assert_ne!(leaning.gains(GainLaw::Laser), Some(laser));
    }

    #[test]
    fn division_undoes_gains_and_keeps_the_size_of_photon_noise() {
        let proper = capture();
        let mut weighted = proper.clone();
        weighted.apply_gains(GainLaw::Both).unwrap();
        let gains = proper.gains(GainLaw::Both).unwrap();
        let divided = weighted.without_gains(GainLaw::Both).unwrap();
        assert_eq!(divided.devices, [None; 2]);
        let factor = divided.histograms[0] / proper.histograms[0];
        for (one, other) in divided.histograms.iter().zip(&proper.histograms) {
            assert!((one - factor * other).abs() <= 1e-5 * one.abs());
        }
        // Variances of divided photon counts, and the divided counts: the sums agree.
        let totals = |c: &Capture| c.of_rows(|h| f64::from(h[0]));
        let common = totals(&weighted)[0] / totals(&divided)[0] / gains[0];
        let variance: f64 = totals(&weighted).iter().zip(&gains).map(|(n, g)| n / (g * common).powi(2)).sum();
        let mean: f64 = totals(&divided).iter().sum();
        assert!((variance / mean - 1.0).abs() < 1e-5, "{variance} {mean}");
    }

    #[test]
    fn a_device_on_or_behind_the_wall_has_no_gains() {
        for z in [0.0, -0.2, f64::NAN] {
            let capture = capture().with(|c| c.devices[0] = Some(dvec3(0.1, 0.2, z)));
            assert!(
                capture.gains(GainLaw::Laser).is_none() && capture.without_gains(GainLaw::Both).is_none()
            );
            assert!(capture.gains(GainLaw::Detector).is_some());
            assert!(capture.clone().apply_gains(GainLaw::Laser).unwrap_err().what.contains("in front"));
        }
        assert!(capture().with(|c| c.devices = [None; 2]).gains(GainLaw::Laser).is_none());
    }
}
