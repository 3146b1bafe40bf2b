use glam::{DVec2, DVec3, dvec2, dvec3};

use super::Call;
pub use thirdbounce::capture::pulse::Way;
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Binning, Grid, Model, Reflectance};

/// A scene at one lateral resolution.
#[derive(Debug, Clone, Copy)]
pub struct Twin<'a> {
    /// The capture and the numbers of its reconstruction.
    pub model: &'a Model,
    /// The voxels.
    pub grid: &'a Grid,
}

/// Raw variables of a voxel: albedo a and normal q, before ELU and tanh.
pub type Raw = [f64; 4];

/// The surface element of a sample, as every pair sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres.
    pub point: DVec3,
    /// Albedo.
    pub albedo: f64,
    /// Unit normal.
    pub normal: DVec3,
    /// Length of the normal before normalization.
    pub length: f64,
}

impl Sample {
    /// The sample in a slot of `sample_points` and `sample_normals`.
    pub fn at(twin: &Twin, points: &[Raw], normals: &[Raw], slot: usize) -> Sample {
        let [x, y, z, albedo] = points[slot];
        let directed = twin.model.reflectance.has_normals();
        let [a, b, c, length] = if directed { normals[slot] } else { [0.0, 0.0, -1.0, 1.0] };
        Sample { point: dvec3(x, y, z), albedo, normal: dvec3(a, b, c), length }
    }
}

/// Three numbers in [0, 1) from a voxel's storage index, the iteration and a stream: the same bits as in the kernels.
/// PCG3D, Jarzynski & Olano 2020, "Hash functions for GPU rendering".
pub fn random3(index: u32, iteration: u32, stream: u32, seed: u32) -> [f64; 3] {
    let v = [index, iteration, seed ^ stream.wrapping_mul(0x9e37_79b9)];
    let [mut x, mut y, mut z] = v.map(|a| a.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z] = [x ^ x >> 16, y ^ y >> 16, z ^ z >> 16];
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z].map(|a| f64::from(a >> 8) / 16_777_216.0)
}

/// Position of the sample of voxel `index`, in voxels.
pub fn sample_point(call: &Call, index: u32) -> DVec3 {
    let grid = call.twin.grid;
    let centre = DVec3::from_array(grid.voxel(index as usize).map(|c| c as f64));
    if call.constant(constant::CONTINUOUS, 1) == 0 {
        return centre;
    }
    let shift = DVec3::from_array(random3(index, call.push.iteration, 1, call.paper.seed)) - 0.5;
    let last = DVec3::from_array(grid.n.map(|n| n as f64 - 1.0));
    (centre + shift).clamp(DVec3::ZERO, last)
}

pub(super) fn elu(a: f64) -> f64 {
    if a > 0.0 { a } else { a.exp() - 1.0 }
}

/// The normal before normalization.
pub(super) fn toward_wall(v: Raw) -> DVec3 {
    dvec3(v[1], v[2], v[3]).clamp(DVec3::splat(-10.0), DVec3::splat(10.0)).map(f64::tanh) - DVec3::Z
}

/// A step of Adam: Kingma & Ba 2015, algorithm 1. `steps`: those since the moments were zero.
pub(super) fn adam(
    paper: &PaperData,
    rate: f64,
    steps: u32,
    gradient: f64,
    [value, first, second]: [&mut f64; 3],
) {
    let [b1, b2] = [paper.beta1, paper.beta2].map(f64::from);
    *first = b1 * *first + (1.0 - b1) * gradient;
    *second = b2 * *second + (1.0 - b2) * gradient * gradient;
    let [first, second] = [*first / (1.0 - b1.powi(steps as i32)), *second / (1.0 - b2.powi(steps as i32))];
    *value -= rate * first / (second.sqrt() + f64::from(paper.epsilon));
}

/// Bits of the larger of a float by its bits and of a number.
pub(super) fn larger(bits: u32, value: f64) -> u32 {
    bits.max((value.max(0.0) as f32).to_bits())
}

/// Sets a fault bit if a value is not finite.
pub(super) fn watch(counts: &mut [u32], value: f64, fault: u32) {
    if !value.is_finite() {
        counts[COUNT_FAULTS as usize] |= fault;
    }
}

