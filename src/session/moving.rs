//! The room as what rests in the frames of a session: a running background in the place of a capture of the empty room.
//!
//! Of the last frames, those that show the room agree in the counts of [`WINDOW`] neighbouring bins of a pair ([`rested`]), and their mean
//! is the background. The background is of the frames before the one that is subtracted from. It is renewed for an eighth of the pairs with
//! each frame.

use std::sync::Arc;

use rayon::prelude::*;
use thirdbounce_base::host;

use crate::capture::{Capture, RoomLight};
use crate::engine::{variance_per_count, without_room};
use crate::{Error, Result};

use super::resting::{Resting, RestingScratch, WINDOW, rested};

/// Frames of the background by default: three seconds of ten frames a second.
pub const MOVING_FRAMES: usize = 31;
/// Frames from which on there is a background: fewer show the object at one place.
pub(super) const LEAST_FRAMES: usize = 5;
/// Most frames: a minute of many.
const MOST_FRAMES: usize = 1000;
/// Share of the moving light in windows in doubt above which nothing is subtracted: an object that sways before a wall has .40 to .48, those
/// that leave their place up to .28 in the first frames, and up to .1 later.
const DOUBTED: f64 = 0.35;
/// Standard deviations of noise from which on what is left of a frame is evidence of light.
const EVIDENT: f64 = 4.0;
/// Frames in which all pairs are renewed once, at most; fewer while there are few frames.
const ROUND: usize = 8;

/// Frames of the background that a session may be asked for.
///
/// # Errors
/// A number out of range, or counts of an empty room beside it.
pub(super) fn check(frames: Option<usize>, scan: &Capture) -> Result<()> {
    let Some(frames) = frames else { return Ok(()) };
    if !(LEAST_FRAMES..=MOST_FRAMES).contains(&frames) {
        return Err(Error::options(
            format!("the background of what moves is that of {frames} frames"),
            format!("give {LEAST_FRAMES} to {MOST_FRAMES} frames"),
        ));
    }
    if scan.empty.is_some() {
        return Err(Error::options(
            "a capture of the empty room and a background of the frames are both to be subtracted",
            "give one of them",
        ));
    }
    Ok(())
}

/// What is solved of a frame.
#[derive(Debug)]
pub(super) enum Subtracted {
    /// All of it, for this reason.
    None(String),
    /// What is left without the room, and whether that is noise alone.
    Left(Arc<Capture>, bool),
}

/// Subtracts the room that a frame holds.
pub(super) fn subtract(frame: &Capture, light: &RoomLight) -> Subtracted {
    match without_room(frame, light) {
        Some((gain, left)) => Subtracted::Left(Arc::new(left), gain.evidence < EVIDENT),
        None => Subtracted::None(
            "no gain makes what rests a part of this frame, and nothing is subtracted".into(),
        ),
    }
}

/// What rests in the last frames.
pub(super) struct RunningRoom {
    pairs: usize,
    bins: usize,
    /// The last frames, `[frame][pair * bins + bin]`, and their sums over windows, `[frame][pair * windows + window]`.
    frames: Vec<Vec<f32>>,
    windows: Vec<Vec<f32>>,
    /// The place of the next frame, and frames that came.
    next: usize,
    came: usize,
    most: usize,
    light: RoomLight,
    /// What the frames say of each pair.
    found: Vec<Resting>,
    /// Variance of a bin per count in the last frames.
    per_count: f64,
}

impl RunningRoom {
    /// For frames of this scan.
    ///
    /// # Errors
    /// The memory of the host does not hold the frames.
    pub fn new(scan: &Capture, most: usize) -> Result<RunningRoom> {
        let (pairs, bins) = (scan.pair_count(), scan.bins);
        let rows = |length: usize| {
            (0..most).map(|_| host::room("frames of the background", length)).collect::<Result<Vec<_>>>()
        };
        host::ask("frames of the background", host::bytes(pairs * (bins + bins.div_ceil(WINDOW)), 4 * most))?;
        Ok(RunningRoom {
            pairs,
            bins,
            frames: rows(pairs * bins)?,
            windows: rows(pairs * bins.div_ceil(WINDOW))?,
            next: 0,
            came: 0,
            most,
            light: scan.room_light_of_mean(),
            found: vec![Resting::default(); pairs],
            per_count: 1.0,
        })
    }

