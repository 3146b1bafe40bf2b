//! The values that an iteration of the vector solver passes to the next: sums, momentum and length of steps, on the
//! device against the float64 twin.

use std::sync::Arc;

use fixtures::device::vectors::*;
use fixtures::device::*;
use thirdbounce::solve::OnDevice;
use thirdbounce::transport::Model;
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Momentum};

#[test]
pub fn finish_decides_on_the_momentum() {
    let gpu = gpu();
    // Of each voxel one lane, four and 32.
    for (sizes, of_group) in [([64, 1, 0], 64), ([8, 32, 4 * ACTIVE as u32], 64), ([8, 32, u32::MAX], 8)] {
        let (model, grid) = (scene(4, 50, 20), grid());
        let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
        let grouped = sizes[1] > 1;
        Arc::make_mut(&mut job.plan).tune(|t| t.group_losses = grouped);
        assert_eq!(resize(&mut job, sizes, ACTIVE), of_group);
        let partials = if grouped { grouped_losses(&model) } else { losses(&model) };
        decides_on_the_momentum(&model, &mut job, of_group, partials);
    }
    assert_valid(&gpu);
}

/// Voxels whose partial sums are summed.
const ACTIVE: usize = 777;

/// `voxels`: of a partial sum. `losses`: how many partial losses there are.
fn decides_on_the_momentum(model: &Model, job: &mut OnDevice, voxels: usize, losses: usize) {
    let (active, elements) = (ACTIVE, model.pairs() * model.bins);
    let mut random = Random::new(21);
    let mut want = Momentum { share: 0.5, ..REST };
    write_momentum(job, want);
    let (mut rises, mut turns) = (0, 0);
    for i in 0..24 {
        // The objective falls, with an occasional rise; some steps go against the momentum.
        let rise = i % 7 == 6;
        let level = 1.0 / f64::from(1 + i) + if rise { 2.0 } else { 0.0 };
        if i > 0 && i % 7 == 0 {
            // A rise within rounding does not count, a larger one does.
            for (more, rose) in [(1.0 + 3e-6, false), (1.0 - 3e-6, false), (1.0 + 5e-5, true)] {
                let share = want.share;
                let risen = want.objective * more;
                write(job, buffer::LOSS_PARTIALS, &vec![0.0f32; 2 * losses]);
                let mut l1 = vec![0.0f32; active.div_ceil(voxels)];
                write(job, buffer::AGAINST_PARTIALS, &l1);
                l1[0] = risen as f32;
                write(job, buffer::L1_PARTIALS, &l1);
                set_counts(job, active, 1.25);
                run_iteration(job, i, &["finish"]);
                want = twin::finish_accelerated(want, f64::from(risen as f32), 0.0);
                assert_eq!(want.share > share, rose && share < 1.0, "{more}");
                assert_eq!(read_momentum(job).restarts, want.restarts, "{more}");
            }
        }
        let sign = if i % 5 == 4 { 1.0 } else { -1.0 };
        let loss: Vec<f32> = (0..2 * losses).map(|_| (level * random.uniform(50.0, 51.0)) as f32).collect();
        let l1: Vec<f32> = (0..active.div_ceil(voxels)).map(|_| (level * 0.01) as f32).collect();
        let against: Vec<f32> = l1.iter().map(|_| (sign * random.uniform(0.1, 1.0)) as f32).collect();
        write(job, buffer::LOSS_PARTIALS, &loss);
        write(job, buffer::L1_PARTIALS, &l1);
        write(job, buffer::AGAINST_PARTIALS, &against);
        set_counts(job, active, 1.25);
        run_iteration(job, i, &["finish"]);
        let sum = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>();
        let data = |k: usize| loss.iter().skip(k).step_by(2).map(|x| f64::from(*x)).sum::<f64>();
        let objective = data(0) / elements as f64 + sum(&l1);
        let before = want;
        want = twin::finish_accelerated(want, objective, sum(&against));
        rises += usize::from(objective > (1.0 + 1e-5) * before.objective);
        turns += usize::from(sign > 0.0);
        let got = read_momentum(job);
        let close =
            |a: f64, b: f64| assert!((a - b).abs() < 2e-6 * b.abs().max(1.0), "{i}: {got:?} {want:?}");
        close(got.t, want.t);
        close(got.beta, want.beta);
        close(got.objective, want.objective);
        close(got.share, want.share);
        assert_eq!(got.restarts, want.restarts);
        let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..);
        let row = rows[i as usize];
        let told = |k: u32| f64::from(f32::from_bits(row[k as usize]));
        close(told(TRACE_OBJECTIVE), data(0) / elements as f64);
        close(told(TRACE_DATA), data(1) / elements as f64);
        close(told(TRACE_L1), sum(&l1));
        close(told(TRACE_RESTARTS), want.restarts);
        assert_eq!((row[TRACE_ACTIVE as usize], told(TRACE_PEAK)), (777, 1.25));
        assert_eq!(read::<u32>(job, buffer::COUNTS, 4), [777, 777, 0, 0]);
    }
    assert!(rises > 2 && turns > 3 && want.share == 1.0 && want.restarts > 4.0);
}

/// FISTA's sequence by its recurrence: t grows by about a half, beta tends to one.
#[test]
fn momentum_grows_until_a_restart() {
    let mut m = REST;
    for i in 1..=50 {
        m = twin::finish_accelerated(m, 1.0 / f64::from(i), -1.0);
    }
    assert!(m.t > 25.0 && m.t < 30.0 && m.beta > 0.88 && m.beta < 1.0 && m.restarts == 0.0, "{m:?}");
    let turned = twin::finish_accelerated(m, 0.001, 1.0);
    assert_eq!((turned.t, turned.beta, turned.restarts, turned.share), (1.0, 0.0, 1.0, REST.share));
    let rose = twin::finish_accelerated(m, 1.0, -1.0);
    assert_eq!((rose.t, rose.beta, rose.share), (1.0, 0.0, 1.5 * REST.share));
    assert_eq!(twin::finish_accelerated(Momentum { share: 0.9, ..m }, 1.0, -1.0).share, 1.0);
}
