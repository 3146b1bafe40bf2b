//! Parts of the pairs. Where the histograms of all pairs do not fit on the device, they lie on the host, and passes over
//! pairs take them part by part: buffers of pairs are as large as one part of them.
//!
//! What a part is computed from lies in one of two slots on the device. The next part is copied into the other slot while
//! this one is computed.

use super::divide::texels_of;
use super::{Level, LevelPairs, Needs, Plan};
use crate::advice::advice;
use crate::gpu::{Buffer, Memory, check};
use crate::transport::kernels::{PADDING, buffer, constant};
use crate::transport::{Model, cells};
use crate::{Error, Result};

/// Measured histograms of a part, by slot.
const PART_MEASURED: Buffer = Buffer::named("part_measured");
/// Wall points of a part, by slot.
const PART_WALL: Buffer = Buffer::named("part_wall");
/// State of the noise term of a part, by slot.
const PART_NOISE: Buffer = Buffer::named("part_noise");
/// Constants of a level with the numbers of a part's pairs: two for each level, as the last part may be smaller.
const PART_SCENE: Buffer = Buffer::named("part_scene");
/// Measured histograms on the host, by part.
const STORED_MEASURED: Buffer = Buffer::named("stored_measured");
/// Wall points of all parts on the host.
const STORED_WALL: Buffer = Buffer::named("stored_wall");
/// State of the noise term on the host, by part.
const STORED_NOISE: Buffer = Buffer::named("stored_noise");

/// The most parts. Each is a buffer on the host.
const MOST_PARTS: usize = 1024;

/// The most values of histograms that kernels index: they count three words of noise for a bin.
const MOST_VALUES: u64 = 1 << 30;

/// A part of the pairs of a level: those whose histograms are on the device at once.
#[derive(Debug, Clone, PartialEq)]
pub struct PairPart {
    /// Its number among those of the level.
    pub number: usize,
    /// How many the level has.
    pub of: usize,
    /// Its first pair.
    pub first: usize,
    /// Its measured pairs.
    pub own: LevelPairs,
    /// The pairs that light is rendered for.
    pub rendered: LevelPairs,
    /// Buffer that holds its measured histograms.
    pub measured: Buffer,
    /// Buffer that holds the state of its noise term.
    pub noise: Buffer,
    /// What is copied to the device before it is computed; nothing where all pairs are one part.
    pub stored: Vec<Stored>,
}

/// A stretch of a buffer on the host, and where on the device it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stored {
    /// Buffer on the host.
    pub host: Buffer,
    /// First byte there.
    pub offset: u64,
    /// Buffer on the device.
    pub device: Buffer,
    /// Bytes.
    pub bytes: u64,
    /// It changes while the part is computed, and is copied back.
    pub changes: bool,
}

impl PairPart {
    /// Whether it is one of several.
    pub fn is_cut(&self) -> bool {
        self.of > 1
    }

    /// Whether it is the first or the last one.
    pub fn is_first(&self) -> bool {
        self.number == 0
    }

    /// Whether it is the last one.
    pub fn is_last(&self) -> bool {
        self.number + 1 == self.of
    }
}

impl Plan {
    /// The parts of a level, in order: the first ones are the largest. One where all its pairs are on the device.
    pub fn parts(&self, level: &Level) -> impl Iterator<Item = PairPart> + use<> {
        let whole = (!self.is_cut()).then(|| PairPart {
            number: 0,
            of: 1,
            first: 0,
            own: self.measured(level),
            rendered: level.rendered,
            measured: level.measured,
            noise: buffer::NOISE_STATE,
            stored: vec![],
        });
        let cut = if whole.is_none() { self.cut_parts(level) } else { vec![] };
        whole.into_iter().chain(cut)
    }

