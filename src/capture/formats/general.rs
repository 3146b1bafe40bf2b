//! General-NLOS captures: every pair may have its own laser and sensor point on an irregular wall.
//!
//! `laserpoints` and `detectpoints` (N, M, 3), metres, are in `setup.mat`. `data` (N, M, T), with bins of 32 ps, is in
//! a second file. The axes are in MATLAB's order, or in the order in which other programs write them to HDF5. The axis
//! of length 3 tells which.
//!
//! Axes: the coordinates in the file are kept. The front view of their `show_result.py` has y up and x to the left. Our
//! pictures show it mirrored, unless the capture is flipped in x ([`crate::capture::Turn`]).

use glam::DVec3;

use super::frame;
use super::given::Given;
use super::set::Set;
use crate::capture::Capture;
use crate::error::{Error, Result};

const PICOSECONDS: f64 = 32.0;

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub fn read(set: &mut Set, given: &Given, notes: &mut Vec<String>) -> Result<Capture> {
    set.add_beside(&["setup.mat".into(), "data.mat".into()])?;
    let file = set.holding("data")?.ok_or_else(|| missing("data"))?;
    let counts = file.counts("data")?;
    let integer_counts = counts.whole();
    let stored = ["laserpoints", "detectpoints"].map(|name| {
        let file = set.holding(name)?.ok_or_else(|| missing(name))?;
        file.numbers(name)?.ok_or_else(|| file.missing(name))
    });
    let [lasers, sensors] = stored;
    let (lasers, sensors) = (lasers?, sensors?);
    // An axis of three points may look like x, y, z: then the shape of the data decides.
    let fits = |matlab: bool| match (&lasers.0[..], &counts.shape[..]) {
        (&[3, m, n], &[bins, a, b]) if matlab && [a, b] == [m, n] => Some(([n, m], bins)),
        (&[n, m, 3], &[a, b, bins]) if !matlab && [a, b] == [n, m] => Some(([n, m], bins)),
        _ => None,
    };
    let matlab = fits(true).is_some();
    let Some(([n, m], bins)) = fits(matlab).filter(|_| lasers.0 == sensors.0) else {
        return Err(Error::input(
            format!(
                "data has shape {:?}, laserpoints {:?} and detectpoints {:?}, which do not agree",
                counts.shape, lasers.0, sensors.0
            ),
            "data is (N, M, T), laserpoints and detectpoints are (N, M, 3), all in the same axis order",
        ));
    };
    let bin_width = given.bin_width("a General-NLOS capture", Some(PICOSECONDS), notes)?;
    let pairs = n * m;
    let mut histograms = vec![0.0; counts.values.len()];
    if matlab {
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
