//! The two layouts of the phasor-field publications, MATLAB v5 or v7.3.
//!
//! 2019 (Liu and others, *Phasor-field virtual wave optics*): a struct `dataset`. `data` is (laser points, camera
//! points, t) in MATLAB's order, which HDF5 readers such as y-tal (format.py) see reversed, or stored in the reversed
//! order. `deltat` and `t0` are metres of path. `laserPos` and `cameraPos` are (n, 3); the optional `laserNorm` and
//! `cameraNorm` are (n, 3) or a single one. The devices are `laserOrigin` and `cameraOrigin`. The paths include the
//! legs from and to the devices, which are removed. The wall is rotated to face +z. Axes: the coordinates in the file
//! are kept, except for that rotation.
//!
//! 2020 (Liu, Bauer, Velten, *Phasor field diffraction*): `rect_data` (d1, d2, t) without outer legs, `ts` seconds per
//! bin, `sampling_spacing` in metres, `SPAD_index` (d1, d2) of the only sensor point in the scan, counted from 1 as in
//! MATLAB. Axes: d1 runs down and d2 to the left. Their code shows `fliplr` of the volume by `imagesc`: d1 as rows from
//! the top, d2 as columns from the right. The middle of the scan is the origin.

use glam::DVec3;

use super::frame;
use super::frame::{Axes, WallDirection};
use super::points::{per_pair, unit};
use super::unread::Unread;
use super::variables::Variables;
use crate::conditioning::legs;
use crate::error::{Error, Result};
use crate::files::array::transpose;
use crate::{Capture, METRES_PER_PICOSECOND, host};

/// Rows from the top, columns from the right.
const AXES: Axes = Axes { d1: WallDirection::Down, d2: WallDirection::Left };

/// The index of a pair's point in its list, from the pair and the number of camera points.
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
        // A single point may lie along either axis.
        match shape[..] {
            [3, _] => Ok(frame::points(&shape, &values)),
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
    let shape = file.counts_shape("dataset/data")?;
    let (l, s) = (laser.len(), camera.len());
    let [first, second, third] = shape[..] else { return Err(misfit(&shape, l, s)) };
    if [second, third] != [s, l] && [first, second] != [l, s] {
        return Err(misfit(&shape, l, s));
    }
    let pairs = l * s;
    let counts = file.counts("dataset/data")?;
    let integer_counts = counts.whole();
    let (bins, histograms) = match counts.shape[..] {
        [bins, a, b] if [a, b] == [s, l] => {
            let by_camera = transpose(&counts.values, bins, pairs)?;
            let place = |p: usize| (p % s * l + p / s) * bins;
            let all = (0..pairs).flat_map(|p| &by_camera[place(p)..place(p) + bins]).copied();
            (bins, host::collected("the counts", by_camera.len(), all)?)
        }
        [a, b, bins] if [a, b] == [l, s] => (bins, counts.values),
        _ => return Err(misfit(&shape, l, s)),
    };
    let spread = |what: &str, given: Option<Vec<DVec3>>, count: usize, of: Place| {
        let Some(given) = given else { return Ok(None) };
        let list = per_pair(&format!("dataset/{what}"), given, count)?;
        host::collected("the wall points", pairs, (0..pairs).map(|p| list[of(p, s)])).map(Some)
    };
    let (of_laser, of_camera): (Place, Place) = (|p, s| p / s, |p, s| p % s);
    let normals = |given: Option<Vec<DVec3>>| given.map(|n| n.into_iter().map(unit).collect());
    let scan = if l == 1 { [s, 1] } else { [l, s] };
    let laser = spread("laserPos", Some(laser), l, of_laser)?.unwrap_or_default();
    let sensor = spread("cameraPos", Some(camera), s, of_camera)?.unwrap_or_default();
    let capture = Capture {
        laser_normal: spread("laserNorm", normals(vectors("laserNorm")?), l, of_laser)?,
        sensor_normal: spread("cameraNorm", normals(vectors("cameraNorm")?), s, of_camera)?,
        t_start: number("t0")?,
        integer_counts,
        ..Capture::new(scan, laser, sensor, bins, number("deltat")?, histograms)
    };
    let device = |name: &str| -> Result<DVec3> {
        let name = format!("dataset/{name}");
        file.point(&name)?.ok_or_else(|| file.missing(&name))
    };
    let (laser_at, camera_at) = (device("laserOrigin")?, device("cameraOrigin")?);
    legs::check_measured(&capture)?;
    let outer: Vec<f64> = (capture.laser.iter().zip(&capture.sensor))
        .map(|(l, s)| laser_at.distance(*l) + camera_at.distance(*s))
        .collect();
    notes.push("the legs from the laser to the wall and from the wall to the camera are removed".into());
    Ok(frame::facing_z(legs::remove(&capture, &outer)?, None, notes))
}

fn misfit(shape: &[usize], lasers: usize, sensors: usize) -> Error {
    Error::input(
        format!(
            "dataset/data has shape {shape:?} (MATLAB order reversed) for {lasers} laser and {sensors} camera points"
        ),
        "data is (laser points, camera points, t) in MATLAB",
    )
}

/// Finds a capture of the 2020 layout without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not fit, or a sensor point outside the scan.
pub(super) fn read_2020<'f>(file: &'f Variables, notes: &mut Vec<String>) -> Result<Unread<'f>> {
    let number = |name: &str| -> Result<f64> { file.number(name)?.ok_or_else(|| file.missing(name)) };
    let (seconds, spacing) = (number("ts")?, number("sampling_spacing")?);
    let (shape, index) = file.numbers("SPAD_index")?.ok_or_else(|| file.missing("SPAD_index"))?;
    let counts = file.counts_shape("rect_data")?;
    let [_, n2, n1] = counts[..] else {
        return Err(Error::input(
            format!("rect_data has {} axes, not three", counts.len()),
            "rect_data is (d1, d2, t) in MATLAB: two axes of the scan, then the bins",
        ));
    };
    let [at1, at2] = index[..] else {
        return Err(Error::input(
            format!("SPAD_index has shape {shape:?}"),
            "SPAD_index is the place of the sensor point in the scan, two numbers",
        ));
    };
    let within = |v: f64, n: usize| v.fract() == 0.0 && v >= 1.0 && v <= n as f64;
    if !(within(at1, n1) && within(at2, n2)) {
        return Err(Error::input(
            format!("SPAD_index is ({at1}, {at2}) in a scan of {n1} x {n2}"),
            "SPAD_index counts from 1 along both axes of the scan, within it",
        ));
    }
    let spad = AXES.pairs([n1, n2])[(at2 as usize - 1) * n1 + at1 as usize - 1];
    notes.push(format!("the only sensor point is ({at1}, {at2}) of the scan, counted from 1"));
    let wall = spacing * (n1.max(n2).max(2) - 1) as f64;
    let bin_width = seconds * 1e12 * METRES_PER_PICOSECOND;
    let mut scanned = Unread::scanned(file, "rect_data", AXES, wall, bin_width)?;
    scanned.outline.sensor = host::filled("the wall points", n1 * n2, scanned.outline.sensor[spad])?;
    Ok(scanned)
}
