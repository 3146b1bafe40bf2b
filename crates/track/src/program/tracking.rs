//! Positions of hidden objects in one capture or in frames, as a table, a report and a page.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Value, json};
use thirdbounce::capture::{Capture, Reflectance};
use thirdbounce::engine::{background, room_light, variances, without_room};
use thirdbounce::export::track::{TrackRow, csv, figure, page};
use thirdbounce::files::atomic;
use thirdbounce::files::staging::Staging;
use thirdbounce::glam::{DMat3, DVec3};
use thirdbounce::job;
use thirdbounce::settings::{ReflectanceSetting, Settings};

use super::calibration;
use crate::error::{Error, Result};
use crate::{Edge, Finding, LocateOptions, Position, Sight, TrackState, Tracker, locate};

/// Names of the files of a result; the report is the last that appears.
pub const FILES: [&str; 4] = ["track.csv", "track.svg", "track.html", "track.json"];

/// What is asked.
#[derive(Debug, Clone)]
pub struct Tracking {
    /// Captures, a frame each.
    pub frames: Vec<PathBuf>,
    /// How captures are read and prepared.
    pub settings: Settings,
    /// What is looked for; the box comes from the settings.
    pub options: LocateOptions,
    /// A calibration of the pairs by known positions.
    pub calibration: Option<PathBuf>,
    /// An edge that hides a part of the scene.
    pub edge: Option<Edge>,
    /// Seconds from frame to frame.
    pub frame_time: f64,
    /// Standard deviation of a coordinate of the acceleration, metres per second squared.
    pub acceleration: f64,
    /// Folder of the results.
    pub out: PathBuf,
}

/// What was found.
#[derive(Debug)]
pub struct Tracked {
    /// A row per position.
    pub rows: Vec<TrackRow>,
    /// What was done and what it means, as sentences.
    pub notes: Vec<String>,
    /// Files that were written.
    pub files: Vec<PathBuf>,
    /// Positions a second, without reading.
    pub rate: f64,
}

/// Locates the objects of all frames, follows them, and writes the results. `hear` gets the number of frames that are done.
///
/// # Errors
/// A frame that cannot be read, or of another scan than the first; settings that do not fit; results that cannot be written. Nothing is
/// written then.
pub fn track(what: &Tracking, hear: &mut dyn FnMut(usize) -> Result<()>) -> Result<Tracked> {
    check(what)?;
    let calibration = what.calibration.as_deref().map(calibration::read).transpose()?;
    let mut tracker = Tracker::new(what.frame_time, what.acceleration);
    let (mut rows, mut notes, mut reports) = (vec![], vec![], vec![]);
    let (mut seconds, mut first, mut volume) = (0.0, None::<Capture>, None);
    for (number, path) in what.frames.iter().enumerate() {
        let loaded = job::load(path, &what.settings)?;
        if first
            .as_ref()
            .is_some_and(|first| first.laser != loaded.capture.laser || first.sensor != loaded.capture.sensor)
        {
            return Err(Error::input(
                format!("{}: its points differ from those of {}", path.display(), what.frames[0].display()),
                "give frames of one scan, or track them one by one",
            ));
        }
        if number == 0 {
            notes.extend(loaded.notes.iter().chain(&loaded.warnings).cloned());
        }
        let capture = emptied(loaded.capture, number == 0, &mut notes);
        let clock = Instant::now();
        let found = match &calibration {
            Some(calibration) => {
                calibration.locate(&capture, what.options.volume, what.options.blobs.is_some())
            }
            None => {
                let sight = Sight::of(&capture, law(&what.settings), noise(&capture))?.past(what.edge);
                locate(&sight, &what.options, &tracker.expected())
            }
        };
        let found = found.map_err(|e| if what.frames.len() > 1 { e.at(path.display()) } else { e })?;
        let states = tracker.step(&found.positions);
        seconds += clock.elapsed().as_secs_f64();
        let time = number as f64 * what.frame_time;
        let name = path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let own: Vec<TrackRow> = states.iter().filter_map(|state| row(&name, time, state, &found)).collect();
        reports.push(frame_report(&name, time, &found, &own));
        volume.get_or_insert(found.volume);
        rows.extend(own);
        first.get_or_insert(capture);
        hear(number + 1)?;
    }
    let (Some(capture), Some(volume)) = (first, volume) else {
        return Err(Error::options("no frame was given", "give one or more captures"));
    };
    notes.extend(said(&rows, what, &capture));
    let rate = what.frames.len() as f64 / seconds.max(1e-9);
    let report = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "frames": reports,
        "frame_time_s": what.frame_time,
        "acceleration_m_s2": what.acceleration,
        "volume_m": volume.map(|corner| corner.to_array()),
        "pairs": capture.pair_count(),
        "bins": capture.bins,
        "positions_per_second": rate,
        "settings": serde_json::to_value(&what.settings).unwrap_or_default(),
        "notes": notes,
    });
    let files = write(what, &rows, &notes, &report, volume, &capture)?;
    Ok(Tracked { rows, notes, files, rate })
}

fn check(what: &Tracking) -> Result<()> {
    for (value, name) in
        [(what.frame_time, "the time between frames"), (what.acceleration, "the acceleration")]
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::options(format!("{name} is {value}"), "give a number above 0"));
        }
    }
    if what.calibration.is_some()
        && (what.settings.empty.is_some() || what.options.blobs.is_some_and(|n| n > 1))
    {
        return Err(Error::options(
            "a calibration holds the empty room and one object",
            "leave out --empty, and --blobs 2 or 3",
        ));
    }
    let inputs = || {
        let beside = what.settings.empty.iter().chain(&what.calibration);
        what.frames.iter().chain(beside).map(PathBuf::as_path)
    };
    FILES.iter().try_for_each(|name| job::check_not_input(&what.out.join(name), inputs()))
}

