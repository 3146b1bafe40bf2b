//! Histograms of an instrument: text and .phu, and arrays, npy or npz with `hists`, `histograms` or `counts`. So people store what
//! low-cost sensors with zones give them, such as ST's VL53L8CH and AMS's TMF8828.
//!
//! The last axis are the bins. The axes before it are the points in their order, (points, t) or (rows, columns, t). One more axis in
//! front of these are readings, which are added up. Counts are whole; the width of a bin is not in the file.

use std::io::{BufReader, Read, Seek};
use std::path::Path;

use super::arrays::Holder;
use super::tables::{self, MOST, StoredHistograms};
use super::{open, unreadable, zone_logs};
use crate::advice::advice;
use crate::capture::METRES_PER_PICOSECOND;
use crate::capture::formats::recognised::{self, Content, HistogramFormat};
use crate::capture::formats::variables::Variables;
use crate::error::{Error, Result};
use crate::files::archive::Npz;
use crate::files::array::{Array, Head, transpose};
use crate::host;

const NAMES: [&str; 3] = ["hists", "histograms", "counts"];

/// First bytes of a MATLAB v5 file.
const MATLAB: &[u8] = b"MATLAB";

/// Histograms of an instrument, one for each point.
pub(super) struct InstrumentHistograms {
    pub(super) name: String,
    /// Seconds of a bin.
    pub(super) tick: f64,
    /// Bins of a point.
    pub(super) bins: usize,
    /// Sums over all readings, or those of one, `[point * bins + bin]`.
    pub(super) counts: Vec<u32>,
    /// The same of each reading, if they are asked for.
    pub(super) readings: Vec<Vec<u32>>,
    /// What a count of 1 stands for: 1, less for fractions.
    pub(super) unit: f64,
}

/// Which readings of a file are used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Readings {
    /// All, added up.
    #[default]
    Sum,
    /// One of them, from 0.
    One(usize),
    /// Each for itself, beside their sum.
    Each,
}

/// The histograms of these points; `None` if the file holds no such array. `bin_width` is a path, metres. Notes say what was assumed.
///
/// # Errors
/// `Kind::Input` for an array that cannot be read or does not fit the points, or counts that are not whole; `Kind::Options`
/// without the width of a bin.
pub(super) fn read(
    path: &Path,
    points: usize,
    bin_width: Option<f64>,
    which: Readings,
    notes: &mut Vec<String>,
) -> Result<Option<InstrumentHistograms>> {
    let table = match array(path)? {
        None if let Some(table) = matrix(path, points)? => table,
        Some((name, array)) => StoredHistograms {
            name,
            tick: None,
            shape: array.shape.clone(),
            values: array.to_f64(),
            unit: 1.0,
        },
        None => match recognised::of(path)?.map(|known| known.content) {
            Some(Content::Histograms(HistogramFormat::Tmf8829)) => zone_logs::tmf8829(path, notes)?,
            Some(Content::Histograms(HistogramFormat::Cnh)) => zone_logs::vl53l8ch(path, notes)?,
            Some(Content::Histograms(format)) => tables::read(path, format, points, notes)?,
            _ => return Ok(None),
        },
    };
    let StoredHistograms { name, tick, shape, values, unit } = table;
    let tick = tick.or(bin_width.map(|width| width / (1e12 * METRES_PER_PICOSECOND))).ok_or_else(|| {
        Error::options(
            format!("{name} does not say how wide its bins are"),
            advice!["give the width of a bin, as a time or a path: " BinWidth " 250ps for a VL53L8CH, 91ps for a TMF8820"],
        )
    })?;
    let (bins, places) = match shape.split_last() {
        Some((bins, places)) if *bins > 0 && values.len() <= MOST => (*bins, places),
        _ => return Err(misfit(&name, &shape, points)),
    };
    let of_points = |places: &[usize]| places.iter().product::<usize>() == points;
    let fits = of_points(places)
        || places.split_first().is_some_and(|(_, inner)| !inner.is_empty() && of_points(inner));
    if !fits || points == 0 {
        return Err(misfit(&name, &shape, points));
    }
    let size = points.saturating_mul(bins);
    let number = values.len() / size.max(1);
    if let Readings::One(reading) = which
        && reading >= number
    {
        return Err(Error::options(
            format!("reading {reading} was asked for, but {name} has {number} readings"),
            format!("give a number from 0 to {}", number.saturating_sub(1)),
        ));
    }
    if number > 1 && which == Readings::Sum {
        notes.push(format!("the {number} readings of {name} are added up"));
    }
    let is_used = |at: usize| !matches!(which, Readings::One(reading) if at / size != reading);
    let mut counts = host::filled(&name, size, 0u32)?;
    let mut readings = vec![];
    if which == Readings::Each {
        readings = (0..number).map(|_| host::room(&name, size)).collect::<Result<Vec<Vec<u32>>>>()?;
    }
    for (at, value) in values.into_iter().enumerate().filter(|(at, _)| is_used(*at)) {
        if !(value >= 0.0 && value.fract() == 0.0 && value <= f64::from(u32::MAX)) {
            return Err(Error::input(
                format!("{name} holds {value}, which is no count"),
                "store counts; for normalised histograms write a capture with hists and pt_cloud (docs/data.md)",
            ));
        }
        let sum = &mut counts[at % size];
        *sum = sum.saturating_add(value as u32);
        readings.get_mut(at / size).into_iter().for_each(|counts| counts.push(value as u32));
    }
    Ok(Some(InstrumentHistograms { name, tick, bins, counts, readings, unit }))
}

