//! The vector solver's domain on the device against the float64 twins: reduction, doubling, the start, maps, room.

use std::sync::Arc;

use fixtures::device::surfaces::surface_options;
use fixtures::device::vectors::*;
use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{COLUMNS_HOST, OnDevice, Plan, SMOOTH, extract, surface, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bound, Momentum, Twin};
use thirdbounce::transport::{Grid, Model, Volume};

/// Checks the state after the domain has changed to `mask`: zero outside, momentum at rest, lists, points.
fn check_settled(job: &mut OnDevice, twin: &Twin, mask: &[bool], v: &[DVec3], momentum: Momentum) {
    let count = twin.grid.storage();
    let (mut want, mut before) = (v.to_vec(), vec![DVec3::NAN; count]);
    let mut rest = momentum;
    twin::settle(mask, &mut want, &mut before, &mut rest);
    let active = twin::compact(mask);
    let raw = read_vectors(job, buffer::RAW, &active, count);
    assert!(error(flat(&raw), flat(&want)) < 1e-6);
    assert_eq!(read_vectors(job, buffer::BEFORE, &active, count), raw);
    assert_eq!(read_momentum(job), rest);
    assert_eq!(read::<u32>(job, buffer::ACTIVE_VOXELS, active.len()), active);
    let points = read_raw(job, buffer::SAMPLE_POINTS, active.len());
    for (got, want) in points.iter().zip(twin::points(twin, &active)) {
        assert!((dvec3(got[0], got[1], got[2]) - want.point).length() < 1e-6 && got[3] == 1.0);
    }
}

#[test]
pub fn reduction_smooths_the_lengths_and_settles() {
    let gpu = gpu();
    let (mut model, grid) = (scene(3, 40, 22), grid());
    model.keep_above = 0.6;
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.4, 23).1;
    let v = within(vectors(grid.storage(), 24), &domain);
    let bounds: Vec<[f64; 2]> = v.iter().map(|v| [v.x, v.y]).collect();
    let o = vector_options(&grid).with(|o| o.domain.keep_above = 0.6);
    let mut job = job(&gpu, &model, &grid, &o);
    let active = write_domain(&mut job, &domain);
    write_vectors(&mut job, buffer::RAW, &active, &v);
    write_bounds(&mut job, &active, &bounds);
    set_counts(&mut job, active.len(), 0.0);
    let momentum = Momentum { t: 7.0, beta: 0.8, objective: 3.0, restarts: 2.0, share: 0.5 };
    write_momentum(&mut job, momentum);
    let mut level = 0;
    let s = Schedule::of(|s| vector::due(s, &job.plan, &o, &mut level, o.domain.reduce_every));
    job.perform(&s);
    let smooth = twin::smooth(&grid, twin::lengths(&v, &domain), &job.plan.domain.taps);
    assert!(error(read_floats(&mut job, SMOOTH, grid.storage()), smooth.iter().copied()) < 2e-6);
    let kept = twin::threshold(&twin, &smooth);
    let share = kept.iter().filter(|k| **k).count() as f64 / grid.voxels() as f64;
    assert!(share > 0.02 && share < 0.9, "{share}");
    assert_eq!(read_mask(&mut job, buffer::MASK, grid.storage()), kept);
    check_settled(&mut job, &twin, &kept, &v, momentum);
    // Bounds stay with their voxels; newly active voxels have none yet.
    let stayed = twin::compact(&kept);
    let got = read_bounds(&mut job, &stayed, grid.storage());
    let stays = |i: &u32| domain[*i as usize];
    assert!(stayed.iter().any(stays) && !stayed.iter().all(stays));
    assert!(stayed.iter().all(|i| got[*i as usize] == bounds[*i as usize]));
    assert!(
        Schedule::of(|s| vector::due(s, &job.plan, &o, &mut level, o.domain.reduce_every + 1))
            .commands
            .is_empty()
    );
    assert_valid(&gpu);
}

