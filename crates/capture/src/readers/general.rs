//! General-NLOS captures: every pair may have its own laser and sensor point on an irregular wall.
//!
//! `laserpoints` and `detectpoints` (N, M, 3), metres, are in `setup.mat`. `data` (N, M, T), with bins of 32 ps, is in
//! a second file. The axes are in MATLAB's order, or in the order in which other programs write them to HDF5. The axis
//! of length 3 tells which.
//!
//! What the instrument wrote has `counts` in place of `data`: of the same axes, or (rows, T) with the legs in its paths. Then row
//! i * M + j of the first N * M belongs to point (i, j), where odd i run backwards, and path 0 is at the mean of `peak1` and
//! `peak2` (N, M) of files of these names, in bins, rounded (`gn_data.py`).
//!
//! Axes: the coordinates in the file are kept. The front view of their `show_result.py` has y up and x to the left, as
//! our pictures have.

use glam::DVec3;

use super::counts::Counts;
use super::frame;
use super::read_options::ReadOptions;
use super::set::Set;
use crate::error::{Error, Result};
use crate::{Capture, host};

const PICOSECONDS: f64 = 32.0;

/// The name of the counts of a set, `None` without any. What was worked up comes before what the instrument wrote.
pub(super) fn counts_name(set: &Set) -> Option<&'static str> {
    ["data", "counts"].into_iter().find(|name| set.any(name))
}

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub fn read(set: &mut Set, given: &ReadOptions, notes: &mut Vec<String>) -> Result<Capture> {
    // Of a file with counts, those are meant, whatever lies beside it.
    if counts_name(set).is_none() {
        set.add_beside(&["data.mat".into()])?;
    }
    set.add_beside(&["setup.mat".into()])?;
    let name = counts_name(set).ok_or_else(|| missing("data"))?;
    let shape = set.holding(name)?.ok_or_else(|| missing(name))?.counts_shape(name)?;
    let stored = ["laserpoints", "detectpoints"].map(|name| {
        let file = set.holding(name)?.ok_or_else(|| missing(name))?;
        file.numbers(name)?.ok_or_else(|| file.missing(name))
    });
    let [lasers, sensors] = stored;
    let (lasers, sensors) = (lasers?, sensors?);
    let agree = || {
        let axes = shape.len() == 2 || lasers.0.iter().product::<usize>() / 3 <= shape.iter().product();
        (axes && lasers.0 == sensors.0).then_some(())
    };
    agree().ok_or_else(|| misfit(name, &shape, [&lasers.0, &sensors.0]))?;
    let counts = set.holding(name)?.ok_or_else(|| missing(name))?.counts(name)?;
    let counts = if shape.len() == 2 { in_order(set, counts, &lasers.0, notes)? } else { counts };
    let integer_counts = counts.whole();
    // An axis of three points may look like x, y, z: then the shape of the data decides.
    let fits = |matlab: bool| match (&lasers.0[..], &counts.shape[..]) {
        (&[3, m, n], &[bins, a, b]) if matlab && [a, b] == [m, n] => Some(([n, m], bins)),
        (&[n, m, 3], &[a, b, bins]) if !matlab && [a, b] == [n, m] => Some(([n, m], bins)),
        _ => None,
    };
    let matlab = fits(true).is_some();
    let Some(([n, m], bins)) = fits(matlab).filter(|_| lasers.0 == sensors.0) else {
        return Err(misfit(name, &counts.shape, [&lasers.0, &sensors.0]));
    };
    let bin_width = given.bin_width("a General-NLOS capture", Some(PICOSECONDS), notes)?;
    let pairs = n * m;
    let mut histograms = vec![];
    if matlab {
        histograms = host::filled("the counts", counts.values.len(), 0.0)?;
        for (at, value) in counts.values.iter().enumerate() {
            let (bin, j, i) = (at / pairs, at % pairs / n, at % n);
            histograms[(i * m + j) * bins + bin] = *value;
        }
    } else {
        histograms = counts.values;
    }
    let [laser, sensor] = [&lasers.1, &sensors.1].map(|values| points([n, m], matlab, values));
    let capture = Capture::new([n, m], laser, sensor, bins, bin_width, histograms);
    Ok(frame::in_order(Capture { integer_counts, ..capture }))
}

