//! Frames that lie in buffers of the caller's, on the device.

use super::Session;
use crate::gpu::Gpu;
use crate::gpu::caller::{Lent, Moment};
use crate::maps::Maps;
use crate::session::Feed;
use crate::solve::{LentCounts, Prepared};
use crate::{Error, Result};

/// A frame whose counts lie in a caller's buffer, and whose maps go into one.
#[derive(Clone)]
pub struct LentFrame {
    /// The counts.
    pub counts: LentCounts,
    /// Where the maps go, as 32-bit floats one after the other, for n pixels: albedo `[n]`, depth `[n]` in metres, normals `[n][3]`,
    /// mask `[n]` (1 or 0), confidence `[n]` in metres; depth, normal and confidence are NaN where nothing is. Pixel
    /// `ix * ny + iy` is at ix along +x, iy along +y. `None`: they are only given to who takes the frame.
    pub maps: Option<Lent>,
    /// Brought about when the maps are there.
    pub done: Option<Moment>,
}

/// Numbers of a pixel in a lent buffer of maps.
const OF_PIXEL: usize = 7;

impl Session {
    /// Bytes of the maps of a frame in a lent buffer: see [`LentFrame::maps`].
    pub fn lent_maps_bytes(&self) -> u64 {
        let [nx, ny, _] = self.plan().levels.maps.n;
        (nx * ny * OF_PIXEL * 4) as u64
    }
}

impl LentFrame {
    /// # Errors
    /// The session or the buffers do not allow it.
    pub(super) fn check(&self, session: &Session) -> Result<()> {
        let refused = |what: String, mend: &str| Err(Error::options(what, mend.to_string()));
        let Some(rows) = session.plan().demand.lent else {
            return refused(
                "this session takes counts from the host only".into(),
                "make it with `lent` in its options",
            );
        };
        if matches!(session.submitter.feed(), Feed::Sum { .. }) {
            return refused(
                "frames in lent buffers cannot be summed".into(),
                "add them up in the caller's own pass, or feed single frames",
            );
        }
        let plan = session.plan();
        let pairs = plan.scene.pairs_of_capture();
        let wanted = self.counts.format.bytes_of(pairs * rows.counts);
        if self.counts.counts.bytes() != wanted {
            return refused(
                format!(
                    "{} bytes of counts for {pairs} pairs of {} bins, which are {wanted} bytes",
                    self.counts.counts.bytes(),
                    rows.counts
                ),
                "lend pairs x bins counts in the format that was named, bin by bin within a pair",
            );
        }
        let wanted = session.lent_maps_bytes();
        if let Some(maps) = self.maps.as_ref().filter(|maps| maps.bytes() < wanted) {
            return refused(
                format!("{} bytes for maps, which are {wanted} bytes", maps.bytes()),
                "lend a buffer of `lent_maps_bytes`",
            );
        }
        if [Some(&self.counts.counts), self.maps.as_ref()]
            .into_iter()
            .flatten()
            .any(|lent| !lent.is_on(session.gpu()))
        {
            return refused(
                "a buffer was imported on another device than the session's".into(),
                "import it on the session's own",
            );
        }
        Ok(())
    }

    /// Writes the maps into their buffer, if there is one, and brings its moment about.
    ///
    /// # Errors
    /// The device fails.
    pub(super) fn give(&mut self, prepared: &mut dyn Prepared, maps: &Maps, gpu: &Gpu) -> Result<()> {
        let Some(to) = &self.maps else {
            return self.done.take().map_or(Ok(()), |done| gpu.signal(done));
        };
        prepared.give(bytemuck::cast_slice(&words_of(maps)), to, self.done)?;
        self.done = None;
        Ok(())
    }

    /// Brings the moments about that have not come, from the host.
    pub(super) fn release(&mut self, gpu: &Gpu) {
        // On a lost device nobody waits for them.
        let _ = self.counts.release(gpu);
        let _ = self.done.take().map(|done| gpu.signal(done));
    }
}

/// The maps as numbers: see [`LentFrame::maps`].
fn words_of(maps: &Maps) -> Vec<f32> {
    let mask = maps.mask.iter().map(|is_surface| f32::from(u8::from(*is_surface)));
    let pixels = maps.albedo.len();
    let confidence = maps.confidence.as_deref().unwrap_or(&[]).iter().copied();
    let confidence = confidence.chain(std::iter::repeat(f32::NAN)).take(pixels);
    let mut words = Vec::with_capacity(OF_PIXEL * pixels);
    words.extend(&maps.albedo);
    words.extend(&maps.depth);
    words.extend(maps.normal.as_flattened());
    words.extend(mask);
    words.extend(confidence);
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