/// The reflectance by which light falls with the distance.
pub fn law(settings: &Settings) -> Reflectance {
    match settings.model {
        Some(ReflectanceSetting::Known(law)) => law,
        _ => Reflectance::Cosine,
    }
}

/// Variances of a bin per count, and without light.
pub fn noise(capture: &Capture) -> [f64; 2] {
    if capture.integer_counts { [1.0, 0.0] } else { variances(capture, background(capture)) }
}

/// The capture without the empty room that it holds.
fn emptied(capture: Capture, is_first: bool, notes: &mut Vec<String>) -> Capture {
    let Some(light) = room_light(&capture) else { return capture };
    match without_room(&capture, &light) {
        Some((gain, left)) => {
            if is_first {
                let mean = gain.of_pair.iter().sum::<f64>() / gain.of_pair.len().max(1) as f64;
                notes.push(format!(
                    "the empty capture is subtracted with a mean gain of {mean:.3}: {:.1} % of the counts",
                    100.0 * gain.share
                ));
            }
            left
        }
        None => {
            notes.push("no gain makes the empty capture a part of the counts: it is not subtracted".into());
            capture.with(|capture| capture.empty = None)
        }
    }
}

/// Covariances xx, yy, zz, xy, xz, yz.
fn six(matrix: DMat3) -> [f64; 6] {
    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|(i, j)| matrix.col(j)[i])
}

/// The row of an object that has a position in the frame.
pub fn row(name: &str, time: f64, state: &TrackState, found: &Finding) -> Option<TrackRow> {
    let position: &Position = &found.positions[state.position?];
    let filtered = [0, 1, 2].map(|k| state.covariance.col(k)[k].max(0.0).sqrt());
    Some(TrackRow {
        frame: name.into(),
        time,
        track: state.track,
        at: position.at.to_array(),
        covariance: six(position.covariance),
        filtered: [state.at.to_array(), filtered],
        velocity: state.velocity.to_array(),
        distance: position.distance,
        light: position.light,
        extent: position.extent,
        share: position.share,
        unmeasured: position.unmeasured.map(|direction| direction.to_array()),
    })
}

fn frame_report(name: &str, time: f64, found: &Finding, rows: &[TrackRow]) -> Value {
    let blob = |row: &TrackRow| {
        json!({
            "track": row.track,
            "position_m": row.at,
            "sigma_m": row.deviations(),
            "covariance_m2": row.covariance,
            "filtered_m": row.filtered[0],
            "filtered_sigma_m": row.filtered[1],
            "velocity_m_s": row.velocity,
            "distance_m": row.distance[0],
            "distance_sigma_m": row.distance[1],
            "light": row.light[0],
            "light_sigma_log": row.light[1],
            "extent_m": row.extent[0],
            "extent_sigma_log": row.extent[1],
            "share": row.share,
            "unmeasured": row.unmeasured,
        })
    };
    json!({
        "frame": name,
        "time_s": time,
        "blobs": rows.iter().map(blob).collect::<Vec<_>>(),
        "background": found.background,
        "reduced_chi_square": found.excess,
        "drops": found.drops,
        "needed_drop": found.needed,
    })
}

/// What the rows mean.
fn said(rows: &[TrackRow], what: &Tracking, capture: &Capture) -> Vec<String> {
    let mut notes = vec![];
    let empty = what.frames.len() - {
        let mut times: Vec<f64> = rows.iter().map(|row| row.time).collect();
        times.dedup();
        times.len()
    };
    if empty > 0 {
        notes.push(format!("{empty} of {} frames prove no object", what.frames.len()));
    }
    if let Some(direction) = rows.iter().find_map(|row| row.unmeasured) {
        let [x, y, z] = direction;
        notes.push(format!(
            "{} wall points do not measure the direction ({x:.2}, {y:.2}, {z:.2}): along it, the position is the middle of what the box allows, \
             and its error is that; the distance from the wall points is measured",
            capture.pair_count()
        ));
    }
    if !rows.is_empty() {
        notes.push(
            "a position is the centre of an object as its light shows it; of an object as large as a person it is the centre of light".into(),
        );
    }
    notes
}

fn write(
    what: &Tracking,
    rows: &[TrackRow],
    notes: &[String],
    report: &Value,
    volume: [DVec3; 2],
    capture: &Capture,
) -> Result<Vec<PathBuf>> {
    let title = match &what.frames[..] {
        [one] => one.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        all => format!("{} frames", all.len()),
    };
    let wall: Vec<[f64; 3]> = capture.laser.iter().chain(&capture.sensor).map(DVec3::to_array).collect();
    let drawn = figure(&title, rows, volume.map(|corner| corner.to_array()), &wall);
    let json = serde_json::to_string_pretty(report).map_err(|e| {
        Error::output(format!("cannot be written as JSON: {e}"), "please report this as a bug")
    })?;
    let texts = [csv(rows), drawn.svg(), page(&title, &drawn, rows, notes), json + "\n"];
    let staging = Staging::new(&what.out)?;
    let place = |name: &str| Path::new(staging.path()).join(name);
    let files: Vec<PathBuf> = FILES.iter().map(|name| place(name)).collect();
    files.iter().zip(&texts).try_for_each(|(file, text)| atomic::write(file, text.as_bytes()))?;
    staging.commit(&files)
}
