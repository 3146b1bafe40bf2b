//! The active domain on the device against brute force: first volume, smoothing, threshold, lists, doubling,
//! maps.

use std::sync::Arc;

use fixtures::device::*;
use thirdbounce::gpu::{Buffer, Schedule};
use thirdbounce::solve::paper::{compact, double, extract, initialise, reduce};
use thirdbounce::solve::{Accumulation, COLUMNS_HOST, OnDevice, paper};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Raw, Twin};
use thirdbounce::transport::{Grid, Model};

/// Everything that compaction writes, against brute force over `domain`.
fn assert_lists(job: &mut OnDevice, grid: &Grid, domain: &[bool], continuous: bool) {
    let active = twin::compact(domain);
    let touched = if continuous { twin::touched(grid, domain) } else { active.clone() };
    let counts: Vec<u32> = read(job, buffer::COUNTS, COUNTS as usize);
    assert_eq!(counts[COUNT_ACTIVE as usize] as usize, active.len());
    assert_eq!(counts[COUNT_TOUCHED as usize] as usize, touched.len());
    assert_eq!(read::<u32>(job, buffer::ACTIVE_VOXELS, touched.len()), touched);
    assert_eq!(read::<u32>(job, buffer::RANKS, grid.storage() / 32), ranks_of(domain));
    if continuous {
        let rim = twin::rim(grid, domain);
        assert_eq!(read_mask(job, buffer::RIM_MASK, grid.storage()), rim);
        let behind: Vec<u32> = ranks_of(&rim).iter().map(|r| r + active.len() as u32).collect();
        assert_eq!(read::<u32>(job, buffer::RIM_RANKS, grid.storage() / 32), behind);
    }

    let sets = job.plan.forward_sets(job.plan.finest());
    let arguments: Vec<[u32; 3]> = read(job, buffer::ARGUMENTS, (ARGUMENTS_FORWARD + sets) as usize);
    let groups = |n: usize, size: u32| {
        let g = n.div_ceil(size as usize) as u32;
        [g.min(GROUPS_X), g.div_ceil(GROUPS_X), 1]
    };
    let t = job.plan.division.tuning;
    assert_eq!(arguments[ARGUMENTS_SAMPLE as usize], groups(active.len(), WORKGROUP));
    assert_eq!(
        arguments[ARGUMENTS_BACKWARD as usize],
        groups(active.len(), t.samples_of_group(active.len()))
    );
    assert_eq!(arguments[ARGUMENTS_UPDATE as usize], groups(touched.len(), WORKGROUP));
    let tiles = job.plan.scene.pairs.div_ceil(t.lanes as usize) as u32;
    for set in 0..sets as usize {
        let want = if job.plan.division.accumulation == Accumulation::Owned {
            if set * (t.chunk as usize) < active.len() { [tiles, 1, 1] } else { [0, 0, 1] }
        } else {
            let chunks = active.len().div_ceil(t.chunk as usize) as u32;
            [if chunks == 0 { 0 } else { tiles }, chunks, 1]
        };
        assert_eq!(arguments[ARGUMENTS_FORWARD as usize + set], want);
    }
}

#[test]
pub fn compaction_lists_every_active_voxel_in_brick_order() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let grid = grid();
    for accumulation in [Accumulation::Owned, Accumulation::Cas] {
        let mut o = options(&model, &grid);
        o.accumulation = accumulation;
        for share in [0.0, 0.002, 0.1, 0.7, 1.0] {
            let (_, domain) = state(&model, &grid, share, 2);
            let mut job = job(&gpu, &model, &grid, &o);
            write_domain(&mut job, &domain);
            let schedule = Schedule::of(|s| compact(s, &job.plan, job.plan.finest()));
            job.perform(&schedule);
            assert_lists(&mut job, &grid, &domain, true);
        }
    }
    assert_valid(&gpu);
}

