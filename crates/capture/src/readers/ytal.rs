//! y-tal captures: HDF5, or its arrays in an npz or MATLAB file.
//!
//! `H` in one of the layouts of `H_format` (1 = T_Sx_Sy, 2 = T_Lx_Ly_Sx_Sy, 3 = T_Si, 4 = T_Li_Si);
//! `{laser,sensor}_grid_xyz` are the wall points, `{laser,sensor}_grid_normals` their normals, `{laser,sensor}_xyz` the
//! **devices**; `delta_t` and `t_start` in metres of path. A missing value is an empty dataspace, in npz a Python object. If
//! `t_accounts_first_and_last_bounces` is set, the legs between devices and wall are removed. If `H_format` is missing
//! or 0 (unknown), the numbers of axes and of points decide. 10 to 13 are the same four layouts in frequencies. These
//! are refused, because y-tal does not store the frequencies.
//!
//! Normals of another grid than the points' (y-tal's `downscale` thins points and counts alone) are averaged over the points' blocks,
//! else left out.
//!
//! In layouts 1 and 3 the laser points and the sensor points are paired one by one if there are as many of both
//! (confocal); otherwise all pairs share a single point. Layouts 2 and 4 hold every combination: the scan becomes
//! (laser points, sensor points), pair `l * S + s`, unless one side is a single point.
//!
//! Axes: the coordinates in the file are kept. y-tal's frame is right-handed: for a viewer who looks at the wall, x is
//! to the right, y up, and z away from the wall.

use std::path::Path;

use glam::DVec3;
use rust_hdf5::types::HBool;
use rust_hdf5::{H5File, Hdf5Error};

use super::counts::largest_count;
use super::documented::Documented;
use super::exhaustive;
use super::points::{check_places, compact, per_pair, squeezed, triples, unit};
use super::variables::Variables;
use crate::conditioning::legs;
use crate::conditioning::warnings::EARLY;
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::array::transpose;
use crate::files::atomic;
use crate::{Capture, host};

/// Direct light may come this much before path 0, metres (334 ps): impulse responses of published captures are 30 to 200 ps wide.
const SPREAD: f64 = 0.1;
/// The array that shows y-tal's content.
pub(super) const SENSOR_POINTS: &str = "sensor_grid_xyz";
pub(super) const WANTED: &str = "y-tal's H, H_format, laser_grid_xyz, sensor_grid_xyz and delta_t, and optionally t_start, laser_grid_normals, \
                                 sensor_grid_normals, laser_xyz, sensor_xyz, t_accounts_first_and_last_bounces";

