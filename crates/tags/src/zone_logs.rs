//! Logs of sensors with zones as their public drivers write them: readings one after the other, a histogram for each zone.
//!
//! TMF8829: JSON of the logger of the Python driver (ams-OSRAM/tmf8829_driver_python, `tmf8829/utilities/tmf8829_logger_service.py`), also
//! packed with gzip, or several JSON values one after the other. `Result_Set` are the readings, `mp_histo` of one [row][column] `bin`,
//! `ref_histo` the reference histograms, which are left out: path 0 is the wall's own peak. Bins are 200 ps times 2^`bin_shift` of
//! `configuration`; `histogram_bins` are counted before the shift, later ones are filler. Evidence for 200 ps: `vcsel_period` is named by
//! it, and peaks of a public log move by 0.12 m of distance a bin at a shift of 2.
//!
//! VL53L8CH: compact normalised histograms (CNH). The evaluation kit's table has a column `cnh__hist_bin_B_aZ` for bin B of aggregate Z and a
//! row a reading (gavinlloyd1/UR5e-VL53L8CH, `python/data_analysis`). The Arduino driver's example prints `Aggregate Z, Ambient: A, Bins: ...`
//! (davideq/VL53L8CH, `examples/VL53L8CH_CNHData`). Values are fractions without the ambient light, and may be negative.

use std::io::{BufReader, Read};
use std::path::Path;

use flate2::read::GzDecoder;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::tables::{LONGEST, MOST, StoredHistograms};
use super::text::Plain;
use super::{open, unreadable};
use crate::capture::formats::recognised::GZIP;
use crate::error::{Error, Result};

/// Seconds of a bin of a TMF8829 before bins are joined.
const TICK: f64 = 200e-12;
/// Bins are joined by at most this power of two.
const MOST_SHIFT: u32 = 7;
/// Zones of a sensor, at most.
const MOST_ZONES: usize = 1 << 12;

