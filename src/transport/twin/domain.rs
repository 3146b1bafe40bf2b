use glam::DVec3;

use super::render::{elu, toward_wall};
use super::{Raw, Twin, random3};
use crate::transport::kernels::{LEVEL_SHIFT, LEVELS};
use crate::transport::{BRICK_VOXELS, Grid, Model};

/// The first domain: voxels that are not too near and within reach of a bin.
pub fn initialise(twin: &Twin) -> Vec<bool> {
    let near = twin.model.near_z(twin.grid);
    let reachable = twin.model.reachable_bricks(twin.grid);
    let allowed = |i: usize| {
        let c = twin.grid.voxel(i);
        twin.grid.contains(c) && c[2] >= near && reachable[i / BRICK_VOXELS]
    };
    (0..twin.grid.storage()).map(allowed).collect()
}

/// The first volume: albedo uniform in [0, `span`), normals zero.
pub fn initialise_raw(twin: &Twin, span: f64) -> Vec<Raw> {
    let albedo = |i: usize| span * random3(i as u32, 0, 0, twin.model.seed)[0];
    (0..twin.grid.storage()).map(|i| [albedo(i), 0.0, 0.0, 0.0]).collect()
}

/// Weights 0..=radius of a Gaussian of `sigma` voxels, cut off at `truncate` sigmas. They sum to 1 over both sides.
pub fn taps(sigma: f64, truncate: f64) -> Vec<f64> {
    let radius = (truncate * sigma + 0.5) as usize;
    let half: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.into_iter().map(|w| w / sum).collect()
}

/// The separable Gaussian of the active voxels' albedo, zero outside the grid: raw, or after ELU with a noise term.
pub fn gaussian(twin: &Twin, raw: &[Raw], active: &[bool], taps: &[f64]) -> Vec<f64> {
    let has_noise = twin.model.noise.iter().sum::<f64>() > 0.0;
    let albedo = |a: f64| if has_noise { elu(a) } else { a };
    smooth(
        twin.grid,
        raw.iter().zip(active).map(|(r, a)| if *a { albedo(r[0]) } else { 0.0 }).collect(),
        taps,
    )
}

/// The separable Gaussian of a volume, zero outside the grid.
fn smooth(grid: &Grid, mut volume: Vec<f64>, taps: &[f64]) -> Vec<f64> {
    for axis in 0..3 {
        let source = volume.clone();
        for (i, v) in volume.iter_mut().enumerate() {
            let c = grid.voxel(i);
            *v = 0.0;
            if !grid.contains(c) {
                continue;
            }
            for at in c[axis].saturating_sub(taps.len() - 1)..(c[axis] + taps.len()).min(grid.n[axis]) {
                let mut n = c;
                n[axis] = at;
                *v += taps[at.abs_diff(c[axis])] * source[grid.index(n)];
            }
        }
    }
    volume
}

/// The domain after a reduction: voxels above the share [`Model::keep_above`] of the maximum, not too near and within
/// reach of a bin.
pub fn threshold(twin: &Twin, smooth: &[f64]) -> Vec<bool> {
    let above = twin.model.keep_above * smooth.iter().fold(0.0f64, |a, b| a.max(*b));
    let near = twin.model.near_z(twin.grid);
    let reachable = twin.model.reachable_bricks(twin.grid);
    let keep = |(i, v): (usize, &f64)| {
        let c = twin.grid.voxel(i);
        twin.grid.contains(c) && c[2] >= near && *v > above && reachable[i / BRICK_VOXELS]
    };
    smooth.iter().enumerate().map(keep).collect()
}

/// As [`threshold`] for a domain of raw albedo: where no smoothed value is above zero, the domain stays as it was, if it
/// fits into `room`.
pub fn threshold_raw(twin: &Twin, smooth: &[f64], before: &[bool], room: usize) -> Vec<bool> {
    let stays = smooth.iter().all(|v| *v <= 0.0) && before.iter().filter(|a| **a).count() <= room;
    if stays { before.to_vec() } else { threshold(twin, smooth) }
}

/// Number of voxels that may be active at each level below the largest smoothed value, the highest level last. Levels
/// are steps of a thirty-second of an octave, by the upper bits of the float. Values below all count in the lowest.
pub fn levels(twin: &Twin, smooth: &[f64]) -> Vec<u32> {
    let mut levels = vec![0; LEVELS as usize];
    let peak = smooth.iter().fold(0.0f64, |a, b| a.max(*b));
    let key = |v: f64| (v as f32).to_bits() >> LEVEL_SHIFT;
    // Every value above zero counts.
    let model = Model { keep_above: 0.0, ..twin.model.clone() };
    let allowed = threshold(&Twin { model: &model, grid: twin.grid }, smooth);
    for (value, _) in smooth.iter().zip(allowed).filter(|(_, allowed)| *allowed) {
        let below = key(peak) - key(*value);
        levels[(LEVELS - 1 - below.min(LEVELS - 1)) as usize] += 1;
    }
    levels
}

