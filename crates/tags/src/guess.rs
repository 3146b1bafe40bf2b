//! Guesses unspecified properties of a scan, for a first look at a file.

use std::collections::BTreeMap;
use std::path::Path;

use super::survey::MOST_CHANNELS;
use super::{Division, Inputs, Record, Survey, TagFormat, Tags};
use crate::error::Result;

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
    /// The channels of laser pulses and markers that are likely in arrays or text without tags of the given channel of laser pulses:
    /// most tags are laser pulses, and channels of few tags are markers.
    ///
    /// # Errors
    /// Those of [`Tags::open`] and [`Tags::records`].
    pub fn guessed(self, path: &Path) -> Result<Inputs> {
        let tags = Tags::open(path, &self)?;
        let is_told = matches!(tags.format, TagFormat::Picoquant(_)) || tags.is_t3();
        let mut counts = BTreeMap::new();
        if !is_told {
            tags.records(|record| {
                let channel = match record {
                    Record::Photon { channel, .. } => channel,
                    Record::Sync { .. } => self.sync,
                    Record::Marker { .. } => return,
                };
                if counts.len() < MOST_CHANNELS {
                    *counts.entry(channel).or_insert(0u64) += 1;
                }
            })?;
        }
        if counts.len() < 2 || counts.contains_key(&self.sync) {
            return Ok(self);
        }
        let most = counts.values().max().copied().unwrap_or(0);
        let sync = counts
            .iter()
            .find(|(_, count)| 20 * **count > 19 * most)
            .map_or(self.sync, |(channel, _)| *channel);
        let photons = counts
            .iter()
            .filter(|(channel, _)| **channel != sync)
            .map(|(_, count)| *count)
            .max()
            .unwrap_or(0);
        let is_marker = |(channel, count): &(&i32, &u64)| **channel != sync && **count * 20 < photons;
        let markers = match self.markers.is_empty() {
            true => counts.iter().filter(is_marker).map(|(channel, _)| *channel).take(16).collect(),
            false => self.markers.clone(),
        };
        Ok(Inputs { sync, markers, ..self })
    }
}
