//! A caller's own Vulkan device: the same bits as on an own one, counts in the caller's buffers, maps in them.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use fixtures::caller::{Blocks, Caller, moment};
use fixtures::captures::{assert_error, changed};
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Reconstruction};
use thirdbounce::gpu::external::Imported;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::{Preset, SceneTraits};
use thirdbounce::session::{ExternalCounts, ExternalFrame, Format, Session, SessionOptions};
use thirdbounce::surface::Follow;
use thirdbounce::{Kind, Result};

use crate::session::{bits, frames, scan, surface};

/// A scan of photon counts, and two frames of it.
fn photons(bin_width: f64) -> (Capture, [Vec<f32>; 2]) {
    let scan = changed(&scan(12, bin_width), |c| c.integer_counts = true);
    let frames = frames(&scan).map(|counts| counts.iter().map(|v| v.round()).collect());
    (scan, frames)
}

fn lending() -> SessionOptions {
    SessionOptions { external: true, ..SessionOptions::default() }
}

/// Solves counts from the host.
fn of_host(session: &mut Session, counts: &[f32]) -> Reconstruction {
    session.submit(counts).unwrap();
    session.wait().unwrap().result.clone()
}

/// Solves an external frame that is there, without semaphores.
fn of_lent(
    session: &mut Session,
    counts: &fixtures::caller::Mapped<'_>,
    format: Format,
) -> Result<Reconstruction> {
    let counts = ExternalCounts { counts: counts.lend(), format, after: None, taken: None };
    session.submit_external(ExternalFrame { counts, maps: None, done: None })?;
    session.wait().map(|frame| frame.result.clone())
}

#[test]
fn a_callers_device_gives_the_bits_of_an_own_one() {
    let (scan, [counts, _]) = photons(0.03);
    let own = Gpu::open(&GpuOptions::vulkan()).unwrap();
    let want = bits(&of_host(
        &mut Session::new(&own, &scan, None, &surface(|_| ()), SessionOptions::default()).unwrap(),
        &counts,
    ));
    let caller = Caller::new();
    let blocks = Arc::new(Blocks::new(&caller));
    for with_blocks in [false, true] {
        let mut vulkan = caller.vulkan();
        if with_blocks {
            vulkan.blocks = Some(blocks.clone());
        }
        // SAFETY: the caller lives longer.
        let gpu = unsafe { Gpu::of_external(&vulkan) }.unwrap();
        let mut session =
            Session::new(&gpu, &scan, None, &surface(|_| ()), SessionOptions::default()).unwrap();
        let before = caller.lock.taken();
        assert_eq!(bits(&of_host(&mut session, &counts)), want);
        assert!(caller.lock.taken() > before, "submissions take the caller's lock");
        let [out, all] = [0, 1].map(|i| blocks.count[i].load(Relaxed));
        assert_eq!((out > 20, all > 20), (with_blocks, with_blocks), "{out} of {all} blocks");
    }
    assert_eq!(blocks.count[0].load(Relaxed), 0, "all blocks are given back");
    assert_eq!(caller.messages(), Vec::<String>::new());
}

