//! The vector solver's kernels. Vectors are albedo * normal. They are by storage index or, next to a list of active
//! voxels, by slot.

use glam::{DVec3, dvec3};

use super::domain::{Column, brightest, columns};
use super::pulse::{Way, instrument};
use super::render::{Kernel, accumulate, gather, shine};
use super::{Sample, Twin, forward};
use crate::transport::Model;

/// Toward the wall: the direction in which a zero vector may grow.
const TOWARD_WALL: DVec3 = dvec3(0.0, 0.0, -1.0);

/// Centres of the active voxels as samples of unit weight with zero vectors.
pub fn points(twin: &Twin, active: &[u32]) -> Vec<Sample> {
    let centre = |i: &u32| DVec3::from_array(twin.grid.voxel(*i as usize).map(|c| c as f64));
    let sample =
        |i| Sample { point: twin.grid.position(centre(i)), albedo: 1.0, normal: DVec3::ZERO, length: 0.0 };
    active.iter().map(sample).collect()
}

/// y = v + beta (v - v before) as the vectors of the active voxels' samples; without normals, as their albedo too.
pub fn extrapolate(twin: &Twin, active: &[u32], v: &[DVec3], before: &[DVec3], beta: f64) -> Vec<Sample> {
    let mut samples = points(twin, active);
    for (s, i) in samples.iter_mut().zip(active) {
        let i = *i as usize;
        s.normal = v[i] + beta * (v[i] - before[i]);
        if !twin.model.reflectance.has_normals() {
            s.albedo = -s.normal.z;
        }
    }
    samples
}

/// A voxel's part of the roughness term.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rough {
    /// Half of the energy of each pair with a neighbour.
    pub energy: f64,
    /// Gradient by the voxel's vector.
    pub gradient: DVec3,
}

/// The roughness of the samples' vectors: the sum over pairs of neighbours of mu |y_i - y_j|² / 2, where mu is the
/// smaller one of roughness * lambda² / (D peak²), limited to share * D / 12 so that it allows steps of D. `bounds` are
/// (D, lambda) by storage index; `share` is the share of D that a step divides by.
pub fn roughness(
    twin: &Twin,
    active: &[u32],
    samples: &[Sample],
    bounds: &[[f64; 2]],
    share: f64,
    peak: f64,
) -> Vec<Rough> {
    let grid = twin.grid;
    let mut slots = vec![None; grid.storage()];
    active.iter().enumerate().for_each(|(slot, i)| slots[*i as usize] = Some(slot));
    let mu = |i: u32| {
        let [d, lambda] = bounds[i as usize];
        if d > 0.0 { (twin.model.roughness * (lambda / peak).powi(2) / d).min(share * d / 12.0) } else { 0.0 }
    };
    let mut all = vec![Rough::default(); active.len()];
    for (a, i) in active.iter().enumerate().filter(|_| peak > 0.0) {
        let here = grid.voxel(*i as usize);
        // Each pair of neighbours once, from its lower side.
        for axis in 0..3 {
            let mut there = here;
            there[axis] += 1;
            let Some(b) = grid.contains(there).then(|| slots[grid.index(there)]).flatten() else { continue };
            let mu = mu(*i).min(mu(active[b]));
            let jump = samples[a].normal - samples[b].normal;
            for (slot, sign) in [(a, 1.0), (b, -1.0)] {
                all[slot].energy += 0.25 * mu * jump.length_squared();
                all[slot].gradient += sign * mu * jump;
            }
        }
    }
    all
}

/// Accumulated histograms without the surface's cosines, before the render scale: an upper bound for all vectors that
/// are no longer than the samples' albedos.
pub fn forward_bound(twin: &Twin, samples: &[Sample]) -> Vec<f64> {
    accumulate(twin, samples, |k, s| s.albedo * k.most)
}

/// d(weighted mean squared error) / d(accumulated value) of every bin, then the weighted error and the plain one.
/// Without `measure` the measurement counts as zero. Both directions go through the model's instrument.
pub fn residual_weighted(twin: &Twin, accumulated: &[f64], measure: bool) -> (Vec<f64>, [f64; 2]) {
    let m = twin.model;
    let (render, elements) = (f64::from(m.scene(twin.grid).render_scale), m.elements as f64);
    let seen = instrument(twin, accumulated, Way::Spread);
    let measured = |i: usize| if measure { f64::from(m.measured[i]) } else { 0.0 };
    let plain: Vec<f64> = seen.iter().enumerate().map(|(i, sum)| sum * render - measured(i)).collect();
    let filter = |rows: &mut [f64]| {
        m.high_pass.iter().for_each(|f| rows.chunks_mut(m.bins).for_each(|row| f.apply(row, m.bin_width)));
    };
    let weigh = |i: usize| m.bin_weight(i % m.bins).sqrt();
    let mut rows: Vec<f64> = plain.iter().enumerate().map(|(i, d)| weigh(i) * d).collect();
    filter(&mut rows);
    let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / elements;
    let loss = [squares(&rows), squares(&plain)];
    filter(&mut rows);
    let gradient: Vec<f64> =
        rows.iter().enumerate().map(|(i, v)| 2.0 / elements * render * weigh(i) * v).collect();
    (instrument(twin, &gradient, Way::Back), loss)
}