/// One of the JSON values of a log.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Part {
    #[serde(rename = "Result_Set")]
    results: Option<Results>,
    configuration: Option<Configuration>,
    /// A configuration that is a value of its own.
    bin_shift: Option<u32>,
    histogram_bins: Option<usize>,
    /// Frames of the sensor as they come, halves of a reading.
    frames: Option<IgnoredAny>,
    frame: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Results {
    Many(Vec<Reading>),
    One(Box<Reading>),
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Configuration {
    bin_shift: Option<u32>,
    histogram_bins: Option<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Reading {
    mp_histo: Vec<Vec<ZoneBins>>,
    /// Of the high accuracy range, where there are two.
    #[serde(rename = "mp_histo_HA")]
    accurate: Vec<Vec<ZoneBins>>,
}

#[derive(Deserialize)]
struct ZoneBins {
    bin: Vec<u32>,
}

/// What the parts of a log of a TMF8829 hold.
#[derive(Default)]
struct SensorLog {
    readings: Vec<Reading>,
    shift: Option<u32>,
    used: Option<usize>,
    /// Whether there are single frames, which are halves of a reading.
    are_halves: bool,
}

fn log(path: &Path) -> Result<SensorLog> {
    let mut head = [0; 2];
    let is_packed = open(path)?.read_exact(&mut head).is_ok() && head == GZIP;
    let file = BufReader::new(open(path)?);
    let text: Box<dyn Read> =
        if is_packed { Box::new(BufReader::new(GzDecoder::new(file))) } else { Box::new(file) };
    let mut log = SensorLog::default();
    for part in serde_json::Deserializer::from_reader(text.take(LONGEST)).into_iter::<Part>() {
        let part = part.map_err(|e| {
            Error::input(
                format!("the log of a TMF8829 is damaged or ends early: {e}"),
                "end the logging in order, and copy the file again",
            )
        })?;
        let configuration = part.configuration.unwrap_or_default();
        log.shift = log.shift.or(configuration.bin_shift).or(part.bin_shift);
        log.used = log.used.or(configuration.histogram_bins).or(part.histogram_bins);
        log.are_halves |= part.frames.is_some() || part.frame.is_some();
        match part.results {
            Some(Results::Many(all)) => log.readings.extend(all),
            Some(Results::One(one)) => log.readings.push(*one),
            None => {}
        }
    }
    Ok(log)
}

/// Reads the log of a TMF8829.
pub(super) fn tmf8829(path: &Path, notes: &mut Vec<String>) -> Result<StoredHistograms> {
    let SensorLog { readings, shift, used, are_halves } = log(path)?;
    let is_long = readings.iter().all(|reading| reading.mp_histo.is_empty());
    let histograms = |reading: Reading| if is_long { reading.accurate } else { reading.mp_histo };
    let all: Vec<Vec<Vec<ZoneBins>>> =
        readings.into_iter().map(histograms).filter(|rows| !rows.is_empty()).collect();
    let Some(first) = all.first() else {
        let (what, hint) = match are_halves {
            true => ("holds single frames, halves of a reading", "log combined results (dumpMeasurement)"),
            false => {
                ("has no histograms", "set `histograms` to 1 in the sensor's configuration, and log again")
            }
        };
        return Err(Error::input(format!("the log of a TMF8829 {what}"), hint));
    };
    let (rows, columns) = (first.len(), first.first().map_or(0, Vec::len));
    let length = first.first().and_then(|row| row.first()).map_or(0, |zone| zone.bin.len());
    let is_same = |reading: &Vec<Vec<ZoneBins>>| {
        reading.len() == rows
            && reading
                .iter()
                .all(|row| row.len() == columns && row.iter().all(|zone| zone.bin.len() == length))
    };
    if let Some(other) = all.iter().position(|reading| !is_same(reading)) {
        return Err(Error::input(
            format!(
                "reading {other} of the log has other zones or bins than {rows} x {columns} zones of {length} bins"
            ),
            "log readings of one configuration",
        ));
    }
    let shift = shift.unwrap_or_else(|| {
        notes.push(
            "the log has no configuration: bins are taken as four of 200 ps; give the bin width for others"
                .into(),
        );
        2
    });
    if shift > MOST_SHIFT {
        return Err(Error::input(
            format!("the log of a TMF8829 joins bins by 2^{shift}"),
            format!("its configuration holds a bin_shift of up to {MOST_SHIFT}"),
        ));
    }
    let bins = used.map_or(length, |used| used >> shift).clamp(usize::from(length > 0), length);
    let repeats = |row: &Vec<ZoneBins>| row.len() > 1 && row.iter().all(|zone| zone.bin == row[0].bin);
    if all.iter().all(|reading| reading.iter().all(repeats)) {
        return Err(Error::input(
            "all zones of a row of the log have the same histogram: the program that wrote it repeats one",
            "log again with a newer version of the driver",
        ));
    }
    let mut values = vec![];
    for zone in all.iter().flatten().flatten() {
        values.extend(zone.bin[..bins].iter().map(|count| f64::from(*count)));
        if values.len() > MOST {
            return Err(Error::input("the log has too many readings", "split it"));
        }
    }
    notes.push(format!(
        "a log of a TMF8829: {} readings of {rows} x {columns} zones, {bins} bins; its reference histograms are left out",
        all.len()
    ));
    Ok(StoredHistograms {
        name: "the log".into(),
        tick: Some(TICK * f64::from(1u32 << shift)),
        shape: vec![all.len(), rows * columns, bins],
        values,
        unit: 1.0,
    })
}

/// Reads compact normalised histograms of a VL53L8CH: a table with columns of their bins, or printed aggregates.
pub(super) fn vl53l8ch(path: &Path, notes: &mut Vec<String>) -> Result<StoredHistograms> {
    let mut text = vec![];
    Plain::new(open(path)?)?.take(LONGEST).read_to_end(&mut text).map_err(unreadable)?;
    let text = String::from_utf8_lossy(&text);
    cnh(&text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>(), notes)
}

fn cnh(lines: &[&str], notes: &mut Vec<String>) -> Result<StoredHistograms> {
    let is_table = |line: &&str| line.to_lowercase().contains(COLUMN);
    let (zones, bins, mut values) = match lines.iter().position(is_table) {
        Some(head) => table(&lines[head..])?,
        None => printed(lines)?,
    };
    let readings = values.len() / (zones * bins);
    let least = values.iter().copied().fold(0.0, f64::min);
    if least < 0.0 {
        values.iter_mut().for_each(|value| *value -= least);
        notes.push(format!("the histograms have values down to {least}: the ambient light is subtracted in them; all are lifted by {:.6}", -least));
    }
    let most = values.iter().copied().fold(0.0, f64::max);
    let are_counts = least == 0.0 && values.iter().all(|value| value.fract() == 0.0);
    let unit = if are_counts || most == 0.0 { 1.0 } else { most / STEPS };
    values.iter_mut().for_each(|value| *value = (*value / unit).round());
    notes.push(format!("histograms of a VL53L8CH: {readings} readings of {zones} zones, {bins} bins"));
    Ok(StoredHistograms {
        name: "the histograms of a VL53L8CH".into(),
        tick: None,
        shape: vec![readings, zones, bins],
        values,
        unit,
    })
}

/// Begin of the names of columns.
const COLUMN: &str = "cnh__hist_bin_";
/// Steps of fractions.
const STEPS: f64 = (1u32 << 20) as f64;

/// Zones, bins and values `[reading][zone][bin]` of a table.
fn table(lines: &[&str]) -> Result<(usize, usize, Vec<f64>)> {
    let head = lines.first().copied().unwrap_or_default();
    let separator = [';', '\t'].into_iter().find(|s| head.contains(*s)).unwrap_or(',');
    let cells = |line: &str| {
        line.split(separator).map(|c| c.trim().trim_matches('"').to_lowercase()).collect::<Vec<_>>()
    };
    let place = |name: &String| -> Option<[usize; 2]> {
        let (bin, zone) = name.strip_prefix(COLUMN)?.split_once("_a")?;
        Some([zone.parse().ok()?, bin.parse().ok()?])
    };
    let names = cells(head);
    let places: Vec<(usize, [usize; 2])> =
        names.iter().enumerate().filter_map(|(at, name)| Some((at, place(name)?))).collect();
    let size = |k: usize| places.iter().map(|(_, place)| place[k] + 1).max().unwrap_or(0);
    let (zones, bins) = (size(0), size(1));
    let mut seen: Vec<[usize; 2]> = places.iter().map(|(_, place)| *place).collect();
    seen.sort_unstable();
    seen.dedup();
    if zones > MOST_ZONES || zones.checked_mul(bins) != Some(seen.len()) || seen.len() != places.len() {
        return Err(Error::input(
            format!("the table has {} columns of {zones} zones and {bins} bins", places.len()),
            "export all columns cnh__hist_bin_B_aZ, once each",
        ));
    }
    let mut values = vec![];
    for (number, line) in lines.iter().enumerate().skip(1) {
        let cells = cells(line);
        let from = values.len();
        values.resize(from + zones * bins, 0.0); // bounded: the text
        for (at, [zone, bin]) in &places {
            let value = cells.get(*at).and_then(|cell| cell.parse::<f64>().ok()).filter(|v| v.is_finite());
            values[from + zone * bins + bin] = value.ok_or_else(|| {
                Error::input(
                    format!("row {number} of the table has no number in column {}", names[*at]),
                    "export whole rows, with decimal points",
                )
            })?;
        }
    }
    if values.is_empty() {
        return Err(Error::input("the table has no row below its names", "log at least one reading"));
    }
    Ok((zones, bins, values))
}

/// The same of printed aggregates. A reading that is cut at either end of the text is left out.
fn printed(lines: &[&str]) -> Result<(usize, usize, Vec<f64>)> {
    let parsed = |line: &&str| -> Option<(usize, Vec<f64>)> {
        let lower = line.to_lowercase();
        let (head, bins) = lower.strip_prefix("aggregate ")?.split_once("bins:")?;
        let zone = head.split(',').next()?.trim().parse().ok()?;
        let bins = bins.split(',').map(str::trim).filter(|text| !text.is_empty());
        let values = bins.map(|text| text.parse().ok().filter(|v: &f64| v.is_finite()));
        Some((zone, values.collect::<Option<_>>()?))
    };
    let all: Vec<(usize, Vec<f64>)> = lines.iter().filter_map(parsed).collect();
    let zones = all.iter().map(|(zone, _)| zone + 1).max().unwrap_or(0);
    let bins = all.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let mut values = vec![];
    if zones > 0 && zones <= MOST_ZONES {
        for first in (0..all.len()).filter(|at| all[*at].0 == 0) {
            let reading = all.get(first..first + zones).unwrap_or_default();
            let is_whole =
                |(at, (zone, values)): (usize, &(usize, Vec<f64>))| *zone == at && values.len() == bins;
            if !reading.is_empty() && reading.iter().enumerate().all(is_whole) {
                reading.iter().for_each(|(_, bins)| values.extend(bins));
            }
        }
    }
    if values.is_empty() {
        return Err(Error::input(
            "no reading of a VL53L8CH is whole: lines `Aggregate Z, Ambient: A, Bins: ...` of zones 0, 1, 2, ... with as many bins each",
            "keep the sensor's output as text, with at least one reading from its first zone to its last",
        ));
    }
    Ok((zones, bins, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_and_printed_aggregates_are_the_same_histograms() {
        let mut notes = vec![];
        let text = "time,cnh__hist_bin_0_a0,cnh__hist_bin_1_a0,cnh__hist_bin_0_a1,cnh__hist_bin_1_a1\n1,0.5,2.5,3.5,-0.5\n2,1,2,3,4";
        let lines: Vec<&str> = text.lines().collect();
        let read = cnh(&lines, &mut notes).unwrap();
        let back = |read: &StoredHistograms| {
            read.values.iter().map(|v| (v * read.unit * 2.0).round() / 2.0).collect::<Vec<_>>()
        };
        assert_eq!(
            (read.shape.clone(), back(&read)),
            (vec![2, 2, 2], vec![1.0, 3.0, 4.0, 0.0, 1.5, 2.5, 3.5, 4.5])
        );
        assert!(notes[0].contains("lifted by 0.5"), "{notes:?}");
        let text = "Zone 0: No target\nAggregate 1, Ambient: 1.0, Bins: 7.0, 7.0, \nAggregate 0, Ambient: 2.0, Bins: 1.0, 2.0, \n\
                    Aggregate 1, Ambient: 1.0, Bins: 3.0, 4.0, \nAggregate 0, Ambient: 2.0, Bins: 9.0, ";
        let read = cnh(&text.lines().collect::<Vec<_>>(), &mut notes).unwrap();
        assert_eq!((read.shape, read.values, read.unit), (vec![1, 2, 2], vec![1.0, 2.0, 3.0, 4.0], 1.0));
        for (text, why) in [
            ("cnh__hist_bin_0_a0,cnh__hist_bin_1_a1\n1,2", "2 columns of 2 zones and 2 bins"),
            (
                "cnh__hist_bin_0_a0,cnh__hist_bin_1_a0\n1",
                "row 1 of the table has no number in column cnh__hist_bin_1_a0",
            ),
            ("cnh__hist_bin_0_a0", "no row below"),
            ("Aggregate 1, Ambient: 1.0, Bins: 7.0", "no reading of a VL53L8CH is whole"),
        ] {
            let error = cnh(&text.lines().collect::<Vec<_>>(), &mut notes).unwrap_err();
            assert!(error.what.contains(why), "{error}");
        }
    }
}