/// Reads a capture from an HDF5 or MATLAB file, as [`read`] does.
///
/// # Errors
/// Those of [`read`].
pub(super) fn read_variables(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    read(&Documented::of_file(file, &[SENSOR_POINTS, "laser_grid_xyz"], WANTED)?, notes)
}

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for a damaged file, a missing dataset, an unknown layout, shapes that do not agree, or paths that
/// include the outer legs if the file does not hold the positions of the devices.
pub(super) fn read(source: &Documented, notes: &mut Vec<String>) -> Result<Capture> {
    let stored = source.counts_shape("H")?;
    let (laser_shape, laser) =
        vectors(source, "laser_grid_xyz")?.ok_or_else(|| source.missing("laser_grid_xyz"))?;
    let (sensor_shape, sensor) =
        vectors(source, "sensor_grid_xyz")?.ok_or_else(|| source.missing("sensor_grid_xyz"))?;
    let (l, s) = (laser.len(), sensor.len());
    let format = source.number("H_format")?.unwrap_or(0.0) as i64;
    let with_stokes = holds_stokes(format, &stored, l.max(s));
    let shape = if with_stokes { stored[..stored.len() - 1].to_vec() } else { stored };
    let format = known_format(format, &shape, [l, s]);
    let (scan, exhaustive) = layout(format, &shape, [&laser_shape, &sensor_shape])?;
    let pairs = scan[0] * scan[1];
    if exhaustive && l.checked_mul(s) != Some(pairs) {
        return Err(Error::input(
            format!("H has shape {shape:?} for {l} laser and {s} sensor points"),
            "H must hold one histogram for every combination of laser and sensor point",
        ));
    }
    // The axes of each side in H; a list may be that of a grid.
    let axes = |side: Side| match (format, &shape[1..], side) {
        (2, [lx, ly, ..], Side::Laser) => vec![*lx, *ly],
        (2, [_, _, sx, sy], Side::Sensor) => vec![*sx, *sy],
        (4, [li, _], Side::Laser) => grid_of(*li, &[&laser_shape]).to_vec(),
        (4, [_, si], Side::Sensor) => grid_of(*si, &[&sensor_shape]).to_vec(),
        _ => scan.to_vec(),
    };
    let places = |what: &str, found: &[usize], side: Side| {
        let axes = axes(side);
        let is_list = squeezed(&found[..found.len() - 1]) == [axes.iter().product::<usize>()];
        let is_good = is_list && matches!(format, 3 | 4);
        if is_good { Ok(()) } else { check_places(what, found, &axes, &shape) }
    };
    places("laser_grid_xyz", &laser_shape, Side::Laser)?;
    places("sensor_grid_xyz", &sensor_shape, Side::Sensor)?;
    let spread = |what: &str, side: Side, given: Vec<DVec3>| match (exhaustive, side) {
        (false, _) => per_pair(what, given, pairs),
        (true, Side::Laser) => {
            let given = per_pair(what, given, l)?;
            let all = given.iter().flat_map(|&p| std::iter::repeat_n(p, s)); // bounded: an iterator
            host::collected(what, pairs, all)
        }
        (true, Side::Sensor) => {
            let given = per_pair(what, given, s)?;
            host::collected(what, pairs, (0..l).flat_map(|_| given.iter().copied()))
        }
    };
    let normals = |what: &str, side, notes: &mut Vec<String>| -> Result<Option<Vec<DVec3>>> {
        let Some((found, values)) = source.numbers(what)? else { return Ok(None) };
        let given = match triples(what, &found, &values) {
            Ok(given) if places(what, &found, side).is_ok() => given,
            given => match of_blocks(what, &found, given.unwrap_or_default(), &axes(side), notes) {
                Some(means) => means,
                None => return Ok(None),
            },
        };
        spread(what, side, given.into_iter().map(unit).collect()).map(Some)
    };
    let laser = spread("laser_grid_xyz", Side::Laser, laser)?;
    let sensor = spread("sensor_grid_xyz", Side::Sensor, sensor)?;
    let bin_width = source.number("delta_t")?.ok_or_else(|| source.missing("delta_t"))?;
    let h = counts(source, with_stokes, notes)?;
    let histograms = transpose(&h, shape[0], pairs)?;
    let capture = Capture {
        laser_normal: normals("laser_grid_normals", Side::Laser, notes)?,
        sensor_normal: normals("sensor_grid_normals", Side::Sensor, notes)?,
        t_start: source.number("t_start")?.unwrap_or(0.0),
        integer_counts: histogram_figures::whole(&h),
        ..Capture::new(scan, laser, sensor, shape[0], bin_width, histograms)
    };
    // Empty, or one position for each point, if there is no single device.
    let device = |name: &str| -> Result<Option<DVec3>> {
        let is_one = source.numbers(name)?.is_some_and(|(_, values)| values.len() == 3);
        let found = if is_one { vectors(source, name)? } else { None };
        Ok(found.map(|(_, points)| points[0]).filter(|at| at.is_finite()))
    };
    let capture = Capture { devices: [device("laser_xyz")?, device("sensor_xyz")?], ..capture };
    if source.number("t_accounts_first_and_last_bounces")?.is_none_or(|flag| flag == 0.0) {
        return Ok(capture);
    }
    without_legs(source, capture, notes)
}