// The active domain.

/// Indices of the set voxels, in storage order.
pub fn compact(mask: &[bool]) -> Vec<u32> {
    (0..mask.len() as u32).filter(|i| mask[*i as usize]).collect()
}

/// Voxels among the 26 neighbours of an active voxel that are not active.
pub fn rim(grid: &Grid, active: &[bool]) -> Vec<bool> {
    let mut rim = vec![false; active.len()];
    for i in compact(active) {
        let c = grid.voxel(i as usize);
        for z in c[2].saturating_sub(1)..(c[2] + 2).min(grid.n[2]) {
            for y in c[1].saturating_sub(1)..(c[1] + 2).min(grid.n[1]) {
                for x in c[0].saturating_sub(1)..(c[0] + 2).min(grid.n[0]) {
                    let i = grid.index([x, y, z]);
                    rim[i] = !active[i];
                }
            }
        }
    }
    rim
}

/// Whether a voxel's bit is set.
pub(super) fn is_set(mask: &[u32], index: usize) -> bool {
    mask[index / 32] >> (index % 32) & 1 == 1
}

/// The words of a mask.
pub(super) fn mask_of(words: usize, on: impl Fn(usize) -> bool) -> Vec<u32> {
    (0..words).map(|w| (0..32).fold(0, |word, i| word | u32::from(on(32 * w + i)) << i)).collect()
}

/// The slot of a voxel's state: the number of set bits before its own, if it is set and there is room.
pub(super) fn slot_of(mask: &[u32], ranks: &[u32], index: usize, room: u32) -> Option<usize> {
    let before = (mask[index / 32] & ((1 << (index % 32)) - 1)).count_ones();
    is_set(mask, index)
        .then(|| ranks[index / 32] + before)
        .filter(|slot| *slot < room)
        .map(|slot| slot as usize)
}

/// Whether a voxel is in the grid and not too near.
pub(super) fn may_be_active(twin: &Twin, index: usize) -> bool {
    let c = twin.grid.voxel(index);
    twin.grid.contains(c) && c[2] >= twin.model.near_z(twin.grid)
}

/// The voxels (up to eight) that are interpolated at `g`, with their weights.
pub(super) fn corners(grid: &Grid, g: DVec3) -> impl Iterator<Item = (usize, f64)> {
    (0..8).filter_map(move |corner| {
        let at = g.floor() + DVec3::from_array([0, 1, 2].map(|a| f64::from(corner >> a & 1)));
        let near = (1.0 - (g - at).abs()).max(DVec3::ZERO);
        let (weight, c) = (near.element_product(), at.to_array().map(|v| v as usize));
        (weight > 0.0 && grid.contains(c)).then(|| (grid.index(c), weight))
    })
}

// Light.

/// The arm from a sample to a wall point of a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    pub toward: DVec3,
    pub distance: f64,
    /// (reference / distance)², or its root for retroreflective surfaces; 0 for a degenerate pair.
    pub falloff: f64,
    /// Cosine at the wall.
    pub wall: f64,
    pub wall_normal: DVec3,
}

/// A pair as a sample sees it: the arms to the scanned point and to the other point.
pub(super) struct PairGeometry {
    pub arms: [Arm; 2],
    pub falloff: f64,
    /// Path in bins from the leading edge of bin 0.
    pub bin: f64,
}

/// The arms of a pair: value = albedo · cosines · falloff, at path r_l + r_s.
fn kernel(twin: &Twin, pair: usize, s: &Sample) -> PairGeometry {
    let m = twin.model;
    let wall = m.rendered_wall();
    let arms = wall.points_of(pair).map(|number| {
        let [point, normal] = wall.point(number);
        let d = point - s.point;
        let r = d.length();
        if r < m.nearest(twin.grid) || r == 0.0 {
            return Arm { toward: DVec3::ZERO, distance: 0.0, falloff: 0.0, wall: 0.0, wall_normal: normal };
        }
        let toward = d / r;
        let falloff = (m.reference / r).powi(m.falloff_power() / 2);
        Arm { toward, distance: r, falloff, wall: (-normal.dot(toward)).max(0.0), wall_normal: normal }
    });
    let falloff = arms[0].falloff * arms[1].falloff;
    PairGeometry { falloff, bin: (arms[0].distance + arms[1].distance - m.t_start) / m.bin_width, arms }
}