/// dLoss / d(vector) of every sample; a zero vector counts as directed toward the wall.
pub fn gradient_vectors(twin: &Twin, samples: &[Sample], residual: &[f64]) -> Vec<DVec3> {
    let reflectance = twin.model.reflectance;
    let of_sample = |s: &Sample| {
        let direction = if s.normal == DVec3::ZERO { TOWARD_WALL } else { s.normal };
        let (mut albedo, mut vector) = (0.0, DVec3::ZERO);
        gather(twin, s, residual, |k, r| {
            let (value, slope) = shine(reflectance, &k.arms, direction);
            albedo += r * k.falloff * value;
            vector += r * k.falloff * slope;
        });
        if reflectance.has_normals() { vector } else { dvec3(0.0, 0.0, -albedo) }
    };
    samples.iter().map(of_sample).collect()
}

/// Nearest point of the cone v_z <= 0, |v_xy| <= cone |v_z|.
pub fn into_cone(cone: f64, v: DVec3) -> DVec3 {
    let across = v.truncate();
    if across.length() <= -cone * v.z {
        return v;
    }
    // Onto the cone's edge in the plane of v and the axis, or to its apex.
    let edge = (cone * across.normalize_or_zero()).extend(-1.0).normalize();
    edge * v.dot(edge).max(0.0)
}

/// Group soft threshold: the proximal map of `by` |v|.
pub fn shrink(v: DVec3, by: f64) -> DVec3 {
    v.normalize_or_zero() * (v.length() - by).max(0.0)
}

/// A voxel's parts of the partial sums of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepSums {
    /// The group term and the roughness at y.
    pub group: f64,
    /// D (y - v') . (v' - v): positive where the momentum leads uphill.
    pub against: f64,
}

/// The proximal gradient step from y, the samples' vectors; their `length` is the energy of the roughness there. `v`
/// and `before` change in place. `bounds` are (D, lambda) by storage index; `share` is the share of D that the step
/// divides by. A voxel whose D is zero becomes zero.
#[allow(clippy::too_many_arguments)] // the kernel's bindings
pub fn step(
    twin: &Twin,
    active: &[u32],
    samples: &[Sample],
    gradient: &[DVec3],
    bounds: &[[f64; 2]],
    share: f64,
    v: &mut [DVec3],
    before: &mut [DVec3],
) -> Vec<StepSums> {
    let one = |((i, s), g): ((&u32, &Sample), &DVec3)| {
        let i = *i as usize;
        let (y, [d, lambda]) = (s.normal, [bounds[i][0] * share, bounds[i][1]]);
        let next = match d > 0.0 {
            true => shrink(into_cone(twin.model.cone, y - *g / d), lambda / d),
            false => DVec3::ZERO,
        };
        before[i] = v[i];
        v[i] = next;
        StepSums { group: lambda * y.length() + s.length, against: d * (y - next).dot(next - before[i]) }
    };
    active.iter().zip(samples).zip(gradient).map(one).collect()
}

/// Expected brightness of voxels, as weights of their bounds. `shares` are smoothed albedos over the largest one.
pub fn expect(shares: &[f64], power: f64) -> Vec<f64> {
    shares.iter().map(|s| ((s + 0.05) / 1.05).powf(power)).collect()
}

/// The bounds that [`bound`] computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// D, from a residual that is the weighted isotropic rendering of the domain.
    Step,
    /// lambda, from a residual that holds the weighted variances.
    Noise,
}

/// Bounds at the samples. For [`Bound::Step`] the samples' albedos are its weights.
pub fn bound(twin: &Twin, samples: &[Sample], residual: &[f64], what: Bound) -> Vec<f64> {
    samples
        .iter()
        .map(|s| {
            let mut sum = 0.0;
            gather(twin, s, residual, |k, r| {
                sum += r * if what == Bound::Step { k.most } else { k.most * k.most };
            });
            if what == Bound::Step { sum / s.albedo } else { twin.model.noise_factor * sum.sqrt() }
        })
        .collect()
}

