//! The learned start as a schedule of a device: bands, back-projection, network and what columns say, in one submission.

use super::graph::{Footprint, Layers, Then, answer};
use super::network::{GROUPS, Network};
use super::sizes::{BANDS, CHANNELS, SAMPLES};
use crate::gpu::{Buffer, BufferPlan, Constant, Kernel, KernelCode, Place, Schedule};
use crate::transport::kernels::*;

/// A kernel of the schedule: what it calls it, its module and its constants.
pub type LearnedKernel = (Kernel, &'static KernelCode, &'static [(Constant, u32)]);

/// All of them.
pub static LEARNED_KERNELS: &[&LearnedKernel] = &[
    &BANDS_OF,
    &PROJECT,
    &LEVELS_OF,
    &INPUT,
    &VOLUME,
    &POINT,
    &HALVE,
    &DOUBLE,
    &NORMALISE,
    &ACTIVATE,
    &ADD,
    &HEAD,
    &PLANE,
    &PLANE_ADD,
    &PLANE_LAST,
];

static BANDS_OF: LearnedKernel = (Kernel::named("learned_bands"), &kernel::LEARNED_BANDS, &[]);
static PROJECT: LearnedKernel = (Kernel::named("learned_project"), &kernel::LEARNED_PROJECT, &[]);
static LEVELS_OF: LearnedKernel =
    (Kernel::named("learned_moments_bands"), &kernel::LEARNED_MOMENTS, &[(constant::OF_BANDS, 1)]);
static INPUT: LearnedKernel =
    (Kernel::named("learned_activate_input"), &kernel::LEARNED_ACTIVATE, &[(constant::MODE, 2)]);
static VOLUME: LearnedKernel =
    (Kernel::named("learned_convolve"), &kernel::LEARNED_CONVOLVE, &[(constant::FINISH, 1)]);
static POINT: LearnedKernel = (
    Kernel::named("learned_convolve_point"),
    &kernel::LEARNED_CONVOLVE,
    &[(constant::REACH_X, 0), (constant::REACH, 0)],
);
static PLANE: LearnedKernel = (
    Kernel::named("learned_convolve_plane"),
    &kernel::LEARNED_CONVOLVE,
    &[(constant::REACH_X, 0), (constant::FINISH, 2)],
);
static PLANE_ADD: LearnedKernel = (
    Kernel::named("learned_convolve_plane_add"),
    &kernel::LEARNED_CONVOLVE,
    &[(constant::REACH_X, 0), (constant::FINISH, 3)],
);
static PLANE_LAST: LearnedKernel =
    (Kernel::named("learned_convolve_plane_last"), &kernel::LEARNED_CONVOLVE, &[(constant::REACH_X, 0)]);
static HALVE: LearnedKernel = (Kernel::named("learned_resize"), &kernel::LEARNED_RESIZE, &[]);
static DOUBLE: LearnedKernel =
    (Kernel::named("learned_resize_double"), &kernel::LEARNED_RESIZE, &[(constant::TRANSPOSED, 1)]);
static NORMALISE: LearnedKernel = (Kernel::named("learned_moments"), &kernel::LEARNED_MOMENTS, &[]);
static ACTIVATE: LearnedKernel = (Kernel::named("learned_activate"), &kernel::LEARNED_ACTIVATE, &[]);
static ADD: LearnedKernel =
    (Kernel::named("learned_activate_add"), &kernel::LEARNED_ACTIVATE, &[(constant::MODE, 1)]);
static HEAD: LearnedKernel = (Kernel::named("learned_head"), &kernel::LEARNED_HEAD, &[]);

/// Arenas of activations.
const ARENA: Buffer = Buffer::named("learned_arena");
/// Logits of the mask: the four pixels of a column are channels, [2 (x % 2) + y % 2][x / 2][y / 2].
pub const LEARNED_MASK: Buffer = Buffer::named("learned_mask");

const RUN: usize = LEARNED_RUN as usize;
/// Invocations of a workgroup.
const GROUP: usize = 64;

/// Channels of a volume in an arena, `[channel][x][y][z]`.
#[derive(Debug, Clone, Copy)]
pub struct FeatureVolume {
    /// The arena.
    pub arena: Buffer,
    channels: usize,
    n: [usize; 3],
}

impl FeatureVolume {
    fn cells(&self) -> usize {
        self.n.iter().product()
    }

    /// Bytes of all channels.
    pub fn bytes(&self) -> u64 {
        4 * (self.channels * self.cells()) as u64
    }

