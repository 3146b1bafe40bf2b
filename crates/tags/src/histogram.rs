//! A capture from time tags and a scan.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::collect::PointCounts;
use super::division::{Course, Rounds};
use super::{Division, Inputs, Readings, Scan, Survey, Tags, Zero, lines, shape, stored, zero};
use crate::advice::advice;
use crate::capture::{Capture, METRES_PER_PICOSECOND, Turn, conditioning};
use crate::error::{Error, Result};
use crate::host;

/// Metres of path in a second.
const LIGHT: f64 = METRES_PER_PICOSECOND * 1e12;
/// Bins are at least this wide, metres, if nothing else is asked for: 8 ps, a fraction of any detector's jitter.
const USUAL_BIN: f64 = 8.0 * METRES_PER_PICOSECOND;
/// Cells in a bin, so that each point's path 0 falls within a small part of a bin of an edge.
const FINE: i64 = 8;
/// Longest delay of path 0, seconds.
const LONGEST: f64 = 1.0;
/// Laser pulses of two points may differ by this share before pile-up is not taken out.
const EVEN: f64 = 0.05;

/// Whether the capture shall hold the number of laser pulses of a point: pile-up is then taken out when it is read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PileUp {
    /// If the file shows that the detector records at most one photon of a laser pulse.
    #[default]
    Auto,
    /// Yes.
    On,
    /// No.
    Off,
}

/// How time tags become histograms.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Asked {
    /// The channels of arrays and text.
    pub inputs: Inputs,
    /// Which photons belong to which point; `None` takes the lines of an image, if the header has any.
    pub division: Option<Division>,
    /// Seconds of the points of a line, where no marker ends it; `None`: as the header says, or until photons cease.
    pub line_time: Option<f64>,
    /// Points by which the photons of every second line of a scan in both directions come late; `None`: an estimate.
    pub line_shift: Option<f64>,
    /// Lines, or points, of each round that come before those of the scan.
    pub lines_before: usize,
    /// The detector; `None` takes the only one.
    pub channel: Option<i32>,
    /// Bin width in metres of path; `None` takes the instrument's ticks, or as many as 8 ps need.
    pub bin_width: Option<f64>,
    /// What delay is path 0.
    pub zero: Zero,
    /// Photons later than this after their laser pulse are left out, seconds.
    pub until: Option<f64>,
    /// Whether the capture shall hold the number of laser pulses.
    pub pile_up: PileUp,
    /// How to mirror and rotate the scan.
    pub turn: Turn,
    /// Where laser and sensor stand, metres, in the coordinates of the scan: wall points then move along the laser's beam to where
    /// their own returns come from. `None` leaves them where they are given.
    pub seen_from: Option<[DVec3; 2]>,
    /// Which readings of an instrument's own histograms are used.
    pub readings: Readings,
}

/// A capture from time tags, and how it came about.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Histograms {
    /// The capture; its name is the file's stem.
    pub capture: Capture,
    /// Captures of each reading, with the points and the path 0 of `capture`, if they are asked for.
    pub readings: Vec<Capture>,
    /// What wrote the file.
    pub instrument: String,
    /// What the file holds; `None` for histograms of the instrument.
    pub survey: Option<Survey>,
    /// The direct peak of each pair of the capture as a path from the laser's trigger on, metres.
    pub direct: Option<Vec<f64>>,
    /// Photons in the capture.
    pub photons: u64,
    /// Photons of the detector that are not in the capture.
    pub left_out: u64,
    /// Laser pulses of the point with the fewest and of that with the most.
    pub pulses: Option<[u64; 2]>,
    /// Whether wall points are where their own returns come from.
    pub shaped: bool,
    /// Pairs without a direct peak, which were left out.
    pub dropped: usize,
    /// Sentences that say what was done and what is odd.
    pub notes: Vec<String>,
}

/// Makes a capture of a file of time tags or of the instrument's own histograms, and the points of its scan. Time tags are
/// read twice.
///
/// # Errors
/// `Kind::Input`, beginning with the path: a file that cannot be read, or has no photons for the points; no direct peak.
/// `Kind::Options` for options that do not fit the file. `Kind::Memory` if the histograms do not fit.
pub fn histogram(path: &Path, scan: &Scan, asked: &Asked) -> Result<Histograms> {
    made(path, scan, asked).map_err(|e| {
        let place = path.display().to_string();
        if e.what.starts_with(&place) { e } else { e.at(place) }
    })
}