#[test]
fn a_volume_without_light_is_pruned_to_nothing() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 22), grid());
    let domain = state(&model, &grid, 0.5, 23).1;
    let o = vector_options(&grid);
    let mut job = job(&gpu, &model, &grid, &o);
    let active = write_domain(&mut job, &domain);
    write_vectors(&mut job, buffer::RAW, &active, &vec![DVec3::ZERO; grid.storage()]);
    set_counts(&mut job, active.len(), 0.0);
    write_momentum(&mut job, REST);
    job.perform(&Schedule::of(|s| vector::due(s, &job.plan, &o, &mut 0, o.domain.reduce_every)));
    assert_eq!(read_mask(&mut job, buffer::MASK, grid.storage()), vec![false; grid.storage()]);
    assert_valid(&gpu);
}

/// A domain that exceeds the room keeps its brightest voxels, and the list never exceeds the room.
#[test]
pub fn a_domain_beyond_its_room_keeps_the_brightest() {
    let gpu = gpu();
    let (mut model, grid) = (scene(3, 40, 22), grid());
    model.keep_above = 0.05;
    let domain = state(&model, &grid, 0.5, 23).1;
    let v = within(vectors(grid.storage(), 24), &domain);
    let o = vector_options(&grid).with(|o| o.domain.keep_above = 0.05);
    let mut job = job(&gpu, &model, &grid, &o);
    let smooth = twin::smooth(&grid, twin::lengths(&v, &domain), &job.plan.domain.taps);
    let twin = Twin { model: &model, grid: &grid };
    let all = twin::threshold(&twin, &smooth);
    let count = |mask: &[bool]| mask.iter().filter(|m| **m).count();
    let peak = smooth.iter().fold(0.0f64, |a, b| a.max(*b));
    for room in [count(&all) + 1, count(&all) / 2, 40, 1] {
        // The voxels that are active already must fit.
        Arc::make_mut(&mut job.plan).domain.capacity = count(&domain).max(room);
        job.upload().unwrap();
        let active = write_domain(&mut job, &domain);
        write_vectors(&mut job, buffer::RAW, &active, &v);
        set_counts(&mut job, active.len(), 0.0);
        write_momentum(&mut job, REST);
        Arc::make_mut(&mut job.plan).domain.capacity = room;
        let s = Schedule::of(|s| vector::due(s, &job.plan, &o, &mut 0, o.domain.reduce_every));
        let split = s.commands.iter().position(|c| c.name() == "threshold").unwrap() + 1;
        let [before, after] =
            [&s.commands[..split], &s.commands[split..]].map(|c| Schedule { commands: c.to_vec() });
        job.perform(&before);
        job.upload().unwrap();
        job.perform(&after);
        let levels = twin::levels(&twin, &smooth);
        assert_eq!(
            levels.iter().sum::<u32>() as usize,
            smooth
                .iter()
                .enumerate()
                .filter(|(i, s)| {
                    let c = grid.voxel(*i);
                    grid.contains(c) && c[2] >= model.near_z(&grid) && **s > 0.0
                })
                .count()
        );
        let got: Vec<u32> = read(&mut job, buffer::LEVELS, LEVELS as usize);
        // A value may round into the next level.
        let moved: u32 = got.iter().zip(&levels).map(|(a, b)| a.abs_diff(*b)).sum();
        assert!(moved <= 4, "{moved} of {}", levels.iter().sum::<u32>());
        let least = twin::room(&got, peak, 0.05, room);
        let told: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        let told_least = f64::from(f32::from_bits(told[COUNT_LEAST_SMOOTH as usize]));
        assert_eq!(told_least, least, "room for {room}");
        assert_eq!(least > 0.0, room < count(&all));
        // The next iteration reports it.
        run_iteration(&mut job, 3, &["finish"]);
        let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..);
        assert_eq!(rows[3][TRACE_LEAST as usize], told[COUNT_LEAST_SMOOTH as usize]);
        let kept: Vec<bool> = all.iter().zip(&smooth).map(|(a, s)| *a && *s >= least).collect();
        let differ = read_mask(&mut job, buffer::MASK, grid.storage());
        let differ = differ.iter().zip(&kept).filter(|(a, b)| a != b).count();
        assert!(differ <= 1, "{differ}");
        let active = told[COUNT_ACTIVE as usize] as usize;
        assert!(active <= room && (active > room / 2 || count(&kept) < room), "{active} of {room}");
        let listed: Vec<u32> = read(&mut job, buffer::ACTIVE_VOXELS, active);
        assert!(listed.iter().all(|i| kept[*i as usize] || differ > 0));
    }
    assert_valid(&gpu);
}

