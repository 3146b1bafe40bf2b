//! Files of MATLAB or HDF5 with one array of counts and arrays of the wall points of its pairs, under names of their own.
//!
//! The newest public captures of curved walls have `trans_data` (M, 1, t), `camera_points` and `laser_points` (M, 3). 3D-RSD
//! (Gu, Sultan, Masumnia-Bisheh, Waller, Velten 2023) has `total_rect_data` (P, t), `ts` in seconds, the laser points as
//! `camera_pos` (P, 3), and the only sensor point as `laser_pos_base` (1, 1, 3): its README says that the names are flipped.
//! Path 0 is at the wall. Points are never ignored: unknown content is refused.
//!
//! Axes: the coordinates in the file are kept. Pictures of 3D-RSD's `RSD_main.m` have y up and x to the left, as ours.

use glam::DVec3;

use super::points::{per_pair, squeezed, unit};
use super::read_options::ReadOptions;
use super::variables::Variables;
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::array::transpose;
use crate::{Capture, METRES_PER_PICOSECOND, host};

/// Parts of the names of arrays of points.
const LASERS: [&str; 5] = ["laser", "illum", "light", "source", "emit"];
const SENSORS: [&str; 5] = ["camera", "sensor", "spad", "detect", "cam_"];
/// Parts of the names of quantities that are no points.
const QUANTITIES: [&str; 10] =
    ["dist", "speed", "veloc", "range", "depth", "power", "angle", "time", "delay", "toa"];
const POINTS: [&str; 7] = ["point", "pos", "xyz", "grid", "coord", "wall", "norm"];

/// Whether this is a capture of 3D-RSD.
pub(super) fn is_3d_rsd(file: &Variables) -> bool {
    file.have(&["total_rect_data", "camera_pos"])
}

/// Reads a capture of 3D-RSD without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub(super) fn read_3d_rsd(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    let seconds = file.number("ts")?.ok_or_else(|| file.missing("ts"))?;
    let laser = List::read(file, "camera_pos")?.ok_or_else(|| file.missing("camera_pos"))?;
    let name = ["laser_pos_base", "laser_pos"].into_iter().find(|name| file.have(&[name]));
    let sensor = List::read(file, name.unwrap_or("laser_pos_base"))?;
    let sensor = sensor.filter(|s| s.points.len() == 1).ok_or_else(|| {
        Error::input(
            "there is no laser_pos_base of one point, the place of the sensor on the wall",
            "store laser_pos_base as (1, 3) in metres",
        )
    })?;
    notes.push(
        "camera_pos are the laser points and laser_pos_base is the only sensor point, as 3D-RSD says".into(),
    );
    let bin_width = seconds * 1e12 * METRES_PER_PICOSECOND;
    made(file, "total_rect_data", [laser, sensor], [None, None], bin_width)
}

/// Wall points or normals as a file has them.
#[derive(Clone)]
struct List {
    name: String,
    shape: Vec<usize>,
    /// Lengths of the axes but that of x, y, z, in C order.
    places: Vec<usize>,
    points: Vec<DVec3>,
}

/// The axis of x, y, z of an array of this shape: the first in the order of MATLAB, the last in that of C.
pub(super) fn axis_of_xyz(file: &Variables, shape: &[usize]) -> Option<usize> {
    let [first, last] = [shape.first() == Some(&3), shape.last() == Some(&3)];
    match (first, last, file.in_matlab_order()) {
        (true, true, matlab) => Some(if matlab { 0 } else { shape.len() - 1 }),
        (true, false, _) => Some(0),
        (false, true, _) => Some(shape.len() - 1),
        (false, false, _) => None,
    }
}

impl List {
    fn read(file: &Variables, name: &str) -> Result<Option<List>> {
        let Some((shape, values)) = file.numbers(name)? else { return Ok(None) };
        let axis = axis_of_xyz(file, &shape).ok_or_else(|| {
            Error::input(
                format!("{name} has shape {shape:?}, without x, y, z along the first or the last axis"),
                format!("store {name} as (points, 3), metres"),
            )
        })?;
        let n = values.len() / 3;
        let at = |p: usize, c: usize| if axis == 0 { values[c * n + p] } else { values[3 * p + c] };
        let points = (0..n).map(|p| DVec3::new(at(p, 0), at(p, 1), at(p, 2))).collect();
        let places = if axis == 0 { shape[1..].to_vec() } else { shape[..axis].to_vec() };
        Ok(Some(List { name: name.into(), shape, places: squeezed(&places), points }))
    }
}

/// Whether a name contains one of these parts.
fn has(name: &str, parts: &[&str]) -> bool {
    parts.iter().any(|part| name.to_lowercase().contains(part))
}

/// Refuses a single point that may be a device away from the wall.
fn check_single(lists: [&List; 2]) -> Result<()> {
    let unclear = |list: &&List| list.points.len() == 1 && !has(&list.name, &["point", "xyz", "grid"]);
    let Some(one) = lists.into_iter().find(unclear) else { return Ok(()) };
    let side = if has(&one.name, &LASERS) { "laser" } else { "camera" };
    Err(Error::input(
        format!("{} is a single point: is it on the wall, or the place of the device?", one.name),
        format!("name it {side}_point if it is on the wall"),
    ))
}