#[test]
fn compaction_with_fixed_sampling_touches_what_is_active() {
    let gpu = gpu();
    let mut model = model(3, 40, 1);
    model.sampling = thirdbounce::transport::Sampling::Fixed;
    let grid = grid();
    let (_, domain) = state(&model, &grid, 0.3, 3);
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    write_domain(&mut job, &domain);
    let schedule = Schedule::of(|s| compact(s, &job.plan, job.plan.finest()));
    job.perform(&schedule);
    assert_lists(&mut job, &grid, &domain, false);
    assert_valid(&gpu);
}

/// A state's buffers, in the order that tests use.
const STATE: [Buffer; 3] = [buffer::RAW, buffer::MOMENT_FIRST, buffer::MOMENT_SECOND];

/// Writes a domain and the state of the voxels that it touches, by storage index. Returns the touched voxels.
fn hold(job: &mut OnDevice, grid: &Grid, domain: &[bool], state: &[Vec<Raw>; 3]) -> Vec<u32> {
    let touched = write_touched(job, grid, domain);
    for (buffer, state) in STATE.into_iter().zip(state) {
        write_state(job, buffer, &touched, state);
    }
    touched
}

/// Moments that differ from voxel to voxel.
fn moments(raw: &[Raw], by: f64) -> Vec<Raw> {
    raw.iter().map(|r| r.map(|v| f64::from((by * v) as f32))).collect()
}

#[test]
pub fn initialise_is_uniform_and_keeps_the_near_space_out() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    let schedule = Schedule::of(|s| initialise(s, &job.plan, job.plan.finest()));
    job.perform(&schedule);
    let (raw, domain) = (twin::initialise_raw(&twin, 1.0), twin::initialise(&twin));
    assert!(model.near_z(&grid) > 0, "the scene has a near space to keep out");
    let touched = twin::touched(&grid, &domain);
    let got = read_state(&mut job, buffer::RAW, &touched, grid.storage());
    assert_eq!(got, twin::carry(&touched, &raw));
    assert_lists(&mut job, &grid, &domain, true);
    let mean = raw.iter().map(|r| r[0]).sum::<f64>() / raw.len() as f64;
    assert!((mean - 0.5).abs() < 4.0 / (12.0 * raw.len() as f64).sqrt(), "{mean}");
    for buffer in [buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
        assert!(read_raw(&mut job, buffer, touched.len()).concat().iter().all(|v| *v == 0.0));
    }
    let sums: Vec<f32> = read(&mut job, buffer::HISTOGRAMS, model.cells());
    assert!(sums.iter().all(|v| *v == 0.0));
    assert_valid(&gpu);
}

#[test]
pub fn reduction_smooths_and_keeps_what_is_above_the_threshold() {
    let gpu = gpu();
    let mut model = model(3, 40, 1);
    let grid = grid();
    // A noise term smooths what ELU leaves of a dark edge.
    for (keep, noise, dark) in [(0.05, [0.0; 2], 0.0), (0.4, [0.0; 2], 0.0), (0.4, [0.05, 0.06], 2.0)] {
        (model.keep_above, model.noise) = (keep, noise);
        let twin = Twin { model: &model, grid: &grid };
        let (mut raw, mut domain) = state(&model, &grid, 0.8, 4);
        // One bright blob in dim surroundings. Its edge is too near to be active, and it outgrows its domain.
        for (i, r) in raw.iter_mut().enumerate() {
            let c = grid.voxel(i).map(|v| v as f64);
            let d2 = (c[0] - 4.0).powi(2) + (c[1] - 7.0).powi(2) + (c[2] - 2.0).powi(2);
            r[0] = f64::from((5.0 * (-0.2 * d2).exp() + 0.01 * r[0] - dark) as f32);
            domain[i] &= d2 < 6.0;
        }
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
        let state = [raw.clone(), moments(&raw, 2.0), moments(&raw, 3.0)];
        let touched = hold(&mut job, &grid, &domain, &state);
        let mut schedule = Schedule::of(|s| reduce(s, &job.plan, job.plan.finest(), job.model.keep_above));
        let split = schedule.commands.iter().position(|c| c.name() == "threshold").unwrap();
        let after = Schedule { commands: schedule.commands.split_off(split) };
        job.perform(&schedule);
        let smooth = twin::gaussian(&twin, &raw, &domain, &job.plan.domain.taps);
        let got: Vec<f32> = read(&mut job, buffer::GRADIENT, grid.storage());
        assert!(error(got.iter().map(|v| f64::from(*v)), smooth.iter().copied()) < 2e-6);
        job.perform(&after);
        let kept = twin::threshold(&twin, &smooth);
        let share = kept.iter().filter(|k| **k).count() as f64 / grid.voxels() as f64;
        assert!(share > 0.005 && share < 0.9, "the test prunes something and keeps something: {share}");
        assert_lists(&mut job, &grid, &kept, true);
        // Voxels that stay touched keep their state to the bit; those that were not touched before have none.
        let now = twin::touched(&grid, &kept);
        assert!(now.iter().any(|i| !touched.contains(i)) && now.iter().any(|i| touched.contains(i)));
        for (buffer, state) in STATE.into_iter().zip(&state) {
            let want = twin::carry(&now, &twin::carry(&touched, state));
            assert_eq!(read_state(&mut job, buffer, &now, grid.storage()), want, "{buffer}");
        }
    }
    assert_valid(&gpu);
}

