//! Every kernel of an iteration against its float64 twin, on random input in poisoned buffers.

use fixtures::device::*;
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{Accumulation, NoiseTerm, paper};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Twin};
use thirdbounce::transport::{Binning, Gradient, Sampling};

/// Runs the commands of one iteration whose kernel is among `names`.
fn run(job: &mut thirdbounce::solve::OnDevice, names: &[&str], number: u32, step: u32) {
    let mut s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), number, step));
    s.commands.retain(|c| names.contains(&c.name()));
    assert!(!s.commands.is_empty());
    job.perform(&s);
}

#[test]
pub fn sample() {
    let gpu = gpu();
    for sampling in [Sampling::Continuous, Sampling::Fixed] {
        let mut model = model(3, 40, 1);
        model.sampling = sampling;
        let grid = grid();
        let twin = Twin { model: &model, grid: &grid };
        let (raw, domain) = state(&model, &grid, 0.3, 2);
        let active = twin::compact(&domain);
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
        let touched = write_touched(&mut job, &grid, &domain);
        write_state(&mut job, buffer::RAW, &touched, &raw);
        write(&mut job, buffer::COUNTS, &[active.len() as u32, touched.len() as u32, 0, 0, 0, 0]);
        run(&mut job, &["sample"], 5, 1);
        let want = twin::sample(&twin, 5, &active, &raw);
        let got = read_samples(&mut job, active.len());
        for (g, w) in got.iter().zip(&want) {
            assert!((g.point - w.point).length() < 1e-6, "{g:?} {w:?}");
            assert!((g.albedo - w.albedo).abs() < 3e-6, "{g:?} {w:?}");
            assert!(
                (g.normal - w.normal).length() < 1e-5 && (g.length - w.length).abs() < 3e-6,
                "{g:?} {w:?}"
            );
        }
        let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        let peak = got.iter().fold(0.0f64, |a, s| a.max(s.albedo.abs()));
        assert_eq!(f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]), peak as f32);
        let partials: Vec<f32> =
            read(&mut job, buffer::L1_PARTIALS, active.len().div_ceil(WORKGROUP as usize));
        let sum: f64 = partials.iter().map(|p| f64::from(*p)).sum();
        assert!((sum / twin::finish(&want) - 1.0).abs() < 1e-5);
    }
    assert_valid(&gpu);
}

#[test]
fn continuous_samples_stay_within_half_a_voxel_and_cover_it() {
    let model = model(2, 16, 1);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let index = grid.index([5, 6, 7]) as u32;
    let mut low = glam::DVec3::MAX;
    let mut high = glam::DVec3::MIN;
    let mut sum = glam::DVec3::ZERO;
    for i in 0..4000 {
        let d = twin::sample_point(&twin, index, i) - glam::dvec3(5.0, 6.0, 7.0);
        (low, high, sum) = (low.min(d), high.max(d), sum + d);
    }
    assert!(low.min_element() >= -0.5 && high.max_element() < 0.5);
    assert!(low.max_element() < -0.49 && high.min_element() > 0.49, "{low} {high}");
    // Four standard errors of the mean of 4000 uniform numbers.
    assert!((sum / 4000.0).abs().max_element() < 4.0 * (1.0f64 / 12.0 / 4000.0).sqrt());
    let corner = twin::sample_point(&twin, grid.index([0, 0, 0]) as u32, 3);
    assert!(corner.min_element() >= 0.0, "clamped to the grid");
}

