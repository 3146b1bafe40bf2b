//! Wall points of a scan whose file holds two voltages or angles of a galvo scanner for each point.
//!
//! The calibration is a text of lines `name = numbers`; `#` begins a comment. Lengths are in metres, angles in degrees:
//!
//! | name | numbers | meaning |
//! |---|---|---|
//! | `origin` | x, y, z | the middle of the second mirror |
//! | `forward` | x, y, z | where the beam goes when both values are `offset` |
//! | `up` | x, y, z | where the second value moves it; default 0, 1, 0 |
//! | `scale` | a, b | degrees by which the **beam** turns for each unit of the two values: 2 for the angle of a mirror, the degrees of a volt for voltages; negative ones turn it to the other side; default 1, 1 |
//! | `offset` | a, b | the values of the middle; default 0, 0 |
//! | `between` | e | distance of the two mirrors; default 0 |
//! | `wall` | x, y, z, and its normal x, y, z | a point of the wall, and where it faces; default 0, 0, 0, 0, 0, 1 |
//!
//! The first mirror turns the beam by θ across, the second by φ up: to first order the wall of a scanner with its mirrors apart
//! is cushioned, and so are these points. With r = forward × up, the beam begins at origin + r e tan θ, and its direction is
//! r sin θ + (up sin φ + forward cos φ) cos θ.

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};

/// The geometry of a galvo scanner and its wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Galvo {
    /// The middle of the second mirror, metres.
    pub origin: DVec3,
    /// Unit directions: of the beam at the offset, and up; they are at right angles.
    pub forward: DVec3,
    /// See [`Galvo::forward`].
    pub up: DVec3,
    /// Degrees of the beam for each unit of the two values.
    pub scale: [f64; 2],
    /// The values at which the beam goes forward.
    pub offset: [f64; 2],
    /// Distance of the two mirrors, metres.
    pub between: f64,
    /// A point of the wall, and its unit normal.
    pub wall: [DVec3; 2],
}

const NAMES: &str = "origin, forward, up, scale, offset, between, wall";

impl Galvo {
    /// Reads a calibration.
    ///
    /// # Errors
    /// `Kind::Input`, beginning with the path: no such file, an unknown name, numbers that are none, no origin or direction.
    pub fn read(path: &Path) -> Result<Galvo> {
        let text = std::fs::read_to_string(path).map_err(super::unreadable);
        text.and_then(|text| Galvo::of_text(&text)).map_err(|e| e.at(path.display()))
    }

    fn of_text(text: &str) -> Result<Galvo> {
        let mut given: Vec<(&str, Vec<f64>)> = vec![];
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() {
                continue;
            }
            let parsed = line.split_once('=').and_then(|(name, rest)| {
                let parts = rest.split([',', ';', '\t', ' ']).filter(|part| !part.is_empty());
                let values: Option<Vec<f64>> =
                    parts.map(|part| part.parse().ok().filter(|v: &f64| v.is_finite())).collect();
                Some((name.trim(), values?))
            });
            let count = |name: &str| match name {
                "origin" | "forward" | "up" => Some(3),
                "scale" | "offset" => Some(2),
                "between" => Some(1),
                "wall" => Some(6),
                _ => None,
            };
            match parsed {
                Some((name, values)) if count(name) == Some(values.len()) => given.push((name, values)),
                _ => {
                    return Err(Error::input(
                        format!("line {} of the galvo's calibration is {line:?}", number + 1),
                        format!(
                            "write name = numbers, for example origin = 0.3, -0.2, -1.4; names are {NAMES}"
                        ),
                    ));
                }
            }
        }
        let get = |name: &str| given.iter().rev().find(|(n, _)| *n == name).map(|(_, values)| &values[..]);
        let vector = |name: &str| get(name).map(|v| DVec3::new(v[0], v[1], v[2]));
        let missing = |name: &str| {
            Error::input(
                format!("the galvo's calibration has no {name}"),
                format!("add it; names are {NAMES}"),
            )
        };
        let direction = |what: &str, v: DVec3| {
            v.try_normalize().ok_or_else(|| {
                Error::input(
                    format!("{what} of the galvo's calibration is no direction"),
                    "give one that is not 0",
                )
            })
        };
        let forward = direction("forward", vector("forward").ok_or_else(|| missing("forward"))?)?;
        let up = vector("up").unwrap_or(DVec3::Y);
        let wall = get("wall").unwrap_or(&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        Ok(Galvo {
            origin: vector("origin").ok_or_else(|| missing("origin"))?,
            forward,
            up: direction("up, across forward,", up - forward * up.dot(forward))?,
            scale: get("scale").map_or([1.0; 2], |v| [v[0], v[1]]),
            offset: get("offset").map_or([0.0; 2], |v| [v[0], v[1]]),
            between: get("between").map_or(0.0, |v| v[0]),
            wall: [
                DVec3::new(wall[0], wall[1], wall[2]),
                direction("the normal of wall", DVec3::new(wall[3], wall[4], wall[5]))?,
            ],
        })
    }