/// Reads a capture whose counts come with arrays of points; `None` if the file holds none.
///
/// # Errors
/// `Kind::Input` for points that do not fit the counts or whose meaning is not known, `Kind::Options` without a bin width.
pub(super) fn read(
    file: &Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Option<Capture>> {
    let mut shapes = Vec::new();
    for name in file.names() {
        shapes.extend(file.shape(&name).ok().flatten().map(|shape| (name, shape)));
    }
    let size = |shape: &[usize]| shape.iter().fold(1usize, |n, d| n.saturating_mul(*d));
    let Some((array, counts)) = shapes.iter().max_by_key(|(_, shape)| size(shape)).cloned() else {
        return Ok(None);
    };
    let of_pairs = |n: usize| counts.iter().any(|bins| n > 1 && size(&counts) / bins == n);
    let mut lists = Vec::new();
    for (name, shape) in shapes.iter().filter(|(name, _)| *name != array) {
        let named = [&LASERS[..], &SENSORS, &POINTS].iter().any(|parts| has(name, parts));
        let holds_points = axis_of_xyz(file, shape).is_some() && size(shape) >= 3;
        if holds_points && !has(name, &QUANTITIES) && (named || of_pairs(size(shape) / 3)) {
            lists.extend(List::read(file, name)?);
        }
    }
    if lists.iter().all(|list| list.points.len() == 1) {
        return Ok(None);
    }
    let (normals, points): (Vec<List>, Vec<List>) =
        lists.into_iter().partition(|list| has(&list.name, &["norm"]));
    let names =
        points.iter().chain(&normals).map(|l| format!("{} {:?}", l.name, l.shape)).collect::<Vec<_>>();
    let unclear = || {
        Error::input(
            format!("{array} {counts:?} comes with points whose meaning is not known: {}", names.join(", ")),
            "name them laser_points and camera_points, one of each per histogram, or write npz: H [T, P], laser_xyz [P, 3], \
             sensor_xyz [P, 3], delta_t",
        )
    };
    let side = |lists: Vec<List>| -> Result<[Option<List>; 2]> {
        let (mut laser, mut sensor) = (None, None);
        for list in lists {
            let to = match (has(&list.name, &LASERS), has(&list.name, &SENSORS)) {
                (true, false) => &mut laser,
                (false, true) => &mut sensor,
                // One list of no side is that of a confocal scan.
                _ => &mut sensor,
            };
            if to.replace(list).is_some() {
                return Err(unclear());
            }
        }
        Ok([laser, sensor])
    };
    let (laser, sensor) = match side(points)? {
        [Some(laser), Some(sensor)] => (laser, sensor),
        [None, Some(list)] | [Some(list), None] => {
            notes.push(format!(
                "{} are the only points: laser and sensor point of a pair are one (confocal)",
                list.name
            ));
            (list.clone(), list)
        }
        [None, None] => return Err(unclear()),
    };
    check_single([&laser, &sensor])?;
    let what = format!("a file with {array}, {} and {}", laser.name, sensor.name);
    let bin_width = given.bin_width(&what, None, notes)?;
    notes.push(format!(
        "{array} {counts:?} is read with {} as laser points and {} as sensor points; t = 0 is at the wall",
        laser.name, sensor.name
    ));
    made(file, &array, [laser, sensor], side(normals)?, bin_width).map(Some)
}

/// The capture of counts, points and normals. The bins are the axis without which the counts have one histogram for each point.
fn made(
    file: &Variables,
    array: &str,
    [laser, sensor]: [List; 2],
    normals: [Option<List>; 2],
    bin_width: f64,
) -> Result<Capture> {
    let shape = file.counts_shape(array)?;
    let misfit = |lists: [&List; 2]| {
        let [a, b] = lists.map(|list| format!("{} {:?}", list.name, list.shape));
        let order = if file.in_matlab_order() { " (MATLAB order reversed)" } else { "" };
        Error::input(
            format!("{array} has shape {shape:?}, {a} and {b}{order}, which do not agree"),
            "there is one point of each side, or a single one, for each histogram, in the same order",
        )
    };
    let places = if sensor.points.len() == 1 { laser.places.clone() } else { sensor.places.clone() };
    let pairs: usize = places.iter().product();
    let fits = |axis: &usize| {
        let others = [&shape[..*axis], &shape[axis + 1..]].concat();
        squeezed(&others) == places
    };
    let mut axes = (0..shape.len()).filter(fits);
    let axis = if file.in_matlab_order() { axes.next() } else { axes.next_back() };
    let agree = |list: &List| list.points.len() == 1 || list.places == places;
    let Some(axis) = axis.filter(|_| agree(&laser) && agree(&sensor)) else {
        return Err(misfit([&laser, &sensor]));
    };
    let counts = file.counts(array)?;
    let bins = shape[axis];
    let histograms = match axis {
        0 => transpose(&counts.values, bins, pairs)?,
        _ if axis + 1 == shape.len() || shape[axis + 1..].iter().all(|n| *n == 1) => counts.values,
        _ => {
            let inner: usize = shape[axis + 1..].iter().product();
            let at = |pair: usize, bin: usize| (pair / inner * bins + bin) * inner + pair % inner;
            let all = (0..pairs).flat_map(|pair| (0..bins).map(move |bin| (pair, bin)));
            host::collected("the counts", pairs * bins, all.map(|(pair, bin)| counts.values[at(pair, bin)]))?
        }
    };
    let [laser_normal, sensor_normal] = normals.map(|list| {
        let Some(list) = list else { return Ok(None) };
        if !agree(&list) {
            return Err(misfit([&list, &sensor]));
        }
        per_pair(&list.name, list.points.into_iter().map(unit).collect(), pairs).map(Some)
    });
    let scan = match places[..] {
        [x, y] => [x, y],
        _ => [pairs, 1],
    };
    let (laser, sensor) =
        (per_pair(&laser.name, laser.points, pairs)?, per_pair(&sensor.name, sensor.points, pairs)?);
    Ok(Capture {
        laser_normal: laser_normal?,
        sensor_normal: sensor_normal?,
        integer_counts: histogram_figures::whole(&histograms),
        ..Capture::new(scan, laser, sensor, bins, bin_width, histograms)
    })
}
