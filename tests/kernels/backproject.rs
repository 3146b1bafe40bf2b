//! The kernels of back-projections against the float64 twins, on random input in poisoned buffers.

use fixtures::device::surfaces::*;
use fixtures::device::*;
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::OnDevice;
use thirdbounce::solve::closed_form::passes::{PROJECTED, gather_filtered};
use thirdbounce::solve::closed_form::{OfProjection, hat};
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::twin::{self, Twin};
use thirdbounce::transport::{Grid, Model};

const NEEDS: OfProjection = OfProjection { pixels_per_voxel: 1 };

/// Runs those kernels of a back-projection that are among `names`.
fn project(job: &mut OnDevice, names: &[&str]) -> usize {
    let mut s = Schedule::of(|s| gather_filtered(s, &job.plan, job.plan.finest(), job.plan.scene.bins));
    s.commands.retain(|c| names.contains(&c.name()));
    job.perform(&s);
    s.commands.len()
}

#[test]
pub fn filter_and_backproject() {
    let gpu = gpu();
    let mut model = scene(4, 50, 19);
    // A subtracted background leaves negative values.
    model.measured.iter_mut().for_each(|m| *m -= 2.0);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &NEEDS);
    for (sigma, odd) in [(0.2, false), (2.5, false), (40.0, false), (2.5, true)] {
        let mut hat = hat(sigma, model.bins);
        if odd {
            hat[0] = -hat[0];
        }
        write(&mut job, buffer::HAT_TAPS, &hat);
        project(&mut job, &["filter"]);
        let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
        let want = twin::filter(&twin, &half, odd);
        let got = read_rows::<f32>(&mut job, buffer::RESIDUAL).into_iter().map(f64::from);
        assert!(error(got, want.iter().copied()) < 3e-6);
        assert!(read_padding(&mut job, buffer::RESIDUAL).iter().all(|w| *w == 0));
        project(&mut job, &["backproject"]);
        let filtered: Vec<f64> = want.iter().map(|w| f64::from(*w as f32)).collect();
        let want = twin::backproject(&twin, &filtered);
        assert!(
            [want.iter().filter(|v| **v > 0.0).count(), want.iter().filter(|v| **v < 0.0).count()]
                .iter()
                .all(|n| *n > 100)
        );
        assert!(error(read_floats(&mut job, PROJECTED, grid.storage()), want) < 3e-5);
    }
    assert_valid(&gpu);
}

/// Compares a back-projection of random residuals, which must run in `dispatches` dispatches, with its twin.
fn check(gpu: &Gpu, model: &Model, grid: &Grid, dispatches: usize, texels: bool) {
    let mut job = job_tuned(gpu, model, grid, &NEEDS, |t| t.texels &= texels);
    let mut random = Random::new(13);
    let residual: Vec<f32> =
        (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 0.6) as f32).collect();
    write_rows(&mut job, buffer::RESIDUAL, &residual, 0.0);
    assert_eq!(project(&mut job, &["backproject"]), dispatches);
    let residual: Vec<f64> = residual.into_iter().map(f64::from).collect();
    let want = twin::backproject(&Twin { model, grid }, &residual);
    let e = error(read_floats(&mut job, PROJECTED, grid.storage()), want);
    assert!(e < 3e-5, "{:?} {:?}: {e}", model.wall.geometry, model.reflectance);
}

#[test]
fn backprojection_of_every_model_pair_and_wall() {
    let gpu = gpu();
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&scene(5, 64, 9), geometry, reflectance, curved, 20);
        [false, true].into_iter().for_each(|texels| check(&gpu, &model, &grid(), 1, texels));
    }
    assert_valid(&gpu);
}

/// The second dispatch continues the sums of the first.
#[test]
fn backprojection_over_more_pairs_than_a_dispatch_takes() {
    let gpu = gpu();
    let (grid, models) = more_pairs_than_a_dispatch_takes();
    models.into_iter().for_each(|(model, dispatches)| check(&gpu, &model, &grid, dispatches, true));
    assert_valid(&gpu);
}
