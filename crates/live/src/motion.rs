//! What moves in live frames: positions with their errors, and the outline of the mask.
//!
//! Positions are those of `thirdbounce track`, not of the maps: their errors are measured (docs/track.md), and they exist where a few points
//! make no picture. They cost a small share of a frame: counts are summed over neighbouring pairs and bins first.

use std::collections::VecDeque;
use std::f64::consts::LN_2;

use serde::Serialize;
use thirdbounce::capture::{Capture, Reflectance};
use thirdbounce::export::track::TrackRow;
use thirdbounce::glam::DVec3;
use thirdbounce::maps::Maps;
use thirdbounce::session::Frame;
use thirdbounce::{Error, Result};
use thirdbounce_track::program::tracking::{noise, row};
use thirdbounce_track::{LocateOptions, Sight, Tracker, locate};

/// Pairs that positions are found from, at most, and at least after pairs are summed; bins at most: a position has errors of centimetres by
/// the shape of its object.
const MOST_PAIRS: usize = 256;
const LEAST_PAIRS: usize = 64;
const MOST_BINS: usize = 64;
/// Deviation of a coordinate of the acceleration of objects, metres per second squared: that of `thirdbounce track`.
const ACCELERATION: f64 = 1.0;
/// Least seconds between frames for the filter.
const LEAST_STEP: f64 = 1e-3;
/// Least share of the light's evidence that an object has: an object shades the room behind it, and what is then subtracted too much or too
/// little there is proved as an object, too. Evidence: docs/batch-and-live.md.
const LEAST_SHARE: f64 = 0.25;
/// Rows that a page shows, at most.
const SHOWN: usize = 600;

/// Follows what moves from frame to frame.
pub(super) struct MotionTrack {
    law: Reflectance,
    options: LocateOptions,
    tracker: Tracker,
    last: Option<f64>,
    shown: VecDeque<ShownRow>,
}

/// What a frame shows.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    /// Rows of the frame, one per object.
    pub rows: Vec<TrackRow>,
    /// Why there are none, if that is an error.
    pub failed: Option<Error>,
    /// Milliseconds that it took.
    pub took_ms: f64,
}

/// A row on the page. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct ShownRow {
    time: f64,
    track: usize,
    at: [f64; 3],
    sigma: [f64; 3],
}

/// What moves, for the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct MotionShown {
    /// Whether the room is subtracted from the newest frame.
    is_known: bool,
    /// Rows of the newest frame.
    rows: Vec<ShownRow>,
    /// Rows of the last frames, the newest last.
    track: Vec<ShownRow>,
    /// Edges of the mask of the newest frame, metres: x and y of one end, x and y of the other. None without a row.
    outline: Vec<[f64; 4]>,
    /// Part of the wall that the maps show, metres: x from, to, y from, to.
    extent: [f64; 4],
}

impl MotionTrack {
    /// `volume`: the box that holds the objects.
    pub fn new(law: Reflectance, volume: [DVec3; 2]) -> MotionTrack {
        let options = LocateOptions { volume: Some(volume), ..LocateOptions::default() };
        MotionTrack {
            law,
            options,
            tracker: Tracker::new(1.0, ACCELERATION),
            last: None,
            shown: VecDeque::new(),
        }
    }

    /// Takes a frame that was taken `time` seconds after the first one. `None`: nothing was subtracted from it.
    pub fn take(&mut self, name: &str, time: f64, frame: &Frame) -> Option<Moved> {
        let clock = std::time::Instant::now();
        let left = frame.left.as_deref()?;
        let step = self.last.replace(time).map_or(1.0, |last| (time - last).max(LEAST_STEP));
        self.tracker.set_frame_time(step);
        let found = few(left).and_then(|few| {
            let sight = Sight::of(&few, self.law, noise(&few))?;
            locate(&sight, &self.options, &self.tracker.expected())
        });
        let mut moved = Moved::default();
        match found {
            Ok(mut found) => {
                found.positions.retain(|position| position.share >= LEAST_SHARE);
                let states = self.tracker.step(&found.positions);
                moved.rows = states.iter().filter_map(|state| row(name, time, state, &found)).collect();
            }
            Err(error) => moved.failed = Some(error),
        }
        self.shown.extend(moved.rows.iter().map(ShownRow::of));
        while self.shown.len() > SHOWN {
            self.shown.pop_front();
        }
        moved.took_ms = 1e3 * clock.elapsed().as_secs_f64();
        Some(moved)
    }

    /// What the page shows of a frame.
    pub fn shown(&self, maps: &Maps, moved: Option<&Moved>) -> MotionShown {
        let rows: Vec<ShownRow> =
            moved.iter().flat_map(|moved| moved.rows.iter().map(ShownRow::of)).collect();
        let outline = if rows.is_empty() { vec![] } else { edges(maps) };
        MotionShown {
            is_known: moved.is_some(),
            rows,
            track: self.shown.iter().copied().collect(),
            outline,
            extent: maps.extent,
        }
    }
}

impl ShownRow {
    fn of(row: &TrackRow) -> ShownRow {
        ShownRow { time: row.time, track: row.track, at: row.at, sigma: row.deviations() }
    }
}

