//! Buffers written and read by name, as their kernels see them.

use glam::dvec3;
use thirdbounce::gpu::{Command, Schedule};
use thirdbounce::solve::{OnDevice, upload};
use thirdbounce::transport::Grid;
use thirdbounce::transport::kernels::PADDING;
use thirdbounce::transport::twin::{self, Raw, Sample, Twin};

pub fn write<T: bytemuck::NoUninit>(job: &mut OnDevice<'_>, buffer: &'static str, values: &[T]) {
    upload(&mut job.executor, buffer, bytemuck::cast_slice(values)).expect("an upload runs");
}

pub fn read<T: bytemuck::Pod>(job: &mut OnDevice<'_>, buffer: &'static str, count: usize) -> Vec<T> {
    let bytes = count * size_of::<T>();
    if bytes == 0 {
        return vec![];
    }
    let mut s = Schedule::default();
    s.commands.push(Command::Copy {
        from: buffer,
        from_offset: 0,
        to: "back",
        to_offset: 0,
        bytes: bytes as u64,
    });
    job.executor.run(&s).expect("a copy runs");
    bytemuck::pod_collect_to_vec(&job.executor.arena.mapped(Buffer::named("back"))[..bytes])
}

/// Cells of histograms or residuals that are bins, `[pair * bins + bin]`.
pub fn read_rows<T: bytemuck::Pod>(job: &mut OnDevice<'_>, buffer: &'static str) -> Vec<T> {
    let cells: Vec<T> = read(job, buffer, job.model.cells());
    job.model.bins_of(&cells)
}

/// The rest of them: what no bin may ever be told of.
pub fn read_padding(job: &mut OnDevice<'_>, buffer: &'static str) -> Vec<u32> {
    let (cells, stride) = (job.model.cells(), job.model.stride());
    let words = job.plan.bytes()[buffer] as usize / 4 / cells;
    let all: Vec<u32> = read(job, buffer, cells * words);
    all.chunks(words)
        .enumerate()
        .filter(|(i, _)| i % stride < PADDING as usize)
        .flat_map(|(_, c)| c)
        .copied()
        .collect()
}

/// Writes histograms or residuals, and the same to every cell that is no bin.
pub fn write_rows<T: bytemuck::NoUninit>(
    job: &mut OnDevice<'_>,
    buffer: &'static str,
    bins: &[T],
    padding: T,
) {
    let none = [padding; PADDING as usize];
    let rows = bins.chunks(job.model.bins).flat_map(|row| none.iter().chain(row));
    let cells: Vec<T> = rows.chain(&none).copied().collect();
    write(job, buffer, &cells);
}

/// No light in any bin, and all bits set in what is none.
pub fn zero_histograms(job: &mut OnDevice<'_>) {
    let bins = job.model.pairs() * job.model.bins;
    if job.plan.fixed_point() {
        write_rows(job, buffer::HISTOGRAMS, &vec![0u64; bins], u64::MAX);
    } else {
        write_rows(job, buffer::HISTOGRAMS, &vec![0u32; bins], u32::MAX);
    }
}

pub fn write_raw(job: &mut OnDevice<'_>, buffer: &'static str, raw: &[Raw]) {
    let values: Vec<[f32; 4]> = raw.iter().map(|r| r.map(|v| v as f32)).collect();
    write(job, buffer, &values);
}

pub fn read_raw(job: &mut OnDevice<'_>, buffer: &'static str, count: usize) -> Vec<Raw> {
    read::<[f32; 4]>(job, buffer, count).into_iter().map(|r| r.map(f64::from)).collect()
}

pub fn write_mask(job: &mut OnDevice<'_>, buffer: &'static str, on: &[bool]) {
    let words: Vec<u32> =
        on.chunks(32).map(|c| c.iter().enumerate().fold(0, |w, (i, b)| w | u32::from(*b) << i)).collect();
    write(job, buffer, &words);
}

pub fn read_mask(job: &mut OnDevice<'_>, buffer: &'static str, count: usize) -> Vec<bool> {
    let words: Vec<u32> = read(job, buffer, count / 32);
    (0..count).map(|i| words[i / 32] >> (i % 32) & 1 == 1).collect()
}

/// Writes a domain as the compaction would: mask, ranks (set bits before each word of it) and list, which it returns.
pub fn write_domain(job: &mut OnDevice<'_>, on: &[bool]) -> Vec<u32> {
    write_mask(job, buffer::MASK, on);
    let ranks = ranks_of(on);
    write(job, buffer::RANKS, &ranks);
    let active = twin::compact(on);
    write(job, buffer::ACTIVE_VOXELS, &active);
    active
}

