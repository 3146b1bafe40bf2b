//! A coarse volume as a start of the surface: what a closed form, one linear step with one surface per column, cannot tell apart.
//!
//! minimise  ½ Σ (F √w (A v - h))² / (P T)  +  Σ λ |v|   over vectors v of albedo times normal
//!
//! on columns twice as wide as the pixels of the first fit, by accelerated proximal gradient (Beck, Teboulle 2009) with a step
//! bound per voxel (De Pierro 1995) and group shrinkage by photon noise. The domain begins with the brightest voxels of the closed
//! form and loses dark ones. The maxima of its columns are the layers of the surface.

use glam::{DVec3, dvec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::fit::Fit;
use super::layers::{least_columns, split};
use super::needs::{OF_VOXEL, VOLUME_HOST};
use super::passes::{SURFACE_GATHER, VOLUME_STEP};
use super::support::finer;
use crate::Result;
use crate::gpu::Schedule;
use crate::maps::Maps;
use crate::solve::on_device::{OnDevice, trace_rows, upload};
use crate::solve::over_pairs::{
    compare, forward, gather, groups, over_parts, scene_of_sums, size_passes, turns_of_finish,
};
use crate::solve::passes::{FINISH, FORWARD, RESIDUAL, objective};
use crate::solve::plan::pass::Pass;
use crate::solve::{Level, Plan, VolumeMap};
use crate::transport::kernels::*;

/// Evidence: benches/NOTES.md, "Coarse volume".
mod constants {
    /// Columns per side.
    pub const COLUMNS: usize = 32;
    /// Most voxels of the first domain.
    pub const MOST: usize = 8192;
    /// Dimmer voxels of the closed form, as a share of its brightest, are not in the first domain.
    pub const DIMMEST: f32 = 0.02;
    /// Reductions of the domain, and iterations before each.
    pub const BLOCKS: usize = 4;
    pub const ITERATIONS: usize = 5;
    /// Group weight in standard deviations of the gradient's noise, and at least this share of the steepest gradient.
    pub const NOISE: f64 = 3.0;
    pub const SPARSE: f64 = 2e-3;
    /// Share of noise in the energy above which iterations take all pairs, not one batch.
    pub const NOISY: f64 = 0.05;
    /// A voxel darker than this share of the brightest is empty.
    pub const EMPTY: f64 = 1e-3;
    /// A surface ends where a column falls below this share of its maximum.
    pub const ENDS: f64 = 0.5;
    /// A second maximum, and a pixel, below this share of the first one, or of white, is no surface.
    pub const SECOND: f64 = 0.3;
    pub const LIT: f32 = 0.1;
}
use constants::*;

/// A voxel of the domain: its place, its vector, and D and lambda of its steps.
#[derive(Debug, Clone, Copy)]
struct Voxel {
    at: [usize; 3],
    vector: DVec3,
    bound: f64,
    weight: f64,
}

/// The domain of a solve.
struct VoxelDomain {
    voxels: Vec<Voxel>,
    /// Voxels along x, y, z, the centre of the first, and their size, metres.
    n: [usize; 3],
    origin: DVec3,
    pitch: DVec3,
}

/// The layers of a coarse volume for the counts that `fit` has, on its pixels, from a closed form's volume on these. `None` if it
/// has no light.
///
/// # Errors
/// The device fails.
pub(crate) fn start(fit: &mut Fit, light: &VolumeMap) -> Result<Option<Vec<Maps>>> {
    let job = fit.planned.made(|_| Ok(()))?;
    let plan = job.plan.clone();
    let pixels = plan.levels.pixels.expect("a fit has pixels");
    let [noise, energy] = job.light();
    let level = plan.batch(0).copied().filter(|_| noise <= NOISY * energy).unwrap_or(pixels);
    let most = MOST.min(plan.domain.capacity);
    let mut domain = VoxelDomain::of(light, &pixels, most, plan.scene.bin_width);
    if domain.voxels.is_empty() {
        return Ok(None);
    }
    bounds(job, &level, &mut domain)?;
    let (mut share, mut before) = (1.0, f64::INFINITY);
    for _ in 0..BLOCKS {
        domain.put(job, &level)?;
        let count = domain.voxels.len();
        job.executor.run_once(|s| {
            let mut t = 1.0f64;
            for row in 0..ITERATIONS {
                let next = 0.5 * (1.0 + (1.0 + 4.0 * t * t).sqrt());
                iteration(s, &plan, &level, count, row, [(t - 1.0) / next, share]);
                t = next;
            }
            s.copy(buffer::VOXELS, VOLUME_HOST, count as u64 * OF_VOXEL);
        })?;
        let last = trace_rows(job, ITERATIONS - 1..ITERATIONS)[0][TRACE_OBJECTIVE as usize];
        let left = f64::from(f32::from_bits(last));
        if left > before {
            // The bound ignores how cosines grow as vectors turn.
            share *= 2.0;
        }
        before = before.min(left);
        let state: Vec<[f32; 8]> = job.executor.read(VOLUME_HOST, ..count);
        for (voxel, v) in domain.voxels.iter_mut().zip(state) {
            voxel.vector = dvec3(v[0].into(), v[1].into(), v[2].into());
        }
        domain.reduce();
    }
    // The lists are those of pixels again after the next fit places them.
    Ok(domain.layers(&pixels))
}

/// D and lambda of every voxel: from the rendering of all voxels at unit albedo, and from a draw of the photon noise.
fn bounds(job: &mut OnDevice, level: &Level, domain: &mut VoxelDomain) -> Result<()> {
    let set = |domain: &mut VoxelDomain, albedo: f64| {
        domain.voxels.iter_mut().for_each(|v| v.vector = -albedo * DVec3::Z);
    };
    let plan = job.plan.clone();
    let has_normals = plan.scene.reflectance.has_normals();
    // Along -z.
    let along = |g: &[f32; 4]| f64::from(if has_normals { -g[2] } else { g[0] });
    let gathered = |job: &mut OnDevice, domain: &VoxelDomain, pass: &Pass| -> Result<Vec<f64>> {
        domain.put(job, level)?;
        let count = domain.voxels.len();
        job.executor.run_once(|s| {
            passes(s, &plan, level, pass);
            s.copy(buffer::GRADIENT, VOLUME_HOST, count as u64 * 16);
        })?;
        Ok(job.executor.read::<[f32; 4]>(VOLUME_HOST, ..count).iter().map(along).collect())
    };
    set(domain, 1.0);
    let unit = gathered(job, domain, &RESIDUAL)?;
    set(domain, 0.0);
    let dark = gathered(job, domain, &RESIDUAL)?;
    let steepest = gathered(job, domain, objective(&job.plan.clone()))?;
    let steepest = steepest.iter().fold(0.0f64, |most, g| most.max(g.abs()));
    // A measurement of noise alone.
    let counts = level.first * job.model.bins..(level.first + level.pairs) * job.model.bins;
    let [per_value, floor] = job.model.variance;
    let mut random = Pcg64::seed_from_u64(0);
    let mut draw = |value: &f32| {
        let [radius, angle] = [0, 1].map(|_| random.random::<f64>());
        let normal = (-2.0 * (1.0 - radius).ln()).sqrt() * (std::f64::consts::TAU * angle).cos();
        ((floor + per_value * f64::from(*value)).max(0.0).sqrt() * normal) as f32
    };
    let noise: Vec<f32> = job.model.measured[counts.clone()].iter().map(&mut draw).collect();
    upload(&mut job.executor, level.measured, bytemuck::cast_slice(&noise))?;
    let of_noise = gathered(job, domain, objective(&job.plan.clone()))?;
    let counts = job.model.measured[counts].to_vec();
    upload(&mut job.executor, level.measured, bytemuck::cast_slice(&counts))?;
    // Noise changes slowly with depth.
    let mut sums = vec![[0.0; 2]; domain.n[2]];
    for (voxel, g) in domain.voxels.iter().zip(&of_noise) {
        let sum = &mut sums[voxel.at[2]];
        (sum[0], sum[1]) = (sum[0] + g * g, sum[1] + 1.0);
    }
    const NEAR: usize = 4;
    for (voxel, (unit, dark)) in domain.voxels.iter_mut().zip(unit.iter().zip(&dark)) {
        let z = voxel.at[2];
        let near = &sums[z.saturating_sub(NEAR)..(z + NEAR + 1).min(sums.len())];
        let [squares, count] = near.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        voxel.bound = unit - dark;
        voxel.weight = (NOISE * (squares / count).sqrt()).max(SPARSE * steepest);
    }
    Ok(())
}

/// Renders the samples, compares by the pass `residual`, and gathers the gradients.
fn passes(s: &mut Schedule, plan: &Plan, level: &Level, residual: &Pass) {
    over_parts(s, plan, level, |s, part| {
        forward(s, plan, level, part, &FORWARD);
        compare(s, plan, level, part, residual, Push::default());
        gather(s, plan, level, part, &SURFACE_GATHER);
    });
}

/// An iteration on `count` voxels: forward, weighted residual, gather, step, finish; writes row `row` of the trace.
pub fn iteration(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    count: usize,
    row: usize,
    [momentum, share]: [f64; 2],
) {
    passes(s, plan, level, objective(plan));
    let [unbias_first, unbias_second] = [momentum, share].map(|v| v as f32);
    s.dispatch(&VOLUME_STEP, groups(count, WORKGROUP), count as u64)
        .bind(buffer::SCENE, level.scene)
        .with(Push { unbias_first, unbias_second, ..Default::default() });
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, scene_of_sums(plan, level))
        .with(Push { iteration: row as u32, ..Default::default() });
}