/// A capture of fewer pairs and bins: sums of neighbours where they can be summed, else pairs at even distances.
fn few(capture: &Capture) -> Result<Capture> {
    let [nx, ny] = capture.scan;
    let narrow = |capture: &Capture| capture.binned(capture.bins.div_ceil(MOST_BINS));
    if capture.pair_count() <= MOST_PAIRS {
        return narrow(capture);
    }
    let fits = |n: usize| (LEAST_PAIRS..=MOST_PAIRS).contains(&(nx * ny / (n * n)));
    let sums = (2..=nx.min(ny)).find(|n| nx % n == 0 && ny % n == 0 && fits(*n));
    if let Some((n, mut summed)) = sums.and_then(|n| Some((n, capture.summed(n).ok()?))) {
        widen(&mut summed, capture, n);
        return narrow(&summed);
    }
    let every = capture.pair_count().div_ceil(MOST_PAIRS);
    let kept: Vec<usize> = (0..capture.pair_count()).step_by(every).collect();
    let chosen = capture.keep(&kept, [kept.len(), 1]);
    narrow(&chosen)
}

/// Gives the sums of n x n points the spots that these make. A Gaussian (FWHM) with the variance of a square has √(2/3 ln 2) times its
/// width, and √2 times this where laser and sensor move together, as the spots of both are independent.
fn widen(summed: &mut Capture, of: &Capture, n: usize) {
    let pitch = |points: &[DVec3]| {
        let steps = [of.scan[1], 1].map(|step| points.get(step).map_or(0.0, |p| p.distance(points[0])));
        steps[0].max(steps[1])
    };
    let both = of.laser == of.sensor;
    let width = |points: &[DVec3], own: Option<f64>| {
        let variances = if both { 2.0 } else { 1.0 };
        let made = (variances * 2.0 / 3.0 * LN_2).sqrt() * n as f64 * pitch(points);
        Some(made.hypot(own.unwrap_or(0.0))).filter(|width| *width > 0.0)
    };
    summed.laser_spot = width(&of.laser, of.laser_spot);
    summed.sensor_spot = width(&of.sensor, of.sensor_spot);
}

/// Edges between the mask and what is outside, joined along lines.
fn edges(maps: &Maps) -> Vec<[f64; 4]> {
    let [x0, x1, y0, y1] = maps.extent;
    let (nx, ny) = (maps.nx, maps.ny);
    let at_x = |i: usize| x0 + (x1 - x0) * i as f64 / nx as f64;
    let at_y = |i: usize| y0 + (y1 - y0) * i as f64 / ny as f64;
    let is_in = |x: usize, y: usize| x < nx && y < ny && maps.mask[x * ny + y];
    let mut all = vec![];
    // Before pixel i of the line; wrapping numbers are outside.
    for x in 0..=nx {
        let is_edge = |y: usize| is_in(x.wrapping_sub(1), y) != is_in(x, y);
        runs(ny, is_edge, |from, to| all.push([at_x(x), at_y(from), at_x(x), at_y(to)]));
    }
    for y in 0..=ny {
        let is_edge = |x: usize| is_in(x, y.wrapping_sub(1)) != is_in(x, y);
        runs(nx, is_edge, |from, to| all.push([at_x(from), at_y(y), at_x(to), at_y(y)]));
    }
    all
}

/// Calls `hear` with the ends of the runs of numbers below `count` for which `is` holds.
fn runs(count: usize, is: impl Fn(usize) -> bool, mut hear: impl FnMut(usize, usize)) {
    let mut from = None;
    for at in 0..=count {
        match (from, at < count && is(at)) {
            (None, true) => from = Some(at),
            (Some(begin), false) => {
                hear(begin, at);
                from = None;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_encloses_the_mask() {
        let mut maps = Maps::empty([4, 3], [0.0, 4.0, 0.0, 3.0]);
        for pixel in [[1, 1], [2, 1], [2, 2]] {
            maps.mask[pixel[0] * 3 + pixel[1]] = true;
        }
        let lines = edges(&maps);
        let length: f64 = lines.iter().map(|[a, b, c, d]| (c - a).abs() + (d - b).abs()).sum();
        assert_eq!(length, 8.0, "{lines:?}");
        assert!(lines.contains(&[3.0, 1.0, 3.0, 3.0]) && lines.contains(&[1.0, 1.0, 3.0, 1.0]), "{lines:?}");
        assert!(edges(&Maps::empty([2, 2], [0.0, 1.0, 0.0, 1.0])).is_empty());
    }

    #[test]
    fn positions_come_from_few_pairs_and_bins() {
        let points: Vec<DVec3> =
            (0..400).map(|i| DVec3::new((i / 20) as f64, (i % 20) as f64, 0.0)).collect();
        let all = Capture::new([20, 20], points.clone(), points, 300, 0.01, vec![1.0; 400 * 300]);
        let less = few(&all).unwrap();
        assert_eq!((less.scan, less.bins), ([10, 10], 60));
        // Two points a metre apart: a standard deviation of 2 / √12 m of both together, √2 of it for each.
        let spots = [less.laser_spot, less.sensor_spot].map(|spot| spot.unwrap() / 2.354_820_045);
        assert!(spots.iter().all(|spot| (spot - 2.0 / 6f64.sqrt()).abs() < 1e-6), "{spots:?}");
        assert_eq!(less.histograms.iter().sum::<f32>(), 400.0 * 300.0, "every count is kept");
        let list = all.keep(&(0..397).collect::<Vec<_>>(), [397, 1]);
        let less = few(&list.with(|c| c.histograms = vec![1.0; 397 * 300])).unwrap();
        assert!(less.pair_count() <= MOST_PAIRS && less.histograms.len() == less.pair_count() * 60);
    }
}
