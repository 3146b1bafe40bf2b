//! The counts of a pair that rest in frames, by windows of neighbouring bins.
//!
//! Frames in which nothing is before the room agree up to noise: they are a cluster of the counts of a window. Light of an object lies
//! above it, its shadow below, both scattered. Of the clusters that a low start and the median find, the one with more frames is the room.
//! An object that never leaves a window has no such cluster: the frames about its least light scatter more than noise. Windows in which they
//! do are in doubt.

/// Neighbouring bins whose counts are one number.
pub(super) const WINDOW: usize = 4;
/// A cluster reaches up to this many standard deviations of photons and of a laser's power, as a share, from its mean.
const NEAR: f64 = 2.5;
const POWER: f64 = 0.02;
/// Share of the frames below the low start, and how many standard deviations a normal variable has that share below it.
const LOW: [f64; 2] = [0.2, 0.84];
/// Most steps from a start to the mean of its cluster.
const STEPS: usize = 8;
/// Scatter of a cluster's frames over that of noise above which a window is in doubt, with the windows beside it whose scatter counts, too.
const SCATTERED: f64 = 1.3;
const BESIDE: usize = 2;

/// What the frames say of a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Resting {
    /// Frames in the mean of a window, summed over the windows.
    pub used: f64,
    /// Mean light of the frames beyond the room, counts, and the part of it that is in windows in doubt.
    pub moving: f64,
    pub doubtful: f64,
}

impl std::ops::AddAssign for Resting {
    fn add_assign(&mut self, other: Resting) {
        self.used += other.used;
        self.moving += other.moving;
        self.doubtful += other.doubtful;
    }
}

/// The counts of a window in all frames.
#[derive(Debug, Clone, Copy, Default)]
struct Window {
    /// Means of the cluster, and of all frames.
    room: f64,
    mean: f64,
    /// Squares about the mean of the cluster in variances of noise, and how many are expected.
    squares: f64,
    expected: f64,
}

/// Memory for the windows of a pair.
#[derive(Default)]
pub(super) struct RestingScratch {
    sorted: Vec<f32>,
    windows: Vec<Window>,
}

/// Writes the counts of a pair that rest. `frames`: `[frame][pair * bins + bin]`; `sums`: `[frame][pair * windows + window]`; `per_count`:
/// variance of a bin per count.
pub(super) fn rested(
    frames: &[Vec<f32>],
    sums: &[Vec<f32>],
    pair: usize,
    per_count: f64,
    row: &mut [f32],
    scratch: &mut RestingScratch,
) -> Resting {
    let (bins, count) = (row.len(), row.len().div_ceil(WINDOW));
    let mut all = Resting::default();
    let RestingScratch { sorted, windows } = scratch;
    windows.clear();
    for (window, room) in row.chunks_mut(WINDOW).enumerate() {
        let sum = |frame: &Vec<f32>| frame[pair * count + window];
        sorted.clear();
        sorted.extend(sums.iter().map(sum));
        sorted.sort_unstable_by(f32::total_cmp);
        let cluster = room_of(sorted, per_count);
        let [least, most] = [cluster[0], cluster[cluster.len() - 1]];
        room.fill(0.0);
        let mut near = 0.0f32;
        for (frame, sums) in frames.iter().zip(sums) {
            if (least..=most).contains(&sum(sums)) {
                let from = pair * bins + window * WINDOW;
                room.iter_mut().zip(&frame[from..]).for_each(|(sum, count)| *sum += count);
                near += 1.0;
            }
        }
        // A cluster has a frame.
        room.iter_mut().for_each(|sum| *sum /= near.max(1.0));
        all.used += f64::from(near);
        let centre = mean(cluster);
        let squares: f64 = cluster.iter().map(|v| (f64::from(*v) - centre).powi(2)).sum();
        windows.push(Window {
            room: centre,
            mean: mean(sorted),
            squares: squares / deviation(centre, per_count).powi(2).max(f64::MIN_POSITIVE),
            expected: f64::from(near) - 1.0,
        });
    }
    for window in 0..count {
        let beside = &windows[window.saturating_sub(BESIDE)..count.min(window + BESIDE + 1)];
        let sum = |of: fn(&Window) -> f64| beside.iter().map(of).sum::<f64>();
        let share = 1.0 / beside.len() as f64;
        let moving = share * sum(|w| w.mean - w.room).max(0.0);
        all.moving += moving;
        if sum(|w| w.squares) > SCATTERED * sum(|w| w.expected) {
            all.doubtful += moving.min(share * sum(|w| w.room));
        }
    }
    all
}