#[test]
pub fn forward_on_every_accumulation_path() {
    let gpu = gpu();
    for binning in [Binning::Linear, Binning::Nearest] {
        let mut model = model(5, 64, 3);
        model.binning = binning;
        let grid = grid();
        let twin = Twin { model: &model, grid: &grid };
        let (raw, domain) = state(&model, &grid, 0.5, 4);
        let active = twin::compact(&domain);
        let samples = away_from_edges(&twin, &twin::sample(&twin, 0, &active, &raw));
        assert!(samples.len() > 800);
        let want = twin::forward(&twin, &samples);
        let peak = samples.iter().fold(0.0f64, |a, s| a.max(s.albedo.abs()));
        let mut fixed: Vec<Vec<i64>> = vec![];
        for accumulation in accumulations(&gpu) {
            let mut o = options(&model, &grid);
            o.accumulation = accumulation;
            let mut job = job(&gpu, &model, &grid, &o);
            write_samples(&mut job, &samples);
            set_counts(&mut job, samples.len(), peak);
            zero_histograms(&mut job);
            run(&mut job, &["forward"], 0, 1);
            let got: Vec<f64> = if job.plan.fixed_point() {
                let sums: Vec<i64> = read_rows(&mut job, buffer::HISTOGRAMS);
                let bound = model.scene(&grid).kernel_bound;
                let exponent = fixed_exponent(peak as f32, bound, samples.len() as u32);
                let got = sums.iter().map(|s| *s as f64 * 2f64.powi(-exponent)).collect();
                fixed.push(sums);
                got
            } else {
                read_rows::<f32>(&mut job, buffer::HISTOGRAMS).into_iter().map(f64::from).collect()
            };
            let e = error(got, want.iter().copied());
            assert!(e < 2e-5, "{binning:?} {accumulation:?}: {e}");
        }
        assert!(
            fixed.iter().all(|sums| *sums == fixed[0]),
            "64-bit atomics and pairs of 32-bit ones give the same bits"
        );
    }
    assert_valid(&gpu);
}

/// The scale of fixed-point accumulation, as in `glsl/include/fixed.glsl`.
fn fixed_exponent(peak: f32, bound: f32, count: u32) -> i32 {
    let exponent = |v: f32| if v == 0.0 { 0 } else { v.log2().floor() as i32 + 1 };
    let bits = if count == 0 { 0 } else { 32 - count.leading_zeros() as i32 };
    (61 - exponent(peak) - exponent(bound) - bits).clamp(-120, 120)
}

#[test]
pub fn residual_with_and_without_noise_term() {
    let gpu = gpu();
    for noise in [NoiseTerm::Off, NoiseTerm::Bin, NoiseTerm::Histogram] {
        for accumulation in [Accumulation::Owned, Accumulation::Fixed] {
            let mut model = model(4, 50, 5);
            let grid = grid();
            if noise != NoiseTerm::Off {
                model.noise = [0.05, 0.06];
            }
            let twin = Twin { model: &model, grid: &grid };
            let mut o = options(&model, &grid);
            o.noise.term = noise;
            o.accumulation = accumulation;
            let mut job = job(&gpu, &model, &grid, &o);
            let elements = model.pairs() * model.bins;
            let mut random = Random::new(6);
            // Sums of about the measured size. Some are negative, which tests the clamp.
            let render = f64::from(model.scene(&grid).render_scale);
            let sums: Vec<f64> = (0..elements).map(|_| random.uniform(-2.0, 10.0) / render).collect();
            let weights: Vec<f64> =
                (0..o.noise_weights(&job.plan)).map(|_| random.uniform(-3.0, 3.0)).collect();
            let state: Vec<[f32; 3]> = weights.iter().map(|w| [*w as f32, 0.0, 0.0]).collect();
            write(&mut job, buffer::NOISE_STATE, &state);
            set_counts(&mut job, 900, 1.5);
            let sums: Vec<f64> = if job.plan.fixed_point() {
                let e = fixed_exponent(1.5, model.scene(&grid).kernel_bound, 900);
                let fixed: Vec<i64> = sums.iter().map(|s| (s * 2f64.powi(e)) as i64).collect();
                write_rows(&mut job, buffer::HISTOGRAMS, &fixed, -1);
                fixed.iter().map(|s| *s as f64 * 2f64.powi(-e)).collect()
            } else {
                let floats: Vec<f32> = sums.iter().map(|s| *s as f32).collect();
                write_rows(&mut job, buffer::HISTOGRAMS, &floats, f32::NAN);
                floats.iter().map(|s| f64::from(*s)).collect()
            };
            let (want, loss) = twin::residual(&twin, &sums, &weights);
            run(&mut job, &["residual"], 0, 1);
            let got: Vec<f32> = read_rows(&mut job, buffer::RESIDUAL);
            assert!(read_padding(&mut job, buffer::RESIDUAL).iter().all(|w| *w == 0));
            assert!(error(got.iter().map(|v| f64::from(*v)), want) < 3e-6);
            let partials: Vec<[f32; 2]> = read(&mut job, buffer::LOSS_PARTIALS, losses(&model));
            assert!(partials.iter().all(|p| p[0] == p[1]), "the paper's objective is the plain one");
            let sum: f64 = partials.iter().map(|v| f64::from(v[1])).sum();
            assert!((sum / elements as f64 / loss - 1.0).abs() < 1e-5);
            let bytes = job.plan.bytes()["histograms"] as usize;
            let left: Vec<u8> = read(&mut job, buffer::HISTOGRAMS, bytes);
            assert!(left.iter().all(|b| *b == 0), "the sums are left at zero");
            // Another part of the pairs, in which nothing is rendered, adds to the losses.
            let (_, dark) = twin::residual(&twin, &vec![0.0; elements], &weights);
            let mut more = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
            more.commands.retain(|c| c.name() == "residual");
            more.commands[0].with(Push { flags: BACKWARD_CONTINUE, ..Default::default() });
            job.perform(&more);
            let partials: Vec<[f32; 2]> = read(&mut job, buffer::LOSS_PARTIALS, losses(&model));
            let sum: f64 = partials.iter().map(|v| f64::from(v[1])).sum();
            assert!((sum / elements as f64 / (loss + dark) - 1.0).abs() < 1e-5);
        }
    }
    assert_valid(&gpu);
}

