//! Memory budgets, 32-bit indices and the size of bindings: a job beyond a limit is refused before anything is allocated,
//! and the advice of the error works.

use std::ops::ControlFlow;
use std::process::Command;

use thirdbounce::engine::{Accumulation, Plan, Problem};
use thirdbounce::gpu::{
    Abilities, Accumulations, Buffer, BufferPlan, DeviceKind, Faults, Limits, Memory, Place, check,
};
use thirdbounce::job::Request;
use thirdbounce::methods::{SolverOptions, paper};
use thirdbounce::transport::{Grid, Model, Reflectance, Volume, Wall};
use thirdbounce::{Error, Kind, Settings, job};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

use super::ledger::{Held, Row, clear, holds};
use super::small::{files, loaded, open, surface};

pub fn rows() -> Vec<Row> {
    vec![honoured(), advice(), claimed(), bound()]
}

/// Budgets around the need of a job: it stays within, or it is refused.
fn honoured() -> Row {
    let mut row =
        Row::new("--memory from 1 MiB to 64 MiB: taken by the device no more than that, or refused");
    let gpu = open(Faults::default(), false);
    let loaded = loaded();
    let mut ran = 0;
    for mebibytes in [1u64, 2, 4, 6, 8, 9, 10, 12, 16, 24, 32, 64] {
        for lateral in [12, 32] {
            let options = surface(Accumulation::Repeatable).with(|o| {
                o.lateral = lateral;
                o.iterations = 1;
            });
            let options = SolverOptions::from(options);
            let case = || -> Held {
                let grid = Settings::default().grid(&options, &loaded.capture).map_err(|e| e.to_string())?;
                let plan = options.plan(&Problem::new(&loaded.capture, grid), &gpu.abilities());
                let plan = plan.map_err(|e| e.to_string())?;
                match thirdbounce::gpu::Arena::new(&gpu, &plan.buffers, Some(mebibytes << 20)) {
                    Ok(arena) => {
                        let taken = arena.taken();
                        holds(taken <= mebibytes << 20, || format!("{taken} bytes are taken"))?;
                        holds(arena.bytes() <= taken, || "more in use than taken".into())?;
                        Ok(None)
                    }
                    Err(e) => {
                        holds(gpu.allocated() == 0, || "something stays allocated".into())?;
                        clear(&e)
                    }
                }
            };
            let held = case();
            ran += usize::from(matches!(held, Ok(None)));
            row.add(&format!("{mebibytes} MiB, lateral {lateral}"), held);
        }
    }
    assert!((4..22).contains(&ran), "{ran} ran: budgets should divide the jobs");
    row
}