/// The capture without the legs between devices and wall, unless its light comes before it can have gone them.
fn without_legs(source: &Documented, capture: Capture, notes: &mut Vec<String>) -> Result<Capture> {
    // Pairs that were not measured are left out later; the rest must be valid.
    legs::check_measured(&capture)?;
    let legs = outer_legs(source, &capture)?;
    let removed = legs::remove(&capture, &legs)?;
    // Direct light of the wall, spread by the instrument, comes about path 0.
    let share = capture.share_before(&legs.iter().map(|leg| leg - SPREAD).collect::<Vec<_>>());
    if share <= EARLY {
        return Ok(removed);
    }
    notes.push(format!(
        "the flag t_accounts_first_and_last_bounces says that the first and last legs are in the times, but {:.0} % of the light comes \
         before it can have gone them: the legs are not taken off (clear the flag, or correct laser_xyz and sensor_xyz)",
        100.0 * share
    ));
    Ok(capture)
}

/// The layout of an `H_format`; of an unknown one, 0, by the axes of `H` and the numbers of laser and sensor points.
fn known_format(format: i64, shape: &[usize], points: [usize; 2]) -> i64 {
    let is_grid = |n: usize| n == points[0].max(points[1]);
    match (format, shape) {
        (0, &[_, _]) => 3,
        // A list of laser points by a list of sensor points, unless a grid has as many points.
        (0, &[_, a, b]) if [a, b] == points && !a.checked_mul(b).is_some_and(is_grid) => 4,
        (0, &[_, _, _]) => 1,
        (0, &[_, _, _, _, _]) => 2,
        (format, _) => format,
    }
}

/// Whether a polarised render has a Stokes vector in place of each count, of which the first number is the intensity.
/// `points`: those of the side with more.
fn holds_stokes(format: i64, shape: &[usize], points: usize) -> bool {
    match (format, shape) {
        (1 | 4, [_, _, _, 4]) | (2, [_, _, _, _, _, 4]) | (3, [_, _, 4]) => true,
        (0, [_, _, _, 4] | [_, _, _, _, _, 4]) => true,
        (0, [_, n, 4]) => points == *n,
        _ => false,
    }
}

/// The counts, or the intensities of Stokes vectors.
fn counts(source: &Documented, with_stokes: bool, notes: &mut Vec<String>) -> Result<Vec<f32>> {
    let h = source.counts("H")?;
    if !with_stokes {
        return Ok(h);
    }
    notes.push("H holds Stokes vectors: the intensity, the first of each, is used".into());
    host::collected("the counts", h.len() / 4, h.iter().step_by(4).copied())
}

/// Normals of shape `found` for points along `axes`: the mean of each block if the grid is a whole multiple of theirs, else `None`.
fn of_blocks(
    what: &str,
    found: &[usize],
    given: Vec<DVec3>,
    axes: &[usize],
    notes: &mut Vec<String>,
) -> Option<Vec<DVec3>> {
    let misfit = format!("{what} has shape {found:?} for points along {axes:?}");
    match (found, axes) {
        (&[nx, ny, 3], &[x, y]) if !given.is_empty() && nx.is_multiple_of(x) && ny.is_multiple_of(y) => {
            let mut sums = vec![DVec3::ZERO; x * y]; // bounded: fewer than the normals
            for (place, normal) in given.into_iter().enumerate() {
                sums[place / ny / (nx / x) * y + place % ny / (ny / y)] += normal;
            }
            notes.push(format!("{misfit}: the mean of each {} x {} of them is used", nx / x, ny / y));
            Some(sums.into_iter().map(DVec3::normalize).collect())
        }
        _ => {
            notes.push(format!("{misfit}, which do not agree: left out, the points show the wall's normals"));
            None
        }
    }
}

/// The scan of a layout, and whether it holds every combination of laser and sensor points.
fn layout(format: i64, shape: &[usize], [laser, sensor]: [&[usize]; 2]) -> Result<([usize; 2], bool)> {
    Ok(match (format, shape) {
        (1, &[_, x, y]) => ([x, y], false),
        (2, &[_, lx, ly, sx, sy]) if lx * ly == 1 => ([sx, sy], true),
        (2, &[_, lx, ly, sx, sy]) if sx * sy == 1 => ([lx, ly], true),
        (2, &[_, lx, ly, sx, sy]) => ([lx * ly, sx * sy], true),
        (3, &[_, n]) => (grid_of(n, &[sensor, laser]), false),
        (4, &[_, 1, n]) => (grid_of(n, &[sensor]), true),
        (4, &[_, n, 1]) => (grid_of(n, &[laser]), true),
        (4, &[_, li, si]) => ([li, si], true),
        (10..=13, _) => {
            return Err(Error::input(
                format!("H_format {format}: H was transformed to frequencies"),
                "save or render it in the time domain, as T_Sx_Sy or another of H_format 1 to 4",
            ));
        }
        _ => {
            return Err(Error::input(
                format!("H has shape {shape:?} and H_format {format}, which do not agree"),
                "known layouts are 1 (T, Sx, Sy), 2 (T, Lx, Ly, Sx, Sy), 3 (T, Si) and 4 (T, Li, Si)",
            ));
        }
    })
}

