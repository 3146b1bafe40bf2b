//! The plain form of a capture: an npz file, or an HDF5 or MATLAB file with the same arrays.
//!
//! `H` [T, X, Y] counts (ix along +x, iy along +y); `sensor_xyz` and `laser_xyz` [X, Y, 3] pair by pair or [1, 3] for a
//! single point, metres; optional `sensor_normal` and `laser_normal` of the same shapes; scalars `delta_t` (bin width,
//! metres of path) and `t_start` (leading edge of bin 0, metres; 0 if missing). Optional `pulse` \[n\], samples of the
//! instrument's pulse, with the scalars `pulse_delta_t` (width of a sample, metres of path) and `pulse_t_start`
//! (leading edge of the first sample behind the path, metres; 0 if missing). Optional scalars `laser_spot` and `sensor_spot`:
//! full widths at half maximum on the wall, metres. Optional scalar `cycles`: laser pulses of a pair, if the detector
//! records only the first photon of each. In place of spots, `sensor_fov` and `laser_fov`, degrees across a square field of view,
//! with `device_xyz` \[3\], where they are seen from. `device_xyz` alone is the position of laser and detector, from where light may
//! weaken; `laser_device_xyz` and `sensor_device_xyz` are both apart. Optional scalar `direct`: the path of direct light in every pair, metres.
//!
//! A list of pairs, of which each has a laser and a sensor point of its own, is `H` [T, P] with [P, 3], or [T, P, 1] with
//! [P, 1, 3].
//!
//! An exhaustive capture (every laser point with every sensor point) is `H` [T, Lx, Ly, Sx, Sy] with
//! `laser_xyz` [Lx, Ly, 3] and `sensor_xyz` [Sx, Sy, 3]. The points of either side may be a list instead: `H` [T, L, S]
//! with [L, 3] and [S, 3], and so on. It is read as the scan (laser points, sensor points), pair `l * S + s`. Normals
//! have the shape of their points, or there is a single one.

use std::path::Path;

use glam::DVec3;

use super::counts::{self, largest_count};
use super::documented::Documented;
use super::points::{check_places, compact, per_pair, squeezed, triples, unit};
use super::read_options::ReadOptions;
use super::variables::Variables;
use super::{exhaustive, ytal, zones};
use crate::error::{Error, Result};
use crate::files::archive::{Npz, npz_bytes};
use crate::files::array::{Array, transpose};
use crate::files::atomic;
use crate::{Capture, Pulse, host};

const WANTED: &str = "H, sensor_xyz, laser_xyz, delta_t, and optionally t_start, sensor_normal, laser_normal, pulse, laser_spot, sensor_spot, sensor_fov, laser_fov, device_xyz, laser_device_xyz, sensor_device_xyz, cycles, direct; other arrays are ignored";

/// Reads a capture from an npz file without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for a damaged archive, a missing array or shapes that do not agree.
pub fn read(path: &Path, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    let mut npz = Npz::open(path)?;
    if zones::is_one(&npz) {
        return zones::read(&mut npz, given, notes);
    }
    let names = npz.names();
    if !names.iter().any(|name| name.ends_with("_xyz") && !name.contains('/')) {
        return Err(counts::alone_in_npz(&mut npz));
    }
    if names.iter().any(|name| name == ytal::SENSOR_POINTS) {
        given.no_bin_width("a y-tal capture")?;
        return ytal::read(&Documented::of_npz(npz, ytal::WANTED), notes);
    }
    read_documented(&Documented::of_npz(npz, WANTED), given, notes)
}