/// Photons of the points in fine bins, and where they are from.
struct Counted {
    cells: PointCounts,
    /// Ticks of a fine bin and of a bin.
    ticks: [i64; 2],
    instrument: String,
    survey: Option<Survey>,
    /// See [`second_share`].
    share: f64,
}

fn counted(
    path: &Path,
    stored: Option<&stored::InstrumentHistograms>,
    scan: &Scan,
    asked: &Asked,
    notes: &mut Vec<String>,
) -> Result<Counted> {
    if let Some(stored) = stored {
        let (fine, ticks) = widths(asked.bin_width, stored.tick, notes)?;
        if asked.division.is_some() {
            return Err(Error::options(
                "the file holds histograms: the instrument has divided the photons",
                "leave out which photons belong to which point",
            ));
        }
        let cells = PointCounts::of_stored(stored, fine as usize, asked.until)?;
        let instrument = format!("histograms: {}", stored.name);
        return Ok(Counted { cells, ticks: [fine, ticks], instrument, survey: None, share: 1.0 });
    }
    if asked.readings != Readings::Sum {
        return Err(Error::options(
            "readings were asked for, but the file holds time tags",
            "leave this out: it is for histograms of an instrument",
        ));
    }
    let tags = Tags::open(path, &asked.inputs)?;
    let (fine, ticks) = widths(asked.bin_width, tags.tick, notes)?;
    let survey = Survey::of(&tags)?;
    notes.extend(survey.passed.notes.iter().cloned());
    let cells = of_tags(&tags, &survey, scan, asked, fine, notes)?;
    let share = second_share(&survey, asked.channel)?;
    Ok(Counted { cells, ticks: [fine, ticks], instrument: tags.instrument, survey: Some(survey), share })
}

fn made(path: &Path, scan: &Scan, asked: &Asked) -> Result<Histograms> {
    check(scan, asked)?;
    let mut notes = vec![];
    let stored = stored::read(path, scan.points(), asked.bin_width, asked.readings, &mut notes)?;
    let Counted { cells, ticks, instrument, survey, share } =
        counted(path, stored.as_ref(), scan, asked, &mut notes)?;
    let per_bin = (ticks[1] / ticks[0]) as usize;
    let total = cells.total();
    if total == 0 {
        return Err(Error::input(
            "no photon belongs to any point",
            "check the channel, and which photons belong to which point",
        ));
    }
    let (zeros, direct) = zeros(&cells, scan, asked, &mut notes)?;
    if stored.is_some() && direct {
        zero::check_scene(&cells, &zeros)?;
    }
    let (outline, pair_of) = outline(scan, asked, &zeros, cells.width, &mut notes)?;
    notes.extend(asked.turn.note());
    let mut readings = vec![];
    if let Some(stored) = &stored {
        for counts in &stored.readings {
            let cells = PointCounts::of_counts(stored, counts, ticks[0] as usize, asked.until)?;
            let capture = bins(&cells, per_bin, &zeros, &pair_of, outline.clone())?;
            let reading = conditioning::measured(capture.with(|c| c.direct = direct.then_some(0.0)), true)?;
            readings.push(reading.capture);
        }
    }
    let mut capture = bins(&cells, per_bin, &zeros, &pair_of, outline)?;
    capture.name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let pulses = cells.pulses.as_ref().and_then(|all| Some([*all.iter().min()?, *all.iter().max()?]));
    capture.direct = direct.then_some(0.0);
    capture.cycles = cycles(&cells, asked.pile_up, share, &mut notes)?;
    let shaped = asked.seen_from.is_some();
    let in_pairs = |zeros: &[f64]| {
        let mut all = vec![0.0; zeros.len()]; // bounded: the points of the scan
        pair_of.iter().zip(zeros).for_each(|(pair, zero)| all[*pair] = zero * cells.width * LIGHT);
        all
    };
    let mut direct = direct.then(|| in_pairs(&zeros));
    let measured: Vec<bool> = capture.histograms.chunks_exact(capture.bins).map(|h| !h[0].is_nan()).collect();
    // The order of the points is that of the scan, and dark points stay.
    let measured_pairs = conditioning::measured(capture, true)?;
    let (mut capture, dropped) = (measured_pairs.capture, measured_pairs.dropped);
    notes.extend(measured_pairs.notes);
    if let Some(all) = direct.as_mut().filter(|all| all.len() != capture.pair_count()) {
        let mut kept = measured.iter();
        all.retain(|_| *kept.next().unwrap_or(&false));
    }
    let photons = capture.histograms.iter().map(|n| f64::from(*n)).sum::<f64>() as u64;
    let left_out = total - photons.min(total) + cells.outside + cells.late;
    let unit = stored.as_ref().map_or(1.0, |stored| stored.unit);
    if unit != 1.0 {
        // Fractions are no photon counts: their noise is estimated.
        for capture in readings.iter_mut().chain([&mut capture]) {
            capture.histograms.iter_mut().for_each(|v| *v = (f64::from(*v) * unit) as f32);
            capture.integer_counts = false;
        }
    }
    Ok(Histograms {
        capture,
        readings,
        instrument,
        survey,
        direct,
        photons,
        left_out,
        pulses,
        shaped,
        dropped,
        notes,
    })
}