#[test]
pub fn noise_learns_as_its_twin() {
    let gpu = gpu();
    for noise in [NoiseTerm::Bin, NoiseTerm::Histogram] {
        let mut model = model(4, 70, 7);
        model.noise = [0.05, 0.06];
        let grid = grid();
        let twin = Twin { model: &model, grid: &grid };
        let mut o = options(&model, &grid);
        o.noise.term = noise;
        let mut job = job(&gpu, &model, &grid, &o);
        let mut random = Random::new(8);
        let residual: Vec<f64> =
            (0..model.pairs() * model.bins).map(|_| random.uniform(-1e-5, 1e-5)).collect();
        let mut want: Vec<[f64; 3]> =
            (0..o.noise_weights(&job.plan)).map(|_| [random.uniform(-1.0, 1.0), 0.0, 0.0]).collect();
        let state: Vec<[f32; 3]> = want.iter().map(|s| s.map(|v| v as f32)).collect();
        write(&mut job, buffer::NOISE_STATE, &state);
        let floats: Vec<f32> = residual.iter().map(|v| *v as f32).collect();
        write_rows(&mut job, buffer::RESIDUAL, &floats, 0.0);
        for step in 1..=3 {
            run(&mut job, &["noise"], step - 1, step);
            twin::noise(&twin, step, &residual, &mut want);
        }
        let got: Vec<[f32; 3]> = read(&mut job, buffer::NOISE_STATE, want.len());
        let e = error(got.iter().map(|s| f64::from(s[0])), want.iter().map(|s| s[0]));
        assert!(e < 1e-4, "{noise:?}: {e}");
        assert!(want.iter().any(|s| s[0].abs() > 1.5), "the weights moved");
    }
    assert_valid(&gpu);
}

#[test]
pub fn backward_published_and_exact() {
    let gpu = gpu();
    for binning in [Binning::Linear, Binning::Nearest] {
        for gradient in [Gradient::Published, Gradient::Exact] {
            let mut model = model(5, 64, 9);
            (model.binning, model.gradient) = (binning, gradient);
            // As strong as the data term, so neither hides the other.
            model.l1 = 5000.0;
            let grid = grid();
            let twin = Twin { model: &model, grid: &grid };
            let (raw, domain) = state(&model, &grid, 0.4, 10);
            let samples = away_from_edges(&twin, &twin::sample(&twin, 0, &twin::compact(&domain), &raw));
            let mut random = Random::new(11);
            let residual: Vec<f64> =
                (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 1.0)).collect();
            let want = twin::backward(&twin, &samples, &residual);
            for texels in [false, true] {
                let mut job = job_tuned(&gpu, &model, &grid, &options(&model, &grid), |t| t.texels &= texels);
                write_samples(&mut job, &samples);
                let floats: Vec<f32> = residual.iter().map(|v| *v as f32).collect();
                write_rows(&mut job, buffer::RESIDUAL, &floats, 0.0);
                set_counts(&mut job, samples.len(), 1.5);
                run(&mut job, &["backward"], 0, 1);
                let got = read_raw(&mut job, buffer::GRADIENT, samples.len());
                let e = error(got.concat(), want.clone().concat());
                assert!(e < 2e-5, "{binning:?} {gradient:?} texels {texels}: {e}");
            }
        }
    }
    assert_valid(&gpu);
}