impl VoxelDomain {
    /// The brightest voxels of a closed form's volume on the pixels of a fit whose bins have this width.
    fn of(light: &VolumeMap, pixels: &Level, most: usize, bin_width: f64) -> VoxelDomain {
        let (grid, from) = (&pixels.grid, &light.grid);
        let wide = (grid.n[0] / COLUMNS).max(1);
        let deep = (0.5 * bin_width / from.pitch.z).round().max(1.0) as usize;
        let n = [grid.n[0].div_ceil(wide), grid.n[1].div_ceil(wide), from.n[2].div_ceil(deep)];
        let pitch =
            grid.pitch * dvec3(wide as f64, wide as f64, 0.0) + DVec3::Z * (deep as f64 * from.pitch.z);
        let shift = dvec3(wide as f64 - 1.0, wide as f64 - 1.0, deep as f64 - 1.0) * 0.5;
        let [near, far] = grid.depth_range();
        let origin = dvec3(
            grid.origin.x + shift.x * grid.pitch.x,
            grid.origin.y + shift.y * grid.pitch.y,
            from.origin.z + shift.z * from.pitch.z,
        );
        let mut values = vec![0.0f32; n[0] * n[1] * n[2]];
        for (column, values_of) in light.albedo.chunks(from.n[2]).enumerate() {
            let [x, y] = [column / from.n[1] / wide, column % from.n[1] / wide];
            for (z, value) in values_of.iter().enumerate() {
                let cell = &mut values[(x * n[1] + y) * n[2] + z / deep];
                *cell = cell.max(*value);
            }
        }
        let in_range = |i: usize| (near..=far).contains(&(origin.z + (i % n[2]) as f64 * pitch.z));
        let brightest = values.iter().copied().fold(0.0, f32::max);
        let mut cells: Vec<usize> =
            (0..values.len()).filter(|i| values[*i] > DIMMEST * brightest && in_range(*i)).collect();
        cells.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        cells.truncate(most);
        cells.sort_unstable();
        let voxel = |i: usize| Voxel {
            at: [i / n[2] / n[1], i / n[2] % n[1], i % n[2]],
            vector: DVec3::ZERO,
            bound: 0.0,
            weight: 0.0,
        };
        VoxelDomain { voxels: cells.into_iter().map(voxel).collect(), n, origin, pitch }
    }