    /// Workgroups of a convolution, each of which leaves moments.
    fn groups(&self) -> usize {
        (self.n[0] * self.n[1].div_ceil(RUN) * self.n[2]).div_ceil(GROUP)
    }

    fn push(&self) -> LearnedPush {
        let [n_x, n_y, n_z] = self.n.map(|n| n as u32);
        LearnedPush { n_x, n_y, n_z, inputs: self.channels as u32, ..LearnedPush::default() }
    }
}

/// The commands of a learned start, with their buffers.
pub struct LearnedSchedule {
    /// All commands but the copies of what is given.
    pub commands: Schedule,
    /// All buffers. Given are [`buffer::LEARNED_WEIGHTS`], `LEARNED_SCAN`, `LEARNED_PAIRS` and `LEARNED_COUNTS`; read back are
    /// [`LEARNED_MASK`] and [`buffer::LEARNED_DEPTH`], a voxel with its fraction of each column.
    pub buffers: Vec<BufferPlan>,
    /// Weights in the order of the kernels.
    pub weights: Vec<u16>,
    /// Back-projected bands, `[band][x][y][z]`, and the logits of depths.
    pub ends: [FeatureVolume; 2],
}

impl LearnedSchedule {
    /// The start for this number of pairs and their bins, in a box of `n` voxels, each a multiple of 8. `None`: from back-projected
    /// bands and `LEARNED_SCALES`, for tests.
    pub fn new(
        network: &Network<'_>,
        n: [usize; 3],
        pairs: Option<[usize; 2]>,
        kind: usize,
    ) -> LearnedSchedule {
        let mut w = Writing {
            network,
            commands: Schedule::default(),
            arenas: vec![],
            weights: vec![],
            moments: 0,
            scales: BANDS,
        };
        w.commands.stage("learned", &[]);
        let projected = w.projected(n, pairs);
        let input = w.take(CHANNELS, n);
        let push = LearnedPush { more: kind as u32, outputs: CHANNELS as u32, ..projected.push() };
        w.elementwise(&INPUT, push, [projected, projected, input]);
        w.give(projected);
        let [logits, _] = answer(&mut w, input);
        let place = |buffer: Buffer, words: usize, place| BufferPlan::new(buffer, 4 * words as u64, place);
        let [pairs, bins] = pairs.unwrap_or_default();
        let mut buffers = vec![
            place(buffer::LEARNED_WEIGHTS, w.weights.len() / 2, Place::Device),
            place(
                buffer::LEARNED_SCAN,
                SCAN_TAPS as usize + BANDS * (2 * LEARNED_TAPS as usize + 1),
                Place::Device,
            ),
            place(buffer::LEARNED_PAIRS, 8 * pairs, Place::Device),
            // Each count is read about once.
            place(buffer::LEARNED_COUNTS, pairs * bins, Place::Upload),
            place(buffer::LEARNED_MOMENTS, 2 * w.moments, Place::Device),
            place(buffer::LEARNED_SCALES, 2 * w.scales, Place::Device),
            place(buffer::LEARNED_DEPTH, n[0] * n[1], Place::Readback),
            place(LEARNED_MASK, 4 * n[0] * n[1], Place::Readback),
        ];
        let arenas = (0..).zip(&w.arenas).map(|(i, (words, _))| place(ARENA.at(i), *words, Place::Device));
        buffers.extend(arenas);
        LearnedSchedule { commands: w.commands, buffers, weights: w.weights, ends: [projected, logits] }
    }
}

/// A schedule that is being written.
struct Writing<'n> {
    network: &'n Network<'n>,
    commands: Schedule,
    /// Words of each arena, and whether it is taken.
    arenas: Vec<(usize, bool)>,
    weights: Vec<u16>,
    /// The most moments and channels of a layer.
    moments: usize,
    scales: usize,
}