/// No raw albedo is above zero, but its noise is: nothing to take a share of.
#[test]
fn a_volume_without_light_keeps_its_domain_if_there_is_room_for_it() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let (_, domain) = state(&model, &grid, 0.3, 4);
    let count = domain.iter().filter(|a| **a).count();
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    let dark =
        |i: usize| [if i.is_multiple_of(9) { 0.5 } else { -0.5 - (i % 7) as f64 / 8.0 }, 0.25, 0.0, -0.5];
    let raw: Vec<_> = (0..grid.storage()).map(dark).collect();
    let state = [raw.clone(), moments(&raw, 2.0), moments(&raw, 3.0)];
    let smooth = twin::gaussian(&twin, &raw, &domain, &job.plan.domain.taps);
    assert!(smooth.iter().all(|v| *v <= 0.0), "no smoothed value is above zero");
    for room in [count, count - 1] {
        let touched = hold(&mut job, &grid, &domain, &state);
        let capacity = std::mem::replace(&mut Arc::make_mut(&mut job.plan).domain.capacity, room);
        let schedule = Schedule::of(|s| reduce(s, &job.plan, job.plan.finest(), job.model.keep_above));
        Arc::make_mut(&mut job.plan).domain.capacity = capacity;
        job.perform(&schedule);
        let kept = twin::threshold_raw(&twin, &smooth, &domain, room);
        assert_eq!(kept.iter().filter(|k| **k).count(), if room < count { 0 } else { count });
        assert_lists(&mut job, &grid, &kept, true);
        let now = twin::touched(&grid, &kept);
        for (buffer, state) in STATE.into_iter().zip(&state) {
            let want = twin::carry(&now, &twin::carry(&touched, state));
            assert_eq!(read_state(&mut job, buffer, &now, grid.storage()), want, "{buffer}");
        }
    }
    assert_valid(&gpu);
}

