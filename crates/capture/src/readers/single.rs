//! A MATLAB or HDF5 file with a single array of counts of a confocal scan of a flat wall, or one that the user names. The file
//! holds neither the wall size nor the bin width, or under a name of its own ([`super::stated`]).
//!
//! Axes: the file does not say which are which. MATLAB programs store (y, x, t). The bins are the axis along which the sums are
//! concentrated, as light rises and decays; where none stands out, the caller has to name the axes. The scan is read with rows
//! from the top and columns from the left, as in the f-k migration of the ABP publication (Zhang and others) for its `tof_data`;
//! [`crate::Turn`] mirrors and rotates it.

use super::frame::{self, Axes, WallDirection};
use super::read_options::ReadOptions;
use super::unread::{ReadCapture, Unread};
use super::variables::Variables;
use super::{counts, stated};
use crate::advice::advice;
use crate::error::{Error, Result};
use crate::{AxisOrder, Capture, host};

/// Rows from the top, columns from the left.
const AXES: Axes = Axes { d1: WallDirection::Down, d2: WallDirection::Right };
/// Half of the light lies in this share of the bins, as a ratio to that of the next axis, or less.
const STANDS_OUT: f64 = 0.6;

/// Finds a capture; see [`super::read`]. Counts whose first axis in the file are the bins are not read yet.
///
/// # Errors
/// `Kind::Options` without a wall size and a bin width, with axes that are not clear, or if several arrays have three axes;
/// `Kind::Input` if none has.
pub(super) fn read<'f>(
    file: &'f Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<ReadCapture<'f>> {
    let mut found = Vec::new();
    if let Some(error) = of_colours(file) {
        return Err(error);
    }
    for name in file.names() {
        if let Some(shape) =
            file.shape(&name)?.filter(|s| s.len() == 3 && s.iter().filter(|d| **d > 1).count() > 1)
        {
            found.push((name, shape));
        }
    }
    if let Some(array) = &given.array {
        found.retain(|(name, _)| name == array);
    }
    if found.len() > 1 {
        let all: Vec<_> = found.iter().map(|(name, shape)| format!("{name} {shape:?}")).collect();
        return Err(Error::options(
            format!("several arrays may be the counts: {}", all.join(", ")),
            advice!["name one: " Array " " (found[0].0.clone())],
        ));
    }
    let [(name, shape)] = &found[..] else {
        if let Some(error) = of_a_matrix(file)?.or_else(|| in_cells(file)) {
            return Err(error);
        }
        let there = file.names();
        let there = if there.is_empty() { "nothing".to_string() } else { there.join(", ") };
        return Err(Error::input(
            format!("is in no known format: it holds {there}"),
            "known formats are y-tal, Z-NLOS, NeTF, Stanford f-k, LCT, CC-SOCR, General-NLOS, phasor-field \
             files, and a file with a single array of counts",
        ));
    };
    if let Some(error) = counts::picture(name, shape) {
        return Err(error);
    }
    if given.array.is_none() && counts::is_result(name) {
        return Err(Error::input(
            counts::of_a_result(name, shape),
            advice!["give the capture that it was made from; if it does hold histograms, say so: " Array " " (name.clone())],
        ));
    }
    let given = &stated::with_bin_width(file, stated::with_wall(file, given.clone(), notes), notes);
    let what = format!("a file with the array of counts {name}{}", stated::quoted(file));
    let (wall, bin_width) = given.wall_and_bin_width(&what)?;
    let order = match given.axes {
        Some(order) => order.in_c_order(file.in_matlab_order()),
        None => found_order(file, name, shape)?,
    };
    let [x, y, t] = order.places();
    notes.push(format!(
        "{name} is read as {} bins of {} columns and {} rows from the top: confocal, t = 0 at the wall (the axes can be given)",
        shape[t], shape[x], shape[y]
    ));
    if [t, x, y] == [0, 1, 2] {
        return Unread::scanned(file, name, AXES, wall, bin_width).map(ReadCapture::Unread);
    }
    let counts = file.counts(name)?;
    let integer_counts = counts.whole();
    let steps = [shape[1] * shape[2], shape[2], 1];
    let (nx, ny, bins) = (shape[x], shape[y], shape[t]);
    let scan = AXES.scan([ny, nx]);
    let mut histograms = host::filled("the counts", counts.values.len(), 0.0f32)?;
    for (place, pair) in AXES.pairs([ny, nx]).into_iter().enumerate() {
        let first = place / ny * steps[x] + place % ny * steps[y];
        for (bin, to) in histograms[pair * bins..(pair + 1) * bins].iter_mut().enumerate() {
            *to = counts.values[first + bin * steps[t]];
        }
    }
    let points = frame::lattice(scan, wall);
    let capture = Capture::new(scan, points.clone(), points, bins, bin_width, histograms);
    Ok(ReadCapture::Whole(Capture { integer_counts, ..capture }))
}