impl Writing<'_> {
    /// A free arena: the smallest that suffices, or the largest, which grows.
    fn take(&mut self, channels: usize, n: [usize; 3]) -> FeatureVolume {
        let words = channels * n.iter().product::<usize>();
        let free = || self.arenas.iter().enumerate().filter(|(_, (_, taken))| !taken);
        let fits = free().filter(|(_, (size, _))| *size >= words).min_by_key(|(_, (size, _))| *size);
        let found = fits.or_else(|| free().max_by_key(|(_, (size, _))| *size)).map(|(i, _)| i);
        let i = found.unwrap_or(self.arenas.len());
        if i == self.arenas.len() {
            self.arenas.push((0, false));
        }
        self.arenas[i] = (self.arenas[i].0.max(words), true);
        FeatureVolume { arena: ARENA.at(i as u16), channels, n }
    }

    /// Gives an arena free.
    fn give(&mut self, of: FeatureVolume) {
        let arenas = (0..).zip(&mut self.arenas);
        arenas.filter(|(i, _)| ARENA.at(*i) == of.arena).for_each(|(_, (_, taken))| *taken = false);
    }

    fn run(
        &mut self,
        kernel: &LearnedKernel,
        groups: [usize; 2],
        turns: usize,
        push: LearnedPush,
        binds: &[(Buffer, Buffer)],
    ) {
        let groups = [groups[0] as u32, groups[1] as u32, 1];
        let command = self.commands.dispatch(kernel.0, groups, turns as u64).with(push);
        binds.iter().fold(command, |command, (block, buffer)| command.bind(*block, *buffer));
    }

    /// A convolution's weights, in the order of its kernel; their place, and its outputs.
    fn packed(&mut self, name: &str, inputs: usize, [x, y, z]: [usize; 3]) -> [usize; 2] {
        let [weights, bias] = self.network.halves(name);
        let (at, outputs) = (self.weights.len(), bias.len());
        for first in (0..outputs).step_by(RUN) {
            for i in 0..inputs {
                for (a, c, b, o) in
                    (0..x * y * z * RUN).map(|k| (k / (z * y * RUN), k / (y * RUN) % z, k / RUN % y, k % RUN))
                {
                    let from = ((((first + o) * inputs + i) * x + a) * y + b) * z + c;
                    self.weights.push(if first + o < outputs { weights[from] } else { 0 });
                }
            }
        }
        self.weights.extend(bias);
        self.align();
        [at, outputs]
    }

    /// A layer's weights and biases as they are; their place, and the number of biases.
    fn plain(&mut self, name: &str) -> [usize; 2] {
        let [weights, bias] = self.network.halves(name);
        let at = self.weights.len();
        self.weights.extend(weights);
        self.weights.extend(&bias);
        self.align();
        [at, bias.len()]
    }

    fn align(&mut self) {
        self.weights.resize(self.weights.len().next_multiple_of(RUN), 0);
    }

    /// The bands of all pairs, and their back-projection, with its moments.
    fn projected(&mut self, n: [usize; 3], pairs: Option<[usize; 2]>) -> FeatureVolume {
        let Some([pairs, bins]) = pairs else { return self.take(BANDS, n) };
        let bands = self.take(4, [pairs, SAMPLES, 1]);
        let broad = self.take(1, [pairs, SAMPLES, 1]);
        let binds = [(buffer::LEARNED_BANDS, bands.arena), (buffer::LEARNED_BROAD, broad.arena)];
        let push = LearnedPush { inputs: bins as u32, ..LearnedPush::default() };
        self.run(&BANDS_OF, [pairs, 1], pairs * (bins + SAMPLES * 8), push, &binds);
        let to = self.take(BANDS, n);
        let groups = to.cells().div_ceil(GROUP * RUN);
        self.moments = self.moments.max(BANDS * groups);
        let push = LearnedPush { inputs: pairs as u32, ..to.push() };
        let all = [binds[0], binds[1], (buffer::LEARNED_OUT, to.arena)];
        self.run(&PROJECT, [groups, 1], to.cells() * pairs, push, &all);
        let push = LearnedPush { inputs: groups as u32, more: BANDS as u32, outputs: 1, ..to.push() };
        self.run(&LEVELS_OF, [BANDS, 1], BANDS * groups, push, &[]);
        self.give(bands);
        self.give(broad);
        to
    }

    /// A convolution of the channels of one or two volumes into `to`, or into a free arena.
    fn convolution(
        &mut self,
        kernel: &LearnedKernel,
        name: &str,
        inputs: &[&FeatureVolume],
        to: Option<Buffer>,
    ) -> FeatureVolume {
        let first = inputs[0];
        // As in the kernel, a reach is 1 unless set.
        let wide = |constant| kernel.2.iter().find(|c| c.0 == constant).map_or(3, |c| 2 * c.1 as usize + 1);
        let wide = [wide(constant::REACH_X), wide(constant::REACH), wide(constant::REACH)];
        let channels: usize = inputs.iter().map(|f| f.channels).sum();
        let [weights, outputs] = self.packed(name, channels, wide);
        let to = match to {
            Some(arena) => FeatureVolume { arena, channels: outputs, n: first.n },
            None => self.take(outputs, first.n),
        };
        self.moments = self.moments.max(outputs.next_multiple_of(RUN) * to.groups());
        let more = (channels - first.channels) as u32;
        let push = LearnedPush { more, outputs: outputs as u32, weights: weights as u32, ..first.push() };
        let binds = [
            (buffer::LEARNED_IN, first.arena),
            (buffer::LEARNED_MORE, inputs[inputs.len() - 1].arena),
            (buffer::LEARNED_OUT, to.arena),
        ];
        // A turn of this loop is 32 additions.
        let turns = to.cells() * channels * outputs * wide.iter().product::<usize>() / 32;
        self.run(kernel, [to.groups(), outputs.div_ceil(RUN)], turns, push, &binds);
        to
    }

    /// `[source, added, target]`.
    fn elementwise(
        &mut self,
        kernel: &LearnedKernel,
        push: LearnedPush,
        [from, with, to]: [FeatureVolume; 3],
    ) {
        let binds = [
            (buffer::LEARNED_IN, from.arena),
            (buffer::LEARNED_MORE, with.arena),
            (buffer::LEARNED_OUT, to.arena),
        ];
        let groups = [to.cells().div_ceil(GROUP * RUN), to.channels];
        self.run(kernel, groups, to.channels * to.cells(), push, &binds);
    }

    fn resized(&mut self, kernel: &LearnedKernel, name: &str, from: FeatureVolume) -> FeatureVolume {
        let [weights, outputs] = self.plain(name);
        let is_halved = std::ptr::eq(kernel, &HALVE);
        let n = if is_halved { from.n.map(|n| n / 2) } else { from.n.map(|n| 2 * n) };
        let to = self.take(outputs, n);
        let coarse = if is_halved { to } else { from };
        let push = LearnedPush {
            inputs: from.channels as u32,
            outputs: outputs as u32,
            weights: weights as u32,
            ..coarse.push()
        };
        let binds = [(buffer::LEARNED_IN, from.arena), (buffer::LEARNED_OUT, to.arena)];
        let turns = coarse.cells() * outputs * from.channels;
        self.run(kernel, [coarse.cells().div_ceil(GROUP), outputs], turns, push, &binds);
        to
    }
}