/// A domain that exceeds the room keeps its brightest voxels, and the list never exceeds the room.
#[test]
pub fn a_domain_beyond_its_room_keeps_the_brightest() {
    let gpu = gpu();
    let (model, grid) = (model(3, 40, 22), grid());
    let twin = Twin { model: &model, grid: &grid };
    let (mut raw, domain) = state(&model, &grid, 0.5, 23);
    raw.iter_mut().for_each(|r| r[0] = r[0].abs());
    let o = options(&model, &grid);
    let mut job = job(&gpu, &model, &grid, &o);
    let smooth = twin::gaussian(&twin, &raw, &domain, &job.plan.domain.taps);
    let all = twin::threshold(&twin, &smooth);
    let count = |mask: &[bool]| mask.iter().filter(|m| **m).count();
    let peak = smooth.iter().fold(0.0f64, |a, b| a.max(*b));
    let state = [raw.clone(), moments(&raw, 2.0), moments(&raw, 3.0)];
    for room in [count(&all) + 1, count(&all) / 2, 40, 1] {
        // The voxels that are active already must fit.
        Arc::make_mut(&mut job.plan).domain.capacity = count(&domain).max(room);
        job.upload().unwrap();
        hold(&mut job, &grid, &domain, &state);
        Arc::make_mut(&mut job.plan).domain.capacity = room;
        let mut before = Schedule::of(|s| reduce(s, &job.plan, job.plan.finest(), model.keep_above));
        let split = before.commands.iter().position(|c| c.name() == "threshold").unwrap() + 1;
        let after = Schedule { commands: before.commands.split_off(split) };
        job.perform(&before);
        job.upload().unwrap();
        job.perform(&after);
        let levels = twin::levels(&twin, &smooth);
        let bright = twin::threshold(
            &Twin { model: &Model { keep_above: 0.0, ..model.clone() }, grid: &grid },
            &smooth,
        );
        assert_eq!(levels.iter().sum::<u32>() as usize, count(&bright));
        let got: Vec<u32> = read(&mut job, buffer::LEVELS, LEVELS as usize);
        // A value may round into the next level.
        let moved: u32 = got.iter().zip(&levels).map(|(a, b)| a.abs_diff(*b)).sum();
        assert!(moved <= 4, "{moved} of {}", levels.iter().sum::<u32>());
        let least = twin::room(&got, peak, model.keep_above, room);
        let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        let reported = counts[COUNT_LEAST_SMOOTH as usize];
        assert_eq!(f64::from(f32::from_bits(reported)), least, "room for {room}");
        assert_eq!(least > 0.0, room < count(&all));
        // The next iteration reports it.
        let mut finish = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 3, 1));
        finish.commands.retain(|c| c.name() == "finish");
        job.perform(&finish);
        let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..);
        assert_eq!(rows[3][TRACE_LEAST as usize], reported);
        let kept: Vec<bool> = all.iter().zip(&smooth).map(|(a, s)| *a && *s >= least).collect();
        let differ = read_mask(&mut job, buffer::MASK, grid.storage());
        let differ = differ.iter().zip(&kept).filter(|(a, b)| a != b).count();
        assert!(differ <= 1, "{differ}");
        let active = counts[COUNT_ACTIVE as usize] as usize;
        assert!(active <= room && (active > room / 2 || count(&kept) < room), "{active} of {room}");
        let listed: Vec<u32> = read(&mut job, buffer::ACTIVE_VOXELS, active);
        assert!(listed.iter().all(|i| kept[*i as usize] || differ > 0));
    }
    assert_valid(&gpu);
}