/// Reads a capture from an HDF5 or MATLAB file with the arrays of the npz form, without checking its values.
///
/// # Errors
/// `Kind::Input` for a missing array or shapes that do not agree.
pub(super) fn read_variables(
    file: &Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Capture> {
    read_documented(&Documented::of_file(file, &["laser_xyz", "sensor_xyz"], WANTED)?, given, notes)
}

fn read_documented(file: &Documented, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    let shape = file.counts_shape("H")?;
    let laser = Points::read(file, "laser_xyz", "laser_normal")?;
    let sensor = Points::read(file, "sensor_xyz", "sensor_normal")?;
    let bins = shape.first().copied().unwrap_or(0);
    let in_pairs = |side: Points, scan: &[usize], pairs: usize| {
        check_places(side.names[0], &side.shape, scan, &shape)?;
        side.per_pair(pairs)
    };
    let places = [laser.places(), sensor.places()].concat();
    // MATLAB drops axes of length 1 at the end; with up to three axes left, pairs have the points of their places.
    let is_dropped =
        shape.len() > 3 && shape.len() <= places.len() && without_ones(&places) == without_ones(&shape[1..]);
    let (scan, laser, sensor) = if shape.len() > 2 && shape[1..] == places || is_dropped {
        let (lasers, sensors) = (laser.points.len(), sensor.points.len());
        let pairs = lasers.saturating_mul(sensors);
        ([lasers, sensors], laser.spread(pairs, |p| p / sensors)?, sensor.spread(pairs, |p| p % sensors)?)
    } else if let [_, nx, ny] = shape[..] {
        let pairs = nx.saturating_mul(ny);
        ([nx, ny], in_pairs(laser, &[nx, ny], pairs)?, in_pairs(sensor, &[nx, ny], pairs)?)
    } else if let [_, pairs] = shape[..] {
        ([pairs, 1], in_pairs(laser, &[pairs], pairs)?, in_pairs(sensor, &[pairs], pairs)?)
    } else {
        return Err(Error::input(
            format!(
                "H has shape {shape:?} with laser_xyz {:?} and sensor_xyz {:?}, which do not agree",
                laser.shape, sensor.shape
            ),
            counts::layout_hint(&shape, laser.places(), sensor.places(), file.is_npz()),
        ));
    };
    let pairs = scan[0] * scan[1];
    let bin_width = match file.number("delta_t")? {
        Some(width) => {
            given.no_bin_width("the file")?;
            width
        }
        None => given.bin_width("a file without delta_t", None, notes)?,
    };
    let t_start = file.number("t_start")?.unwrap_or(0.0);
    let laser_spot = spot(file, ["laser_spot", "laser_fov"], &laser.0, notes)?;
    let sensor_spot = spot(file, ["sensor_spot", "sensor_fov"], &sensor.0, notes)?;
    let pulse = Pulse::read_from(file)?;
    let (histograms, integer_counts) = file.histograms("H", [bins, pairs])?;
    Ok(Capture {
        laser_normal: laser.1,
        sensor_normal: sensor.1,
        t_start,
        integer_counts,
        pulse,
        laser_spot,
        sensor_spot,
        cycles: file.number("cycles")?,
        direct: file.number("direct")?,
        devices: devices(file)?,
        ..Capture::new(scan, laser.0, sensor.0, bins, bin_width, histograms)
    })
}

/// A shape without axes of length 1 at its end.
fn without_ones(shape: &[usize]) -> &[usize] {
    let end = shape.iter().rposition(|n| *n != 1).map_or(0, |at| at + 1);
    &shape[..end]
}

/// The spot of one side: as the file stores it, or that of a field of view.
fn spot(
    file: &Documented,
    [width, angle]: [&str; 2],
    points: &[DVec3],
    notes: &mut Vec<String>,
) -> Result<Option<f64>> {
    let (stored, degrees) = (file.number(width)?, file.number(angle)?);
    let (None, Some(degrees)) = (stored, degrees) else { return Ok(stored) };
    let device = position(file, "device_xyz")?.ok_or_else(|| {
        file.missing("device_xyz")
            .advised("wanted: x, y, z of the device in metres, from where the field of view is seen")
    })?;
    let spot = zones::spot_of(angle, degrees, device, points)?;
    notes.push(format!("{angle} of {degrees} degrees is a spot of {spot:.4} m on the wall"));
    Ok(Some(spot))
}

/// A position.
fn position(file: &Documented, name: &str) -> Result<Option<DVec3>> {
    let Some((shape, values)) = file.numbers(name)? else { return Ok(None) };
    let [x, y, z] = values[..] else {
        return Err(Error::input(
            format!("{name} has shape {shape:?}, not x, y, z"),
            "store it as three numbers in metres",
        ));
    };
    Ok(Some(DVec3::new(x, y, z)))
}

/// The positions of laser and detector.
fn devices(file: &Documented) -> Result<[Option<DVec3>; 2]> {
    let both = position(file, DEVICES[0])?;
    Ok([position(file, DEVICES[1])?.or(both), position(file, DEVICES[2])?.or(both)])
}

/// Arrays of positions: of both devices, of the laser, of the detector.
const DEVICES: [&str; 3] = ["device_xyz", "laser_device_xyz", "sensor_device_xyz"];

/// Wall points of one side as the file stores them.
struct Points {
    names: [&'static str; 2],
    shape: Vec<usize>,
    points: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
}

/// Points and normals, one per pair.
type PerPair = (Vec<DVec3>, Option<Vec<DVec3>>);

impl Points {
    fn read(file: &Documented, name: &'static str, normal: &'static str) -> Result<Points> {
        let (shape, values) = file.require(name)?;
        let points = triples(name, &shape, &values)?;
        let normals = match file.numbers(normal)? {
            None => None,
            Some((found, values)) => {
                let given = triples(normal, &found, &values)?;
                if given.len() > 1 && squeezed(&found) != squeezed(&shape) {
                    return Err(Error::input(
                        format!("{normal} has shape {found:?} and {name} {shape:?}, which do not agree"),
                        format!("store {normal} in the shape of {name}, or a single one as [1, 3]"),
                    ));
                }
                Some(given.into_iter().map(unit).collect())
            }
        };
        Ok(Points { names: [name, normal], shape, points, normals })
    }

    /// The shape of the points, without the axis of x, y, z.
    fn places(&self) -> &[usize] {
        &self.shape[..self.shape.len() - 1]
    }

    /// The points pair by pair, or a single one for all pairs.
    fn per_pair(self, pairs: usize) -> Result<PerPair> {
        let normals = self.normals.map(|n| per_pair(self.names[1], n, pairs)).transpose()?;
        Ok((per_pair(self.names[0], self.points, pairs)?, normals))
    }

    /// The points of a list as each pair uses them.
    fn spread(self, pairs: usize, place: impl Fn(usize) -> usize) -> Result<PerPair> {
        let count = self.points.len();
        let all =
            |list: &[DVec3]| host::collected("the wall points", pairs, (0..pairs).map(|p| list[place(p)]));
        let normals = self.normals.map(|n| per_pair(self.names[1], n, count)).transpose()?;
        Ok((all(&self.points)?, normals.as_deref().map(all).transpose()?))
    }
}

/// Writes a capture. An exhaustive capture whose pairs are ordered laser point by laser point gets the compact form.
/// Equal captures give equal bytes. Counts are stored as uint16 or uint32 if they are whole and fit, else as float32.
/// The file appears whole or not at all.
///
/// # Errors
/// `Kind::Input` if the capture fails its check, `Kind::Output` if the file cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<()> {
    capture.check()?;
    let mut arrays = Vec::new();
    let mut add = |name, (shape, values): (Vec<usize>, Vec<f64>)| {
        arrays.push((name, Array::from_f64(&shape, &values)));
    };
    let names = [("laser_xyz", "laser_normal"), ("sensor_xyz", "sensor_normal")];
    let places = match exhaustive::sides(capture) {
        Some(sides) => {
            for ((points, normals), side) in names.into_iter().zip(&sides) {
                let flat = |values: &[DVec3]| {
                    let shape = vec![side.shape[0], side.shape[1], 3];
                    (shape, values.iter().flat_map(|v| v.to_array()).collect())
                };
                add(points, flat(&side.points));
                side.normals.iter().for_each(|n| add(normals, flat(n)));
            }
            [sides[0].shape, sides[1].shape].concat()
        }
        None => {
            let all = [(&capture.laser, &capture.laser_normal), (&capture.sensor, &capture.sensor_normal)];
            for ((name, normal), (points, normals)) in names.into_iter().zip(all) {
                add(name, compact(points, capture.scan, &[1, 3]));
                normals.iter().for_each(|n| add(normal, compact(n, capture.scan, &[1, 3])));
            }
            capture.scan.to_vec()
        }
    };
    arrays.push(("H", stored_counts(capture, &places)?));
    arrays.push(("delta_t", Array::from_f64(&[], &[capture.bin_width])));
    arrays.push(("t_start", Array::from_f64(&[], &[capture.t_start])));
    if let Some(pulse) = &capture.pulse {
        arrays.push(("pulse", Array::from_f64(&[pulse.samples.len()], &pulse.samples)));
        arrays.push(("pulse_delta_t", Array::from_f64(&[], &[pulse.width])));
        arrays.push(("pulse_t_start", Array::from_f64(&[], &[pulse.start])));
    }
    let [laser, sensor] = capture.devices;
    let devices = if laser == sensor { [laser, None, None] } else { [None, laser, sensor] };
    for (name, device) in DEVICES.into_iter().zip(devices) {
        arrays.extend(device.map(|at| (name, Array::from_f64(&[3], &at.to_array()))));
    }
    let scalars = [
        ("laser_spot", capture.laser_spot),
        ("sensor_spot", capture.sensor_spot),
        ("cycles", capture.cycles),
        ("direct", capture.direct),
    ];
    for (name, value) in scalars.into_iter().filter_map(|(name, value)| Some((name, value?))) {
        arrays.push((name, Array::from_f64(&[], &[value])));
    }
    atomic::write(path, &npz_bytes(&arrays)?)
}

fn stored_counts(capture: &Capture, places: &[usize]) -> Result<Array> {
    let shape = [&[capture.bins], places].concat();
    let h = transpose(&capture.histograms, capture.pair_count(), capture.bins)?;
    Ok(match largest_count(&h).filter(|_| capture.integer_counts) {
        Some(largest) if largest <= f32::from(u16::MAX) => {
            Array::from_u16(&shape, &h.iter().map(|&v| v as u16).collect::<Vec<_>>())
        }
        // 2^32 is one more than the largest uint32.
        Some(largest) if largest < 4_294_967_296.0 => {
            Array::from_u32(&shape, &h.iter().map(|&v| v as u32).collect::<Vec<_>>())
        }
        _ => Array::from_f32(&shape, &h),
    })
}