#[derive(Clone, Copy)]
enum Side {
    Laser,
    Sensor,
}

/// The scan shape of `n` points in a row: X, Y of the first grid with as many points, else [n, 1].
fn grid_of(n: usize, shapes: &[&[usize]]) -> [usize; 2] {
    let grid = shapes.iter().find_map(|shape| match shape {
        &&[x, y, 3] if x * y == n => Some([x, y]),
        _ => None,
    });
    grid.unwrap_or([n, 1])
}

fn outer_legs(source: &Documented, capture: &Capture) -> Result<Vec<f64>> {
    let device = |name: &str| -> Result<DVec3> {
        match vectors(source, name)?.map(|(_, points)| points) {
            Some(points) if points.len() == 1 => Ok(points[0]),
            _ => Err(Error::input(
                format!(
                    "the paths include the legs between devices and wall, but {name} does not hold a position"
                ),
                "store the device's position (x, y, z in metres), or remove the legs and clear \
                 t_accounts_first_and_last_bounces",
            )),
        }
    };
    let (laser, sensor) = (device("laser_xyz")?, device("sensor_xyz")?);
    let pairs = capture.laser.iter().zip(&capture.sensor);
    Ok(pairs.map(|(l, s)| laser.distance(*l) + sensor.distance(*s)).collect())
}

/// The vectors of an array, and its shape.
fn vectors(source: &Documented, name: &str) -> Result<Option<(Vec<usize>, Vec<DVec3>)>> {
    let Some((shape, values)) = source.numbers(name)? else { return Ok(None) };
    let vectors = triples(name, &shape, &values)?;
    Ok(Some((shape, vectors)))
}

/// Writes a capture with the inner path only. The devices are left out: y-tal takes an empty `laser_xyz` for a position
/// and its back-projection fails. The normals of a flat wall are written. Layout 2 (T, Lx, Ly, Sx, Sy) is for
/// exhaustive captures whose pairs are ordered laser point by laser point, and for captures with a single sensor point.
/// All others have layout 1 (T, X, Y). A side of a single point is stored as [1, 1, 3]. The file appears whole or not
/// at all.
///
/// # Errors
/// `Kind::Input` if the capture fails its check, `Kind::Output` if the file cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<()> {
    capture.check()?;
    let faced = facing(capture);
    let capture = faced.as_ref().unwrap_or(capture);
    let h = transpose(&capture.histograms, capture.pair_count(), capture.bins)?;
    atomic::replace(path, |temporary| {
        write_file(capture, &h, temporary).map_err(|e| {
            Error::output(format!("{}: cannot be written: {e}", path.display()), "check path and disk")
        })
    })
}

/// The capture with the normals that y-tal's solvers need, if the wall is flat. `None` if there is nothing to add.
fn facing(capture: &Capture) -> Option<Capture> {
    let missing = capture.laser_normal.is_none() || capture.sensor_normal.is_none();
    (missing && capture.is_planar()).then(|| {
        let all = || Some(vec![DVec3::Z; capture.pair_count()]); // bounded: as the points that are written
        let mut faced = capture.clone();
        faced.laser_normal = faced.laser_normal.or_else(all);
        faced.sensor_normal = faced.sensor_normal.or_else(all);
        faced
    })
}

/// Shape and values of one dataset of vectors.
type Vectors = (Vec<usize>, Vec<f64>);