#[test]
fn lent_counts_give_the_bits_of_counts_on_the_host() {
    let paper: SolverOptions = PaperOptions::preset(Preset::Synthetic)
        .with(|o| (o.lateral, o.iterations, o.accumulation) = (16, 12, Accumulation::Repeatable))
        .into();
    let (photons_of, not_photons) = (photons(0.03), changed(&photons(0.03).0, |c| c.integer_counts = false));
    let lct = SolverOptions::defaults_for("lct", &SceneTraits::of(&photons_of.0)).unwrap().with_lateral(16);
    let bp = SolverOptions::defaults_for("bp", &SceneTraits::of(&photons_of.0)).unwrap().with_lateral(16);
    // Of the narrowest bins, four are one for the solver.
    let narrow = photons(0.005).0;
    for (solver, scan, sum) in [
        (surface(|_| ()), &photons_of.0, None),
        (surface(|_| ()), &narrow, None),
        (surface(|_| ()), &not_photons, Some(1)),
        (paper, &photons_of.0, None),
        (lct, &photons_of.0, None),
        (bp, &photons_of.0, None),
    ] {
        let caller = Caller::new();
        let gpu = caller.gpu();
        let frames: [Vec<f32>; 2] = frames(scan).map(|counts| counts.iter().map(|v| v.round()).collect());
        let mut session =
            Session::new(&gpu, scan, None, &solver, SessionOptions { sum, ..lending() }).unwrap();
        for (counts, format) in
            frames.iter().zip([Format::F32, Format::U16]).chain([(&frames[0], Format::U32)])
        {
            let want = bits(&of_host(&mut session, counts));
            let buffer = caller.buffer(format.bytes_of(counts.len()), false);
            match format {
                Format::F32 => buffer.write(bytemuck::cast_slice(counts)),
                Format::U32 => {
                    buffer.write(bytemuck::cast_slice(&counts.iter().map(|v| *v as u32).collect::<Vec<_>>()))
                }
                Format::U16 => {
                    buffer.write(bytemuck::cast_slice(&counts.iter().map(|v| *v as u16).collect::<Vec<_>>()))
                }
            }
            assert!(bits(&of_lent(&mut session, &buffer, format).unwrap()) == want, "{}", solver.name());
        }
        // Maps of every solver are written, too.
        let buffer = caller.buffer(frames[0].len() as u64 * 4, false);
        buffer.write(bytemuck::cast_slice(&frames[0]));
        let maps = caller.buffer(session.external_maps_bytes(), false);
        let counts = ExternalCounts { counts: buffer.lend(), format: Format::F32, after: None, taken: None };
        session.submit_external(ExternalFrame { counts, maps: Some(maps.lend()), done: None }).unwrap();
        let found = session.wait().unwrap().result.maps.clone();
        let words = maps.read(found.albedo.len());
        assert!(
            words.iter().zip(&found.albedo).all(|(a, b)| a.to_bits() == b.to_bits()),
            "{}",
            solver.name()
        );
        drop((buffer, maps, session, gpu));
        assert_eq!(caller.messages(), Vec::<String>::new());
    }
}

#[test]
fn moments_say_when_counts_are_there_and_when_they_and_the_maps_are_done() {
    let (scan, [counts, _]) = photons(0.03);
    let caller = Caller::new();
    let gpu = caller.gpu();
    let [after, taken, done] = [(); 3].map(|()| caller.semaphore());
    let mut session = Session::new(&gpu, &scan, None, &surface(|_| ()), lending()).unwrap();
    let buffer = caller.buffer(counts.len() as u64 * 4, false);
    let maps = caller.buffer(session.external_maps_bytes(), false);
    let frame = |value: u64| ExternalFrame {
        counts: ExternalCounts {
            counts: buffer.lend(),
            format: Format::F32,
            after: Some(moment(after, value)),
            taken: Some(moment(taken, value)),
        },
        maps: Some(maps.lend()),
        done: Some(moment(done, value)),
    };
    session.submit_external(frame(1)).unwrap();
    assert!(session.wait_for(Duration::from_millis(60)).unwrap().is_none(), "its counts are not there yet");
    assert_eq!([taken, done].map(|s| caller.value(s)), [0, 0]);
    buffer.write(bytemuck::cast_slice(&counts));
    caller.signal(after, 1);
    let found = session.wait().unwrap().result.maps.clone();
    assert_eq!([taken, done].map(|s| caller.reaches(s, 1)), [1, 1]);
    let n = found.albedo.len();
    let words = maps.read(7 * n);
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    assert!(same(&words[..n], &found.albedo) && same(&words[n..2 * n], &found.depth));
    assert!(same(&words[2 * n..5 * n], found.normal.as_flattened()));
    assert!(words[5 * n..6 * n].iter().zip(&found.mask).all(|(word, mask)| (*word == 1.0) == *mask));
    assert!(same(&words[6 * n..], found.depth_error.as_ref().unwrap()));
    // Frames cancelled while queued, and invalid ones, signal their points.
    session.submit_external(frame(2)).unwrap();
    std::thread::sleep(Duration::from_millis(30));
    session.cancel();
    assert_error(session.wait(), Kind::Cancelled, &["before its counts were there"]);
    assert_eq!([taken, done].map(|s| caller.reaches(s, 2)), [2, 2]);
    buffer.write(&vec![0; counts.len() * 4]);
    caller.signal(after, 3);
    session.submit_external(frame(3)).unwrap();
    assert_error(session.wait(), Kind::Input, &["no signal"]);
    assert_eq!([taken, done].map(|s| caller.reaches(s, 3)), [3, 3]);
    buffer.write(bytemuck::cast_slice(&[f32::NAN]));
    caller.signal(after, 4);
    session.submit_external(frame(4)).unwrap();
    assert_error(session.wait(), Kind::Input, &["pair 0", "bin 0", "NaN"]);
    // And the next one is solved.
    buffer.write(bytemuck::cast_slice(&counts));
    caller.signal(after, 5);
    session.submit_external(frame(5)).unwrap();
    assert_eq!(session.wait().unwrap().result.maps.depth.len(), n);
    assert_eq!([taken, done].map(|s| caller.reaches(s, 5)), [5, 5]);
    // So does a session that ends.
    session.submit_external(frame(6)).unwrap();
    drop(session);
    assert_eq!([taken, done].map(|s| caller.reaches(s, 6)), [6, 6]);
    for semaphore in [after, taken, done] {
        caller.destroy(semaphore);
    }
    drop((buffer, maps, gpu));
    assert_eq!(caller.messages(), Vec::<String>::new());
}