/// Each option that an error suggests makes the run fit by itself.
fn advice() -> Row {
    let mut row = Row::new("each option that a refusal suggests makes the run fit");
    let capture = files().capture().display().to_string();
    let dense = files().folder().join("dense.npz");
    let scene = Scene { scan: 48, bin_width: 0.006, ..Scene::named("plane").expect("a built-in scene") };
    let rendering = simulate(&scene, &RenderOptions { noise: 0.5, ..RenderOptions::default() });
    thirdbounce::capture::write(&rendering.expect("a rendering").capture, &dense).expect("a capture");
    let dense = dense.display().to_string();
    let run = |more: &[&str]| {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("r").display().to_string();
        // Without trials: these have plans of their own, which a budget may leave out.
        let base = ["reconstruct", "--out", &out, "--iterations", "1", "--model", "cosine", "--quiet"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
        let done = command.args(base).args(more).output().expect("it runs");
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let cases: [&[&str]; 4] = [
        &[&capture, "--lateral", "256", "--memory", "24M"],
        &[&capture, "--lateral", "96", "--memory", "24M", "--solver", "paper"],
        &[&capture, "--lateral", "256", "--memory", "8M"],
        // What is large in this one is its pairs.
        &[&dense, "--lateral", "16", "--memory", "16M", "--bins", "native", "--begin", "plane"],
    ];
    let mut suggested = 0;
    for case in cases {
        let (code, text) = run(case);
        let hint = text.lines().nth(1).unwrap_or("").trim().to_string();
        let options: Vec<(String, String)> = hint
            .split_once("this would fit: ")
            .map_or("", |m| m.1)
            .split([',', ';'])
            .filter_map(|s| s.trim().trim_start_matches("or ").split_once(' '))
            .filter(|(name, value)| name.starts_with("--") && value.chars().any(|c| c.is_ascii_digit()))
            .map(|(name, value)| (name.to_string(), value.to_string()))
            .collect();
        let refused = holds(code == Some(1) && !options.is_empty(), || format!("{code:?}: {text}"));
        let what = text.lines().next().unwrap_or("").trim_start_matches("error: ").to_string();
        row.add(&format!("{case:?}"), refused.map(|()| Some((what, hint))));
        for (name, value) in options {
            suggested += 1;
            let mut all: Vec<&str> = case.to_vec();
            match all.iter().position(|a| *a == name) {
                Some(at) => all[at + 1] = &value,
                None => all.extend([name.as_str(), value.as_str()]),
            }
            let (code, text) = run(&all);
            row.add(
                &format!("{all:?}"),
                holds(code == Some(0), || format!("{code:?}: {text}")).map(|()| None),
            );
        }
    }
    assert!(suggested >= 4, "only {suggested} options were suggested");
    row
}

fn abilities(limits: Limits) -> Abilities {
    Abilities {
        kind: DeviceKind::Discrete,
        accumulations: Accumulations { float: true, int64: true },
        limits,
    }
}

const USUAL: Limits = Limits {
    storage_range: u32::MAX as u64,
    workgroup_invocations: 1024,
    shared_memory: 48 << 10,
    groups: [i32::MAX as u32, 65_535, 65_535],
    subgroup: 32,
    work: 1 << 30,
};

/// A model with that many pairs and bins, but without their histograms.
fn model(pairs: usize, bins: usize) -> Model {
    Model {
        elements: pairs * bins,
        wall: Wall::confocal(vec![glam::DVec3::ZERO; pairs]),
        bins,
        bin_width: 0.01,
        t_start: 0.3,
        measured: vec![],
        ..Model::new(&loaded().capture, Reflectance::Cosine, 10.0, true)
    }
}

/// Shapes at and beyond the limits of 32-bit indices; nothing is allocated.
fn claimed() -> Row {
    let mut row = Row::new("captures and grids at the limits of 32-bit indices and of one binding, claimed");
    let options = super::small::paper(Accumulation::Repeatable).with(|o| {
        o.general = true;
        o.domain.coarse_to_fine = false;
    });
    let grid = |lateral: usize, deep: f64| {
        let volume = Volume { min: glam::dvec3(-0.5, -0.5, 0.3), max: glam::dvec3(0.5, 0.5, 0.3 + deep) };
        Grid::new(volume, lateral, 0.001)
    };
    // (pairs, bins, lateral, layers), and whether a plan is made, whether it may be allocated where a binding holds
    // 4 GiB and where one holds 128 MiB, as Vulkan promises.
    let cases = [
        (1 << 10, 1 << 10, 64, 64.0, [true, true, true]),
        (1 << 15, 32_767, 64, 64.0, [true, false, false]),
        // Beyond 2^30 values.
        ((1 << 15) + 2, 32_767, 64, 64.0, [false; 3]),
        (1 << 14, 1 << 14, 64, 64.0, [true, true, false]),
        (16, 32_768, 64, 64.0, [false; 3]),
        (16, 100, 512, 512.0, [true, true, false]),
        (16, 100, 1024, 1022.0, [true, false, false]),
        (16, 100, 4096, 512.0, [false; 3]),
        (16, 100, 64, 40_000.0, [false; 3]),
    ];
    for (pairs, bins, lateral, layers, [planned, usual, least]) in cases {
        let plan = || -> Result<Plan, Error> {
            let grid = grid(lateral, layers * 0.001)?;
            paper::plan(&model(pairs, bins), grid, [lateral, lateral], &options, &abilities(USUAL), false)
        };
        let allowed = |range: u64| {
            plan().and_then(|p| check(&p.buffers, &Memory::of_card(range, [u64::MAX / 2; 2]), None))
        };
        let steps = [plan().map(drop), allowed(USUAL.storage_range), allowed(128 << 20)];
        for (at, (step, want)) in steps.into_iter().zip([planned, usual, least]).enumerate() {
            let case = || -> Held {
                match (step, want) {
                    (Ok(()), true) => Ok(None),
                    (Err(e), false) => {
                        holds(matches!(e.kind, Kind::Memory | Kind::Options), || {
                            format!("{:?}: {e}", e.kind)
                        })?;
                        clear(&e)
                    }
                    (Ok(()), false) => Err("it was let through".into()),
                    (Err(e), true) => Err(e.to_string()),
                }
            };
            let what = ["plan", "4 GiB binding", "128 MiB binding"][at];
            row.add(&format!("{pairs} pairs of {bins} bins, {lateral}² x {layers}: {what}"), case());
        }
    }
    row
}

/// Sums beyond 2^63 and buffers beyond a binding, on the real device, without allocating.
fn bound() -> Row {
    let mut row = Row::new("plans beyond the device's memory or its largest binding");
    let gpu = open(Faults::default(), false);
    let range = gpu.limits.storage_range;
    let one = |bytes: u64| vec![BufferPlan::new(Buffer::named("large"), bytes, Place::Device)];
    let many = vec![BufferPlan::new(Buffer::named("a"), 1 << 20, Place::Device); 4];
    let plans = [
        ("a byte beyond a binding", one(range + 1)),
        ("2^62 bytes", one(1 << 62)),
        (
            "more than there is",
            (0..=255)
                .map(|i| BufferPlan::new(Buffer::named("b").at(i), range.min(1 << 34), Place::Device))
                .collect(),
        ),
    ];
    for (what, plan) in plans {
        let case = || -> Held {
            let error = thirdbounce::gpu::Arena::new(&gpu, &plan, None).err().ok_or("it was let through")?;
            holds(error.kind == Kind::Memory && gpu.allocated() == 0, || error.to_string())?;
            clear(&error)
        };
        row.add(what, case());
    }
    let again = job::run(
        &Request::new(surface(Accumulation::Repeatable), tempfile::tempdir().expect("a folder").path()),
        &loaded(),
        &mut |_| ControlFlow::Continue(()),
    );
    row.add("a run afterwards", again.map(|_| None).map_err(|e| e.to_string()));
    row.add(
        "a plan that fits",
        check(&many, &gpu.memory(), Some(64 << 20)).map(|()| None).map_err(|e| e.to_string()),
    );
    row
}