/// Elements of a matrix that may be histograms of a scan, and bins of one at least.
const MATRIX: [usize; 2] = [1024, 16];

/// The error of the largest matrix of a file without an array of three axes, as of pairs x bins.
fn of_a_matrix(file: &Variables) -> Result<Option<Error>> {
    let mut largest: Option<(String, [usize; 2])> = None;
    let mut lists = vec![];
    for name in file.names() {
        let sides: Vec<usize> = file.shape(&name)?.into_iter().flatten().filter(|n| *n > 1).collect();
        if let [n] = sides[..] {
            lists.push(n);
        }
        let [a, b] = sides[..] else { continue };
        let is_larger = largest.as_ref().is_none_or(|(_, [c, d])| a.saturating_mul(b) > c * d);
        if is_larger && a.min(b) >= MATRIX[1] && a.saturating_mul(b) >= MATRIX[0] {
            largest = Some((name, [a, b]));
        }
    }
    Ok(largest.map(|(name, [a, b])| {
        let [first, second] = if file.in_matlab_order() { [b, a] } else { [a, b] };
        let scan = match counts::axis_of_points([first, second], &lists) {
            Some((_, [x, y])) => format!("--scan {x}x{y}"),
            None => "--scan with columns x rows, or a file with the points".into(),
        };
        Error::input(
            format!("{name} is a matrix of {first} x {second}, as of pairs and bins, without the points of the scan"),
            advice![
                "make a capture of it with the points of the scan: thirdbounce histogram FILE " (scan) " --wall 1m --bin-width 32ps "
                "--zero 0ps --out capture.npz (path 0 is at the wall; leave --zero out where the histograms begin at the laser)"
            ],
        )
    }))
}

/// The error of several structs that hold known arrays.
pub(super) fn in_structs(names: &[String]) -> Option<Error> {
    let inside = names.iter().find(|name| {
        let last = name.rsplit('/').next().unwrap_or_default();
        name.contains('/')
            && names.len() > 1
            && ["rect_data", "meas", "data_t", "sig_in", "H"].contains(&last)
    });
    inside.map(|name| {
        let group = name.split('/').next().unwrap_or_default();
        Error::input(
            format!("holds {name} inside the struct {group}, which is not the only one"),
            format!("save its fields as variables of their own: save('capture.mat', '-struct', '{group}')"),
        )
    })
}

/// Elements of a cell array that say what it holds at least.
const CELLS: usize = 2;

