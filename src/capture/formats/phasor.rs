//! The two layouts of the phasor-field publications, MATLAB v5 or v7.3.
//!
//! 2019 (Liu and others, *Phasor-field virtual wave optics*): a struct `dataset` with `data` (t, camera points,
//! laser points), `deltat` and `t0` in metres of path, `laserPos`, `cameraPos` (n, 3), optional `laserNorm`,
//! `cameraNorm` (n, 3 or one), and the devices `laserOrigin`, `cameraOrigin`. The paths include the legs from and
//! to the devices, which are removed. The wall is turned to face +z.
//!
//! 2020 (Liu, Bauer, Velten, *Phasor field diffraction*): `rect_data` (t, x, y) without outer legs, `ts` seconds
//! per bin, `sampling_spacing` in metres, `SPAD_index` (x, y) of the one sensor point in the scan, counted from 1
//! as MATLAB does. Laser points i stand at (i − n/2) spacings.

use glam::DVec3;

use super::variables::Variables;
use super::{frame, legs, per_pair, unit};
use crate::capture::Capture;
use crate::capture::METRES_PER_PICOSECOND;
use crate::error::{Error, Result};

/// The place of a pair's point in its list, from the pair and the number of camera points.
type Place = fn(usize, usize) -> usize;

/// Reads the 2019 layout without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub fn read_2019(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    let number = |name: &str| -> Result<f64> {
        let name = format!("dataset/{name}");
        file.number(&name)?.ok_or_else(|| file.missing(&name))
    };
    let vectors = |name: &str| -> Result<Option<Vec<DVec3>>> {
        let name = format!("dataset/{name}");
        let Some((shape, values)) = file.numbers(&name)? else { return Ok(None) };
        let n = values.len() / 3;
        // (n, 3) of MATLAB comes as [3, n]; a single point may lie along either axis.
        match shape[..] {
            [3, _] => {
                Ok(Some((0..n).map(|p| DVec3::new(values[p], values[n + p], values[2 * n + p])).collect()))
            }
            [_, 3] => Ok(Some(values.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect())),
            _ => Err(Error::input(
                format!("{name} has shape {shape:?}, not three coordinates of each point"),
                format!("store {name} in MATLAB as (n, 3), metres"),
            )),
        }
    };
    let required = |name: &str| -> Result<Vec<DVec3>> {
        vectors(name)?.ok_or_else(|| file.missing(&format!("dataset/{name}")))
    };
    let (laser, camera) = (required("laserPos")?, required("cameraPos")?);
    let counts = file.counts("dataset/data")?;
    let integer_counts = counts.whole();
    let (l, s) = (laser.len(), camera.len());
    // MATLAB drops a last axis of length 1.
    let bins = match counts.shape[..] {
        [a, b, bins] if [a, b] == [l, s] => bins,
        [a, bins] if l == 1 && a == s => bins,
        _ => {
            return Err(Error::input(
                format!(
                    "dataset/data has shape {:?} (MATLAB's reversed) for {l} laser and {s} camera points",
                    counts.shape
                ),
                "data is (t, camera points, laser points)",
            ));
        }
    };
    let pairs = l * s;
    let spread = |what: &str, given: Option<Vec<DVec3>>, count: usize, of: Place| {
        let Some(given) = given else { return Ok(None) };
        let list = per_pair(&format!("dataset/{what}"), given, count)?;
        Ok::<_, Error>(Some((0..pairs).map(|p| list[of(p, s)]).collect::<Vec<_>>()))
    };
    let (of_laser, of_camera): (Place, Place) = (|p, s| p / s, |p, s| p % s);
    let normals = |given: Option<Vec<DVec3>>| given.map(|n| n.into_iter().map(unit).collect());
    let capture = Capture {
        name: String::new(),
        scan: if s == 1 {
            [l, 1]
        } else if l == 1 {
            [s, 1]
        } else {
            [l, s]
        },
        laser_normal: spread("laserNorm", normals(vectors("laserNorm")?), l, of_laser)?,
        sensor_normal: spread("cameraNorm", normals(vectors("cameraNorm")?), s, of_camera)?,
        laser: spread("laserPos", Some(laser), l, of_laser)?.unwrap_or_default(),
        sensor: spread("cameraPos", Some(camera), s, of_camera)?.unwrap_or_default(),
        bins,
        bin_width: number("deltat")?,
        t_start: number("t0")?,
        histograms: counts.values,
        integer_counts,
        pulse: None,
    };
    let device = |name: &str| -> Result<DVec3> {
        let name = format!("dataset/{name}");
        file.point(&name)?.ok_or_else(|| file.missing(&name))
    };
    let (laser_at, camera_at) = (device("laserOrigin")?, device("cameraOrigin")?);
    capture.clone().without_missing()?.0.check()?;
    let outer: Vec<f64> = (capture.laser.iter().zip(&capture.sensor))
        .map(|(l, s)| laser_at.distance(*l) + camera_at.distance(*s))
        .collect();
    notes.push("the legs from the laser to the wall and from the wall to the camera are removed".into());
    frame::facing_z(legs::remove(&capture, &outer)?, None, notes)
}

/// Reads the 2020 layout without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not fit, or a sensor point outside the scan.
pub fn read_2020(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    let number = |name: &str| -> Result<f64> { file.number(name)?.ok_or_else(|| file.missing(name)) };
    let (seconds, spacing) = (number("ts")?, number("sampling_spacing")?);
    let (shape, index) = file.numbers("SPAD_index")?.ok_or_else(|| file.missing("SPAD_index"))?;
    let counts = file.counts("rect_data")?;
    let integer_counts = counts.whole();
    let [ny, nx, bins] = counts.shape[..] else {
        return Err(Error::input(
            format!("rect_data has {} axes, not three", counts.shape.len()),
            "rect_data is (t, x, y) in MATLAB",
        ));
    };
    let [x, y] = index[..] else {
        return Err(Error::input(
            format!("SPAD_index has shape {shape:?}"),
            "SPAD_index is the place of the sensor point in the scan, two numbers",
        ));
    };
    let within = |v: f64, n: usize| v.fract() == 0.0 && v >= 1.0 && v <= n as f64;
    if !(within(x, nx) && within(y, ny)) {
        return Err(Error::input(
            format!("SPAD_index is ({x}, {y}) in a scan of {nx} x {ny}"),
            "SPAD_index counts from 1 along x and y, within the scan",
        ));
    }
    let at = |ix: usize, iy: usize| {
        DVec3::new(ix as f64 - 0.5 * nx as f64, iy as f64 - 0.5 * ny as f64, 0.0) * spacing
    };
    let places = || (0..nx).flat_map(|ix| (0..ny).map(move |iy| (ix, iy)));
    let spad = at(x as usize - 1, y as usize - 1);
    notes.push(format!("the one sensor point is ({}, {}) of the scan, counted from 1", x, y));
    Ok(Capture {
        name: String::new(),
        scan: [nx, ny],
        laser: places().map(|(ix, iy)| at(ix, iy)).collect(),
        sensor: vec![spad; nx * ny],
        laser_normal: None,
        sensor_normal: None,
        bins,
        bin_width: seconds * 1e12 * METRES_PER_PICOSECOND,
        t_start: 0.0,
        histograms: places()
            .flat_map(|(ix, iy)| &counts.values[(iy * nx + ix) * bins..(iy * nx + ix + 1) * bins])
            .copied()
            .collect(),
        integer_counts,
        pulse: None,
    })
}