/// The pairs of a capture without counts, and the pair of each point: where the scan says, or where their own returns come from.
fn outline(
    scan: &Scan,
    asked: &Asked,
    zeros: &[f64],
    width: f64,
    notes: &mut Vec<String>,
) -> Result<(Capture, Vec<usize>)> {
    let Some(places) = asked.seen_from else { return Ok(scan.pairs(asked.turn, None)) };
    let path: Vec<f64> = zeros.iter().map(|zero| zero * width * LIGHT).collect();
    let shape = shape::of(scan, places, &path)?;
    let [least, most, rms] = shape.moved.map(|moved| 1e3 * moved);
    notes.push(format!(
        "wall points are where their own returns come from: {least:.1} to {most:.1} mm farther along the beam than given, {rms:.1} mm \
         RMS"
    ));
    Ok(scan.pairs(asked.turn, Some(&shape.points)))
}

fn check(scan: &Scan, asked: &Asked) -> Result<()> {
    let positive = |what: &str, value: Option<f64>| match value {
        Some(value) if !(value.is_finite() && value > 0.0) => {
            Err(Error::options(format!("{what} is {value}"), "give one above 0"))
        }
        _ => Ok(()),
    };
    positive("the bin width", asked.bin_width)?;
    positive("the last delay", asked.until)?;
    positive("the time of a line", asked.line_time)?;
    if let Some(shift) = asked.line_shift.filter(|shift| shift.is_nan() || shift.abs() > 1e3) {
        return Err(Error::options(
            format!("the shift of every second line is {shift} points"),
            "give a few points or less",
        ));
    }
    if let Some(place) = asked.seen_from.iter().flatten().find(|place| !place.is_finite()) {
        return Err(Error::options(
            format!("laser or sensor stand at {place}"),
            "give three numbers in metres, or six for laser and sensor",
        ));
    }
    match asked.zero {
        Zero::At(delay) if delay.is_nan() || delay.abs() > LONGEST => Err(Error::options(
            format!("the delay of path 0 is {delay} s"),
            "give the seconds from a laser pulse on",
        )),
        Zero::At(_) if asked.seen_from.is_some() => Err(Error::options(
            "the shape of the wall comes from the direct peaks, but one delay was given for all points",
            "take the direct peak as path 0, or leave out where laser and sensor stand",
        )),
        Zero::Direct if !scan.is_confocal() => Err(Error::options(
            "there is no direct peak: laser and sensor see different points of the wall",
            "give the delay of path 0 in place of the direct peak",
        )),
        _ => Ok(()),
    }
}

/// Ticks of a cell, and of a bin: the whole number nearest to the asked width.
fn widths(asked: Option<f64>, tick: f64, notes: &mut Vec<String>) -> Result<(i64, i64)> {
    let tick_path = tick * LIGHT;
    let ticks = match asked {
        Some(width) => (width / tick_path).round().max(1.0),
        None => (USUAL_BIN / tick_path - 1e-6).ceil().max(1.0),
    };
    if ticks > 1e9 {
        return Err(Error::options(
            format!("a bin would be {ticks} ticks of {:.3} ps", tick * 1e12),
            "give a narrower bin width",
        ));
    }
    if let Some(width) = asked.filter(|width| (width / tick_path - ticks).abs() > 1e-3 * ticks) {
        notes.push(format!(
            "bins are {:.3} ps, whole ticks of {:.3} ps, in place of {:.3} ps",
            ticks * tick * 1e12,
            tick * 1e12,
            width / METRES_PER_PICOSECOND
        ));
    }
    let ticks = ticks as i64;
    let parts = (FINE.min(ticks)..=ticks.min(64 * FINE)).find(|parts| ticks % parts == 0).unwrap_or(1);
    Ok((ticks / parts, ticks))
}

