//! The first pass over a file of time tags: what it holds, and its markers.

use super::{Event, Passed, Tags};
use crate::error::{Error, Result};

/// Most markers that are kept: 128 MiB. Scans have thousands.
const MOST_MARKERS: usize = 1 << 23;
/// Most detectors. Instruments have up to 64; a file with more has its columns in another order.
pub(super) const MOST_CHANNELS: usize = 1024;
/// Detectors that a message names.
const NAMED: usize = 16;

/// The photons of a detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Its number.
    pub channel: i32,
    /// Photons with a delay.
    pub photons: u64,
    /// The longest delay, ticks.
    pub longest: i64,
    /// Photons that came after another one of the same laser pulse.
    pub second: u64,
    /// The laser pulse of the last photon.
    last: i64,
}

/// What a file of time tags holds.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Survey {
    /// Detectors in the order of their numbers.
    pub channels: Vec<Channel>,
    /// Markers in the order of their laser pulses: the pulse and the bits.
    pub markers: Vec<(i64, u16)>,
    /// Markers that the file holds later than one of a later laser pulse.
    pub out_of_order: usize,
    /// Photons that the file holds later than one of a later laser pulse.
    pub photons_out_of_order: u64,
    /// Laser pulses up to the last event.
    pub pulses: i64,
    /// Seconds between laser pulses, if known.
    pub period: Option<f64>,
    /// What became of the records.
    pub passed: Passed,
}

impl Survey {
    /// Reads all of a file.
    ///
    /// # Errors
    /// Those of [`Tags::events`]; `Kind::Input` for a file of millions of markers, or without any photon.
    pub fn of(tags: &Tags) -> Result<Survey> {
        let mut survey = Survey::default();
        let mut at = 0;
        let mut newest = i64::MIN;
        let mut last = -1;
        let mut too_many = false;
        let channels = &mut survey.channels;
        let passed = tags.events(|event| match event {
            Event::Photon { channel, sync, delay } => {
                if channels.get(at).is_none_or(|seen: &Channel| seen.channel != channel) {
                    at = channels.iter().position(|seen| seen.channel == channel).unwrap_or(channels.len());
                    if at == MOST_CHANNELS {
                        too_many = true;
                        at = 0;
                    }
                    if at == channels.len() {
                        channels.push(Channel { channel, photons: 0, longest: 0, second: 0, last: -1 });
                    }
                }
                let seen = &mut channels[at];
                seen.photons += 1;
                seen.longest = seen.longest.max(delay);
                seen.second += u64::from(seen.last == sync);
                survey.photons_out_of_order += u64::from(sync < seen.last);
                seen.last = sync;
                last = last.max(sync);
            }
            Event::Marker { bits, sync } => {
                survey.out_of_order += usize::from(sync < newest);
                newest = newest.max(sync);
                last = last.max(sync);
                if survey.markers.len() <= MOST_MARKERS {
                    survey.markers.push((sync, bits));
                }
            }
        })?;
        if let Some(period) = passed.sparse.filter(|_| tags.every.get().is_none()) {
            let _ = tags.every.set(period);
            return Survey::of(tags);
        }
        if too_many {
            return Err(Error::input(
                format!("photons came on more than {MOST_CHANNELS} channels"),
                "check the order of the columns: text is channel, then time in picoseconds",
            ));
        }
        if survey.markers.len() > MOST_MARKERS {
            return Err(Error::input(
                format!("there are more than {MOST_MARKERS} markers"),
                "a scan has some for each line or point: check how the markers are wired",
            ));
        }
        if survey.channels.is_empty() {
            let hint = match passed.without_sync {
                0 => "check that the detector was on, and that the file is the right one",
                _ => {
                    "photons need laser pulses: record the laser's trigger, and name its channel if the file is text or arrays"
                }
            };
            return Err(Error::input("there is no photon with a delay", hint));
        }
        survey.channels.sort_unstable_by_key(|seen| seen.channel);
        survey.markers.sort_by_key(|marker| marker.0);
        Ok(Survey { pulses: last + 1, period: tags.period.or(passed.period), passed, ..survey })
    }

    /// The detector of this number, or the only one.
    ///
    /// # Errors
    /// `Kind::Options` if there is no such detector, or none is named and there are several.
    pub fn channel(&self, wanted: Option<i32>) -> Result<Channel> {
        let found = match (wanted, &self.channels[..]) {
            (Some(number), all) => all.iter().find(|seen| seen.channel == number),
            (None, [only]) => Some(only),
            (None, _) => None,
        };
        found.copied().ok_or_else(|| {
            let named = self.channels.iter().take(NAMED);
            let mut all: Vec<_> = named.map(|c| format!("{} ({} photons)", c.channel, c.photons)).collect();
            let more = self.channels.len().saturating_sub(NAMED);
            all.extend((more > 0).then(|| format!("{more} more")));
            let what = match wanted {
                Some(number) => format!("channel {number} has no photon"),
                None => "photons came on several channels, and none was chosen".into(),
            };
            Error::options(what, format!("choose one of the channels {}", all.join(", ")))
        })
    }

    /// Markers of the file, from 1, and their numbers.
    pub fn markers(&self) -> Vec<(u32, usize)> {
        let count = |bit: u32| self.markers.iter().filter(|m| m.1 >> bit & 1 == 1).count();
        (0..16).map(|bit| (bit + 1, count(bit))).filter(|m| m.1 > 0).collect()
    }

    /// The markers and their numbers as text.
    pub(super) fn marker_counts(&self) -> String {
        let all = self.markers();
        let words: Vec<_> = all.iter().map(|(marker, count)| format!("{count} of marker {marker}")).collect();
        if words.is_empty() { "no marker".into() } else { words.join(", ") }
    }
}