/// The error of cell arrays, with the way to one array.
fn in_cells(file: &Variables) -> Option<Error> {
    let cells = file.cells();
    // Cells of up to three numbers are coordinates.
    let is_point = |shapes: &[Vec<usize>]| shapes.iter().all(|shape| shape.iter().product::<usize>() <= 3);
    let (name, shapes) = cells.iter().max_by_key(|(_, shapes)| (!is_point(shapes), shapes.len()))?;
    if is_point(shapes) && !shapes.is_empty() {
        return Some(Error::input(
            format!("{name} is a MATLAB cell array of coordinates, and the file holds no counts"),
            "store the counts as one array, and the points as a matrix of x, y, z in metres",
        ));
    }
    let all = cells.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    let long = |shape: &Vec<usize>| shape.iter().filter(|n| **n > 1).count();
    let is_one = shapes.windows(2).all(|w| w[0] == w[1]);
    let columns = match shapes.first() {
        Some(first) if shapes.len() >= CELLS && is_one && long(first) == 1 => Some(first.last() != Some(&1)),
        _ => None,
    };
    let hint = match columns {
        // A column of MATLAB is a row in C order.
        Some(true) => format!(
            "make one matrix of it, a column per pair: H = cat(2, {name}{{:}}); save('counts.mat', 'H')"
        ),
        Some(false) => {
            format!("make one matrix of it, a row per pair: H = cat(1, {name}{{:}}); save('counts.mat', 'H')")
        }
        None if !is_one && shapes.iter().all(|shape| long(shape) < 2) => format!(
            "if they are arrival times of photons, count them in bins: e = 0:32e-12:max(cellfun(@(t) max([t(:); 0]), \
             {name}(:))) + 32e-12; H = cell2mat(cellfun(@(t) histcounts(t, e), {name}(:), 'UniformOutput', false)); save('counts.mat', 'H') \
             (32e-12 is the bin width in the unit of the times)"
        ),
        None => format!(
            "make one array of it before it is saved: H = cat(3, {name}{{:}}) or cell2mat; save('counts.mat', 'H')"
        ),
    };
    Some(Error::input(
        match cells.len() {
            1 => format!("{name} is a MATLAB cell array, whose elements are arrays of their own"),
            n => format!("{all} are {n} MATLAB cell arrays, whose elements are arrays of their own"),
        },
        hint,
    ))
}

/// The error of counts with colours.
fn of_colours(file: &Variables) -> Option<Error> {
    let of_colours = |name: String| {
        let shape = file.shape(&name).ok().flatten()?;
        (shape.len() == 4 && (shape[0] == 3 || shape[3] == 3)).then_some((name, shape))
    };
    let (name, shape) = file.names().into_iter().find_map(of_colours)?;
    Some(Error::input(
        format!("{name} has shape {shape:?}: an axis of 3 that looks like colours"),
        "store one array of three axes: the sum over the colours, or one of them",
    ))
}

/// The order of the axes in C order, by where the light is. MATLAB's (y, x, t) and C's (x, y, t) are the usual ones.
fn found_order(file: &Variables, name: &str, shape: &[usize]) -> Result<AxisOrder> {
    let matlab = file.in_matlab_order();
    let shares = file.profiles(name)?.map(|profile| half_of_light(&profile));
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| shares[*a].total_cmp(&shares[*b]));
    let time = match shares[axes[0]] <= STANDS_OUT * shares[axes[1]] {
        true => axes[0],
        false if matlab => 0,
        false => {
            return Err(Error::options(
                format!("no axis of {name} {shape:?} is clearly that of the bins"),
                advice!["name the axes in their order, such as " Axes " xyt"],
            ));
        }
    };
    Ok(AxisOrder::with_bins_at(time))
}

/// The share of a profile's elements that holds half of what is above its least element.
fn half_of_light(profile: &[f64]) -> f64 {
    let least = profile.iter().copied().fold(f64::INFINITY, f64::min);
    let mut above: Vec<f64> = profile.iter().map(|v| v - least).collect();
    above.sort_by(|a, b| b.total_cmp(a));
    let total: f64 = above.iter().sum();
    let mut sum = 0.0;
    let held = above.iter().take_while(|v| {
        let more = sum < 0.5 * total;
        sum += **v;
        more
    });
    if profile.len() < 2 || total <= 0.0 { 1.0 } else { held.count() as f64 / profile.len() as f64 }
}