    /// What is left of a frame without the room, in which `frame.empty` is the background; then the frame is one of those that make the next
    /// background.
    pub fn subtract(&mut self, frame: &mut Capture) -> Subtracted {
        let left = match self.came {
            known @ ..LEAST_FRAMES => Subtracted::None(format!(
                "what rests is not known yet, and nothing is subtracted: {known} of the first {LEAST_FRAMES} frames came before this one"
            )),
            _ => self.left_of(frame),
        };
        self.add(frame);
        left
    }

    fn left_of(&mut self, frame: &Capture) -> Subtracted {
        let mut all = Resting::default();
        self.found.iter().for_each(|found| all += *found);
        if all.doubtful > DOUBTED * all.moving {
            return Subtracted::None(format!(
                "an object moves so little that it covers its own place: {:.0} % of what moves has no frame without it, and nothing is subtracted",
                100.0 * all.doubtful / all.moving
            ));
        }
        let windows = self.bins.div_ceil(WINDOW) * self.pairs;
        self.light.set_variance(self.per_count / (all.used / windows.max(1) as f64).max(1.0));
        subtract(frame, &self.light)
    }

    /// Takes a frame, and renews the background of some pairs.
    fn add(&mut self, frame: &mut Capture) {
        self.per_count = variance_per_count(frame).max(f64::MIN_POSITIVE);
        let (counts, sums) = (&mut self.frames[self.next], &mut self.windows[self.next]);
        counts.clear();
        counts.extend_from_slice(&frame.histograms);
        sums.clear();
        for row in counts.chunks_exact(self.bins) {
            sums.extend(row.chunks(WINDOW).map(|bins| bins.iter().sum::<f32>()));
        }
        self.next = (self.next + 1) % self.most;
        self.came += 1;
        let known = self.came.min(self.most);
        if self.came < LEAST_FRAMES {
            return;
        }
        let first = self.came == LEAST_FRAMES;
        let round = if first { 1 } else { (known / 4).clamp(1, ROUND) };
        let room = frame.empty.get_or_insert_with(|| vec![0.0; frame.histograms.len()]);
        let (bins, per_count, phase) = (self.bins, self.per_count, self.came % round);
        let (frames, windows) = (&self.frames[..known], &self.windows[..known]);
        room.par_chunks_exact_mut(bins).zip(&mut self.found).enumerate().for_each_init(
            RestingScratch::default,
            |scratch, (pair, (row, found))| {
                if pair % round == phase {
                    *found = rested(frames, windows, pair, per_count, row, scratch);
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    const PAIRS: usize = 36;
    const BINS: usize = 80;

    fn scan() -> Capture {
        let points: Vec<DVec3> =
            (0..PAIRS).map(|i| DVec3::new((i / 6) as f64 / 6.0, (i % 6) as f64 / 6.0, 0.0)).collect();
        Capture::new([6, 6], points.clone(), points, BINS, 0.02, vec![])
    }

    fn room(pair: usize, bin: usize, level: f64) -> f64 {
        level * (0.1 + (-(bin as f64 - 40.0 - pair as f64 / 6.0).powi(2) / 50.0).exp())
    }

    /// Light of an object that is in every bin for a third of 30 frames.
    fn object(bin: usize, frame: usize, level: f64) -> f64 {
        let place = 5.0 + 2.4 * (frame % 30) as f64;
        2.0 * level * (-((bin as f64 - place) / 8.0).powi(2)).exp()
    }

    fn errors(level: f64, frames: usize) -> [f64; 2] {
        let mut random = Pcg64::seed_from_u64(11);
        let mut running = RunningRoom::new(&scan(), MOVING_FRAMES).unwrap();
        let mut frame = scan();
        frame.integer_counts = true;
        let mut mean = vec![0.0; PAIRS * BINS];
        for number in 0..frames {
            let draw = |i: usize| {
                let light = room(i / BINS, i % BINS, level) + object(i % BINS, number, level);
                Poisson::new(light).map_or(0.0, |counts| counts.sample(&mut random)) as f32
            };
            frame.histograms = (0..PAIRS * BINS).map(draw).collect();
            mean.iter_mut().zip(&frame.histograms).for_each(|(sum, v)| *sum += f64::from(*v) / frames as f64);
            let left = running.subtract(&mut frame);
            let is_left = matches!(left, Subtracted::Left(_, false));
            // The object covers its own place in the first frames.
            assert!(is_left || number < 20, "{level}, {number}: {left:?}");
            assert!(!is_left || number >= LEAST_FRAMES, "{number}");
        }
        let room = |i: usize| room(i / BINS, i % BINS, level);
        let square = |values: &dyn Fn(usize) -> f64| {
            let sum: f64 = (0..PAIRS * BINS).map(|i| (values(i) - room(i)).powi(2)).sum();
            (sum / (PAIRS * BINS) as f64).sqrt() / level
        };
        let known = frame.empty.unwrap();
        [square(&|i| f64::from(known[i])), square(&|i| mean[i])]
    }

    #[test]
    fn what_rests_is_the_room_whatever_moves_before_it() {
        let [bright, mean] = errors(200.0, 60);
        assert!(bright < 0.04 && mean > 10.0 * bright, "{bright} {mean}");
        let [faint, mean] = errors(0.5, 60);
        assert!(faint < 0.75 * mean, "{faint} {mean}");
    }

    /// Prints the milliseconds of a frame.
    #[test]
    #[ignore = "measures time"]
    fn cost() {
        for (side, bins) in [(16, 352), (32, 512)] {
            let at =
                |i: usize| DVec3::new((i / side) as f64 / side as f64, (i % side) as f64 / side as f64, 0.0);
            let points: Vec<DVec3> = (0..side * side).map(at).collect();
            let mut frame = Capture::new([side, side], points.clone(), points, bins, 0.01, vec![]);
            frame.integer_counts = true;
            frame.histograms = (0..side * side * bins).map(|i| (i * 7 % 11) as f32).collect();
            let mut running = RunningRoom::new(&frame, MOVING_FRAMES).unwrap();
            let mut times = vec![];
            for _ in 0..60 {
                let before = std::time::Instant::now();
                running.subtract(&mut frame);
                times.push(1e3 * before.elapsed().as_secs_f64());
            }
            let mut of = |from: usize, to: usize| {
                times[from..to].sort_by(f64::total_cmp);
                times[(from + to) / 2]
            };
            println!(
                "{side} x {side} points, {bins} bins: {:.1} ms, among the first 31 frames {:.1} ms",
                of(40, 60),
                of(5, 31)
            );
        }
    }

    #[test]
    fn the_room_follows_what_changes_for_good() {
        let mut running = RunningRoom::new(&scan(), LEAST_FRAMES).unwrap();
        let mut frame = scan();
        for (level, frames) in [(100.0, 5), (50.0, 5)] {
            for _ in 0..frames {
                frame.histograms = vec![level; PAIRS * BINS];
                running.subtract(&mut frame);
            }
            assert!(frame.empty.as_ref().unwrap().iter().all(|v| *v == level), "{level}");
        }
        assert!(check(Some(4), &scan()).is_err() && check(Some(5), &scan()).is_ok());
        let with_room = scan().with(|c| c.empty = Some(vec![1.0; PAIRS * BINS]));
        assert!(check(Some(31), &with_room).is_err() && check(None, &with_room).is_ok());
    }
}