    /// Uploads the domain, and sizes the passes over `level`.
    fn put(&self, job: &mut OnDevice, level: &Level) -> Result<()> {
        let place =
            |v: &Voxel| self.origin + self.pitch * dvec3(v.at[0] as f64, v.at[1] as f64, v.at[2] as f64);
        let points: Vec<[f32; 4]> =
            self.voxels.iter().map(|v| place(v).extend(v.vector.length()).as_vec4().to_array()).collect();
        let way = |v: &Voxel| v.vector.try_normalize().unwrap_or(-DVec3::Z);
        let normals: Vec<[f32; 4]> =
            self.voxels.iter().map(|v| way(v).extend(0.0).as_vec4().to_array()).collect();
        let state: Vec<[[f32; 4]; 2]> = (self.voxels.iter())
            .map(|v| [v.vector.extend(v.bound).as_vec4().to_array(), [v.weight as f32, 0.0, 0.0, 0.0]])
            .collect();
        let albedo = points.iter().fold(0.0f32, |most, p| most.max(p[3]));
        upload(&mut job.executor, buffer::SAMPLE_POINTS, bytemuck::cast_slice(&points))?;
        if job.plan.scene.reflectance.has_normals() {
            upload(&mut job.executor, buffer::SAMPLE_NORMALS, bytemuck::cast_slice(&normals))?;
        }
        upload(&mut job.executor, buffer::VOXELS, bytemuck::cast_slice(&state))?;
        job.executor.run_once(|s| {
            s.set(buffer::COUNTS, COUNT_ACTIVE, points.len() as u32);
            s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, albedo.to_bits());
            size_passes(s, &level.rendered);
        })
    }

    /// Removes empty voxels without a lit one beside them.
    fn reduce(&mut self) {
        let brightest = self.voxels.iter().map(|v| v.vector.length()).fold(0.0, f64::max);
        let n = self.n;
        let mut lit = vec![false; n[0] * n[1] * n[2]];
        for v in self.voxels.iter().filter(|v| v.vector.length() > EMPTY * brightest) {
            let [x, y, z] = v.at;
            let span = |at: usize, axis: usize| at.saturating_sub(1)..(at + 2).min(n[axis]);
            for i in span(x, 0) {
                for j in span(y, 1) {
                    lit[(i * n[1] + j) * n[2]..][span(z, 2)].fill(true);
                }
            }
        }
        self.voxels.retain(|v| lit[(v.at[0] * n[1] + v.at[1]) * n[2] + v.at[2]]);
    }

    /// The layers of the surface, on these pixels.
    fn layers(&self, pixels: &Level) -> Option<Vec<Maps>> {
        let grid = &pixels.grid;
        let wide = grid.n[0] / self.n[0];
        let empty = || Maps::empty([self.n[0], self.n[1]], grid.extent());
        let [mut first, mut second] = [empty(), empty()];
        let mut columns = vec![vec![DVec3::ZERO; self.n[2]]; self.n[0] * self.n[1]];
        for v in &self.voxels {
            columns[v.at[0] * self.n[1] + v.at[1]][v.at[2]] = v.vector;
        }
        for (column, vectors) in columns.iter_mut().enumerate() {
            let mut most = 0.0;
            for maps in [&mut first, &mut second] {
                let Some((run, sum, depth)) = brightest_run(vectors) else { break };
                if sum.length() <= SECOND * most {
                    break;
                }
                most = sum.length();
                maps.albedo[column] = most as f32;
                maps.depth[column] = (self.origin.z + depth * self.pitch.z) as f32;
                maps.normal[column] = sum.normalize_or(-DVec3::Z).as_vec3().to_array();
                vectors[run].fill(DVec3::ZERO);
            }
        }
        let white = Maps::white(&first.albedo);
        for maps in [&mut first, &mut second] {
            for pixel in 0..maps.albedo.len() {
                if maps.albedo[pixel] <= LIT * white {
                    super::support::remove(maps, pixel);
                }
            }
        }
        if white <= 0.0 {
            return None;
        }
        let layers = split(&first, &second, least_columns(first.nx)).map_or_else(|| vec![first], Vec::from);
        Some(layers.iter().map(|maps| finer(maps, wide)).collect())
    }
}

/// The stretch of a column around its maximum, the sum of its vectors, and its mean place. `None` in the dark.
fn brightest_run(vectors: &[DVec3]) -> Option<(std::ops::Range<usize>, DVec3, f64)> {
    let at = |z: usize| vectors.get(z).map_or(0.0, |v| v.length());
    let smooth = |z: usize| 0.5 * at(z) + 0.25 * (at(z.wrapping_sub(1)) + at(z + 1));
    let top = (0..vectors.len()).max_by(|a, b| smooth(*a).total_cmp(&smooth(*b)))?;
    let least = ENDS * smooth(top);
    if least <= 0.0 {
        return None;
    }
    let first = (0..top).rev().take_while(|z| smooth(*z) >= least).last().unwrap_or(top);
    let last = (top + 1..vectors.len()).take_while(|z| smooth(*z) >= least).last().unwrap_or(top);
    let run = first..last + 1;
    let sum: DVec3 = vectors[run.clone()].iter().sum();
    let [weights, places] = run.clone().fold([0.0; 2], |a, z| [a[0] + at(z), a[1] + z as f64 * at(z)]);
    (weights > 0.0)
        .then(|| (run.start.saturating_sub(1)..(run.end + 1).min(vectors.len()), sum, places / weights))
}
