//! The validation layer with synchronisation checks has no message for whole solves, profiles and checks.

use std::ops::ControlFlow;

use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::job::{self, Request};
use thirdbounce::settings::Settings;
use thirdbounce_command::profile::{self, ProfileRequest, check};

use super::Share;
use super::ledger::{Held, Row, holds};
use super::small::{files, kinds, open, solve, solvers};

fn silent(messages: Vec<String>) -> Held {
    holds(messages.is_empty(), || messages.join("\n")).map(|()| None)
}

pub fn rows(share: Share) -> Vec<Row> {
    let _alone = fixtures::device::alone();
    let mut solves = Row::new("both solvers, every kind of pairs, every accumulation path");
    let mut i = 0;
    for (kind, capture) in kinds() {
        for accumulation in [Accumulation::Fixed, Accumulation::Float, Accumulation::Owned] {
            for (name, solver) in solvers(accumulation) {
                i += 1;
                if !share.takes(i, i / 4) {
                    continue;
                }
                let case = || -> Held {
                    let gpu = open(Faults::default(), true);
                    solve(&gpu, &solver, &capture, None).map_err(|e| e.to_string())?;
                    silent(gpu.close())
                };
                solves.add(&format!("{name}, {kind}, {accumulation:?}"), case());
            }
        }
    }
    let mut runs = Row::new("whole runs with truth, volume, kernel times; gates");
    let gates = [None, Some("0.8:1.6"), Some(":1.9"), Some("1:")];
    for (g, gate) in gates.into_iter().enumerate() {
        for (s, (name, solver)) in solvers(Accumulation::Auto).into_iter().enumerate() {
            if !share.takes(2 * g + s, 1) {
                continue;
            }
            let case = || -> Held {
                let out = tempfile::tempdir().map_err(|e| e.to_string())?;
                let gate =
                    gate.map(thirdbounce::capture::Gate::parse).transpose().map_err(|e| e.to_string())?;
                let loaded = job::load(&files().capture(), &Settings { gate, ..Settings::default() });
                let request = Request {
                    validation: true,
                    timings: true,
                    truth: Some(files().truth()),
                    volume_file: Some(out.path().join("volume.npz")),
                    ..Request::new(solver, out.path().join("result"))
                };
                let loaded = loaded.map_err(|e| e.to_string())?;
                let done = job::run(&request, &loaded, &mut |_| ControlFlow::Continue(()));
                silent(done.map_err(|e| e.to_string())?.validation)
            };
            runs.add(&format!("{name}, {gate:?}"), case());
        }
    }
    vec![solves, runs, verbs(share), ways()]
}

/// The work of `profile` and `profile --check`.
fn verbs(share: Share) -> Row {
    let mut row = Row::new("profile, profile --check");
    let loaded = super::small::loaded();
    for (i, (name, solver)) in solvers(Accumulation::Auto).into_iter().enumerate() {
        if !share.takes(4 * i, 0) {
            continue;
        }
        let case = || -> Held {
            let request = Request { validation: true, ..Request::new(solver, "") };
            let what = ProfileRequest { request, json: None, trace: None, out: None };
            let done = profile::profile(&what, &loaded, &mut |_| {}, &mut |_| ControlFlow::Continue(()));
            silent(done.map_err(|e| e.to_string())?.validation)
        };
        row.add(&format!("profile {name}"), case());
    }
    let case = || -> Held {
        let gpu = open(Faults::default(), true);
        check::check(&gpu).map_err(|e| e.to_string())?;
        silent(gpu.close())
    };
    row.add("profile --check", case());
    row
}

/// Solves that are cancelled, poisoned, shuffled. And the layer is present and does report a planted mistake.
fn ways() -> Row {
    let mut row = Row::new("cancelled, poisoned, shuffled");
    let capture = super::small::loaded().capture;
    for (name, solver) in solvers(Accumulation::Fixed) {
        let mut case = |what: &str, faults: Faults, run: &dyn Fn(&Gpu) -> Result<(), String>| {
            let gpu =
                Gpu::open(&GpuOptions { validation: true, timings: true, faults, ..GpuOptions::default() });
            let held = gpu.map_err(|e| e.to_string()).and_then(|gpu| {
                run(&gpu)?;
                silent(gpu.close())
            });
            row.add(&format!("{name}, {what}"), held);
        };
        let plain = |gpu: &Gpu| solve(gpu, &solver, &capture, None).map(drop).map_err(|e| e.to_string());
        case("cancelled", Faults::default(), &|gpu| {
            holds(solve(gpu, &solver, &capture, Some(0)).is_err(), || "it was not cancelled".into())
        });
        case("poisoned", Faults { poison: Some(u32::MAX), ..Faults::default() }, &plain);
        case("shuffled", Faults { shuffle: Some(9), ..Faults::default() }, &plain);
    }
    row
}