/// Laser points, sensor points, laser normals, sensor normals, and the shape of H without its bins.
fn stored(capture: &Capture) -> ([Option<Vectors>; 4], Vec<usize>) {
    if let Some([laser, sensor]) = exhaustive::sides(capture) {
        let shape = laser.shape.into_iter().chain(sensor.shape).collect();
        let flat = |side: &exhaustive::StoredSide, values: &[DVec3]| {
            ([&side.shape[..], &[3]].concat(), values.iter().flat_map(|v| v.to_array()).collect())
        };
        let all = [
            Some(flat(&laser, &laser.points)),
            Some(flat(&sensor, &sensor.points)),
            laser.normals.as_ref().map(|n| flat(&laser, n)),
            sensor.normals.as_ref().map(|n| flat(&sensor, n)),
        ];
        return (all, shape);
    }
    let side = |values: &Vec<DVec3>| compact(values, capture.scan, &[1, 1, 3]);
    let (laser, sensor) = (side(&capture.laser), side(&capture.sensor));
    // As many normals as points, because y-tal uses one index for both.
    let facing = |normals: &Option<Vec<DVec3>>, points: &Vectors| {
        let count = points.1.len() / 3;
        normals.as_ref().map(|n| (points.0.clone(), n[..count].iter().flat_map(|v| v.to_array()).collect()))
    };
    let normals = [facing(&capture.laser_normal, &laser), facing(&capture.sensor_normal, &sensor)];
    let [laser_normal, sensor_normal] = normals;
    let mut places = capture.scan.to_vec();
    if sensor.0 == [1, 1, 3] && laser.0 != [1, 1, 3] {
        // y-tal takes the scan of layout 1 as that of the sensor points.
        places.extend([1, 1]);
    }
    ([Some(laser), Some(sensor), laser_normal, sensor_normal], places)
}

fn write_file(capture: &Capture, h: &[f32], path: &Path) -> std::result::Result<(), Hdf5Error> {
    let file = H5File::create(path)?;
    let (vectors, places) = stored(capture);
    let shape = [&[capture.bins], &places[..]].concat();
    let chunk: Vec<usize> =
        std::iter::once(capture.bins.min(64)).chain(places.iter().map(|n| *n.min(&16))).collect();
    match largest_count(h).filter(|&largest| capture.integer_counts && largest < 4_294_967_296.0) {
        Some(_) => {
            let counts: Vec<u32> = h.iter().map(|&v| v as u32).collect();
            file.new_dataset::<u32>()
                .shape(shape)
                .chunk(&chunk)
                .shuffle_deflate(6)
                .create("H")?
                .write_raw(&counts)?;
        }
        None => {
            file.new_dataset::<f32>()
                .shape(shape)
                .chunk(&chunk)
                .shuffle_deflate(6)
                .create("H")?
                .write_raw(h)?;
        }
    }
    let names = ["laser_grid_xyz", "sensor_grid_xyz", "laser_grid_normals", "sensor_grid_normals"];
    for (name, vectors) in names.into_iter().zip(vectors) {
        if let Some((shape, values)) = vectors {
            file.new_dataset::<f64>().shape(shape).create(name)?.write_raw(&values)?;
        }
    }
    // H_format T_Sx_Sy or T_Lx_Ly_Sx_Sy; grid format X_Y_3.
    let format = if places.len() == 4 { 2 } else { 1 };
    for (name, value) in [("H_format", format), ("laser_grid_format", 2), ("sensor_grid_format", 2)] {
        file.new_dataset::<i32>().shape([1]).create(name)?.write_raw(&[value])?;
    }
    file.new_dataset::<f64>().scalar().create("delta_t")?.write_raw(&[capture.bin_width])?;
    file.new_dataset::<f64>().scalar().create("t_start")?.write_raw(&[capture.t_start])?;
    file.new_dataset::<HBool>()
        .scalar()
        .create("t_accounts_first_and_last_bounces")?
        .write_raw(&[HBool::from(false)])?;
    // y-tal passes this to its YAML reader, which refuses strings of fixed length.
    let info = format!("name: {}\nsource: thirdbounce\n", serde_json::Value::from(capture.name.as_str()));
    file.write_vlen_strings("scene_info", &[&info])?;
    file.close()
}
