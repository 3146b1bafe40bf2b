//! Submissions to the device, and waits of the host for them: what a solve costs beside its kernels.

use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::{Session, Settings, reconstruct, session};

/// Submissions and waits of what `runs` does.
fn traffic(gpu: &Gpu, runs: impl FnOnce()) -> [u64; 2] {
    let before = gpu.traffic();
    runs();
    let after = gpu.traffic();
    [after[0] - before[0], after[1] - before[1]]
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
    let solve = || drop(reconstruct(&gpu, &capture, &settings).unwrap());
    let [cold, warm] = [traffic(&gpu, solve), traffic(&gpu, solve)];
    let (mut frames, _) = session(&gpu, &capture, &settings, Default::default()).unwrap();
    frame_of(&mut frames, &capture.histograms);
    let frame = traffic(&gpu, || frame_of(&mut frames, &capture.histograms));
    // Counted: 23 and 15, 21 and 13, 13 and 13.
    let cases = [("cold", cold, [26, 17]), ("warm", warm, [24, 15]), ("a session's frame", frame, [15, 15])];
    for (what, counted, most) in cases {
        assert!((0..2).all(|i| (1..=most[i]).contains(&counted[i])), "{what}: {counted:?}");
    }
}
