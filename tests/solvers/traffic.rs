//! Submissions to the device, and waits of the host for them: what a solve costs beside its kernels.

use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::{Session, Settings, reconstruct, session};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// Submissions and waits of what `runs` does beside the rounds that it returns. Their number depends on the last bits of sums, and
/// each has one of both.
fn traffic(gpu: &Gpu, runs: impl FnOnce() -> usize) -> [u64; 2] {
    let before = gpu.traffic();
    let rounds = runs() as u64;
    let after = gpu.traffic();
    [0, 1].map(|i| (after[i] - before[i]).saturating_sub(rounds))
}

fn frame_of(session: &mut Session, counts: &[f32]) {
    session.submit(counts).unwrap();
    session.wait().unwrap();
}

#[test]
fn a_solve_submits_rarely_and_waits_rarely() {
    // Blocks of iterations as a GPU gets them: on lavapipe they are short.
    let faults = Faults { discrete: true, ..Faults::default() };
    let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::vulkan() }).expect("a device");
    let scene = Scene { scan: 16, bin_width: 0.02, photons: Some(1000.0), ..Scene::named("figure").unwrap() };
    let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let settings = Settings::from_texts([("lateral", "64")]).unwrap();
    let solve = || reconstruct(&gpu, &capture, &settings).unwrap().trace.len();
    let [cold, warm] = [traffic(&gpu, solve), traffic(&gpu, solve)];
    let (mut frames, _) = session(&gpu, &capture, &settings, Default::default()).unwrap();
    frame_of(&mut frames, &capture.histograms);
    let one_frame = || {
        frame_of(&mut frames, &capture.histograms);
        0
    };
    let frame = traffic(&gpu, one_frame);
    // Counted beside 4 to 11 rounds: 17 and 9, 13 and 13.
    let cases = [("cold", cold, [20, 11]), ("warm", warm, [19, 10]), ("a session's frame", frame, [15, 15])];
    for (what, counted, most) in cases {
        assert!((0..2).all(|i| (1..=most[i]).contains(&counted[i])), "{what}: {counted:?}");
    }
}
