//! Every kernel against its float64 reference, and the gradients of the reference against finite differences, by the table of
//! cases in `crates/verify/src/cases.rs`. `THIRDBOUNCE_CASES=WORD` runs those whose name contains the word.

mod place;
mod plans;
mod reference;
mod wide;
mod widths;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use fixtures::device::{assert_valid, gpu, host};
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::Gpu;
use thirdbounce::transport::kernels::KERNELS;
use thirdbounce_kernels::{KERNELS as HOST, kernel_of};
use thirdbounce_verify::{Compared, How, KernelCase, cases};

/// What a case compared on an accumulation path.
type Done = (&'static str, Accumulation, Vec<Compared>);

/// Runs cases on two devices that `open` opens.
fn run<G: Deref<Target = Gpu>>(cases: &[KernelCase], open: impl Fn() -> G + Sync) -> Vec<(usize, Done)> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(vec![]));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let gpu = open();
                while let Some((i, case)) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, cases.get(i)?)))
                {
                    let begun = std::time::Instant::now();
                    for path in case.accumulations(&gpu.abilities()) {
                        let compared = case.run(&gpu, path).expect("a case runs");
                        done.lock().expect("no panic").push((i, (case.name, path, compared)));
                    }
                    println!("case {i} {}: {:.2} s", case.name, begun.elapsed().as_secs_f64());
                }
                assert_valid(&gpu);
            });
        }
    });
    done.into_inner().expect("no panic")
}

#[test]
fn kernels_compute_what_their_reference_computes() {
    compare(gpu, |name| !name.starts_with("limit_"));
}

#[test]
fn kernels_of_the_host_compute_what_their_reference_computes() {
    // Its network has code of its own (`src/learned/tensor.rs`), and one way to add up.
    let others = [
        "learned_",
        "limit_",
        "forward_",
        "residual_scan",
        "pulse_",
        "spot_",
        "residual_fixed",
        "residual_rows_fixed",
    ];
    compare(
        || Box::new(host()),
        |name| {
            !name.ends_with("_texels") && !others.iter().any(|other| name.starts_with(other))
                || name == "forward_owned"
        },
    );
}

/// Runs all cases on devices that `open` opens. They must run the modules that are `wanted`.
fn compare<G: Deref<Target = Gpu>>(open: impl Fn() -> G + Sync, wanted: impl Fn(&str) -> bool) {
    let word = std::env::var("THIRDBOUNCE_CASES").unwrap_or_default();
    let all: Vec<KernelCase> = cases().into_iter().filter(|case| case.name.contains(&word)).collect();
    println!("device {}", open().info.name);
    let (mut wrong, mut seen, mut worst) = (vec![], BTreeSet::new(), BTreeMap::<_, f64>::new());
    let mut fixed: BTreeMap<usize, BTreeSet<u64>> = BTreeMap::new();
    for (i, (name, path, compared)) in run(&all, open) {
        assert!(!compared.is_empty(), "{name} compares nothing");
        for c in &compared {
            seen.insert(c.module);
            let most = worst.entry((name, c.module, c.buffer)).or_default();
            *most = most.max(c.error);
            if !c.passed() {
                let m = &all[i].model;
                wrong.push(format!(
                    "{name} (case {i}, {:?} {:?}), {path:?}: {} {} {:e}",
                    m.wall.geometry, m.reflectance, c.module, c.buffer, c.error
                ));
            }
        }
        // Fixed point gives the same bits by 64-bit atomics and by pairs of 32-bit ones.
        if path.is_fixed() && all[i].how == How::Steps {
            let forward = compared.iter().find(|c| c.module.starts_with("forward")).expect("it renders");
            fixed.entry(i).or_default().insert(forward.bits);
        }
    }
    worst.iter().for_each(|(what, error)| println!("{what:?} {error:.1e}"));
    assert!(wrong.is_empty(), "{}\n{} wrong", wrong.join("\n"), wrong.len());
    assert!(fixed.values().all(|bits| bits.len() == 1), "fixed point depends on the atomics");
    if word.is_empty() {
        // `place.rs` compares places, whose ends have several cells.
        let held = KERNELS.iter().map(|k| k.name).filter(|name| wanted(name) && *name != "places");
        let missing: Vec<_> = held.filter(|name| !seen.contains(name)).collect();
        assert!(missing.is_empty(), "no case in crates/verify/src/cases.rs runs {missing:?}");
    }
}

/// The kernels of `glsl/` and those of the host have the same names, except for those that measure a device's limits.
#[test]
fn every_kernel_is_one_of_the_host() {
    let glsl = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let entries = std::fs::read_dir(glsl).expect("a folder of sources");
    let files = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned());
    let names = files.filter_map(|file| file.strip_suffix(".comp").map(String::from));
    let kernels: BTreeSet<String> = names.filter(|name| !name.starts_with("limit_")).collect();
    assert_eq!(kernels, HOST.iter().map(|row| row.name.to_string()).collect());
    let of = |module: &str| kernel_of(module).map(|row| row.name);
    assert_eq!(
        ["forward_product_float", "residual_rows_fixed", "limit_fma"].map(of),
        [Some("forward_product"), Some("residual_rows"), None]
    );
}
