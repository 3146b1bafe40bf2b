//! Every float that a path may be has a cell within its row, and one that is not a number adds to no bin.

use fixtures::device::*;
use glam::DVec3;
use thirdbounce::engine::plan::passes;
use thirdbounce::engine::{OnDevice, Pass};
use thirdbounce::gpu::Schedule;
use thirdbounce::methods::paper;
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Binning, Model};
use thirdbounce_kernels::Cells;
use thirdbounce_verify::{Raw, Sample, reference, rendered};

/// Floats that are no path of a scene.
fn strange() -> Vec<f32> {
    let not_numbers =
        [0x7fc0_0000, 0xffc0_0000, 0x7f80_0001, 0xff80_0001, 0x7fff_ffff, u32::MAX, 0x7fc0_0042];
    let infinite = [f32::INFINITY, f32::NEG_INFINITY];
    let large = [f32::MAX, f32::MIN, 1e30, -1e30, 8_388_608.0, -8_388_608.0, -1e-42, -0.0];
    not_numbers.map(f32::from_bits).into_iter().chain(infinite).chain(large).collect()
}

#[test]
fn every_float_has_a_cell_of_its_row() {
    let gpu = gpu();
    for (binning, fine) in
        [(Binning::Linear, 0), (Binning::Linear, 1), (Binning::Nearest, 0), (Binning::Nearest, 1)]
    {
        let (model, grid) = (Model { binning, ..model(3, 40, 1) }, grid());
        let split = u32::from(binning == Binning::Linear);
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
        let constants = [(constant::FINE, fine)];
        job.executor.add_kernel(&kernel::PLACES, &kernel::PLACES, &constants).expect("a kernel");
        // The unit in which the kernel takes a path: a pair of a confocal scan goes there and back, and fine paths are
        // whole grains.
        let scene = model.scene(&grid);
        let unit = if fine == 1 { f64::from(scene.grain) } else { 2.0 };
        let known =
            (0..40).map(|bin| ((model.t_start + (f64::from(bin) + 0.3) * model.bin_width) / unit) as f32);
        let all: Vec<f32> = strange().into_iter().chain(known).collect();
        write(&mut job, buffer::RAW, &all);
        let mut s = Schedule::default();
        s.dispatch(&kernel::PLACES, [1, 1, 1], 1)
            .bind(buffer::SCENE, job.plan.finest().scene)
            .bind(buffer::SOURCE, buffer::RAW)
            .bind(buffer::TARGET, buffer::GRADIENT)
            .with(Push { last: all.len() as u32, ..Default::default() });
        job.perform(&s);
        let got: Vec<u32> = read(&mut job, buffer::GRADIENT, all.len());
        let push = Push { last: all.len() as u32, ..Default::default() };
        let floats = Cells::Floats(all.iter().map(|path| f64::from(*path)).collect());
        let mut bound = [floats, Cells::Words(vec![0; all.len()])];
        reference::run("places", (&model, &grid), &[("FINE", fine)], push, &mut bound);
        let want = bound[1].u().to_vec();
        // The first of two cells may be the last one before bin 0.
        let bins = PADDING - split..PADDING + model.bins as u32;
        for ((path, got), want) in all.iter().zip(got).zip(want) {
            let what =
                format!("{binning:?} fine {fine}, path {path} ({:#x}): {got}, not {want}", path.to_bits());
            assert!(got <= model.stride() as u32 + 1, "{what}");
            assert!(if bins.contains(&want) { got == want } else { !bins.contains(&got) }, "{what}");
        }
    }
    assert_valid(&gpu);
}

/// Samples among which some are nowhere.
fn some_nowhere(all: &[Sample]) -> Vec<Sample> {
    let nowhere = [DVec3::NAN, DVec3::INFINITY, DVec3::NEG_INFINITY, DVec3::new(0.1, f64::NAN, 0.5)];
    let mut all = all.to_vec();
    for (i, point) in nowhere.into_iter().enumerate() {
        all.insert(7 * i + 3, Sample { point, ..all[0] });
    }
    all
}

fn perform(job: &mut OnDevice, pass: &Pass) {
    let mut s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
    s.commands.retain(|c| c.name() == pass.kernel.name());
    job.perform(&s);
}

#[test]
fn samples_that_are_nowhere_light_no_bin_and_are_told() {
    let gpu = gpu();
    let (model, grid) = (model(5, 64, 3), grid());
    let known = away_from_edges(&model, &samples(&model, &grid, 0.5, 4));
    let samples = some_nowhere(&known);
    let mut random = Random::new(5);
    let residual: Vec<f64> = model.measured.iter().map(|_| random.uniform(-1.0, 1.0)).collect();
    let want = rendered(&model, &grid, &known);
    let gradient = gathered("backward", (&model, &grid), &samples, &residual, false);
    for accumulation in accumulations(&gpu) {
        let mut o = options(&model, &grid);
        (o.accumulation, o.l1) = (accumulation, 0.0);
        let mut job = job(&gpu, &model, &grid, &o);
        write_samples(&mut job, &samples);
        set_counts(&mut job, samples.len(), 1.0);
        zero_histograms(&mut job);
        perform(&mut job, &passes::FORWARD);
        if !job.plan.fixed_point() {
            let got = read_rows::<f32>(&mut job, buffer::HISTOGRAMS).into_iter().map(f64::from);
            assert!(error(got, want.iter().copied()) < 2e-5, "{accumulation:?}");
        }
        let words: Vec<f32> = residual.iter().map(|r| *r as f32).collect();
        write_rows(&mut job, buffer::RESIDUAL, &words, 0.0);
        perform(&mut job, &paper::passes::BACKWARD);
        let got = read_raw(&mut job, buffer::GRADIENT, samples.len());
        for (i, s) in samples.iter().enumerate() {
            let (is_known, is_finite) = (s.point.is_finite(), got[i].iter().all(|g| g.is_finite()));
            assert_eq!(is_known, is_finite, "{accumulation:?}: sample {i} at {}", s.point);
            assert_eq!(is_known, gradient[i].iter().all(|g| g.is_finite()), "the reference of sample {i}");
        }
        let of_known = |all: &[Raw]| {
            let pairs = all.iter().zip(&samples).filter(|(_, s)| s.point.is_finite());
            pairs.flat_map(|(g, _)| *g).collect::<Vec<f64>>()
        };
        assert!(error(of_known(&got), of_known(&gradient)) < 2e-5, "{accumulation:?}");
        let faults = read::<u32>(&mut job, buffer::COUNTS, COUNTS as usize)[COUNT_FAULTS as usize];
        assert_eq!(faults & FAULT_BACKWARD, FAULT_BACKWARD);
    }
    assert_valid(&gpu);
}