/// Light that a surface vector (unit, or of any length) sends to a pair, without the falloff, and its derivative by the
/// vector. Without normals it is 1.
pub(super) fn shine(reflectance: Reflectance, arms: &[Arm; 2], v: DVec3) -> (f64, DVec3) {
    let [a, b] = arms;
    match reflectance {
        Reflectance::Cosine => {
            let value = v.dot(a.toward);
            if value > 0.0 { (value, a.toward) } else { (0.0, DVec3::ZERO) }
        }
        Reflectance::Lambertian => {
            let n = v.normalize_or_zero();
            let (cos_a, cos_b) = (n.dot(a.toward), n.dot(b.toward));
            if cos_a <= 0.0 || cos_b <= 0.0 {
                return (0.0, DVec3::ZERO);
            }
            let slope = cos_b * a.toward + cos_a * b.toward - cos_a * cos_b * n;
            (a.wall * b.wall * v.length() * cos_a * cos_b, a.wall * b.wall * slope)
        }
        Reflectance::Retroreflective | Reflectance::Isotropic => (1.0, DVec3::ZERO),
    }
}

/// The bins that a path at `position` (in bins from the leading edge of bin 0) adds to, with their shares.
fn shares(model: &Model, position: f64) -> impl Iterator<Item = (usize, f64)> + use<> {
    let both = match model.binning {
        Binning::Nearest => [(position.floor(), 1.0), (-1.0, 0.0)],
        Binning::Linear => {
            let centre = position - 0.5;
            let low = centre.floor();
            [(low, 1.0 - (centre - low)), (low + 1.0, centre - low)]
        }
    };
    let bins = model.bins as f64;
    both.into_iter().filter(move |(b, w)| *b >= 0.0 && *b < bins && *w > 0.0).map(|(b, w)| (b as usize, w))
}

/// The accumulated histogram of one pair, before the render scale.
pub fn rendered_pair(twin: &Twin, pair: usize, samples: &[Sample]) -> Vec<f64> {
    let mut sums = vec![0.0; twin.model.bins];
    for s in samples {
        let k = kernel(twin, pair, s);
        let value = s.albedo * shine(twin.model.reflectance, &k.arms, s.normal).0 * k.falloff;
        shares(twin.model, k.bin).for_each(|(bin, share)| sums[bin] += value * share);
    }
    sums
}

/// Accumulated histograms of the samples, `[pair * bins + bin]`, before the render scale.
pub fn rendered(twin: &Twin, samples: &[Sample]) -> Vec<f64> {
    (0..twin.model.rendered_wall().pairs()).flat_map(|pair| rendered_pair(twin, pair, samples)).collect()
}

/// Histograms of rendered pairs as the instrument shows them: summed over the measured pairs' spots, spread by the pulse.
/// Or back, through both in reverse.
pub fn instrument(model: &Model, values: &[f64], way: Way) -> Vec<f64> {
    let pulse = |values: Vec<f64>| match &model.pulse {
        Some(taps) => values.chunks(model.bins).flat_map(|h| taps.through(h, way)).collect(),
        None => values,
    };
    let spots = |values: Vec<f64>| {
        let stages = model.rendered.as_ref().map_or(vec![], |r| match way {
            Way::Spread => r.stages.clone(),
            Way::Back => r.back(),
        });
        stages.iter().fold(values, |v, stage| stage.through(&v, model.bins))
    };
    match way {
        Way::Spread => pulse(spots(values.to_vec())),
        Way::Back => spots(pulse(values.to_vec())),
    }
}