fn of_tags(
    tags: &Tags,
    survey: &Survey,
    scan: &Scan,
    asked: &Asked,
    fine: i64,
    notes: &mut Vec<String>,
) -> Result<PointCounts> {
    let detector = survey.channel(asked.channel)?;
    let of_image = Division::of_image(&tags.image);
    let division = asked.division.clone().or(of_image).ok_or_else(|| {
        Error::options(
            "it is not known which photons belong to which point",
            format!(
                "name the marker of points or lines, or the laser pulses of a point: the file has {}",
                survey.marker_counts()
            ),
        )
    })?;
    let per_line = scan.per_line.or(tags.image.size[0]);
    let course = |lines: &Rounds, ended: bool, notes: &mut Vec<String>| {
        course(tags, survey, detector.channel, scan, per_line.unwrap_or(1), asked, lines, ended, notes)
    };
    let spans = division
        .spans(survey, [scan.points(), asked.lines_before], per_line, &course, notes)
        .map_err(|e| match &survey.passed.cut {
            Some(cut) => Error { what: format!("{cut}; {}", e.what), ..e },
            None => e,
        })?;
    let longest = asked.until.map_or(i64::MAX, |until| (until / tags.tick).ceil() as i64 - 1);
    let cells = (detector.longest.min(longest).max(0) / fine + 1) as usize;
    if survey.out_of_order > 0 {
        notes.push(format!("{} markers were out of order and are put in order", survey.out_of_order));
    }
    if survey.photons_out_of_order > 0 {
        notes.push(format!(
            "{} photons were out of order and are counted where they belong",
            survey.photons_out_of_order
        ));
    }
    PointCounts::of_tags(tags, detector.channel, &spans, scan.points(), fine, cells)
}

/// The course of the scanner along its lines: by the options, by the header, or by the photons.
#[allow(clippy::too_many_arguments)]
fn course(
    tags: &Tags,
    survey: &Survey,
    detector: i32,
    scan: &Scan,
    per_line: usize,
    asked: &Asked,
    lines: &Rounds,
    ended: bool,
    notes: &mut Vec<String>,
) -> Result<Course> {
    let image = &tags.image;
    let photons = survey.channel(Some(detector))?.photons;
    let reversed = image.both_ways && !scan.both_ways && scan.per_line.is_some();
    if reversed {
        notes.push("every second line runs backwards, as the header says".into());
    }
    if let Some(sine) = image.sine {
        notes.push(format!(
            "the scanner follows a sine over {:.0} % of its amplitude, as the header says",
            100.0 * sine
        ));
    }
    let mut course = Course { sine: image.sine, reversed, ..Course::default() };
    let stated = asked.line_time.or(image.pixel.map(|pixel| pixel * per_line as f64));
    course.duration = match (stated, survey.period) {
        _ if ended => None,
        (Some(seconds), Some(period)) => Some(((seconds / period).round() as i64).max(per_line as i64)),
        _ => {
            let found = lines::duration(tags, detector, lines, photons)?;
            notes.push(match found {
                Some(pulses) => {
                    format!("photons cease {pulses} laser pulses after a line begins: its points take these")
                }
                None => {
                    "no marker ends a line: its points take all its time, a return of the scanner included"
                        .into()
                }
            });
            found
        }
    };
    if reversed || scan.both_ways {
        let lines: Rounds = lines
            .iter()
            .map(|round| {
                let ends = |line: &[i64; 2]| {
                    [line[0], course.duration.map_or(line[1], |d| line[1].min(line[0] + d))]
                };
                round.iter().map(ends).collect()
            })
            .collect();
        course.late = asked.line_shift.map_or_else(|| lines::shift(tags, detector, &lines, per_line), Ok)?;
        if asked.line_shift.is_none() && course.late != 0.0 {
            notes.push(format!(
                "photons of every second line come {:.2} points late: the lines are shifted by this",
                course.late
            ));
        }
    } else if asked.line_shift.is_some() {
        return Err(Error::options(
            "a shift of every second line was given, but all lines run in one direction",
            advice!["leave " LineShift " out, or say that every second line runs backwards"],
        ));
    }
    Ok(course)
}

/// Second photons of a laser pulse, as a share of those that chance would give. Above a few per cent the detector records
/// them. 1 where there are too few to tell.
fn second_share(survey: &Survey, channel: Option<i32>) -> Result<f64> {
    let seen = survey.channel(channel)?;
    let photons = seen.photons as f64;
    let expected = photons * photons / survey.pulses.max(1) as f64 / 2.0;
    Ok(if expected < 20.0 { 1.0 } else { seen.second as f64 / expected })
}

