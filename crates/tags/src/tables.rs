//! Histograms that instruments' software writes: PicoQuant's .phu, and text.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::header::{self, Header};
use super::text::{Plain, real};
use super::{open, unreadable};
use crate::capture::formats::recognised::HistogramFormat;
use crate::error::{Error, Result};
use crate::host;

/// Histograms of points as a file has them.
#[derive(Debug)]
pub(super) struct StoredHistograms {
    pub(super) name: String,
    /// Seconds of a bin, if the file says.
    pub(super) tick: Option<f64>,
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
    /// What a value of 1 stands for: 1 for counts, less for fractions.
    pub(super) unit: f64,
}

/// Most bins of all histograms together, and the longest npy file.
pub(super) const MOST: usize = 1 << 30;
/// Longest text, bytes.
pub(super) const LONGEST: u64 = 1 << 30;
/// Channels of a measurement of a TMF8820, the first is the reference; bytes of a count.
const ZONES: usize = 10;
const BYTES: usize = 3;

/// Reads histograms of a known format. `points`: number of points of the scan.
pub(super) fn read(
    path: &Path,
    format: HistogramFormat,
    points: usize,
    notes: &mut Vec<String>,
) -> Result<StoredHistograms> {
    if format == HistogramFormat::Phu {
        return phu(path);
    }
    let mut text = vec![];
    Plain::new(open(path)?)?.take(LONGEST).read_to_end(&mut text).map_err(unreadable)?;
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    match format {
        HistogramFormat::PicoHarp => {
            let after = |word: &str| {
                lines.iter().position(|line| line.to_lowercase().starts_with(word)).map(|at| at + 1)
            };
            let width = after("#ns/bin")
                .and_then(|at| lines.get(at))
                .and_then(|line| numbers(line)?.first().copied());
            let rows = rows(&lines[after("#counts").unwrap_or(0)..]);
            columns("the table below #counts", rows, width.map(|ns| 1e-9 * ns), 0, 1)
        }
        HistogramFormat::LabView => {
            let end =
                lines.iter().rposition(|line| line.starts_with("***End_of_Header***")).map_or(0, |at| at + 1);
            let value = |key: &str| {
                let line = lines[..end].iter().find(|line| line.starts_with(key))?;
                line.split(['\t', ',', ';']).nth(1).map(str::trim)
            };
            let rows = rows(&lines[end..]);
            let (from, step) = match value("X_Columns") {
                Some("No") => (0, 1),
                Some("Multi") => (1, 2),
                _ => (1, 1),
            };
            let first = |row: usize| rows.get(row).and_then(|row| row.first().copied());
            let of_times = || Some(first(1)? - first(0)?).filter(|_| from == 1);
            let width = value("Delta_X").and_then(|text| real(text.as_bytes())).or_else(of_times);
            columns("the table of the LabVIEW file", rows, width.filter(|width| *width > 0.0), from, step)
        }
        HistogramFormat::Zones => zones(&lines, notes),
        _ => {
            let rows = rows(&lines);
            let wide = rows.first().map_or(0, Vec::len);
            // A first column of the times of bins.
            let is_time = |rows: &[Vec<f64>]| {
                let steps: Vec<f64> = rows.windows(2).map(|w| w[1][0] - w[0][0]).collect();
                steps
                    .first()
                    .is_some_and(|step| *step > 0.0 && steps.iter().all(|s| (s / step - 1.0).abs() < 0.01))
            };
            if rows.len() != points && wide == points + 1 && is_time(&rows) {
                notes.push("the first column is read as the times of the bins, without their unit".into());
                return columns("the table", rows, None, 1, 1);
            }
            if rows.len() != points && wide == points {
                return columns("the table", rows, None, 0, 1);
            }
            if rows.len() == points && wide == points {
                notes.push("the table has as many rows as columns: a row is read as a point".into());
            }
            let shape = vec![rows.len(), wide];
            Ok(StoredHistograms {
                name: "the table".into(),
                tick: None,
                shape,
                values: rows.concat(),
                unit: 1.0,
            })
        }
    }
}

fn numbers(line: &str) -> Option<Vec<f64>> {
    let separator = ['\t', ';', ','].into_iter().find(|s| line.contains(*s)).unwrap_or(' ');
    let parts = line.split(separator).map(str::trim).filter(|part| !part.is_empty());
    parts.map(|part| real(part.trim_matches('"').as_bytes())).collect()
}

/// Lines of numbers of one length; the first may be of words, and LabVIEW ends lines with a comment.
fn rows(lines: &[&str]) -> Vec<Vec<f64>> {
    let all = lines.iter().filter(|line| !line.starts_with('#')).filter_map(|line| numbers(line));
    let mut rows: Vec<Vec<f64>> = all.filter(|row| !row.is_empty()).collect();
    let length = rows.first().map_or(0, Vec::len);
    rows.retain(|row| row.len() == length);
    rows
}