/// The least smoothed value such that at most `room` voxels are as large; 0 if all voxels above the share `above` of
/// the largest value, `peak`, fit. The highest level always stays.
pub fn room(levels: &[u32], peak: f64, above: f64, room: usize) -> f64 {
    let mut counted = 0;
    let fits = |n: &&u32| {
        counted += **n as usize;
        counted <= room
    };
    let kept = levels.iter().rev().take_while(fits).count().max(1) as u32;
    let key = (peak as f32).to_bits() >> LEVEL_SHIFT;
    let below = kept - 1;
    let whole = kept == LEVELS || below > key;
    let least = if whole { 0.0 } else { f64::from(f32::from_bits((key - below) << LEVEL_SHIFT)) };
    if least > above * peak { least } else { 0.0 }
}

/// The rim: voxels among the 26 neighbours of an active voxel that are not active.
pub fn rim(grid: &Grid, active: &[bool]) -> Vec<bool> {
    let mut rim = vec![false; active.len()];
    for i in (0..active.len()).filter(|i| active[*i]) {
        let c = grid.voxel(i);
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

/// Indices of the active voxels, then of their rim: the voxels that samples read, in the order of their state.
pub fn touched(grid: &Grid, active: &[bool]) -> Vec<u32> {
    [compact(active), compact(&rim(grid, active))].concat()
}

/// Indices of the set voxels, in storage order.
pub fn compact(mask: &[bool]) -> Vec<u32> {
    (0..mask.len() as u32).filter(|i| mask[*i as usize]).collect()
}

/// State after a change of the domain: zero for voxels that were not touched before it.
pub fn carry(touched: &[u32], state: &[Raw]) -> Vec<Raw> {
    let mut carried = vec![[0.0; 4]; state.len()];
    touched.iter().for_each(|i| carried[*i as usize] = state[*i as usize]);
    carried
}

/// State at twice the lateral resolution: linear along x and y, cell-centred, clamped at the edges.
pub fn carry_doubled(coarse: &Grid, fine: &Grid, raw: &[Raw]) -> Vec<Raw> {
    let mut doubled = vec![[0.0; 4]; fine.storage()];
    for (i, value) in doubled.iter_mut().enumerate() {
        let c = fine.voxel(i);
        if !fine.contains(c) {
            continue;
        }
        let [xs, ys] = [0, 1].map(|a| {
            let at = ((c[a] as f64 + 0.5) / 2.0 - 0.5).clamp(0.0, coarse.n[a] as f64 - 1.0);
            let low = at.floor() as usize;
            [(low, 1.0 - at.fract()), ((low + 1).min(coarse.n[a] - 1), at.fract())]
        });
        for (x, wx) in xs {
            for (y, wy) in ys {
                let from = raw[coarse.index([x, y, c[2]])];
                (0..4).for_each(|k| value[k] += wx * wy * from[k]);
            }
        }
    }
    doubled
}

/// The domain at twice the lateral resolution: a voxel is active if its parent was.
pub fn double_domain(coarse: &Grid, fine: &Grid, active: &[bool]) -> Vec<bool> {
    let parent = |[x, y, z]: [usize; 3]| coarse.index([x / 2, y / 2, z]);
    (0..fine.storage()).map(|i| fine.voxel(i)).map(|c| fine.contains(c) && active[parent(c)]).collect()
}

/// The surface in one column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Albedo, in the solver's own scale.
    pub albedo: f64,
    /// Depth, metres.
    pub depth: f64,
    /// Unit normal.
    pub normal: DVec3,
}

/// The brightest active voxel of every column `ix * ny + iy`. `None` if no albedo in it is above zero.
pub fn extract(twin: &Twin, raw: &[Raw], active: &[bool]) -> Vec<Option<Column>> {
    let grid = twin.grid;
    let albedo = |i: usize| if active[i] { raw[i][0].max(0.0) } else { 0.0 };
    let all = (0..grid.n[0]).flat_map(|x| (0..grid.n[1]).map(move |y| [x, y]));
    all.map(|[x, y]| {
        let mut best = (0.0, None);
        for z in twin.model.near_z(grid)..grid.n[2] {
            let i = grid.index([x, y, z]);
            if albedo(i) > best.0 {
                best = (albedo(i), Some((z, i)));
            }
        }
        let (z, i) = best.1?;
        let depth = grid.origin.z + z as f64 * grid.pitch.z;
        Some(Column { albedo: best.0, depth, normal: toward_wall(raw[i]).normalize_or_zero() })
    })
    .collect()
}