/// The delay of path 0 in cells for each point, and whether it is that of direct light. NaN without a direct peak.
fn zeros(
    cells: &PointCounts,
    scan: &Scan,
    asked: &Asked,
    notes: &mut Vec<String>,
) -> Result<(Vec<f64>, bool)> {
    let delay = match asked.zero {
        Zero::At(delay) => return Ok((vec![delay / cells.width; cells.points()], false)),
        Zero::Direct => zero::direct(cells, (2.0 * scan.reach() + 0.1) / (cells.width * LIGHT))?,
    };
    let missing = delay.iter().filter(|d| d.is_none()).count();
    if missing > 0 {
        notes.push(format!("{missing} points have no clear peak of direct light"));
    }
    Ok((delay.into_iter().map(|d| d.unwrap_or(f64::NAN)).collect(), true))
}

/// Cells as bins whose paths begin at each point's zero.
fn bins(
    cells: &PointCounts,
    per_bin: usize,
    zeros: &[f64],
    pair_of: &[usize],
    outline: Capture,
) -> Result<Capture> {
    let n = per_bin as f64;
    let known = || zeros.iter().copied().filter(|z| z.is_finite());
    let (early, late) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
    // Which bin the middle of a cell is in, path 0 at the edge of bin 0.
    let bin = |cell: usize, zero: f64| ((cell as f64 + 0.5 - zero) / n).floor();
    let first = bin(0, late);
    // Bins that all points have whole. A scan of points far from each other may leave none.
    let end = ((cells.cells as f64 - late) / n).ceil();
    if !(end - first >= 1.0 && end > 0.0 && end - first < 1e9) {
        return Err(Error::options(
            format!(
                "no path is left: path 0 is at delays of {:.3} to {:.3} ns, and the last photon at {:.3} ns",
                1e9 * early * cells.width,
                1e9 * late * cells.width,
                1e9 * cells.cells as f64 * cells.width
            ),
            "check the delay of path 0 and the last delay",
        ));
    }
    let count = (end - first) as usize;
    let mut histograms = host::filled("the counts", cells.points().saturating_mul(count), 0.0f32)?;
    let mut point_of = vec![0; pair_of.len()]; // bounded: the points of the scan
    pair_of.iter().enumerate().for_each(|(point, pair)| point_of[*pair] = point);
    histograms.par_chunks_mut(count).zip(&point_of).for_each(|(histogram, point)| {
        let zero = zeros[*point];
        if zero.is_nan() {
            return histogram.fill(f32::NAN);
        }
        for (cell, counted) in cells.of(*point).iter().enumerate().filter(|(_, n)| **n > 0) {
            let at = bin(cell, zero) - first;
            if at < count as f64 {
                histogram[at as usize] += *counted as f32;
            }
        }
    });
    let width = cells.width * LIGHT * n;
    Ok(outline.with(|c| {
        (c.bins, c.bin_width, c.t_start) = (count, width, first * width);
        (c.histograms, c.integer_counts) = (histograms, true);
    }))
}

/// The laser pulses of a pair, if pile-up can be taken out.
fn cycles(cells: &PointCounts, asked: PileUp, share: f64, notes: &mut Vec<String>) -> Result<Option<f64>> {
    let fails = |why: String| match asked {
        PileUp::On => Err(Error::options(why, "do not ask for pile-up to be taken out")),
        _ => Ok(None),
    };
    let Some(pulses) = cells.pulses.as_ref().filter(|_| asked != PileUp::Off) else {
        return if asked == PileUp::Off {
            Ok(None)
        } else {
            fails("the number of laser pulses is not known".into())
        };
    };
    let (least, most) = pulses.iter().fold((u64::MAX, 0), |(a, b), n| (a.min(*n), b.max(*n)));
    if (most - least) as f64 > EVEN * most as f64 {
        return fails(format!("points have {least} to {most} laser pulses, which are too different"));
    }
    if asked == PileUp::Auto && share > EVEN {
        return Ok(None);
    }
    let counted = |point: usize| cells.of(point).iter().map(|n| u64::from(*n)).sum::<u64>();
    if let Some(point) = (0..cells.points()).find(|p| counted(*p) >= pulses[*p]) {
        return fails(format!("point {point} has more photons than laser pulses"));
    }
    let mean = pulses.iter().sum::<u64>() as f64 / pulses.len() as f64;
    if asked == PileUp::Auto {
        notes.push(format!(
            "no laser pulse gave two photons, where chance would give many: the capture holds its {mean:.0} laser pulses \
             of a point, so that pile-up can be taken out"
        ));
    }
    Ok(Some(mean))
}
