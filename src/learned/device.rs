//! Runs the schedule of the learned start on a device.

use glam::DVec3;
use rayon::prelude::*;

use super::bands::{Bands, quantile};
use super::network::Network;
use super::schedule::{FeatureVolume, LEARNED_KERNELS, LEARNED_MASK, LearnedSchedule};
use super::sizes::{BANDS, DEEP, NEAR, SIDE, STEP};
use crate::Result;
use crate::gpu::{Arena, Buffer, BufferPlan, Executor, Gpu, KernelRequest, Place, Schedule};
use crate::transport::kernels::*;

const STAGED: Buffer = Buffer::named("learned_staged");
const LOGITS: Buffer = Buffer::named("learned_logits");

/// What kernels take of a capture.
pub struct LearnedScan<'c> {
    /// Laser and sensor points from the middle of the box's face, walls.
    pub pairs: Vec<[DVec3; 2]>,
    /// `[pair][bin]`.
    pub counts: &'c [f32],
    /// Path at which the first bin begins, and width of a bin, walls.
    pub bins: [f64; 2],
    /// Width of a voxel, walls.
    pub pitch: f64,
}

impl LearnedScan<'_> {
    /// Pairs, and bins of each.
    pub fn sizes(&self) -> [usize; 2] {
        [self.pairs.len(), self.counts.len() / self.pairs.len()]
    }

    /// Content of the buffers that kernels read. The largest count is 1.
    pub fn content(&self) -> [(Buffer, Vec<f32>); 3] {
        let most = self.counts.par_iter().map(|v| v.abs()).reduce(|| 0.0, f32::max);
        let scale = if most > 0.0 { 1.0 / most } else { 1.0 };
        let counts: Vec<f32> = self.counts.par_iter().map(|v| v * scale).collect();
        let [_, bins] = self.sizes();
        let words = |(pair, [laser, sensor]): (usize, &[DVec3; 2])| {
            let level = quantile(&counts[pair * bins..][..bins]);
            let [l, s] = [laser, sensor].map(|p| p.as_vec3());
            [l.x, l.y, l.z, level, s.x, s.y, s.z, 0.0]
        };
        let pairs: Vec<[f32; 8]> =
            self.pairs.par_iter().enumerate().map(|(i, ends)| words((i, ends))).collect();
        let scan = [self.bins[0], self.bins[1], STEP, self.pitch, NEAR].map(|v| v as f32);
        let taps = Bands::new().taps;
        [
            (buffer::LEARNED_COUNTS, counts),
            (buffer::LEARNED_PAIRS, pairs.into_flattened()),
            (buffer::LEARNED_SCAN, scan.iter().chain(taps.as_flattened()).copied().collect()),
        ]
    }
}

/// What the network says of every column: the most probable voxel with its fraction, `[x][y]`, and logits of surface on pixels half
/// as wide. `memory` is a budget in bytes.
///
/// # Errors
/// The device or its memory fails.
pub fn answer_on(
    gpu: &Gpu,
    scan: &LearnedScan<'_>,
    kind: usize,
    memory: Option<u64>,
) -> Result<[Vec<f32>; 2]> {
    let made = LearnedSchedule::new(&Network::trained(), [SIDE, SIDE, DEEP], Some(scan.sizes()), kind);
    let [depth, mask, _] = run(gpu, &made, &scan.content(), None, memory)?;
    Ok([depth, mask])
}

/// Logits of depths, `[x][y][z]`, and of surface, from bands as of [`crate::learned::logits`].
///
/// # Errors
/// The device fails.
pub fn logits_on(gpu: &Gpu, bands: &[f32], kind: usize) -> Result<[Vec<f32>; 2]> {
    let made = LearnedSchedule::new(&Network::trained(), [SIDE, SIDE, DEEP], None, kind);
    let [input, logits] = made.ends;
    let content = [(input.arena, bands.to_vec()), (buffer::LEARNED_SCALES, [1.0, 0.0].repeat(BANDS))];
    let [_, mask, depth] = run(gpu, &made, &content, Some(logits), None)?;
    Ok([depth, mask])
}

/// Depths, the mask's logits, and what was asked for.
fn run(
    gpu: &Gpu,
    made: &LearnedSchedule,
    content: &[(Buffer, Vec<f32>)],
    asked: Option<FeatureVolume>,
    memory: Option<u64>,
) -> Result<[Vec<f32>; 3]> {
    let _span = gpu.span("learned start");
    let is_shared =
        |buffer: Buffer| made.buffers.iter().any(|b| b.buffer == buffer && b.place == Place::Upload);
    let weights: &[u8] = bytemuck::cast_slice(&made.weights);
    let content = content.iter().map(|(to, values)| (*to, bytemuck::cast_slice::<f32, u8>(values)));
    let (shared, copied): (Vec<_>, Vec<_>) =
        content.chain([(buffer::LEARNED_WEIGHTS, weights)]).partition(|(to, _)| is_shared(*to));
    let staged = copied.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    let mut buffers = made.buffers.clone();
    buffers.push(BufferPlan::new(STAGED, staged, Place::Upload));
    buffers.push(BufferPlan::new(LOGITS, asked.map_or(0, |f| f.bytes()), Place::Readback));
    let mut executor = Executor::new(gpu, Arena::new(gpu, &buffers, memory)?)?;
    let kernels = LEARNED_KERNELS.iter().map(|(kernel, code, constants)| KernelRequest {
        kernel: *kernel,
        code,
        constants: constants.to_vec(),
    });
    executor.add_kernels(&kernels.collect::<Vec<_>>())?;
    let mut s = Schedule::default();
    let mut at = 0;
    for (to, bytes) in copied {
        executor.write_at(STAGED, at, bytes);
        s.copy_from([STAGED, to], at, bytes.len() as u64);
        at += bytes.len() as u64;
    }
    shared.iter().for_each(|(to, bytes)| executor.write(*to, bytes));
    s.append(&mut made.commands.clone());
    asked.iter().for_each(|f| s.copy(f.arena, LOGITS, f.bytes()));
    executor.run(&s)?;
    let four: Vec<f32> = executor.read(LEARNED_MASK, ..4 * SIDE * SIDE);
    let pixel = |i: usize| {
        let [x, y] = [i / (2 * SIDE), i % (2 * SIDE)];
        four[((x % 2 * 2 + y % 2) * SIDE + x / 2) * SIDE + y / 2]
    };
    let mask = (0..4 * SIDE * SIDE).map(pixel).collect();
    let asked = asked.map(|f| executor.read(LOGITS, ..f.bytes() as usize / 4));
    Ok([executor.read(buffer::LEARNED_DEPTH, ..SIDE * SIDE), mask, asked.unwrap_or_default()])
}