/// Writes the vectors of a domain as an iteration leaves them, without light and with the momentum at rest. Returns the
/// active voxels.
fn hold(job: &mut OnDevice, domain: &[bool], v: &[DVec3]) -> Vec<u32> {
    let active = write_domain(job, domain);
    write_vectors(job, buffer::RAW, &active, v);
    set_counts(job, active.len(), 0.0);
    zero_histograms(job);
    write_momentum(job, REST);
    active
}

/// D and lambda of the solver for a domain with the expected brightness `expected`, by storage index.
fn bounds_of(twin: &Twin, mask: &[bool], expected: &[f64]) -> Vec<[f64; 2]> {
    let active = twin::compact(mask);
    let mut points = twin::points(twin, &active);
    active.iter().zip(&mut points).for_each(|(i, p)| p.albedo = expected[*i as usize]);
    let rendered = twin::forward_bound(twin, &points);
    let (residual, _) = twin::residual_weighted(twin, &rendered, false);
    let d = twin::bound(twin, &points, &residual, Bound::Step);
    let lambda = twin::bound(twin, &points, &twin::variance(twin), Bound::Noise);
    let mut all = vec![[0.0; 2]; mask.len()];
    active.iter().zip(d.iter().zip(&lambda)).for_each(|(i, (d, l))| all[*i as usize] = [*d, *l]);
    all
}

fn check_bounds_of(job: &mut OnDevice, twin: &Twin, mask: &[bool], expected: &[f64]) {
    let got = read_bounds(job, &twin::compact(mask), mask.len());
    let want = bounds_of(twin, mask, expected);
    for k in 0..2 {
        let e = error(got.iter().map(|b| b[k]), want.iter().map(|b| b[k]));
        assert!(e < 3e-5, "{k}: {e}");
    }
}

/// Weights of the bounds after a reduction that left this smoothed albedo.
fn expected(smooth: &[f64], power: f64) -> Vec<f64> {
    let most = smooth.iter().copied().fold(0.0, f64::max);
    twin::expect(&smooth.iter().map(|s| s / most).collect::<Vec<_>>(), power)
}

/// An iteration starts with samples of unit weight, whatever weights the bounds used.
fn check_points(job: &mut OnDevice, twin: &Twin, mask: &[bool]) {
    let want = twin::points(twin, &twin::compact(mask));
    let got: Vec<[f32; 4]> = read(job, buffer::SAMPLE_POINTS, want.len());
    for (g, w) in got.iter().zip(&want) {
        assert!(
            (w.point - dvec3(g[0].into(), g[1].into(), g[2].into())).length() < 1e-6 && g[3] == 1.0,
            "{g:?}"
        );
    }
}