#[test]
pub fn forward_and_backward_of_every_model_pair_and_wall() {
    let gpu = gpu();
    let grid = grid();
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&model(5, 64, 3), geometry, reflectance, curved, 21);
        let twin = Twin { model: &model, grid: &grid };
        let (raw, domain) = state(&model, &grid, 0.4, 10);
        let samples = away_from_edges(&twin, &twin::sample(&twin, 0, &twin::compact(&domain), &raw));
        let want = twin::forward(&twin, &samples);
        assert!(want.iter().any(|v| *v != 0.0));
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
        write_samples(&mut job, &samples);
        set_counts(&mut job, samples.len(), 1.5);
        zero_histograms(&mut job);
        run(&mut job, &["forward"], 0, 1);
        let what = format!("{geometry:?} {reflectance:?} curved {curved}");
        let got: Vec<f32> = read_rows(&mut job, buffer::HISTOGRAMS);
        let e = error(got.into_iter().map(f64::from), want);
        assert!(e < 2e-5, "forward {what}: {e}");
        let mut random = Random::new(11);
        let residual: Vec<f32> =
            (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
        let exact: Vec<f64> = residual.iter().map(|v| f64::from(*v)).collect();
        let want = twin::backward(&twin, &samples, &exact).concat();
        write_rows(&mut job, buffer::RESIDUAL, &residual, 0.0);
        run(&mut job, &["backward"], 0, 1);
        let e = error(read_raw(&mut job, buffer::GRADIENT, samples.len()).concat(), want);
        assert!(e < 2e-5, "backward {what}: {e}");
    }
    assert_valid(&gpu);
}

