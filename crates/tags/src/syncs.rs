//! The laser pulse before an event, where records tell only times.

use super::{Event, Record};

/// The laser pulses that were seen last.
#[derive(Debug, Default)]
pub(super) struct Syncs {
    /// Laser pulses so far.
    count: i64,
    /// When the first was, the last, and the one before it, ticks.
    first: i64,
    last: i64,
    before: i64,
    /// Photons without a laser pulse before them.
    pub(super) without: u64,
    /// Laser pulses that the file holds after a later one.
    pub(super) late: u64,
}

impl Syncs {
    /// Ticks from one laser pulse to the next, on average; `None` for fewer than two.
    pub(super) fn period(&self) -> Option<f64> {
        (self.count > 1).then(|| (self.last as f64 - self.first as f64) / (self.count - 1) as f64)
    }

    /// The event of a record; `None` for a laser pulse, and for a photon without one before it.
    #[inline]
    pub(super) fn event(&mut self, record: Record) -> Option<Event> {
        match record {
            Record::Sync { time } => {
                // One that is late in the file is not taken: it would make delays of the wrong pulse.
                if self.count == 0 {
                    self.first = time;
                }
                if self.count == 0 || time > self.last {
                    (self.before, self.last) = (self.last, time);
                    self.count += 1;
                } else {
                    self.late += 1;
                }
                None
            }
            Record::Photon { channel, time, .. } => {
                let (sync, delay) = match self.count {
                    1.. if time >= self.last => (self.count - 1, time.saturating_sub(self.last)),
                    2.. if time >= self.before => (self.count - 2, time.saturating_sub(self.before)),
                    _ => {
                        self.without += 1;
                        return None;
                    }
                };
                Some(Event::Photon { channel, sync, delay })
            }
            Record::Marker { bits, time } => {
                // Markers may come late by some pulses. The pulses between are as far apart as the last two.
                let period = self.last.saturating_sub(self.before).max(1);
                let behind = self.last.saturating_sub(time).max(0);
                let late = if self.count < 2 { 0 } else { behind / period + i64::from(behind % period > 0) };
                Some(Event::Marker { bits, sync: (self.count - 1 - late).max(0) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_from_the_last_pulse() {
        let mut syncs = Syncs::default();
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