/// Bounds that are renewed with a reduction use its smoothed albedo as weights; with a power of zero all weights are
/// one.
#[test]
pub fn bounds_weigh_voxels_by_how_bright_they_are() {
    let gpu = gpu();
    let (model, grid) = (scene(4, 40, 31), grid());
    let mut first = None;
    for power in [0.0, 0.5, 1.5] {
        let o = vector_options(&grid).with(|o| {
            o.domain.keep_above = 0.3;
            o.bound_power = Some(power);
        });
        let mut job = job(&gpu, &model, &grid, &o);
        let domain = state(&model, &grid, 0.6, 32).1;
        let v = within(vectors(grid.storage(), 33), &domain);
        let active = hold(&mut job, &domain, &v);
        let s =
            Schedule::of(|s| vector::due(s, &job.plan, &o, &mut 0, o.bound_every * o.domain.reduce_every));
        job.perform(&s);
        let smooth = twin::smooth(&grid, twin::lengths(&v, &domain), &job.plan.domain.taps);
        let mask = read_mask(&mut job, buffer::MASK, grid.storage());
        let twin = Twin { model: &model, grid: &grid };
        check_bounds_of(&mut job, &twin, &mask, &expected(&smooth, power));
        check_points(&mut job, &twin, &mask);
        let bounds = read_bounds(&mut job, &twin::compact(&mask), grid.storage());
        let first = first.get_or_insert_with(|| bounds.clone());
        let apart = bounds.iter().zip(&*first).filter(|(b, f)| (b[0] / f[0] - 1.0).abs() > 0.05).count();
        assert_eq!(apart > active.len() / 4, power > 0.0, "{power}: {apart} of {}", active.len());
    }
    assert_valid(&gpu);
}

#[test]
pub fn doubling_interpolates_the_vectors_and_bounds_the_new_domain() {
    check_doubling(&grid(), true, 0, [2, 1]);
}

/// Voxels much thinner than wide: on coarser grids they are deeper, too, and their bins are summed.
#[test]
fn refined_voxels_halve_in_depth_too() {
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 0.615) };
    let thin = Grid::new(volume, 12, 1.0 / 12.0 / 16.0).unwrap();
    assert_eq!(thin.n[2] % 2, 1, "the last voxels of coarser grids reach beyond the box");
    // From the coarsest: wider and deeper voxels, then deeper ones.
    check_doubling(&thin, false, 0, [2, 2]);
    check_doubling(&thin, false, 1, [1, 2]);
}

/// Refines level `from`, whose voxels hold so many of the next level's side by side and behind each other.
fn check_doubling(fine: &Grid, all_bins: bool, from: usize, parts: [usize; 2]) {
    let gpu = gpu();
    let model = scene(3, 160, 25);
    let o = vector_options(fine).with(|o| {
        o.domain.coarse_to_fine = true;
        o.domain.keep_above = 0.5;
        o.bound_power = Some(1.5);
        o.all_bins = all_bins;
    });
    let mut job = job(&gpu, &model, fine, &o);
    let [before, after] = [job.plan.levels.volume[from], job.plan.levels.volume[from + 1]];
    assert_eq!(after.parts, parts);
    let (coarse, fine) = (before.grid, after.grid);
    let model = if after.sum > 1 { model.summed(after.sum) } else { model };
    let domain = state(&model, &coarse, 0.6, 26).1;
    let v = within(vectors(coarse.storage(), 27), &domain);
    hold(&mut job, &domain, &v);
    let mut level = from;
    let s = Schedule::of(|s| vector::due(s, &job.plan, &o, &mut level, o.domain.coarse_iterations));
    assert_eq!(level, from + 1);
    job.perform(&s);

    // Voxels that the reduction leaves out still count in the interpolation of their neighbours.
    let kept_model = Model { keep_above: 0.5, ..model.clone() };
    let smooth = twin::smooth(&coarse, twin::lengths(&v, &domain), &job.plan.domain.taps);
    let kept = twin::threshold(&Twin { model: &kept_model, grid: &coarse }, &smooth);
    let split = twin::double_domain(&coarse, &fine, &kept);
    assert_eq!(read_mask(&mut job, buffer::MASK, fine.storage()), split);
    let share = kept.iter().filter(|k| **k).count() as f64 / coarse.voxels() as f64;
    assert!(share > 0.02 && share < 0.9, "{share}");
    let raw: Vec<twin::Raw> = v.iter().map(|v| [v.x, v.y, v.z, 0.0]).collect();
    let doubled: Vec<DVec3> =
        twin::carry_doubled(&coarse, &fine, &raw).iter().map(|r| dvec3(r[0], r[1], r[2])).collect();
    let twin = Twin { model: &model, grid: &fine };
    check_settled(&mut job, &twin, &split, &doubled, REST);
    // A child is expected to be as bright as its parent.
    let of_coarse = expected(&smooth, 1.5);
    let parent = |i: usize| {
        let [x, y, z] = fine.voxel(i);
        let parent = [x / parts[0], y / parts[0], z / parts[1]];
        if fine.contains([x, y, z]) { of_coarse[coarse.index(parent)] } else { 0.0 }
    };
    let of_fine: Vec<f64> = (0..fine.storage()).map(parent).collect();
    check_bounds_of(&mut job, &twin, &split, &of_fine);
    check_points(&mut job, &twin, &split);
    assert_valid(&gpu);
}

