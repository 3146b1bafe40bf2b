//! Frames in external buffers: counts in a caller's buffer on the device, maps into one.
//!
//! The counts are copied into a readback buffer before the solve, so every solver takes them as it takes counts of the host.

use crate::gpu::external::{ExternalBuffer, TimelinePoint};
use crate::gpu::{Arena, Buffer, BufferPlan, Executor, Gpu, Place};
use crate::maps::Maps;
use crate::session::Feed;
use crate::{Error, Result};

/// Encoding of counts in a buffer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Format {
    /// 32-bit floats.
    #[default]
    F32,
    /// 32-bit unsigned integers.
    U32,
    /// 16-bit unsigned integers, two to a word, the first in its low half.
    U16,
}

impl Format {
    /// Bytes of `count` counts, in whole words.
    pub fn bytes_of(self, counts: usize) -> u64 {
        let each = if self == Format::U16 { 2 } else { 4 };
        (counts as u64 * each).next_multiple_of(4)
    }
}

/// A frame's counts in a caller's buffer: those of bin b of pair p are number `p * bins + b`.
#[derive(Clone)]
pub struct ExternalCounts {
    /// The buffer.
    pub counts: ExternalBuffer,
    /// Encoding of the counts.
    pub format: Format,
    /// The counts are valid from this moment on; `None`: now.
    pub after: Option<TimelinePoint>,
    /// Signalled when the counts were copied: the caller may write the buffer again.
    pub taken: Option<TimelinePoint>,
}

/// A frame whose counts are in a caller's buffer, and whose maps are written to one.
#[derive(Clone)]
pub struct ExternalFrame {
    /// The counts.
    pub counts: ExternalCounts,
    /// Destination of the maps, as 32-bit floats one after the other, for n pixels: albedo `[n]`, depth `[n]` in metres, normals
    /// `[n][3]`, mask `[n]` (1 or 0), expected depth error `[n]` in metres; depth, normal and expected depth error are NaN where nothing is. Pixel
    /// `ix * ny + iy` is at ix along +x, iy along +y. `None`: the maps are only part of the result.
    pub maps: Option<ExternalBuffer>,
    /// Signalled when the maps are written.
    pub done: Option<TimelinePoint>,
}

/// Numbers of a pixel in an external buffer of maps.
const OF_PIXEL: usize = 7;

/// Counts for the host.
const COUNTS_HOST: Buffer = Buffer::named("lent_counts");
/// Maps of the host.
const MAPS_HOST: Buffer = Buffer::named("lent_maps");

/// Host-visible buffers that a caller's buffers are copied to and from.
pub(super) struct Exchange {
    executor: Executor,
    /// Integer counts of a frame.
    words: Vec<u32>,
}

impl Exchange {
    /// Allocates the buffers for frames with the given numbers of counts and pixels. `memory` is a budget in bytes.
    ///
    /// # Errors
    /// Memory or device do not allow it.
    pub fn new(gpu: &Gpu, [counts, pixels]: [usize; 2], memory: Option<u64>) -> Result<Exchange> {
        let plan = [
            BufferPlan::new(COUNTS_HOST, Format::F32.bytes_of(counts), Place::Readback),
            BufferPlan::new(MAPS_HOST, maps_bytes(pixels), Place::Upload),
        ];
        let arena = Arena::new(gpu, &plan, memory)?;
        Ok(Exchange { executor: Executor::new(gpu, arena)?, words: vec![] })
    }

    /// Copies the counts of a frame to the host, in the place of what `counts` holds, and signals that they were copied.
    ///
    /// # Errors
    /// The device fails.
    pub fn take(&mut self, frame: &mut ExternalCounts, number: usize, counts: &mut Vec<f32>) -> Result<()> {
        let Exchange { executor, words } = self;
        executor.settle()?;
        let ticket = executor.copy_external(&frame.counts, COUNTS_HOST, [frame.after, frame.taken])?;
        frame.taken = None;
        executor.wait(ticket)?;
        if frame.format == Format::F32 {
            executor.read_behind(ticket, COUNTS_HOST, ..number, counts);
            return Ok(());
        }
        executor.read_behind(ticket, COUNTS_HOST, ..frame.format.bytes_of(number) as usize / 4, words);
        counts.clear();
        match frame.format {
            Format::U16 => {
                counts.extend(words.iter().flat_map(|w| [w & 0xffff, w >> 16]).map(|c| c as f32));
                counts.truncate(number);
            }
            _ => counts.extend(words.iter().map(|word| *word as f32)),
        }
        Ok(())
    }

