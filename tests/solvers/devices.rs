//! A solve of every kind on the host and on a Vulkan device: the same surface. And on the host the same bits for any number of
//! threads.

use fixtures::device::*;
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Maps;
use thirdbounce::{Capture, Settings, reconstruct};
use thirdbounce_simulate::{Layout, RenderOptions, Scene, simulate};

fn capture(change: impl FnOnce(&mut Scene)) -> Capture {
    let mut scene = Scene { scan: 16, bin_width: 0.02, photons: None, ..Scene::named("figure").unwrap() };
    change(&mut scene);
    simulate(&scene, &RenderOptions { noise: 0.1, ..Default::default() }).unwrap().capture
}

fn settings(more: &[(&'static str, &'static str)]) -> Settings {
    let common = [("lateral", "24"), ("deterministic", "true")];
    Settings::from_texts(common.into_iter().chain(more.iter().copied())).unwrap()
}

fn maps(gpu: &Gpu, capture: &Capture, settings: &Settings) -> Maps {
    reconstruct(gpu, capture, settings).unwrap().maps
}

/// Share of the pixels of either mask that both have, and the mean difference of their depths, metres.
fn agreement(a: &Maps, b: &Maps) -> [f64; 2] {
    let pixels = || 0..a.mask.len();
    let both: Vec<usize> = pixels().filter(|i| a.mask[*i] && b.mask[*i]).collect();
    let either = pixels().filter(|i| a.mask[*i] || b.mask[*i]).count();
    let off: f64 = both.iter().map(|i| f64::from((a.depth[*i] - b.depth[*i]).abs())).sum();
    [both.len() as f64 / either.max(1) as f64, off / both.len().max(1) as f64]
}

#[test]
fn a_solve_of_every_kind_finds_the_same_surface_on_the_host_and_on_vulkan() {
    let plain = capture(|_| ());
    let fit: &[_] = &[("model", "cosine"), ("pulse", "none"), ("iterations", "40")];
    let one_laser = capture(|s| s.layout = Layout::OneLaser { point: glam::dvec2(0.1, 0.0) });
    let cases = [
        ("surface", &plain, settings(fit), 0.9),
        // Its support follows weak evidence, and rounding decides between pixels.
        ("one laser point", &one_laser, settings(fit), 0.6),
        ("whole default", &plain, settings(&[]), 0.9),
        ("paper", &plain, settings(&[("solver", "paper"), ("iterations", "60")]), 0.9),
        ("back-projection", &plain, settings(&[("solver", "fbp")]), 0.9),
        ("light-cone transform", &plain, settings(&[("solver", "lct")]), 0.9),
    ];
    let vulkan = gpu();
    for (what, capture, settings, least) in cases {
        let [shared, off] = agreement(&maps(&host(), capture, &settings), &maps(&vulkan, capture, &settings));
        assert!(shared > least && off < 0.01, "{what}: {shared:.3} of the pixels, {off:.4} m");
    }
}

#[test]
fn the_host_gives_the_same_bits_with_any_number_of_threads() {
    let capture = capture(|_| ());
    for more in [&[][..], &[("solver", "paper"), ("iterations", "30")], &[("solver", "fbp")]] {
        let settings = settings(more);
        let of = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| maps(&host(), &capture, &settings))
        };
        let bits = |maps: &Maps| -> Vec<u32> {
            maps.albedo.iter().chain(&maps.depth).map(|v| v.to_bits()).collect()
        };
        let [one, two, five] = [1, 2, 5].map(|threads| bits(&of(threads)));
        assert!(one == two && one == five, "{more:?}");
    }
}