#[test]
pub fn start_leaves_a_domain_with_its_bounds_and_nothing_in_it() {
    let gpu = gpu();
    let (mut model, grid) = (scene(5, 64, 28), grid());
    model.keep_above = 0.3;
    let twin = Twin { model: &model, grid: &grid };
    let o = vector_options(&grid).with(|o| o.domain.start_above = 0.3);
    let mut job = job(&gpu, &model, &grid, &o);
    let hat = vector::hat(2.0, model.bins);
    write(&mut job, buffer::HAT_TAPS, &hat);
    let s = Schedule::of(|s| vector::start(s, &job.plan, job.plan.finest(), &o));
    job.perform(&s);
    let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
    let projected = twin::backproject(&twin, &twin::filter(&twin, &half, false));
    let smooth = twin::smooth(&grid, projected, &job.plan.domain.taps);
    assert!(error(read_floats(&mut job, SMOOTH, grid.storage()), smooth.iter().copied()) < 3e-5);
    let mask = read_mask(&mut job, buffer::MASK, grid.storage());
    let want = twin::threshold(&twin, &smooth);
    let differ = mask.iter().zip(&want).filter(|(a, b)| a != b).count();
    assert!(differ <= 1, "{differ} voxels on the wrong side of the threshold");
    assert!(want.iter().any(|w| *w) && want.iter().filter(|w| **w).count() < grid.voxels() / 2);
    let share = f64::from(o.step_share as f32);
    check_settled(&mut job, &twin, &mask, &vec![DVec3::ZERO; grid.storage()], Momentum { share, ..REST });
    check_bounds_of(&mut job, &twin, &mask, &vec![1.0; grid.storage()]);
    let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
    assert_eq!(counts[COUNT_PEAK_ALBEDO as usize], 0);
    let bytes = job.plan.bytes()["histograms"] as usize;
    assert!(read::<u8>(&mut job, buffer::HISTOGRAMS, bytes).iter().all(|b| *b == 0));
    assert_valid(&gpu);
}

#[test]
fn extract_takes_a_column_from_all_of_its_surface() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 29), grid());
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.15, 30).1;
    let v: Vec<DVec3> = vectors(grid.storage(), 31)
        .into_iter()
        .map(|v| twin::into_cone(model.cone, v).map(|v| f64::from(v as f32)))
        .collect();
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    let active = write_domain(&mut job, &domain);
    write_vectors(&mut job, buffer::RAW, &active, &v);
    let s = Schedule::of(|s| extract(s, job.plan.finest()));
    job.perform(&s);
    let got: Vec<[f32; 8]> = job.executor.read(COLUMNS_HOST, ..);
    let brightest = twin::lengths(&v, &domain);
    let (mut found, mut empty, mut together, mut farther) = (0, 0, 0, 0);
    for (i, (g, w)) in got.iter().zip(twin::extract_vectors(&twin, &v, &domain)).enumerate() {
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
        let column = (0..grid.n[2]).map(|z| brightest[grid.index([i / grid.n[1], i % grid.n[1], z])]);
        let (z, longest) = column.enumerate().fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        together += usize::from(w.albedo > 1.2 * longest);
        farther += usize::from(w.depth > grid.origin.z + (z as f64 + 0.5) * grid.pitch.z);
    }
    assert!(found > 80 && empty > 5 && together > 10 && farther > 10, "{found} {empty} {together} {farther}");
    assert_valid(&gpu);
}