#[test]
fn taps_are_a_truncated_gaussian_that_sums_to_one() {
    let taps = twin::taps(3.0, 4.0);
    assert_eq!(taps.len(), 13, "cut off at 4 sigma");
    assert!((taps[0] + 2.0 * taps[1..].iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!((taps[3] / taps[0] - (-0.5f64).exp()).abs() < 1e-12);
}

#[test]
pub fn doubling_interpolates_the_volume_and_splits_every_voxel() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let fine = grid();
    let coarse = fine.coarser(2);
    let mut o = options(&model, &fine);
    o.domain.coarse_to_fine = true;
    let mut job = job(&gpu, &model, &fine, &o);
    assert_eq!(job.plan.levels.volume.len(), 2);
    assert_eq!(job.plan.levels.volume[0].grid, coarse);
    let (raw, domain) = state(&model, &coarse, 0.3, 5);
    // Slots of the coarse level.
    let coarse_touched = write_touched(&mut job, &coarse, &domain);
    write_state(&mut job, buffer::RAW, &coarse_touched, &raw);
    let schedule =
        Schedule::of(|s| double(s, &job.plan, &job.plan.levels.volume[0], &job.plan.levels.volume[1]));
    job.perform(&schedule);
    let split = twin::double_domain(&coarse, &fine, &domain);
    assert_eq!(split.iter().filter(|a| **a).count(), 4 * domain.iter().filter(|a| **a).count());
    assert_eq!(read_mask(&mut job, buffer::MASK, fine.storage()), split);
    assert_lists(&mut job, &fine, &split, true);
    let touched = twin::touched(&fine, &split);
    let kept = twin::carry(&coarse_touched, &raw);
    let want = twin::carry(&touched, &twin::carry_doubled(&coarse, &fine, &kept));
    let got = read_state(&mut job, buffer::RAW, &touched, fine.storage());
    assert!(error(got.concat(), want.concat()) < 1e-6);
    // Active voxels are interpolated from touched voxels only.
    let whole = twin::carry_doubled(&coarse, &fine, &raw);
    let active = twin::compact(&split);
    assert!(error(twin::carry(&active, &got).concat(), twin::carry(&active, &whole).concat()) < 1e-6);
    for buffer in [buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
        assert!(read_raw(&mut job, buffer, touched.len()).concat().iter().all(|v| *v == 0.0));
    }
    assert_valid(&gpu);
}

#[test]
fn doubling_keeps_a_linear_volume_linear_inside() {
    let fine = grid();
    let coarse = fine.coarser(2);
    let at = |g: &Grid, i: usize| g.position(glam::DVec3::from_array(g.voxel(i).map(|c| c as f64)));
    let linear = |p: glam::DVec3| [p.x + 2.0 * p.y, p.y, p.z, 3.0 * p.x];
    let raw: Vec<Raw> = (0..coarse.storage()).map(|i| linear(at(&coarse, i))).collect();
    let doubled = twin::carry_doubled(&coarse, &fine, &raw);
    for (i, value) in doubled.iter().enumerate() {
        let c = fine.voxel(i);
        if fine.contains(c) && (1..fine.n[0] - 1).contains(&c[0]) && (1..fine.n[1] - 1).contains(&c[1]) {
            let want = linear(at(&fine, i));
            assert!((0..4).all(|k| (value[k] - want[k]).abs() < 1e-12));
        }
    }
}

#[test]
pub fn extract_finds_the_brightest_voxel_of_every_column() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let (raw, domain) = state(&model, &grid, 0.08, 6);
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    let touched = write_touched(&mut job, &grid, &domain);
    write_state(&mut job, buffer::RAW, &touched, &raw);
    let schedule = Schedule::of(|s| extract(s, job.plan.finest()));
    job.perform(&schedule);
    let got: Vec<[f32; 8]> = job.executor.read(COLUMNS_HOST, ..);
    let want = twin::extract(&twin, &raw, &domain);
    let (mut found, mut empty) = (0, 0);
    for (g, w) in got.iter().zip(&want) {
        let Some(w) = w else {
            assert_eq!(*g, [0.0; 8]);
            empty += 1;
            continue;
        };
        found += 1;
        let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 2e-5, "{g:?} {w:?}");
        close(g[0], w.albedo);
        close(g[1], w.depth);
        (0..3).for_each(|k| close(g[4 + k], w.normal[k]));
    }
    assert!(found > 50 && empty > 10, "both kinds of column are tried: {found} {empty}");
    assert_valid(&gpu);
}

#[test]
fn fills_and_copies_of_a_schedule_run_in_order() {
    let gpu = gpu();
    let model = model(3, 40, 1);
    let grid = grid();
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    let mut s = Schedule::default();
    s.fill(buffer::GRADIENT, 64, 1);
    s.copy(buffer::GRADIENT, buffer::SAMPLE_POINTS, 64);
    s.fill(buffer::GRADIENT, 32, 2);
    s.copy(buffer::GRADIENT, buffer::SAMPLE_NORMALS, 64);
    job.perform(&s);
    assert_eq!(read::<u32>(&mut job, buffer::SAMPLE_POINTS, 16), [1; 16]);
    let want: Vec<u32> = [[2; 8], [1; 8]].concat();
    assert_eq!(read::<u32>(&mut job, buffer::SAMPLE_NORMALS, 16), want);
    assert_valid(&gpu);
}