fn misfit(name: &str, shape: &[usize], points: usize) -> Error {
    Error::input(
        format!("{name} has shape {shape:?}, which does not fit {points} points"),
        "store (points, t) or (rows, columns, t), in the order of the scan; readings may come before as one more axis. Columns of time \
         tags have the names channel and time_ps in a first line",
    )
}

/// The largest matrix of a MATLAB or HDF5 file that has a row or a column for each point; `None` for other files.
fn matrix(path: &Path, points: usize) -> Result<Option<StoredHistograms>> {
    let mut magic = vec![];
    open(path)?.take(8).read_to_end(&mut magic).map_err(unreadable)?;
    if Holder::of(&magic) != Some(Holder::Hdf5) && !magic.starts_with(MATLAB) {
        return Ok(None);
    }
    let file = Variables::open(path)?;
    let mut found: Option<(String, Vec<usize>)> = None;
    for name in file.names() {
        let Some(shape) = file.shape(&name)? else { continue };
        let size: usize = shape.iter().fold(1, |n, d| n.saturating_mul(*d));
        let is_larger = found.as_ref().is_none_or(|(_, other)| size > other.iter().product::<usize>());
        let sides: Vec<usize> = shape.iter().copied().filter(|n| *n > 1).collect();
        if is_larger && size <= MOST && sides.len() <= 2 && sides.contains(&points) {
            found = Some((name, sides));
        }
    }
    let Some((name, sides)) = found else { return Ok(None) };
    let values = file.counts(&name)?.values;
    // Shapes are reversed in files of MATLAB, whose rows are read as points where both sides fit.
    let points_last = match sides[..] {
        [a, b] if a == b => file.in_matlab_order(),
        [_, b] => b == points,
        _ => false,
    };
    let bins = values.len() / points;
    let values: Vec<f64> = match points_last {
        true => transpose(&values, bins, points)?.into_iter().map(f64::from).collect(),
        false => values.into_iter().map(f64::from).collect(),
    };
    Ok(Some(StoredHistograms { name, tick: None, shape: vec![points, bins], values, unit: 1.0 }))
}

/// The name of the array, and the array.
fn array(path: &Path) -> Result<Option<(String, Array)>> {
    let mut file = open(path)?;
    let mut magic = [0; 6];
    if file.read_exact(&mut magic).is_err() {
        return Ok(None);
    }
    if &magic == b"\x93NUMPY" {
        let length = file.metadata().map_err(unreadable)?.len();
        if length > 8 * MOST as u64 {
            return Err(Error::input(
                format!("has {length} bytes, too many for histograms"),
                "store one scan",
            ));
        }
        let mut file = BufReader::new(open(path)?);
        let head = Head::read(&mut file)?;
        let begin = file.stream_position().map_err(unreadable)?;
        return head.whole(&mut file, length - begin).map(|array| Some(("the array".into(), array)));
    }
    if Holder::of(&magic) != Some(Holder::Npz) {
        return Ok(None);
    }
    let mut npz = Npz::open(path)?;
    let Some(name) = NAMES.iter().find(|name| npz.names().iter().any(|n| n == *name)) else {
        return Ok(None);
    };
    Ok(npz.get(name)?.map(|array| (name.to_string(), array)))
}