/// Variance of every bin's residual, taken back through the instrument to the paths.
pub fn variance(twin: &Twin) -> Vec<f64> {
    let m = twin.model;
    let render = f64::from(m.scene(twin.grid).render_scale);
    let of_bin = |(i, value): (usize, &f32)| {
        let scale = 2.0 / m.elements as f64 * render * m.bin_weight(i % m.bins);
        scale * scale * (m.variance[0] * f64::from(*value).max(0.0) + m.variance[1])
    };
    let of_bins: Vec<f64> = m.measured.iter().enumerate().map(of_bin).collect();
    instrument(twin, &of_bins, Way::Squared)
}

/// Weighted histograms, convolved along time with `hat`, the weights at 0, 1, 2, ... bins to either side. `odd`: those of
/// earlier bins are the negatives of those of later ones.
pub fn filter(twin: &Twin, hat: &[f64], odd: bool) -> Vec<f64> {
    let m = twin.model;
    let filtered = |histogram: &[f32], bin: usize| -> f64 {
        let near = |b: &usize| b.abs_diff(bin) < hat.len();
        let side = |b: usize| if odd && b < bin { -1.0 } else { 1.0 };
        let value = |b: usize| side(b) * hat[b.abs_diff(bin)] * m.bin_weight(b) * f64::from(histogram[b]);
        (0..m.bins).filter(near).map(value).sum()
    };
    m.measured.chunks(m.bins).flat_map(|h| (0..m.bins).map(move |b| filtered(h, b))).collect()
}

/// What is left of the measurement, `left[pair * bins + bin]` in bins of which one is `from` of those that `to` of are one
/// of the twin's, and weighted there; summed to the twin's bins and convolved along time with `hat`, as in [`filter`].
pub fn filter_left(twin: &Twin, hat: &[f64], left: &[f64], bins: usize, [from, to]: [usize; 2]) -> Vec<f64> {
    let m = twin.model;
    let filtered = |left: &[f64], bin: usize| -> f64 {
        let mut sums = vec![0.0; m.bins];
        for (b, value) in left.iter().enumerate() {
            let middle = (b as f64 + 0.5) * from as f64 / to as f64;
            if let Some(sum) = sums.get_mut(middle as usize) {
                *sum += value;
            }
        }
        sums.iter().enumerate().map(|(b, v)| hat.get(b.abs_diff(bin)).map_or(0.0, |h| h * v)).sum()
    };
    let rows = left.chunks(bins).take(m.pairs());
    rows.flat_map(|row| (0..m.bins).map(|bin| filtered(row, bin)).collect::<Vec<_>>()).collect()
}

/// Back-projection of filtered histograms into every voxel that is not too near, by storage index. It uses the cosine
/// of a surface that faces the wall and no falloff; negative sums become zero.
pub fn backproject(twin: &Twin, filtered: &[f64]) -> Vec<f64> {
    let grid = twin.grid;
    // It takes spots for points.
    let sharp = Model { rendered: None, ..twin.model.clone() };
    let twin = &Twin { model: &sharp, grid };
    let near = twin.model.near_z(grid);
    let allowed = |i: &u32| {
        let c = grid.voxel(*i as usize);
        grid.contains(c) && c[2] >= near
    };
    let voxels: Vec<u32> = (0..grid.storage() as u32).filter(allowed).collect();
    let directed = twin.model.reflectance.has_normals();
    let mut volume = vec![0.0; grid.storage()];
    for (s, i) in points(twin, &voxels).into_iter().zip(voxels) {
        let mut sum = 0.0;
        let cosine = |k: &Kernel| if directed { (-k.arms[0].toward.z).max(0.0) } else { 1.0 };
        gather(twin, &s, filtered, |k, r| sum += r * cosine(k));
        volume[i as usize] = sum.max(0.0);
    }
    volume
}

/// State after a change of the domain: inactive voxels are zero, and the momentum is at rest.
pub fn settle(active: &[bool], v: &mut [DVec3], before: &mut [DVec3], momentum: &mut Momentum) {
    for (v, _) in v.iter_mut().zip(active).filter(|(_, a)| !**a) {
        *v = DVec3::ZERO;
    }
    before.copy_from_slice(v);
    *momentum = Momentum { t: 1.0, beta: 0.0, objective: f64::INFINITY, ..*momentum };
}

/// FISTA's state between iterations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Momentum {
    /// FISTA's t.
    pub t: f64,
    /// Extrapolation of the next iteration.
    pub beta: f64,
    /// Objective of the previous iteration.
    pub objective: f64,
    /// Restarts so far.
    pub restarts: f64,
    /// Share of the bound that a step divides by.
    pub share: f64,
}