/// The values that are the room's.
fn room_of(sorted: &[f32], per_count: f64) -> &[f32] {
    let low = f64::from(sorted[(LOW[0] * (sorted.len() - 1) as f64).round() as usize]);
    let below = cluster(sorted, low + LOW[1] * deviation(low, per_count), per_count);
    let middle = cluster(sorted, f64::from(sorted[sorted.len() / 2]), per_count);
    if below.len() >= middle.len() { below } else { middle }
}

/// The values about the mean that they have, from a start; at least one.
fn cluster(sorted: &[f32], start: f64, per_count: f64) -> &[f32] {
    let mut centre = start;
    let mut found = &sorted[..0];
    for _ in 0..STEPS {
        let reach = NEAR * deviation(centre, per_count);
        let from = sorted.partition_point(|v| f64::from(*v) < centre - reach);
        let to = sorted.partition_point(|v| f64::from(*v) <= centre + reach);
        let next = &sorted[from..to.max(from)];
        if next.is_empty() || std::ptr::eq(next, found) {
            break;
        }
        found = next;
        centre = mean(found);
    }
    if found.is_empty() { &sorted[sorted.len() / 2..][..1] } else { found }
}

/// Standard deviation of a window of noise and power.
fn deviation(counts: f64, per_count: f64) -> f64 {
    (per_count * counts.max(per_count) + (POWER * counts).powi(2)).sqrt()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// Counts of frames with these means in every bin of a pair, and what rests in them.
    fn of(bins: usize, means: &dyn Fn(usize, usize) -> f64, frames: usize) -> (Vec<f32>, Resting) {
        let mut random = Pcg64::seed_from_u64(71);
        let mut draw = |mean: f64| Poisson::new(mean).map_or(0.0, |counts| counts.sample(&mut random)) as f32;
        let frames: Vec<Vec<f32>> =
            (0..frames).map(|f| (0..bins).map(|bin| draw(means(f, bin))).collect()).collect();
        let sums: Vec<Vec<f32>> =
            frames.iter().map(|f| f.chunks(WINDOW).map(|bins| bins.iter().sum()).collect()).collect();
        let mut row = vec![0.0; bins];
        let found = rested(&frames, &sums, 0, 1.0, &mut row, &mut RestingScratch::default());
        (row, found)
    }

    fn mean_of(row: &[f32]) -> f64 {
        row.iter().map(|v| f64::from(*v)).sum::<f64>() / row.len() as f64
    }

    #[test]
    fn an_object_that_is_there_in_most_frames_is_no_room() {
        // Light of 15 to 60 counts in two thirds of the frames; the median is the object's.
        let passes =
            |frame: usize, _| 20.0 + if frame.is_multiple_of(3) { 0.0 } else { 15.0 + 1.5 * frame as f64 };
        let (row, found) = of(400, &passes, 31);
        assert!((mean_of(&row) - 20.0).abs() < 0.5, "{}", mean_of(&row));
        assert!(found.doubtful < 0.2 * found.moving, "{found:?}");
        // A shadow, clear of noise, in a third of the frames.
        let (row, _) = of(400, &|frame, _| if frame.is_multiple_of(3) { 6.0 } else { 20.0 }, 31);
        assert!((mean_of(&row) - 20.0).abs() < 0.5, "{}", mean_of(&row));
    }

    #[test]
    fn noise_alone_has_no_bias_and_no_doubt() {
        for level in [0.05, 0.5, 3.0, 80.0] {
            let (row, found) = of(4000, &|_, _| level, 31);
            let error = 2.0 * (level / (4000.0 * 31.0)).sqrt();
            // Of few counts, the cluster leaves more out above than below; a gain makes up for it.
            assert!((mean_of(&row) - level).abs() < 0.06 * level + error, "{level}: {}", mean_of(&row));
            assert!(found.used > 0.9 * 31.0 * 1000.0, "{found:?}");
            assert!(found.doubtful <= 0.02 * found.moving, "{level}: {found:?}");
        }
    }

    #[test]
    fn an_object_that_never_leaves_is_in_doubt() {
        // A wide object that sways.
        let sways = |frame: usize, bin: usize| {
            let off = (bin as f64 - 200.0 - 60.0 * (frame as f64 / 5.0).sin()) / 120.0;
            1.0 + 60.0 * (-off * off).exp()
        };
        let (_, found) = of(400, &sways, 31);
        assert!(found.doubtful > 0.4 * found.moving, "{found:?}");
        // One that moves by more than its width.
        let passes = |frame: usize, bin: usize| {
            let off = (bin as f64 - 12.0 * frame as f64) / 15.0;
            20.0 + 60.0 * (-off * off).exp()
        };
        let (_, found) = of(400, &passes, 31);
        assert!(found.doubtful < 0.2 * found.moving, "{found:?}");
    }
}
