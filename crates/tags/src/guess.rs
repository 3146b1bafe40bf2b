//! Guesses unspecified properties of a scan, for a first look at a file.

use std::collections::BTreeMap;
use std::path::Path;

use super::order::Unwrap;
use super::survey::MOST_CHANNELS;
use super::syncs::common_period;
use super::{Division, Inputs, Record, Survey, TagFormat, Tags};
use crate::error::Result;

/// A channel whose tags are rarer than those of another by this factor is one of markers.
const MARKERS: u64 = 20;
/// Intervals of a channel that are looked at.
const LOOKED_AT: usize = 4096;

/// The tags of a channel.
#[derive(Default)]
struct ChannelTimes {
    count: u64,
    last: Option<i64>,
    intervals: Vec<i64>,
}

impl ChannelTimes {
    fn add(&mut self, time: i64) {
        self.count += 1;
        if self.intervals.len() < LOOKED_AT {
            let before = self.last.replace(time);
            self.intervals
                .extend(before.map(|before| time.saturating_sub(before)).filter(|interval| *interval > 0));
        }
    }
}

/// What a scan is likely to be, by the numbers of the tags.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Guess {
    /// Points along x and y, as far as known.
    pub size: [Option<usize>; 2],
    /// Which photons belong to which point; `None`: as the header says, or unknown.
    pub division: Option<Division>,
    /// The detector with the most photons, if there are several.
    pub channel: Option<i32>,
}

impl Guess {
    /// What the scan of a file is likely to be.
    pub fn of(survey: &Survey, tags: &Tags) -> Guess {
        let channel = survey.channels.iter().max_by_key(|c| c.photons).filter(|_| survey.channels.len() > 1);
        let mut guess = Guess { channel: channel.map(|c| c.channel), ..Guess::default() };
        if Division::of_image(&tags.image).is_some() {
            guess.size = tags.image.size;
            return guess;
        }
        let all = survey.markers();
        let most = all.iter().map(|m| m.1).max().unwrap_or(0);
        let mut frequent = all.iter().filter(|m| m.1 == most).map(|m| m.0);
        let Some(start) = frequent.next() else { return guess };
        let (stop, side) = (frequent.next(), most.isqrt());
        if stop.is_none() && side > 1 && side * side == most {
            guess.size = [Some(side); 2];
            guess.division = Some(Division::Pixels { marker: start, frame: None });
        } else {
            guess.size = [None, Some(most)];
            guess.division = Some(Division::Lines { start, stop, frame: None });
        }
        guess
    }
}

impl Inputs {
    /// The channels of laser pulses and markers that are likely in arrays or text, unless the given channel of laser pulses is one:
    /// laser pulses are regular, or else the most tags, and channels of few tags are markers.
    ///
    /// # Errors
    /// Those of [`Tags::open`] and [`Tags::records`].
    pub fn guessed(self, path: &Path) -> Result<Inputs> {
        let tags = Tags::open(path, &self)?;
        let is_told = matches!(tags.format, TagFormat::Picoquant(_)) || tags.is_t3();
        let mut seen: BTreeMap<i32, ChannelTimes> = BTreeMap::new();
        let mut unwrap = Unwrap::of_unit(tags.format.ticks());
        if !is_told {
            tags.records(|record| {
                let channel = match record {
                    Record::Photon { channel, .. } => channel,
                    Record::Sync { .. } => self.sync,
                    Record::Marker { .. } => return,
                };
                let time = unwrap.time(record.time());
                if seen.len() < MOST_CHANNELS || seen.contains_key(&channel) {
                    seen.entry(channel).or_default().add(time);
                }
            })?;
        }
        let busiest = seen.values().map(|seen| seen.count).max().unwrap_or(0);
        let mut regular: Vec<(u64, i32)> = vec![];
        for (channel, seen) in &mut seen {
            let intervals = std::mem::take(&mut seen.intervals);
            // Markers of a scanner are regular, too, but few.
            if MARKERS * seen.count >= busiest && common_period(intervals).is_some() {
                regular.push((seen.count, *channel));
            }
        }
        let counts: BTreeMap<i32, u64> =
            seen.into_iter().map(|(channel, seen)| (channel, seen.count)).collect();
        let is_laser = |channel: i32| regular.iter().any(|(_, regular)| *regular == channel);
        // A channel that was named stays, and that of most files where no other one is regular.
        let stays =
            counts.contains_key(&self.sync) && (self.sync != 0 || regular.is_empty() || is_laser(self.sync));
        if counts.len() < 2 || stays {
            return Ok(self);
        }
        let most = counts.values().max().copied().unwrap_or(0);
        let of_most = counts.iter().find(|(_, count)| 20 * **count > 19 * most).map(|(channel, _)| *channel);
        let sync = regular.iter().max().map(|(_, channel)| *channel).or(of_most).unwrap_or(self.sync);
        let photons = counts
            .iter()
            .filter(|(channel, _)| **channel != sync)
            .map(|(_, count)| *count)
            .max()
            .unwrap_or(0);
        let is_marker = |(channel, count): &(&i32, &u64)| **channel != sync && **count * MARKERS < photons;
        let markers = match self.markers.is_empty() {
            true => counts.iter().filter(is_marker).map(|(channel, _)| *channel).take(16).collect(),
            false => self.markers.clone(),
        };
        Ok(Inputs { sync, markers, ..self })
    }
}