/// The momentum after an iteration with this objective and sum of [`StepSums::against`]: FISTA's sequence (Beck & Teboulle
/// 2009), restarted where the step went against the momentum, or where the objective rose (O'Donoghue & Candès 2015) by
/// more than the rounding of fp32 sums. Where it rose, steps become shorter, down to 1 / D.
pub fn finish_accelerated(before: Momentum, objective: f64, against: f64) -> Momentum {
    let rose = objective > (1.0 + 1e-5) * before.objective;
    let share = if rose { (1.5 * before.share).min(1.0) } else { before.share };
    if rose || against > 0.0 {
        return Momentum { t: 1.0, beta: 0.0, objective, restarts: before.restarts + 1.0, share };
    }
    let t = (1.0 + (1.0 + 4.0 * before.t * before.t).sqrt()) / 2.0;
    Momentum { t, beta: (before.t - 1.0) / t, objective, share, ..before }
}

/// The objective of the vector solver: the weighted mean squared error plus the sum of lambda |v|.
pub fn objective_vectors(twin: &Twin, samples: &[Sample], lambda: &[f64]) -> f64 {
    let (_, loss) = residual_weighted(twin, &forward(twin, samples), true);
    loss[0] + samples.iter().zip(lambda).map(|(s, l)| l * s.normal.length()).sum::<f64>()
}

/// Lengths of the active vectors, 0 elsewhere; the reduction smooths them.
pub fn lengths(v: &[DVec3], active: &[bool]) -> Vec<f64> {
    v.iter().zip(active).map(|(v, a)| if *a { v.length() } else { 0.0 }).collect()
}

/// The surface of every column, from the voxels within a depth of two lateral voxels around the longest vector, because
/// a slanted surface fills several voxels, each with less. Albedo is the 3/2 norm of their lengths. Depth is that of
/// the farthest vector longer than half of the longest. The normal is the direction of the longest.
pub fn extract_vectors(twin: &Twin, v: &[DVec3], active: &[bool]) -> Vec<Option<Column>> {
    columns(twin, &lengths(v, active), |c| surface_around(twin, v, active, c, |_| true))
}

/// The second surface of every column: that around the longest vector which is more than two lateral voxels from the
/// longest of all, with a vector shorter than half of it in between. Voxels so near to the longest of all are not part of
/// it.
pub fn extract_behind(twin: &Twin, v: &[DVec3], active: &[bool]) -> Vec<Option<Column>> {
    let (grid, reach, lengths) = (twin.grid, reach(twin), lengths(v, active));
    let mut rest = vec![0.0; lengths.len()];
    let mut firsts = vec![];
    for at in (0..grid.n[0]).flat_map(|x| (0..grid.n[1]).map(move |y| [x, y])) {
        let of = |z: usize| lengths[grid.index([at[0], at[1], z])];
        let first = brightest(twin, &lengths, at);
        firsts.push(first);
        for (z, first) in (0..grid.n[2]).filter_map(|z| Some((z, first?))) {
            let between = if z < first { z + 1..=first } else { first..=z.saturating_sub(1) };
            let least = between.map(of).fold(f64::INFINITY, f64::min);
            if z.abs_diff(first) > reach && least < 0.5 * of(z) {
                rest[grid.index([at[0], at[1], z])] = of(z);
            }
        }
    }
    columns(twin, &rest, |c| {
        let first = firsts[c[0] * grid.n[1] + c[1]].unwrap_or(0);
        surface_around(twin, v, active, c, |z| z.abs_diff(first) > reach && (z > first) == (c[2] > first))
    })
}

/// Voxels along z to each side that a surface may fill: two lateral voxels.
fn reach(twin: &Twin) -> usize {
    (2.0 * twin.grid.pitch.x.max(twin.grid.pitch.y) / twin.grid.pitch.z).ceil() as usize
}

/// Albedo, z index and direction of the surface around a voxel, from those voxels of its column that are `part` of it.
fn surface_around(
    twin: &Twin,
    v: &[DVec3],
    active: &[bool],
    [x, y, z]: [usize; 3],
    part: impl Fn(usize) -> bool,
) -> (f64, usize, DVec3) {
    let (grid, reach) = (twin.grid, reach(twin));
    let at = |z: &usize| v[grid.index([x, y, *z])];
    let around = z.saturating_sub(reach).max(twin.model.near_z(grid))..=(z + reach).min(grid.n[2] - 1);
    let around: Vec<usize> = around.filter(|z| active[grid.index([x, y, *z])] && part(*z)).collect();
    let norm = around.iter().map(|z| at(z).length().powf(1.5)).sum::<f64>().powf(1.0 / 1.5);
    let far = around.iter().rev().find(|far| at(far).length() > 0.5 * at(&z).length());
    (norm, *far.unwrap_or(&z), at(&z))
}