impl Layers for Writing<'_> {
    type Volume = FeatureVolume;

    fn channels(of: &FeatureVolume) -> usize {
        of.channels
    }

    fn outputs(&self, name: &str) -> usize {
        self.network.outputs(name)
    }

    fn convolved(&mut self, name: &str, inputs: &[&FeatureVolume], over: Footprint) -> FeatureVolume {
        let kernel = if over == Footprint::Near { &VOLUME } else { &POINT };
        self.convolution(kernel, name, inputs, None)
    }

    fn activate(&mut self, name: &str, of: &mut FeatureVolume, with: Option<&FeatureVolume>) {
        let [weights, _] = self.plain(name);
        self.scales = self.scales.max(of.channels);
        let each = of.channels / GROUPS;
        let push = LearnedPush {
            inputs: of.groups() as u32,
            more: of.channels as u32,
            outputs: each as u32,
            weights: weights as u32,
            ..of.push()
        };
        self.run(&NORMALISE, [GROUPS, 1], of.channels * of.groups(), push, &[]);
        let kernel = if with.is_some() { &ADD } else { &ACTIVATE };
        let push = LearnedPush { outputs: of.channels as u32, ..of.push() };
        self.elementwise(kernel, push, [*of, *with.unwrap_or(of), *of]);
    }

    fn halved(&mut self, name: &str, fine: &FeatureVolume) -> FeatureVolume {
        self.resized(&HALVE, name, *fine)
    }

    fn doubled(&mut self, name: &str, coarse: &FeatureVolume) -> FeatureVolume {
        self.resized(&DOUBLE, name, *coarse)
    }

    fn columns(&mut self, features: &FeatureVolume, logits: &FeatureVolume) -> FeatureVolume {
        let [x, y, z] = features.n;
        let seen = self.take(2 * features.channels + 2, [1, x, y]);
        let binds = [
            (buffer::LEARNED_IN, features.arena),
            (buffer::LEARNED_MORE, logits.arena),
            (buffer::LEARNED_OUT, seen.arena),
        ];
        self.run(&HEAD, [x * y, 1], x * y * z * features.channels, features.push(), &binds);
        seen
    }

    fn plane(&mut self, name: &str, input: &FeatureVolume, then: Then) -> FeatureVolume {
        let (kernel, to) = match then {
            Then::Activated => (&PLANE, None),
            Then::Added => (&PLANE_ADD, None),
            Then::Last => (&PLANE_LAST, Some(LEARNED_MASK)),
        };
        self.convolution(kernel, name, &[input], to)
    }

    fn free(&mut self, of: FeatureVolume) {
        self.give(of);
    }
}