#[test]
fn backward_in_slices_and_in_parts_gives_the_same_sums() {
    let gpu = gpu();
    let model = model(5, 64, 9);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let (raw, domain) = state(&model, &grid, 0.4, 10);
    let samples = rounded(&twin::sample(&twin, 0, &twin::compact(&domain), &raw));
    let mut random = Random::new(11);
    let residual: Vec<f32> =
        (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
    let exact: Vec<f64> = residual.iter().map(|v| f64::from(*v)).collect();
    let want = twin::backward(&twin, &samples, &exact).concat();
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    write_samples(&mut job, &samples);
    write_rows(&mut job, buffer::RESIDUAL, &residual, 0.0);
    let all = samples.len() as u32;
    for sizes in [[32, 4, u32::MAX], [8, 8, u32::MAX], [1, 64, u32::MAX], [8, 32, 3 * all], [8, 32, all]] {
        let of_group = resize(&mut job, sizes, samples.len());
        let mut s = Schedule::default();
        // Two dispatches, as for many pairs: the second adds to the sums of the first.
        let groups = samples.len().div_ceil(of_group) as u32;
        let scene = job.plan.finest().scene;
        s.fill(buffer::COUNTS, 4, samples.len() as u32);
        s.dispatch(&paper::passes::BACKWARD, [groups, 1, 1], 1).bind(buffer::SCENE, scene).with(Push {
            last: model.pairs() as u32,
            flags: BACKWARD_FINISH,
            ..Default::default()
        });
        job.perform(&s);
        let got = read_raw(&mut job, buffer::GRADIENT, samples.len()).concat();
        assert!(error(got, want.iter().copied()) < 2e-5, "{sizes:?}");
    }
    assert_valid(&gpu);
}

#[test]
pub fn update_continuous_and_fixed() {
    let gpu = gpu();
    // At iteration 4 the learning rate is full, half, almost zero, zero.
    let decays = [(0.0, 1.0), (8.0, 0.5), (4.5, 0.0302), (3.0, 0.0)];
    for ((decay_over, rate), sampling) in
        decays.into_iter().zip([Sampling::Continuous, Sampling::Fixed].repeat(2))
    {
        let mut model = model(3, 40, 12);
        (model.sampling, model.decay_over) = (sampling, decay_over);
        let grid = grid();
        let twin = Twin { model: &model, grid: &grid };
        assert!((twin::learning_rate(&twin, 4) / model.learning_rate - rate).abs() < 1e-4);
        let (mut raw, domain) = state(&model, &grid, 0.2, 13);
        let mut random = Random::new(14);
        let active = twin::compact(&domain);
        let touched = match sampling {
            Sampling::Continuous => twin::touched(&grid, &domain),
            Sampling::Fixed => active.clone(),
        };
        let gradient: Vec<twin::Raw> =
            active.iter().map(|_| std::array::from_fn(|_| random.uniform(-1e-4, 1e-4))).collect();
        let mut first = vec![[0.0; 4]; grid.storage()];
        let mut second = first.clone();
        for i in &touched {
            first[*i as usize] = std::array::from_fn(|_| random.uniform(-1e-4, 1e-4));
            second[*i as usize] = std::array::from_fn(|_| random.uniform(1e-9, 1e-8));
        }
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
        assert_eq!(write_touched(&mut job, &grid, &domain), touched);
        write_state(&mut job, buffer::RAW, &touched, &raw);
        write_state(&mut job, buffer::MOMENT_FIRST, &touched, &first);
        write_state(&mut job, buffer::MOMENT_SECOND, &touched, &second);
        write_raw(&mut job, buffer::GRADIENT, &gradient);
        run(&mut job, &["update"], 4, 3);
        twin::update(&twin, 4, 3, &active, &touched, &gradient, &mut raw, &mut first, &mut second);
        for (buffer, want) in
            [(buffer::MOMENT_FIRST, &first), (buffer::MOMENT_SECOND, &second), (buffer::RAW, &raw)]
        {
            let want = twin::carry(&touched, want);
            let e = error(read_state(&mut job, buffer, &touched, want.len()).concat(), want.concat());
            // A rate of almost zero is one less a cosine, which drivers need not round well.
            let most = if rate < 0.1 { 4e-5 } else { 1e-5 };
            assert!(e < most, "{buffer:?}: {e}");
        }
    }
    assert_valid(&gpu);
}

#[test]
pub fn finish_sums_and_resets() {
    let gpu = gpu();
    let model = model(4, 50, 15);
    let grid = grid();
    let mut job = job(&gpu, &model, &grid, &options(&model, &grid));
    let mut random = Random::new(16);
    let loss: Vec<f32> = (0..2 * losses(&model)).map(|_| random.uniform(0.0, 1.0) as f32).collect();
    let l1: Vec<f32> = (0..777usize.div_ceil(64)).map(|_| random.uniform(0.0, 50.0) as f32).collect();
    write(&mut job, buffer::LOSS_PARTIALS, &loss);
    write(&mut job, buffer::L1_PARTIALS, &l1);
    set_counts(&mut job, 777, 1.25);
    run(&mut job, &["finish"], 2, 1);
    let row = job.executor.read::<[u32; TRACE_ROW as usize]>(buffer::TRACE, 2..3)[0];
    let sum = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>();
    let part = |k: usize| sum(&loss.iter().skip(k).step_by(2).copied().collect::<Vec<f32>>()) / 800.0;
    assert!((f64::from(f32::from_bits(row[TRACE_OBJECTIVE as usize])) / part(0) - 1.0).abs() < 1e-6);
    assert!((f64::from(f32::from_bits(row[0])) / part(1) - 1.0).abs() < 1e-6);
    assert!((f64::from(f32::from_bits(row[1])) / sum(&l1) - 1.0).abs() < 1e-6);
    assert_eq!((row[2], f32::from_bits(row[3])), (777, 1.25));
    let counts: Vec<u32> = read(&mut job, buffer::COUNTS, 4);
    assert_eq!(counts, [777, 777, 0, 0]);
    assert_valid(&gpu);
}