fn misfit(name: &str, shape: &[usize], [lasers, sensors]: [&[usize]; 2]) -> Error {
    Error::input(
        format!(
            "{name} has shape {shape:?}, laserpoints {lasers:?} and detectpoints {sensors:?}, which do not agree"
        ),
        "data is (N, M, T), laserpoints and detectpoints are (N, M, 3), all in the same axis order",
    )
}

/// Counts (rows, T) of the instrument as `data` has them: point by point, with path 0 at bin 0.
fn in_order(set: &mut Set, counts: Counts, points: &[usize], notes: &mut Vec<String>) -> Result<Counts> {
    let [bins, rows] = counts.shape[..] else { return Ok(counts) };
    let [3, m, n] = points[..] else {
        return Err(Error::input(
            format!("counts has shape {:?} (MATLAB order reversed) and laserpoints {points:?}", counts.shape),
            "laserpoints is (N, M, 3) in MATLAB, and counts (N * M, T) or (N, M, T)",
        ));
    };
    let pairs = n.saturating_mul(m);
    set.add_beside(&["peak1.mat".into(), "peak2.mat".into()])?;
    let peak = |name: &str| -> Result<Vec<f64>> {
        let file = set.holding(name)?.ok_or_else(|| {
            Error::input(
                format!("counts are as the instrument wrote them, and there is no {name}.mat with the bins of direct light"),
                "lay peak1.mat and peak2.mat beside the file, or give the worked-up data",
            )
        })?;
        let (shape, values) = file.numbers(name)?.ok_or_else(|| file.missing(name))?;
        let good = shape == [m, n] && values.iter().all(|v| (0.0..bins as f64).contains(v));
        good.then_some(values).ok_or_else(|| {
            Error::input(
                format!(
                    "{name} has shape {shape:?} (MATLAB order reversed) for {n} x {m} points and {bins} bins"
                ),
                format!("{name} is (N, M), the bin of direct light of each point"),
            )
        })
    };
    let (first, second) = (peak("peak1")?, peak("peak2")?);
    if rows < pairs || pairs == 0 {
        return Err(Error::input(
            format!("counts has {rows} rows for {n} x {m} points"),
            "counts has a row for each point, and may have more",
        ));
    }
    // Of (i, j), which MATLAB stores at j * n + i.
    let zero = |i: usize, j: usize| (0.5 * (first[j * n + i] + second[j * n + i])).round_ties_even() as usize;
    let places = || (0..m).flat_map(|j| (0..n).map(move |i| (i, j)));
    let latest = places().map(|(i, j)| zero(i, j)).max().unwrap_or(0).min(bins - 1);
    let kept = bins - latest;
    let mut values = host::filled("the counts", kept * pairs, 0.0)?;
    for (place, (i, j)) in places().enumerate() {
        let row = i * m + if i % 2 == 1 { m - 1 - j } else { j };
        let zero = zero(i, j).min(latest);
        for bin in 0..kept {
            values[bin * pairs + place] = counts.values[(zero + bin) * rows + row];
        }
    }
    notes.push(format!(
        "counts are put in order as in gn_data.py of the publication: odd rows run backwards, path 0 is at the mean of peak1 and \
         peak2, and {kept} of {bins} bins are behind it for all points"
    ));
    if rows > pairs {
        notes.push(format!("the last {} of {rows} rows of counts belong to no point", rows - pairs));
    }
    Ok(Counts { shape: vec![kept, m, n], values })
}

/// Wall points `[i * M + j]`.
fn points([n, m]: [usize; 2], matlab: bool, values: &[f64]) -> Vec<DVec3> {
    let at = |i: usize, j: usize, c: usize| {
        if matlab { values[(c * m + j) * n + i] } else { values[(i * m + j) * 3 + c] }
    };
    let places = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    places.map(|(i, j)| DVec3::new(at(i, j, 0), at(i, j, 1), at(i, j, 2))).collect()
}

fn missing(name: &str) -> Error {
    Error::input(
        format!("there is no file with {name}"),
        "a General-NLOS capture is a folder with setup.mat (laserpoints, detectpoints) and a file with data: give \
         that folder",
    )
}