#[test]
fn lent_frames_follow_each_other() {
    let (scan, [first, other]) = photons(0.03);
    let caller = Caller::new();
    let gpu = caller.gpu();
    let taken = caller.semaphore();
    let options = SessionOptions { follow: Some(Follow::default()), ..lending() };
    let mut session = Session::new(&gpu, &scan, None, &surface(|o| o.iterations = 30), options).unwrap();
    let buffer = caller.buffer(first.len() as u64 * 4, false);
    // The same scene twice, then another one: the last begins cold, after a look at its counts.
    for (value, (counts, is_warm)) in (1..).zip([(&first, false), (&first, true), (&other, false)]) {
        buffer.write(bytemuck::cast_slice(counts));
        let counts = ExternalCounts {
            counts: buffer.lend(),
            format: Format::F32,
            after: None,
            taken: Some(moment(taken, value)),
        };
        session.submit_external(ExternalFrame { counts, maps: None, done: None }).unwrap();
        assert_eq!(session.wait().unwrap().result.is_warm, is_warm, "frame {value}");
        assert_eq!(caller.reaches(taken, value), value);
    }
    drop((session, buffer, gpu));
    caller.destroy(taken);
}

#[test]
fn memory_of_another_device_is_imported() {
    let (scan, [counts, _]) = photons(0.03);
    let other = Caller::new();
    assert!(other.requirements.features.external_memory_fd, "lavapipe shares memory");
    let shared = other.buffer(counts.len() as u64 * 4, true);
    shared.write(bytemuck::cast_slice(&counts));
    // The library's own device.
    let gpu = Gpu::open(&GpuOptions::vulkan()).unwrap();
    // SAFETY: the descriptor is of so much memory.
    let imported =
        unsafe { Imported::by_fd(&gpu, shared.fd(), [shared.memory_bytes, shared.bytes], None) }.unwrap();
    let mut session = Session::new(&gpu, &scan, None, &surface(|_| ()), lending()).unwrap();
    let want = of_host(&mut session, &counts);
    let external =
        ExternalCounts { counts: imported.lend().unwrap(), format: Format::F32, after: None, taken: None };
    let frame = ExternalFrame { counts: external, maps: None, done: None };
    // What is external keeps it.
    drop(imported);
    session.submit_external(frame.clone()).unwrap();
    assert!(bits(&session.wait().unwrap().result) == bits(&want));
    let elsewhere = Gpu::open(&GpuOptions::vulkan()).unwrap();
    let mut session = Session::new(&elsewhere, &scan, None, &surface(|_| ()), lending()).unwrap();
    assert_error(session.submit_external(frame), Kind::Options, &["another device"]);
}

#[test]
fn what_cannot_be_lent_is_refused() {
    let (scan, [counts, _]) = photons(0.03);
    let caller = Caller::new();
    let gpu = caller.gpu();
    let new = |scan: &Capture, options| Session::new(&gpu, scan, None, &surface(|_| ()), options);
    let buffer = caller.buffer(counts.len() as u64 * 4, false);
    let mut session = new(&scan, SessionOptions::default()).unwrap();
    assert_error(
        of_lent(&mut session, &buffer, Format::F32).map(|_| ()),
        Kind::Options,
        &["from the host only"],
    );
    let mut session = new(&scan, lending()).unwrap();
    assert_error(
        of_lent(&mut session, &buffer, Format::U16).map(|_| ()),
        Kind::Options,
        &["bytes of counts"],
    );
    // What a caller says of its device must hold.
    let mut vulkan = caller.vulkan();
    vulkan.enabled.timeline_semaphore = false;
    // SAFETY: the handles are the caller's, which lives.
    let refused = |vulkan: &_| unsafe { Gpu::of_external(vulkan) }.map(|_| ());
    assert_error(refused(&vulkan), Kind::Device, &["timeline semaphores"]);
    let mut vulkan = caller.vulkan();
    vulkan.family = 77;
    assert_error(refused(&vulkan), Kind::Device, &["queue families"]);
    vulkan.api_version = 1 << 22;
    assert_error(refused(&vulkan), Kind::Device, &["created for Vulkan 1.0"]);
}