    /// The parts of a level that is cut.
    fn cut_parts(&self, level: &Level) -> Vec<PairPart> {
        let held = self.held();
        let counts = self.counts_of_parts(level.pairs, held);
        let (of, at) = (counts.len(), self.number_of(level));
        let (mut first, mut wall_offset) = (0, 0);
        let part = |(number, count): (usize, &usize)| {
            let slot = (number % 2) as u16;
            let [scanned, others] = self.scene.points_of(*count);
            let scene = PART_SCENE.at(2 * at + u16::from(*count < held));
            let own = LevelPairs { count: *count, scanned, others, wall: PART_WALL.at(slot), scene };
            let histograms = (*count * self.scene.bins * 4) as u64;
            let wall = (scanned + others) as u64 * self.scene.bytes_of_point();
            let one = |host, offset, device: Buffer, bytes, changes| Stored {
                host,
                offset,
                device: device.at(slot),
                bytes,
                changes,
            };
            let mut stored = vec![
                one(STORED_MEASURED.at(number as u16), 0, PART_MEASURED, histograms, false),
                one(STORED_WALL, wall_offset, PART_WALL, wall, false),
            ];
            let noise = self.noise_bytes(*count, self.scene.bins);
            if noise > 0 {
                stored.push(one(STORED_NOISE.at(number as u16), 0, PART_NOISE, noise, true));
            }
            let (measured, noise) = (PART_MEASURED.at(slot), PART_NOISE.at(slot));
            let part = PairPart { number, of, first, own, rendered: own, measured, noise, stored };
            (first, wall_offset) = (first + count, wall_offset + wall);
            part
        };
        counts.iter().enumerate().map(part).collect()
    }

    /// Whether the pairs are more than one part.
    pub fn is_cut(&self) -> bool {
        self.held() < self.scene.pairs
    }

    /// In how many parts the pairs of each level of the volume, then of the surface, are taken.
    pub fn part_counts(&self) -> [Vec<usize>; 2] {
        let of = |levels: &[Level]| levels.iter().map(|l| self.parts(l).count()).collect();
        [of(&self.levels.volume), of(self.levels.pixels.as_slice())]
    }

    /// Whether two buffers are the same, or those of two parts.
    pub(in crate::solve) fn of_same_kind(one: Buffer, other: Buffer) -> bool {
        const ALL: [Buffer; 7] =
            [PART_MEASURED, PART_WALL, PART_NOISE, PART_SCENE, STORED_MEASURED, STORED_WALL, STORED_NOISE];
        one == other || one.family() == other.family() && ALL.contains(&one.family())
    }

    /// Bytes of buffers on the host that the device copies from and to while it computes.
    pub fn stored_bytes(&self) -> u64 {
        self.stores().iter().map(|(_, bytes)| bytes).sum()
    }

    /// The same plan, cut into as few parts as fit: on the device, or into `budget` bytes if it is given.
    ///
    /// # Errors
    /// Not even small parts fit, or this plan cannot be cut.
    pub fn within(mut self, needs: &dyn Needs, memory: &Memory, budget: Option<u64>) -> Result<Plan> {
        let Err(whole) = check(&self.buffers, memory, budget) else { return Ok(self) };
        if self.has_spots() {
            return Err(Error {
                what: format!(
                    "{}; pairs with spots are not divided into parts, as each is a sum over its neighbours",
                    whole.what
                ),
                ..whole
            });
        }
        let mut last = whole;
        let mut parts = self.parts(self.finest()).count().max(1);
        while parts < MOST_PARTS {
            parts += parts.div_ceil(4);
            let cut = self.cut_for(parts);
            if self.division.cut == Some(cut) {
                continue;
            }
            self.division.cut = Some(cut);
            if self.part_counts().concat().iter().any(|n| *n > MOST_PARTS) {
                break;
            }
            self.list_again(needs);
            match check(&self.buffers, memory, budget) {
                Ok(()) => return Ok(self),
                Err(e) => last = e,
            }
        }
        Err(Error { what: format!("even with the pairs in parts, {}", last.what), ..last })
    }

    /// Cuts the pairs so that kernels can index each part, if all are too many.
    ///
    /// # Errors
    /// They cannot be cut that far.
    pub(super) fn cut_to_indices(&mut self, model: &Model) -> Result<()> {
        let mut parts = 1usize;
        while let Some(problem) = self.beyond_indices(model) {
            parts += parts.div_ceil(4);
            if self.has_spots() || parts > MOST_PARTS {
                return Err(problem);
            }
            self.division.cut = Some(self.cut_for(parts));
        }
        Ok(())
    }

    /// Cells of a part, by number of parts.
    fn cut_for(&self, parts: usize) -> usize {
        cells(self.scene.pairs.div_ceil(parts), self.scene.bins)
    }

    /// The buffers once more, after a change of [`Plan::division`]. They read no texels where these are too many.
    pub(super) fn list_again(&mut self, needs: &dyn Needs) {
        self.division.tuning.texels = self.largest_view() <= self.division.texels;
        self.buffers = self.list_buffers(needs.buffers(self), self.with_volume);
    }

