//! The laser pulse before an event, where records tell only times.

use super::{Event, Record};

/// The laser pulses that were seen last.
#[derive(Debug, Default)]
pub(super) struct Syncs {
    /// Laser pulses for each that the file holds.
    divider: i64,
    /// Ticks between laser pulses, where the file does not hold all of them: they are numbered by time then.
    every: Option<f64>,
    /// Pulses of the file so far, and the numbers of the last and of the one before it.
    count: i64,
    number: i64,
    previous: i64,
    /// When the first was, the last, and the one before it, ticks.
    first: i64,
    last: i64,
    before: i64,
    /// Ticks of the shortest interval of a laser, and intervals below.
    shortest: i64,
    pub(super) short: u64,
    /// The first intervals.
    intervals: Vec<i64>,
    /// Photons after the last pulse, and how far photons are from the pulses around them: the first ones.
    photons: Vec<i64>,
    around: Vec<[i64; 2]>,
    /// Photons without a laser pulse before them.
    pub(super) without: u64,
    /// Laser pulses that the file holds after a later one.
    pub(super) late: u64,
}

/// Photons and intervals whose lengths are kept.
const LOOKED_AT: usize = 4096;
/// Intervals of a laser are multiples of its period to this share of the period; nearly all of them are.
const OFF_MULTIPLE: f64 = 0.1;
const NEARLY_ALL: f64 = 0.95;

/// Fewer intervals do not tell a laser.
const LEAST_INTERVALS: usize = 100;

/// The period of which nearly all of these intervals are multiples, as those of a laser are.
pub(super) fn common_period(mut sorted: Vec<i64>) -> Option<f64> {
    sorted.sort_unstable();
    let (n, few) = (sorted.len(), sorted.len() / 100);
    if n < LEAST_INTERVALS || sorted[few] < 1 {
        return None;
    }
    let near = &sorted[..sorted.partition_point(|i| *i < sorted[few].saturating_mul(20))];
    (1..=8).map(|parts| sorted[few] as f64 / f64::from(parts)).find_map(|period| {
        let multiple = |interval: &&i64| {
            let times = **interval as f64 / period;
            (times - times.round()).abs() < OFF_MULTIPLE
        };
        let fit: Vec<&i64> = near.iter().filter(multiple).collect();
        let times: f64 = fit.iter().map(|i| (**i as f64 / period).round()).sum();
        let all = fit.iter().map(|i| **i as f64).sum::<f64>();
        (fit.len() as f64 >= NEARLY_ALL * near.len() as f64 && times > 0.0).then(|| all / times)
    })
}

impl Syncs {
    /// Creates the statistics of a file that holds one of every `divider` laser pulses, with `every` ticks between pulses if some are
    /// missing, and `shortest` ticks as the shortest interval of a laser.
    pub(super) fn new(divider: u32, every: Option<f64>, shortest: i64) -> Syncs {
        Syncs { divider: i64::from(divider.max(1)), every, shortest, ..Syncs::default() }
    }

    /// Ticks from one laser pulse to the next, on average; `None` for fewer than two.
    pub(super) fn period(&self) -> Option<f64> {
        (self.count > 1).then(|| (self.last as f64 - self.first as f64) / self.number as f64)
    }

    /// Pulses in the file.
    pub(super) fn count(&self) -> i64 {
        self.count
    }

    /// Ticks between laser pulses, if the intervals between those of the file are different multiples of it.
    pub(super) fn sparse(&self) -> Option<f64> {
        let mut sorted = self.intervals.clone();
        sorted.sort_unstable();
        let (n, few) = (sorted.len(), sorted.len() / 100);
        if n < LEAST_INTERVALS || self.divider > 1 || 2 * sorted[n / 2] < 3 * sorted[few] {
            return None;
        }
        common_period(sorted)
    }

    /// Whether the intervals are those of a laser, as far as there are enough to tell.
    pub(super) fn is_regular(&self) -> bool {
        self.intervals.len() < LEAST_INTERVALS || common_period(self.intervals.clone()).is_some()
    }

    /// Whether the pulses are those after the photons: all photons are within a period before a pulse, and not behind one.
    pub(super) fn is_filtered(&self) -> bool {
        let Some(period) = self.sparse() else { return false };
        let beyond = |gap: usize| self.around.iter().filter(|gaps| gaps[gap] as f64 > period).count();
        10 * beyond(0) > self.around.len() && 100 * beyond(1) < self.around.len()
    }

    /// Number of laser pulses for each pulse in the file, from the repetitions of the photons' delays between two of these; `None`
    /// without repetitions.
    pub(super) fn divided(&self) -> Option<usize> {
        const CELLS: usize = 16;
        let of = |gaps: &[i64; 2]| gaps[0] as f64 / (gaps[0].saturating_add(gaps[1])).max(1) as f64;
        let repeats = |times: &usize| {
            let mut counts = vec![[0.0; CELLS]; *times]; // bounded: 16
            for phase in self.around.iter().map(of) {
                let cell = (phase * (times * CELLS) as f64) as usize;
                counts[(cell / CELLS).min(times - 1)][cell % CELLS] += 1.0;
            }
            let n = *times as f64;
            let mean = self.around.len() as f64 / (n * CELLS as f64);
            let (mut within, mut between) = (0.0, 0.0);
            for cell in 0..CELLS {
                let of_cell = counts.iter().map(|part| part[cell]).sum::<f64>() / n;
                within += n * (of_cell - mean).powi(2) / mean;
                between +=
                    counts.iter().map(|part| (part[cell] - of_cell).powi(2)).sum::<f64>() / of_cell.max(1.0);
            }
            within > 20.0 * CELLS as f64 && between < 1.5 * (n - 1.0) * CELLS as f64
        };
        let is_even = self.divider == 1 && self.sparse().is_none();
        (2..=16).rev().find(|times| is_even && self.around.len() > 1000 && repeats(times))
    }