/// Columns `from`, `from + step`, ... as points.
fn columns(
    name: &str,
    rows: Vec<Vec<f64>>,
    tick: Option<f64>,
    from: usize,
    step: usize,
) -> Result<StoredHistograms> {
    let points = rows.first().map_or(0, |row| row.len().saturating_sub(from).div_ceil(step));
    let mut values = host::room(name, points.saturating_mul(rows.len()))?;
    for point in 0..points {
        values.extend(rows.iter().map(|row| row[from + point * step]));
    }
    Ok(StoredHistograms { name: name.into(), tick, shape: vec![points, rows.len()], values, unit: 1.0 })
}

/// `#Raw,` lines: fields, a zone, and the counts of its bins. A TMF8820 sends the bytes of ten channels one after the other, the lowest
/// first; the first channel is its reference.
fn zones(lines: &[&str], notes: &mut Vec<String>) -> Result<StoredHistograms> {
    let raw = lines.iter().filter(|line| line.to_lowercase().starts_with("#raw,"));
    let all: Vec<Vec<f64>> = raw.filter_map(|line| numbers(&line[5..])).collect();
    let length = all.iter().map(Vec::len).max().unwrap_or(0);
    let bins = if length > 128 { 128 } else { length.saturating_sub(1) };
    let mut sums: Vec<Vec<f64>> = vec![];
    for line in all.iter().filter(|line| line.len() == length && bins > 0) {
        let (zone, counts) = (line[length - bins - 1], &line[length - bins..]);
        let zone = if (0.0..1024.0).contains(&zone) { zone as usize } else { continue };
        sums.resize_with(sums.len().max(zone + 1), || vec![0.0; bins]); // bounded: 1,024 zones
        sums[zone].iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    if sums.len() == ZONES * BYTES {
        notes.push("the lines are read as the three bytes of the counts of ten channels".into());
        let (low, high) = sums.split_at_mut(ZONES);
        for (at, byte) in high.iter().enumerate() {
            let place = 256f64.powi(1 + (at / ZONES) as i32);
            low[at % ZONES].iter_mut().zip(byte).for_each(|(count, byte)| *count += place * byte);
        }
        sums.truncate(ZONES);
        sums.remove(0);
        notes.push("channel 0 is the reference of the sensor and is left out".into());
    }
    Ok(StoredHistograms {
        name: "the #Raw lines".into(),
        tick: None,
        shape: vec![sums.len(), bins],
        values: sums.concat(),
        unit: 1.0,
    })
}

/// Curves of a PHU file: each is a point. Source: as that of [`Header`].
fn phu(path: &Path) -> Result<StoredHistograms> {
    let mut file = open(path)?;
    let length = file.metadata().map_err(unreadable)?.len();
    file.seek(SeekFrom::Start(8)).map_err(unreadable)?;
    let header = Header::read(&mut std::io::BufReader::new(&mut file))?;
    let curves = header.whole("HistoResult_NumberOfCurves").filter(|n| (1..1 << 20).contains(n));
    let curves = curves.ok_or_else(|| header::damaged("it has no number of curves".into()))? as usize;
    let of_curve = |name: &str, curve: usize| {
        header.of_curve(name, curve).ok_or_else(|| header::damaged(format!("curve {curve} has no {name}")))
    };
    let bins = of_curve("HistResDscr_HistogramBins", 0)?;
    let tick = of_curve("HistResDscr_MDescResolution", 0)?;
    let fits = (1.0..=MOST as f64).contains(&(bins * curves as f64)) && tick.is_finite() && tick > 0.0;
    if !fits {
        return Err(header::damaged(format!("{curves} curves have {bins} bins of {tick} s")));
    }
    let mut values = vec![];
    for curve in 0..curves {
        let same = of_curve("HistResDscr_HistogramBins", curve)? == bins
            && of_curve("HistResDscr_MDescResolution", curve)? == tick;
        if !same {
            return Err(Error::input(
                format!("curve {curve} has other bins than the first"),
                "store curves of one measurement, with the same bins",
            ));
        }
        let from = of_curve("HistResDscr_DataOffset", curve)? as u64;
        let bytes = 4 * bins as u64;
        if from.saturating_add(bytes) > length {
            return Err(header::damaged(format!("curve {curve} ends behind the file")));
        }
        let mut counts = host::filled("a curve", bytes as usize, 0u8)?;
        file.seek(SeekFrom::Start(from)).map_err(unreadable)?;
        file.read_exact(&mut counts).map_err(unreadable)?;
        values.extend(counts.as_chunks::<4>().0.iter().map(|count| f64::from(u32::from_le_bytes(*count))));
    }
    Ok(StoredHistograms {
        name: "the curves".into(),
        tick: Some(tick),
        shape: vec![curves, bins as usize],
        values,
        unit: 1.0,
    })
}