    /// The most texels that a buffer has as kernels see it.
    fn largest_view(&self) -> u64 {
        let of_pairs = cells(self.held(), self.scene.bins);
        let points = (self.scene.scanned + self.scene.others) * if self.scene.curved { 2 } else { 1 };
        of_pairs.max(points).max(texels_of(&self.levels, &self.domain)) as u64
    }

    /// What kernels cannot index; `None` if all parts are small enough.
    fn beyond_indices(&self, model: &Model) -> Option<Error> {
        let (rendered, bins) = (model.rendered_wall(), model.bins);
        let pairs = if self.is_cut() { self.held() } else { model.pairs().max(rendered.pairs()) };
        if (pairs as u64 * bins as u64) > MOST_VALUES || cells(pairs, bins) as u64 >= 1 << 31 {
            return Some(Error::memory(
                format!("{pairs} pairs of {bins} bins are beyond 2^30 values"),
                advice!["use a larger " Stride " or a narrower " Gate],
            ));
        }
        let [scanned, others] = match self.is_cut() {
            true => self.scene.points_of(pairs),
            false => [rendered.scanned.len(), rendered.others.len()],
        };
        let tiles = self.division.tuning.tiles(self.scene.geometry, [pairs, scanned, others]);
        (tiles > u64::from(self.division.tiles)).then(|| {
            Error::memory(
                format!("{} pairs are more than this device's workgroup counts reach", model.pairs()),
                advice!["use a larger " Stride],
            )
        })
    }

    /// Pairs that are on the device at once.
    pub(super) fn held(&self) -> usize {
        let Some(most) = self.division.cut else { return self.scene.pairs };
        let most = (most.saturating_sub(PADDING as usize) / (self.scene.bins + PADDING as usize)).max(1);
        self.scene.pairs.min(self.pairs_of_part(self.scene.pairs, most))
    }

    /// Pairs of each of several parts of about the same size, of at most `most` pairs. Of a product: whole rows of
    /// scanned points where these are not more.
    fn pairs_of_part(&self, pairs: usize, most: usize) -> usize {
        let even = |all: usize, most: usize| all.div_ceil(all.div_ceil(most));
        match self.scene.row() {
            Some(row) if row > most => even(row, most),
            Some(row) => even(pairs / row, most / row) * row,
            None => even(pairs, most),
        }
    }

    /// How many pairs each part has, of `pairs` in parts of `held`.
    fn counts_of_parts(&self, pairs: usize, held: usize) -> Vec<usize> {
        let mut all = vec![];
        let mut first = 0;
        while first < pairs {
            let left = match self.scene.row() {
                Some(row) if held < row => row - first % row,
                _ => pairs - first,
            };
            all.push(held.min(left));
            first += held.min(left);
        }
        all
    }

    /// Bytes of the noise term's state by pairs and bins: weight and two moments, by bin or by histogram.
    fn noise_bytes(&self, pairs: usize, bins: usize) -> u64 {
        match self.constant(constant::NOISE) {
            Some(1) => (pairs * bins) as u64 * 12,
            Some(2) => pairs as u64 * 12,
            _ => 0,
        }
    }

    /// Whether pairs have a noise term with a state.
    pub(in crate::solve) fn has_noise(&self) -> bool {
        self.noise_bytes(1, 1) > 0
    }

    /// The place of a level among all.
    fn number_of(&self, level: &Level) -> u16 {
        let mut all = (0..).zip(&self.levels.volume);
        all.find(|(_, l)| l.scene == level.scene).map_or(0, |(i, _)| i)
    }

    /// Buffers on the host with their bytes.
    pub(super) fn stores(&self) -> Vec<(Buffer, u64)> {
        let mut all: Vec<(Buffer, u64)> = vec![];
        for stored in self.parts(self.finest()).flat_map(|part| part.stored) {
            let end = stored.offset + stored.bytes;
            match all.iter_mut().find(|(buffer, _)| *buffer == stored.host) {
                Some((_, bytes)) => *bytes = end.max(*bytes),
                None => all.push((stored.host, end)),
            }
        }
        all
    }

    /// Slots and constants of parts, with their bytes.
    pub(super) fn part_buffers(&self, scene: u64) -> Vec<(Buffer, u64)> {
        let mut all = vec![];
        for part in self.levels.volume.iter().flat_map(|l| self.parts(l)).filter(PairPart::is_cut) {
            all.push((part.own.scene, scene));
            all.extend(part.stored.iter().map(|s| (s.device, s.bytes)));
        }
        all
    }
}