    /// The event of a record; `None` for a laser pulse, and for a photon without one before it.
    #[inline]
    pub(super) fn event(&mut self, record: Record) -> Option<Event> {
        match record {
            Record::Sync { time } => {
                // One that is late in the file is not taken: it would make delays of the wrong pulse.
                if self.count > 0 && time <= self.last {
                    self.late += 1;
                    return None;
                }
                if self.count == 0 {
                    self.first = time;
                } else {
                    self.pass(time);
                }
                (self.before, self.last) = (self.last, time);
                self.count += 1;
                None
            }
            Record::Photon { channel, time, .. } => {
                if self.around.len() + self.photons.len() < LOOKED_AT {
                    self.photons.push(time);
                }
                let (sync, delay) = match self.count {
                    1.. if time >= self.last => (self.number, time.saturating_sub(self.last)),
                    2.. if time >= self.before => (self.previous, time.saturating_sub(self.before)),
                    _ => {
                        self.without += 1;
                        return None;
                    }
                };
                if self.divider == 1 {
                    return Some(Event::Photon { channel, sync, delay });
                }
                let Some(period) = self.spacing() else {
                    self.without += 1;
                    return None;
                };
                let pulses = (delay as f64 / period).floor();
                let delay = delay - (pulses * period).round() as i64;
                Some(Event::Photon { channel, sync: sync + pulses as i64, delay })
            }
            Record::Marker { bits, time } => {
                // Markers may come late by some pulses. The pulses between are as far apart as the last two.
                let after = self
                    .spacing()
                    .map_or(0.0, |period| time.saturating_sub(self.last) as f64 / period)
                    .floor();
                let after = if self.divider > 1 || self.every.is_some() { after } else { after.min(0.0) };
                Some(Event::Marker { bits, sync: (self.number + after as i64).max(0) })
            }
        }
    }

    /// Numbers the next laser pulse.
    #[inline]
    fn pass(&mut self, time: i64) {
        let interval = time.saturating_sub(self.last);
        self.previous = self.number;
        self.number +=
            self.every.map_or(self.divider, |period| (interval as f64 / period).round().max(1.0) as i64);
        self.short += u64::from(interval < self.shortest);
        if self.intervals.len() < LOOKED_AT {
            self.intervals.push(interval);
        }
        let last = self.last;
        let gaps = |photon: i64| [photon.saturating_sub(last), time.saturating_sub(photon)];
        self.around.extend(self.photons.drain(..).map(gaps));
    }

    /// Ticks between the last laser pulses.
    fn spacing(&self) -> Option<f64> {
        let ticks = self.last.saturating_sub(self.before).max(1) as f64;
        (self.count > 1).then(|| self.every.unwrap_or(ticks / self.divider as f64))
    }
}

/// Photons by the laser pulse before them where the file holds the pulse after each photon only (a conditional filter). Pulses are
/// numbered by time.
#[derive(Debug, Default)]
pub(super) struct Filtered {
    /// Ticks between laser pulses.
    period: f64,
    first: Option<i64>,
    waiting: Vec<(i32, i64)>,
    pub(super) without: u64,
}

impl Filtered {
    pub(super) fn new(period: f64) -> Filtered {
        Filtered { period, ..Filtered::default() }
    }

    fn pulse(&self, time: f64) -> i64 {
        ((time - self.first.unwrap_or(0) as f64) / self.period).round().max(0.0) as i64
    }

    pub(super) fn hear(&mut self, record: Record, hear: &mut impl FnMut(Event)) {
        self.first.get_or_insert(record.time());
        match record {
            Record::Sync { time } => {
                for (channel, photon) in std::mem::take(&mut self.waiting) {
                    let delay = self.period - time.saturating_sub(photon) as f64;
                    if delay < 0.0 {
                        self.without += 1;
                        continue;
                    }
                    let sync = self.pulse(time as f64 - self.period);
                    hear(Event::Photon { channel, sync, delay: delay.round() as i64 });
                }
            }
            Record::Photon { channel, time, .. } => self.waiting.push((channel, time)),
            Record::Marker { bits, time } => hear(Event::Marker { bits, sync: self.pulse(time as f64) }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_from_the_last_pulse() {
        let mut syncs = Syncs::new(1, None, 1);
        let photon = |time| Record::Photon { channel: 3, time, delay: 0 };
        assert_eq!(syncs.event(photon(5)), None);
        assert_eq!(syncs.event(Record::Sync { time: 10 }), None);
        assert_eq!(syncs.event(photon(17)), Some(Event::Photon { channel: 3, sync: 0, delay: 7 }));
        syncs.event(Record::Sync { time: 110 });
        // One out of order belongs to the pulse before.
        assert_eq!(syncs.event(photon(109)), Some(Event::Photon { channel: 3, sync: 0, delay: 99 }));
        assert_eq!(syncs.event(photon(110)), Some(Event::Photon { channel: 3, sync: 1, delay: 0 }));
        syncs.event(Record::Sync { time: 210 });
        for (time, sync) in [(215, 2), (209, 1), (110, 1), (109, 0), (-500, 0)] {
            assert_eq!(syncs.event(Record::Marker { bits: 2, time }), Some(Event::Marker { bits: 2, sync }));
        }
        assert_eq!(syncs.event(photon(9)), None);
        assert_eq!(syncs.without, 2);
    }
}
