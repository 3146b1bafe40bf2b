//! The vector solver's work on a capture before its first iteration: background, variance, the filter's hat, and a
//! domain that keeps every true surface.

use fixtures::captures::changed;
use fixtures::device::*;
use rand::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::Schedule;
use thirdbounce::simulate::{Dark, RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::{VectorOptions, background, default_volume, variance_per_count, vector};
use thirdbounce::transport::Grid;
use thirdbounce::transport::kernels::buffer;

/// Photon counts of 16 x 16 pairs: a peak of the given size on a level of dark counts.
fn counts(peak: f64, dark: f64, at: f64, seed: u64) -> Capture {
    let mut random = Pcg64::seed_from_u64(seed);
    let (scan, bins) = ([16, 16], 256);
    let wall: Vec<_> =
        (0..256).map(|i| glam::dvec3(f64::from(i / 16), f64::from(i % 16), 0.0) / 16.0).collect();
    let mean = |bin: usize| dark + peak * (-0.5 * ((bin as f64 - at) / 12.0).powi(2)).exp();
    let mut draw = |i: usize| match Poisson::new(mean(i % bins)) {
        Ok(counts) => counts.sample(&mut random) as f32,
        Err(_) => 0.0,
    };
    let histograms = (0..256 * bins).map(&mut draw).collect();
    let mut made = Capture::new(scan, wall.clone(), wall, bins, 0.01, histograms);
    made.integer_counts = true;
    made
}

/// The same pairs with these values, which are not photon counts.
fn values(capture: &Capture, histograms: Vec<f32>) -> Capture {
    changed(capture, |c| (c.integer_counts, c.histograms) = (false, histograms))
}

#[test]
fn background_is_the_dark_level_behind_the_signal() {
    for (dark, seed) in [(1.0, 1), (5.0, 2), (40.0, 3)] {
        let level = background(&counts(60.0, dark, 90.0, seed));
        assert!((level / dark - 1.0).abs() < 0.05, "{dark} is taken for {level}");
    }
    assert_eq!(background(&counts(60.0, 0.0, 90.0, 4)), 0.0);
}

#[test]
fn there_is_no_background_where_the_signal_ends_the_histogram() {
    // The strongest bin is among the last, so the values there are signal.
    for at in [245.0, 250.0, 255.0] {
        assert_eq!(background(&counts(60.0, 1.0, at, 5)), 0.0, "{at}");
    }
    let one_bin = changed(&counts(60.0, 1.0, 90.0, 6), |c| (c.bins, c.histograms) = (1, vec![7.0; 256]));
    assert_eq!(background(&one_bin), 0.0);
}

#[test]
fn variance_per_count_is_the_scale_of_scaled_photons() {
    let photons = counts(200.0, 20.0, 120.0, 7);
    assert_eq!(variance_per_count(&photons), 1.0, "photons");
    for factor in [1.0, 0.037, 512.0] {
        let scaled = values(&photons, photons.histograms.iter().map(|h| h * factor).collect());
        let found = variance_per_count(&scaled) / f64::from(factor);
        assert!((found - 1.0).abs() < 0.2, "{factor}: {found}");
    }
    // Without noise the background is almost zero, and nothing is subtracted from zero.
    let smooth = |i: usize| 100.0 + 50.0 * (i as f32 / 40.0).sin();
    let silent = values(&photons, (0..photons.histograms.len()).map(|i| smooth(i % 256)).collect());
    assert!(variance_per_count(&silent) < 1e-3);
    let empty = values(&silent, vec![0.0; photons.histograms.len()]);
    assert_eq!(variance_per_count(&empty), 0.0);
}

#[test]
fn the_model_carries_the_noise_in_its_own_units() {
    let capture = counts(500.0, 4.0, 90.0, 8);
    // General, so that all bins stay.
    let o = VectorOptions::default().with(|o| o.general = true);
    let grid = Grid::new(default_volume(&capture, 0.2).unwrap(), 16, capture.bin_width).unwrap();
    let model = vector::model(&capture, &grid, &o);
    let scale = 1.0 / model.counts_per_unit;
    // A bin of n counts has the variance n, whatever was subtracted; so has a bin with background only.
    for (counts, value) in capture.histograms.iter().zip(&model.measured).step_by(37) {
        let variance = model.variance[0] * f64::from(*value) + model.variance[1];
        let want = f64::from(*counts) * scale * scale;
        assert!((variance - want).abs() < 1e-6 * scale, "{counts} counts: {variance}, not {want}");
    }
    let dark: f64 = model.measured.chunks(256).map(|h| f64::from(h[250])).sum::<f64>() / 256.0;
    assert!(dark.abs() < 0.15 * 4.0 * scale, "the background is gone: {dark}");
    let kept = o.with(|o| o.background = false);
    let kept = vector::model(&capture, &grid, &kept);
    assert!(kept.measured.iter().all(|m| *m >= 0.0) && kept.variance[1] == 0.0);
}

#[test]
fn the_hat_has_no_sum_and_fits_its_buffer() {
    for sigma in [0.1, 0.7, 3.0, 20.0, 500.0] {
        for bins in [2, 10, 400] {
            let hat = vector::hat(sigma, bins);
            let radius = hat[0] as usize;
            assert!(hat.len() == radius + 2 && hat.len() <= bins + 1);
            let sum = f64::from(hat[1]) + 2.0 * hat[2..].iter().map(|w| f64::from(*w)).sum::<f64>();
            let size = hat[1..].iter().fold(0.0f32, |a, w| a.max(w.abs()));
            assert!(sum.abs() < 1e-5 * f64::from(size.max(1e-3)), "{sigma} {bins}: {sum}");
            assert!(hat[2..].iter().all(|w| *w <= hat[1]), "highest in its middle");
        }
    }
    // The second derivative of a Gaussian: zero at sigma, lowest at sqrt(3) sigma.
    let hat = vector::hat(30.0, 400);
    assert!(hat[1 + 30].abs() < 0.01 && hat[1 + 20] > 0.0 && hat[1 + 40] < 0.0);
    let lowest = (0..=120).min_by(|a, b| hat[1 + a].total_cmp(&hat[1 + b])).unwrap();
    assert!((50..=54).contains(&lowest), "{lowest}");
}

#[test]
fn nothing_true_is_pruned_by_the_start() {
    let gpu = gpu();
    for (name, photons) in [("letter:K", None), ("spheres", None), ("spheres", Some(30.0))] {
        let mut scene = Scene::named(name).unwrap();
        (scene.scan, scene.bin_width, scene.photons) = (32, 0.01, photons);
        if photons.is_some() {
            scene.dark = Dark::Fraction(0.01);
        }
        let options = RenderOptions { noise: 0.02, ..Default::default() };
        let capture = simulate(&scene, &options).unwrap().capture;
        let o = VectorOptions::default().with(|o| {
            o.lateral = 32;
            o.domain.coarse_to_fine = false;
        });
        let volume = default_volume(&capture, o.domain.min_depth).unwrap();
        let grid = Grid::new(volume, o.lateral, capture.bin_width).unwrap();
        let model = vector::model(&capture, &grid, &o);
        let mut job = job(&gpu, &model, &grid, &o);
        let hat = vector::hat(vector::HAT_SIGMA * grid.pitch.x / capture.bin_width, model.bins);
        write(&mut job, buffer::HAT_TAPS, &hat);
        let s = Schedule::of(|s| vector::start(s, &job.plan, job.plan.finest(), &o));
        job.perform(&s);
        let mask = read_mask(&mut job, buffer::MASK, grid.storage());
        let active = mask.iter().filter(|m| **m).count() as f64 / grid.voxels() as f64;

        let true_maps = truth(&scene, o.lateral).unwrap();
        let kept = |pixel: usize| {
            let z = ((f64::from(true_maps.depth[pixel]) - grid.origin.z) / grid.pitch.z).round();
            let c = [(pixel / 32) as f64, (pixel % 32) as f64, z];
            (0..27).any(|k| {
                let n = [0, 1, 2].map(|a| c[a] + f64::from(k / [1, 3, 9][a] % 3 - 1));
                let inside = n.iter().all(|v| *v >= 0.0) && grid.contains(n.map(|v| v as usize));
                inside && mask[grid.index(n.map(|v| v as usize))]
            })
        };
        // The cone limits vectors, so the solver cannot represent steeper surfaces at the edge of a sphere.
        let steep = |pixel: usize| -f64::from(true_maps.normal[pixel][2]) < 1.0 / o.cone.hypot(1.0);
        let pixels: Vec<usize> = (0..true_maps.mask.len()).filter(|p| true_maps.mask[*p]).collect();
        let share = |of: &dyn Fn(usize) -> bool| {
            let of: Vec<bool> = pixels.iter().filter(|p| of(**p)).map(|p| kept(*p)).collect();
            assert!(of.len() > 50);
            of.iter().filter(|k| **k).count() as f64 / of.len() as f64
        };
        let (held, all) = (share(&|p| !steep(p)), share(&|_| true));
        assert!(held >= 0.99 && all >= 0.9, "{name}: {held} of what can be held is active, {all} of all");
        assert!(active < 0.25, "{name}: {active} is active");
    }
    assert_valid(&gpu);
}
