//! The kernels that let a domain grow where a new frame misses something, against the float64 twins.

use fixtures::device::vectors::*;
use fixtures::device::*;
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::vector::{self, follow::passes::*};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Twin};

#[test]
pub fn what_is_left_is_summed_and_filtered() {
    let gpu = gpu();
    let (model, grid) = (scene(4, 50, 19), grid());
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    job.executor.add_kernels(&[FILTER_LEFT.wanted(&job.plan)]).unwrap();
    let (level, source) = (*job.plan.finest(), job.plan.domain.volumes[0]);
    let mut random = Random::new(11);
    // One of these bins here, and so many there, which end in the middle of one here, too.
    for (from, to, bins, sigma) in
        [(1u32, 1u32, 50usize, 2.5), (1, 2, 101, 0.2), (2, 5, 124, 2.5), (3, 4, 66, 40.0)]
    {
        let left: Vec<f32> = (0..model.pairs() * bins).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
        // Padding is before every row, and holds no values.
        let padded: Vec<f32> = left
            .chunks(bins)
            .flat_map(|row| [[f32::NAN; PADDING as usize].to_vec(), row.to_vec()].concat())
            .collect();
        assert!(padded.len() <= grid.storage(), "the source has room");
        write(&mut job, source, &padded);
        let hat = vector::hat(sigma, model.bins);
        write(&mut job, buffer::HAT_TAPS, &hat);
        let mut s = Schedule::default();
        let groups = (model.cells() as u32).div_ceil(WORKGROUP);
        s.dispatch(&FILTER_LEFT, [groups, 1, 1], 1)
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::SOURCE, source)
            .with(Push {
                first: from,
                step: to,
                last: bins as u32,
                flags: (-0.25f32).to_bits(),
                ..Default::default()
            });
        job.perform(&s);
        let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
        let left: Vec<f64> = left.into_iter().map(f64::from).collect();
        let want = twin::filter_left(&twin, &half, &left, bins, [from as usize, to as usize]);
        let got = read_rows::<f32>(&mut job, buffer::RESIDUAL).into_iter().map(f64::from);
        assert!(error(got, want.iter().map(|w| -0.25 * w)) < 1e-5, "{from} {to}");
    }
    assert_valid(&gpu);
}

#[test]
pub fn the_domain_before_is_joined_to_the_new_one() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 1), grid());
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    job.executor.add_kernels(&[JOIN.wanted(&job.plan)]).unwrap();
    let [before, new] = [3, 4].map(|seed| state(&model, &grid, 0.3, seed).1);
    write_mask(&mut job, buffer::MASK_BEFORE, &before);
    write_mask(&mut job, buffer::MASK, &new);
    let mut s = Schedule::default();
    let groups = (grid.storage() as u32 / 32).div_ceil(WORKGROUP);
    s.dispatch(&JOIN, [groups, 1, 1], 1).bind(buffer::SCENE, job.plan.finest().scene);
    job.perform(&s);
    let want = twin::join(&new, &before);
    assert!(want != new && want != before, "both have voxels of their own");
    assert_eq!(read_mask(&mut job, buffer::MASK, grid.storage()), want);
    assert_valid(&gpu);
}