/// Calls `hear` with the kernel of every pair of a dispatch and a sample, with the residual at its path, and with the
/// rise of the residual between the two bins around the path.
pub(super) fn gather(
    call: &Call,
    s: &Sample,
    residual: &[f64],
    mut hear: impl FnMut(&PairGeometry, f64, f64),
) {
    let twin = &call.twin;
    for pair in call.push.first..call.push.last {
        let pair = pair as usize;
        let (k, row) = (kernel(twin, pair, s), call.row(pair));
        let at = |bin: f64| {
            if bin >= 0.0 && bin < twin.model.bins as f64 { residual[row + bin as usize] } else { 0.0 }
        };
        let low = (k.bin - 0.5).floor();
        let r: f64 = shares(twin.model, k.bin).map(|(b, w)| w * residual[row + b]).sum();
        // A path that is not finite reads no bin and is reported.
        hear(&k, if k.bin.is_finite() { r } else { f64::NAN }, at(low + 1.0) - at(low));
    }
}

// The surface: pixels with a depth and an albedo.

/// Slope between two pixels that halves their bond.
const EDGE: f64 = 2.5;

/// The eight neighbours of a pixel in the order of its stencils; seen from neighbour k, the pixel is number 7 - k.
pub(super) const AROUND: [[i32; 2]; 8] =
    [[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]];

/// The pixels of a surface: the buffers `pixels` and `pixel_of`.
pub(super) struct PixelBuffers<'a> {
    pub grid: &'a Grid,
    pub pixels: &'a [u32],
    pub pixel_of: &'a [u32],
}