#[test]
pub fn extract_finds_the_second_surface_of_a_column() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 32), grid());
    let twin = Twin { model: &model, grid: &grid };
    let mut domain = state(&model, &grid, 0.3, 33).1;
    let mut v: Vec<DVec3> = vectors(grid.storage(), 34)
        .into_iter()
        .map(|v| twin::into_cone(model.cone, v).map(|v| f64::from(v as f32)))
        .collect();
    // In the first columns nothing is dark: one thick surface, as bright everywhere, has no second one.
    let thick = (0..grid.storage()).filter(|i| grid.contains(grid.voxel(*i)) && grid.voxel(*i)[0] < 3);
    for i in thick.filter(|i| grid.voxel(*i)[2] >= model.near_z(&grid)) {
        (domain[i], v[i]) = (true, dvec3(0.0, 0.0, -1.0 - 0.25 * (grid.voxel(i)[2] % 3) as f64));
    }
    let mut job = job(&gpu, &model, &grid, &surface_options(&grid, 1));
    let active = write_domain(&mut job, &domain);
    write_vectors(&mut job, buffer::RAW, &active, &v);
    let s = Schedule::of(|s| surface::extract_behind(s, job.plan.finest()));
    job.perform(&s);
    let got: Vec<[f32; 8]> = job.executor.read(COLUMNS_HOST, ..);
    let first = twin::extract_vectors(&twin, &v, &domain);
    let (mut before, mut behind, mut none) = (0, 0, 0);
    for (i, (g, w)) in got.iter().zip(twin::extract_behind(&twin, &v, &domain)).enumerate() {
        let Some(w) = w else {
            assert_eq!(*g, [0.0; 8]);
            none += 1;
            continue;
        };
        assert!(i / grid.n[1] >= 3, "a thick surface is one");
        let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 2e-5, "{g:?} {w:?}");
        close(g[0], w.albedo);
        close(g[1], w.depth);
        (0..3).for_each(|k| close(g[4 + k], w.normal[k]));
        let of_first = first[i].map_or(0.0, |c| c.depth);
        before += usize::from(w.depth < of_first);
        behind += usize::from(w.depth > of_first);
    }
    assert!(before > 20 && behind > 20 && none >= 3 * grid.n[1], "{before} {behind} {none}");
    assert_valid(&gpu);
}

/// The scene of the paper: 32 x 32 confocal points, 128 x 128 x 333 voxels. The paper's code takes 1,659 MB for it.
#[test]
fn the_papers_scene_takes_150_megabytes() {
    let gpu = gpu();
    let model = scene(32, 512, 40);
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.25), max: dvec3(0.5, 0.5, 1.4) };
    let grid = Grid::new(volume, 128, (volume.max.z - volume.min.z) / 333.0).unwrap();
    assert_eq!(grid.n, [128, 128, 333]);
    // With voxels as small as the paper's, and as large as two pixels of the surface.
    for (pixels_per_voxel, most) in [(1, 100_000_000), (2, 60_000_000)] {
        let o = vector_options(&grid).with(|o| {
            o.domain.coarse_to_fine = true;
            o.domain.room = None;
            o.surface.pixels_per_voxel = Some(pixels_per_voxel);
            o.surface.iterations = 60;
        });
        let plan = Plan::new(&model, grid, [32, 32], &o, &gpu.abilities(), false).unwrap();
        let bytes: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
        assert!(bytes < most, "{bytes}");
        let storage = plan.finest().grid.storage();
        assert_eq!([plan.finest().grid.n[0], plan.levels.maps.n[0]], [128 / pixels_per_voxel, 128]);
        assert!(plan.domain.capacity * 16 >= storage && plan.domain.capacity < storage);
        assert!(plan.left_out.iter().any(|l| l.contains("inactive voxels")), "{:?}", plan.left_out);
        let larger = plan.left_out.iter().any(|l| l.contains("2 of them wide"));
        assert_eq!(larger, pixels_per_voxel == 2, "{:?}", plan.left_out);
    }
}