    /// The point of the wall that the beam meets; `None` if it meets none.
    pub fn point(&self, values: [f64; 2]) -> Option<DVec3> {
        let [across, up] = [0, 1].map(|i| ((values[i] - self.offset[i]) * self.scale[i]).to_radians());
        let right = self.forward.cross(self.up);
        let begin = self.origin + right * (self.between * across.tan());
        let direction = right * across.sin() + (self.up * up.sin() + self.forward * up.cos()) * across.cos();
        let [point, normal] = self.wall;
        let along = (point - begin).dot(normal) / direction.dot(normal);
        (along.is_finite() && along > 0.0).then(|| begin + direction * along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn a_beam_meets_the_wall_where_trigonometry_says() {
        let galvo = Galvo::of_text(
            "# made by hand\norigin = 0 0 -2\nforward = 0, 0, 1\nscale = 4, 4 # degrees of a volt\noffset = 0.5, 0\nbetween = 0.1\n",
        )
        .unwrap();
        assert!(galvo.point([0.5, 0.0]).unwrap().distance(DVec3::ZERO) < 1e-12);
        let [across, up] = [8f64, 12.0].map(f64::to_radians);
        let y = 2.0 * up.tan();
        // Of two mirrors e apart: x = (√(z² + y²) + e) tan θ, y = z tan φ.
        let x = (y.hypot(2.0) + 0.1) * across.tan();
        // Right of a beam along +z, seen along it with y up, is -x.
        let point = galvo.point([2.5, 3.0]).unwrap();
        assert!(point.distance(dvec3(-x, y, 0.0)) < 1e-12, "{point}");
        assert_eq!(galvo.point([30.0, 0.0]), None, "backwards");
        // A wall at a slant.
        let slant = Galvo { wall: [DVec3::ZERO, dvec3(1.0, 0.0, 1.0).normalize()], ..galvo };
        let point = slant.point([2.5, 3.0]).unwrap();
        assert!((point.x + point.z).abs() < 1e-12 && point.z > 0.0);
    }

    #[test]
    fn what_is_no_calibration_is_refused() {
        let good = "origin = 0 0 -2\nforward = 0 0 1\n";
        for (text, words) in [
            ("", "no forward"),
            ("forward = 0 0 1", "no origin"),
            ("origin = 0 0 -2\nforward = 0 0 0", "forward"),
            (&format!("{good}up = 0 0 3"), "up"),
            (&format!("{good}scale = 4"), "line 3"),
            (&format!("{good}tilt = 4"), "line 3"),
            (&format!("{good}offset = 1, x"), "line 3"),
            (&format!("{good}wall = 0 0 0 0 0 0"), "wall"),
        ] {
            let error = Galvo::of_text(text).unwrap_err();
            assert!(error.what.contains(words), "{text}: {error}");
        }
    }
}