/// Writes the rim behind such a domain, too, and both counts; what is touched is returned, in the order of its state.
pub fn write_touched(job: &mut OnDevice<'_>, grid: &Grid, on: &[bool]) -> Vec<u32> {
    let active = write_domain(job, on);
    if !job.plan.has_rim {
        set_counts(job, active.len(), 1.0);
        return active;
    }
    let rim = twin::rim(grid, on);
    write_mask(job, buffer::RIM_MASK, &rim);
    let ranks: Vec<u32> = ranks_of(&rim).iter().map(|r| r + active.len() as u32).collect();
    write(job, buffer::RIM_RANKS, &ranks);
    let touched = twin::touched(grid, on);
    write(job, buffer::ACTIVE_VOXELS, &touched);
    set_both_counts(job, [active.len(), touched.len()], 1.0);
    touched
}

/// Writes the state of the touched voxels, from all by storage index.
pub fn write_state(job: &mut OnDevice<'_>, buffer: &'static str, touched: &[u32], state: &[Raw]) {
    write_raw(job, buffer, &touched.iter().map(|i| state[*i as usize]).collect::<Vec<_>>());
}

/// State by storage index, nothing where no voxel is touched.
pub fn read_state(job: &mut OnDevice<'_>, buffer: &'static str, touched: &[u32], count: usize) -> Vec<Raw> {
    let by_slot = read_raw(job, buffer, touched.len());
    let mut all = vec![[0.0; 4]; count];
    touched.iter().zip(by_slot).for_each(|(i, value)| all[*i as usize] = value);
    all
}

pub fn ranks_of(on: &[bool]) -> Vec<u32> {
    let count = |c: &[bool]| c.iter().filter(|b| **b).count() as u32;
    let before = |sum: &mut u32, c| Some(std::mem::replace(sum, *sum + count(c)));
    on.chunks(32).scan(0, before).collect()
}

/// Writes samples as `sample.comp` would.
pub fn write_samples(job: &mut OnDevice<'_>, samples: &[Sample]) {
    let f = |v: f64| v as f32;
    let points: Vec<[f32; 4]> =
        samples.iter().map(|s| [f(s.point.x), f(s.point.y), f(s.point.z), f(s.albedo)]).collect();
    let normals: Vec<[f32; 4]> =
        samples.iter().map(|s| [f(s.normal.x), f(s.normal.y), f(s.normal.z), f(s.length)]).collect();
    write(job, buffer::SAMPLE_POINTS, &points);
    // Left out where surfaces have no direction.
    if job.plan.reflectance.has_normals() {
        write(job, buffer::SAMPLE_NORMALS, &normals);
    }
}

pub fn read_samples(job: &mut OnDevice<'_>, count: usize) -> Vec<Sample> {
    let points = read_raw(job, buffer::SAMPLE_POINTS, count);
    let normals = read_raw(job, buffer::SAMPLE_NORMALS, count);
    let sample = |(p, n): (&Raw, &Raw)| Sample {
        point: dvec3(p[0], p[1], p[2]),
        albedo: p[3],
        normal: dvec3(n[0], n[1], n[2]),
        length: n[3],
    };
    points.iter().zip(&normals).map(sample).collect()
}

/// Samples as the device will see them: rounded to fp32.
pub fn rounded(samples: &[Sample]) -> Vec<Sample> {
    let f = |v: f64| f64::from(v as f32);
    samples
        .iter()
        .map(|s| Sample {
            point: s.point.map(f),
            albedo: f(s.albedo),
            normal: s.normal.map(f),
            length: f(s.length),
        })
        .collect()
}

/// Samples none of whose paths comes near the edge of a bin, where fp32 and float64 may choose different ones.
pub fn away_from_edges(twin: &Twin, samples: &[Sample]) -> Vec<Sample> {
    let m = twin.model;
    let clear = |s: &&Sample| {
        (0..m.pairs()).all(|pair| {
            let position = (m.wall.path(pair, s.point) - m.t_start) / m.bin_width;
            (position - position.round()).abs() > 1e-4
        })
    };
    rounded(samples).iter().filter(clear).copied().collect()
}

/// Sets the count of active voxels (and of touched ones) and the dispatch arguments that follow from it.
pub fn set_counts(job: &mut OnDevice<'_>, active: usize, peak_albedo: f64) {
    set_both_counts(job, [active; 2], peak_albedo);
}

fn set_both_counts(job: &mut OnDevice<'_>, [active, touched]: [usize; 2], peak_albedo: f64) {
    write(job, buffer::COUNTS, &[active as u32, touched as u32, (peak_albedo as f32).to_bits(), 0, 0, 0]);
    let mut s = Schedule::default();
    let scene = job.plan.finest().scene;
    s.dispatch(&passes::ARGUMENTS, [1, 1, 1]).bind(buffer::SCENE, scene);
    job.executor.run(&s).expect("a dispatch runs");
}