impl PixelBuffers<'_> {
    /// Columns before those of a pixel's layer, and its lateral position.
    pub fn place(&self, pixel: usize) -> (usize, [i32; 2]) {
        let [x, y] = [self.grid.n[0], self.grid.n[1]];
        let column = self.pixels[pixel] as usize;
        let at = column % (x * y);
        (column - at, [at / y, at % y].map(|v| v as i32))
    }

    /// The pixel at an offset in the layer of another, if there is one.
    pub fn beside(&self, pixel: usize, [dx, dy]: [i32; 2]) -> Option<usize> {
        let (layer, [x, y]) = self.place(pixel);
        let [nx, ny] = [self.grid.n[0], self.grid.n[1]].map(|n| n as i32);
        let (x, y) = (x + dx, y + dy);
        let inside = (0..nx).contains(&x) && (0..ny).contains(&y);
        let found = inside.then(|| self.pixel_of[layer + (x * ny + y) as usize]);
        found.filter(|other| *other != u32::MAX).map(|other| other as usize)
    }

    /// A pixel's neighbours, with their numbers among the eight.
    pub fn neighbours(&self, pixel: usize) -> impl Iterator<Item = (usize, usize)> {
        (0..8).filter_map(move |k| Some((k, self.beside(pixel, AROUND[k])?)))
    }

    /// Bond of two pixels at this offset whose depths differ by `step`: a Gaussian that stops at edges.
    pub fn bond(&self, [dx, dy]: [i32; 2], sigma: f64, step: f64) -> f64 {
        let steep = step / (EDGE * self.size());
        (-f64::from(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp() / (1.0 + steep.powi(4))
    }

    /// Difference of depths at the last renewal of bonds.
    pub fn step(&self, bond_depths: &[f64], from: usize, to: usize) -> f64 {
        let depth = |pixel: usize| bond_depths[self.pixels[pixel] as usize];
        depth(to) - depth(from)
    }

    /// Distances between neighbours, metres.
    pub fn pitch(&self) -> DVec2 {
        self.grid.pitch.truncate()
    }

    /// Side of a square with a pixel's area, metres.
    pub fn size(&self) -> f64 {
        (self.grid.pitch.x * self.grid.pitch.y).sqrt()
    }

    /// Offset of a pixel's k-th point (of 1 or 4) from its centre, metres.
    pub fn part(&self, k: usize, points: usize) -> DVec2 {
        let quarter = |k: usize| [-0.25, 0.25][k];
        if points == 1 { DVec2::ZERO } else { dvec2(quarter(k / 2), quarter(k % 2)) * self.pitch() }
    }

    /// The gradient of a pixel's depth and albedo: its own, and the gradients of all slopes that use its depth.
    pub fn pulled(&self, pixel: usize, stencils: &[[f64; 2]], gradient: &[Raw]) -> [f64; 2] {
        let slope = |pixel: usize| dvec2(gradient[pixel][0], gradient[pixel][1]);
        let through = |(k, other): (usize, usize)| {
            DVec2::from_array(stencils[8 * other + 7 - k]).dot(slope(other))
                - DVec2::from_array(stencils[8 * pixel + k]).dot(slope(pixel))
        };
        [gradient[pixel][2] + self.neighbours(pixel).map(through).sum::<f64>(), gradient[pixel][3]]
    }
}

/// Sigma, pixels, of the Gaussian that spreads gradients at step `number` (from 1): it narrows to the pixel itself in
/// three fifths of the iterations.
pub(super) fn sigma_at(weights: &[f64], number: u32) -> Option<f64> {
    let [first, iterations] = [SURFACE_SPREAD, SURFACE_ITERATIONS].map(|i| weights[i as usize]);
    Some(first * (1.0 - f64::from(number - 1) / iterations / 0.6)).filter(|sigma| *sigma >= 0.35)
}

/// Pixels to each side that a Gaussian of this sigma covers, as offsets.
pub(super) fn covered(sigma: f64) -> impl Iterator<Item = [i32; 2]> {
    let reach = (2.0 * sigma - 1e-3).ceil() as i32;
    (-reach..=reach).flat_map(move |x| (-reach..=reach).map(move |y| [x, y]))
}

/// Unit normal, toward the wall, of a pixel with these slopes.
pub(super) fn facing(slope: DVec2) -> DVec3 {
    slope.extend(-1.0).normalize()
}

/// Area of a pixel's surface over its lateral area. Without normals, albedo is per lateral area, and this is 1.
pub(super) fn stretch(twin: &Twin, slope: DVec2) -> f64 {
    if twin.model.reflectance.has_normals() { slope.extend(-1.0).length() } else { 1.0 }
}

/// Least and largest depth of a surface, metres.
pub(super) fn depth_limits(twin: &Twin) -> [f64; 2] {
    [twin.model.near_z(twin.grid), twin.grid.n[2] - 1].map(|z| twin.grid.position(DVec3::Z * z as f64).z)
}

/// Sum of the partial sums of a dispatch, and the row of the trace that closes an iteration.
pub(super) fn close(
    call: &Call,
    counts: &mut [u32],
    losses: &[[f64; 2]],
    magnitudes: &[f64],
    trace: &mut [u32],
) {
    let of = |constant, usual| call.constant(constant, usual);
    let tile = (WORKGROUP * RESIDUAL_BINS) as usize;
    let partials =
        if of(constant::ROWS, 0) == 0 { call.cells().div_ceil(tile) } else { call.scene.pairs as usize };
    let mean =
        |k: usize| losses[..partials].iter().map(|l| l[k]).sum::<f64>() / call.twin.model.elements as f64;
    let active = counts[COUNT_ACTIVE as usize];
    let summed = active.div_ceil(of(constant::SUMMED, WORKGROUP)) as usize;
    let row = &mut trace[(call.push.iteration * TRACE_ROW) as usize..][..TRACE_ROW as usize];
    let mut put = |at: u32, value: f64| row[at as usize] = (value as f32).to_bits();
    put(TRACE_DATA, mean(1));
    put(TRACE_OBJECTIVE, mean(0));
    put(TRACE_L1, magnitudes[..summed].iter().sum());
    for (at, count) in [
        (TRACE_ACTIVE, COUNT_ACTIVE),
        (TRACE_PEAK, COUNT_PEAK_ALBEDO),
        (TRACE_FAULTS, COUNT_FAULTS),
        (TRACE_LEAST, COUNT_LEAST_SMOOTH),
    ] {
        row[at as usize] = counts[count as usize];
    }
    counts[COUNT_PEAK_ALBEDO as usize] = 0;
}

/// Number `i` of two in each word, in half precision.
pub(super) fn half(words: &[u32], i: usize) -> f64 {
    let bits = words[i / 2] >> (16 * (i % 2)) & 0xffff;
    let (exponent, rest) = ((bits >> 10 & 31) as i32, f64::from(bits & 1023));
    let size = if exponent == 0 { rest * 2f64.powi(-24) } else { (1024.0 + rest) * 2f64.powi(exponent - 25) };
    if bits >> 15 == 1 { -size } else { size }
}

/// x sigmoid(x).
pub(super) fn silu(x: f64) -> f64 {
    x / (1.0 + (-x).exp())
}