    /// Writes the maps into a caller's buffer, and signals `done` afterwards.
    ///
    /// # Errors
    /// The device fails. Then `done` was not signalled.
    fn give(&mut self, maps: &Maps, to: &ExternalBuffer, done: Option<TimelinePoint>) -> Result<()> {
        self.executor.write_external(bytemuck::cast_slice(&words_of(maps)), MAPS_HOST, to, done)
    }
}

/// Bytes of the maps in an external buffer, by number of pixels.
pub(super) fn maps_bytes(pixels: usize) -> u64 {
    (pixels * OF_PIXEL * 4) as u64
}

impl ExternalCounts {
    /// Signals from the host that the buffer may be written again, if that was not signalled yet.
    ///
    /// # Errors
    /// The device fails.
    fn release(&mut self, gpu: &Gpu) -> Result<()> {
        self.taken.take().map_or(Ok(()), |taken| gpu.signal(taken))
    }
}

impl ExternalFrame {
    /// Checks it for a session on this device, with frames of pairs and bins, with these bytes of maps.
    ///
    /// # Errors
    /// The session or the buffers do not allow it.
    pub(super) fn check(
        &self,
        gpu: &Gpu,
        [pairs, bins]: [usize; 2],
        feed: Feed,
        wanted_maps: u64,
    ) -> Result<()> {
        let refused = |what: String, hint: &str| Err(Error::options(what, hint.to_string()));
        if matches!(feed, Feed::Sum { .. }) {
            return refused(
                "frames in external buffers cannot be summed".into(),
                "add them up in the caller's own pass, or feed single frames",
            );
        }
        let wanted = self.counts.format.bytes_of(pairs * bins);
        if self.counts.counts.bytes() != wanted {
            return refused(
                format!(
                    "{} bytes of counts for {pairs} pairs of {bins} bins, which are {wanted} bytes",
                    self.counts.counts.bytes()
                ),
                "lend pairs x bins counts in the format that was named, bin by bin within a pair",
            );
        }
        if let Some(maps) = self.maps.as_ref().filter(|maps| maps.bytes() < wanted_maps) {
            return refused(
                format!("{} bytes for maps, which are {wanted_maps} bytes", maps.bytes()),
                "lend a buffer of `external_maps_bytes`",
            );
        }
        if [Some(&self.counts.counts), self.maps.as_ref()]
            .into_iter()
            .flatten()
            .any(|external| !external.is_on(gpu))
        {
            return refused(
                "a buffer was imported on another device than the session's".into(),
                "import it on the session's own",
            );
        }
        Ok(())
    }

    /// Writes the maps into their buffer, if there is one, and signals that the frame is done.
    ///
    /// # Errors
    /// The device fails.
    pub(super) fn give(&mut self, exchange: &mut Exchange, maps: &Maps, gpu: &Gpu) -> Result<()> {
        match &self.maps {
            Some(to) => exchange.give(maps, to, self.done)?,
            None => self.done.map_or(Ok(()), |done| gpu.signal(done))?,
        }
        self.done = None;
        Ok(())
    }

    /// Signals the moments that were not signalled yet, from the host.
    pub(super) fn release(&mut self, gpu: &Gpu) {
        // No waits on a lost device.
        let _ = self.counts.release(gpu);
        let _ = self.done.take().map(|done| gpu.signal(done));
    }
}

/// The maps as numbers: see [`ExternalFrame::maps`].
fn words_of(maps: &Maps) -> Vec<f32> {
    let mask = maps.mask.iter().map(|is_surface| f32::from(u8::from(*is_surface)));
    let pixels = maps.albedo.len();
    let depth_error = maps.depth_error.as_deref().unwrap_or(&[]).iter().copied();
    let depth_error = depth_error.chain(std::iter::repeat(f32::NAN)).take(pixels);
    let mut words = Vec::with_capacity(OF_PIXEL * pixels);
    words.extend(&maps.albedo);
    words.extend(&maps.depth);
    words.extend(maps.normal.as_flattened());
    words.extend(mask);
    words.extend(depth_error);
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_planes_one_after_the_other() {
        let maps = Maps {
            albedo: vec![1.0, 2.0],
            depth: vec![3.0, 4.0],
            normal: vec![[5.0, 6.0, 7.0], [8.0, 9.0, 10.0]],
            mask: vec![false, true],
            ..Maps::empty([2, 1], [0.0, 2.0, 0.0, 1.0])
        };
        let words = words_of(&maps);
        assert_eq!(words[..12], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 0.0, 1.0]);
        assert!(words.len() == 14 && words[12..].iter().all(|w| w.is_nan()));
    }
}
