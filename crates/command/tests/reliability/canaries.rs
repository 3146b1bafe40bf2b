//! Whole solves of every kind with a canary behind every buffer, and two at once on one device.

use std::thread;

use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::Faults;
use thirdbounce::methods::{NoiseTerm, SolverOptions};
use thirdbounce::surface::Begin;

use super::Share;
use super::ledger::{Held, Row, holds};
use super::small::{bits, kinds, loaded, open, paper, solve, solvers, surface};

const ACCUMULATIONS: [Accumulation; 3] = [Accumulation::Fixed, Accumulation::Float, Accumulation::Owned];

/// Solves, and looks whether anything was written past an end.
fn guarded(solver: &SolverOptions, capture: &Capture) -> Held {
    let gpu = open(Faults { guard: true, ..Faults::default() }, false);
    let done = solve(&gpu, solver, capture, None).map_err(|e| e.to_string())?;
    let seen = gpu.take_guarded();
    // Those of the plan, the one that canaries are read through, and those of a closed form that came before.
    let buffers = done.plan.buffers.len() + 1;
    holds(seen.buffers >= buffers, || format!("{} canaries were looked at, not {buffers}", seen.buffers))?;
    holds(seen.overruns.is_empty(), || format!("written past the end: {:?}", seen.overruns)).map(|()| None)
}

pub fn rows(share: Share) -> Vec<Row> {
    let mut kinds_row = Row::new("both solvers, every kind of pairs, every accumulation path");
    let mut i = 0;
    for (kind, capture) in kinds() {
        for accumulation in ACCUMULATIONS {
            for (name, solver) in solvers(accumulation) {
                i += 1;
                if share.takes(i, i / 4) {
                    kinds_row.add(&format!("{name}, {kind}, {accumulation:?}"), guarded(&solver, &capture));
                }
            }
        }
    }
    let mut parts = Row::new("a pulse, spots, noise terms, little room, no doubling, a fixed support");
    for (what, solver, capture) in others() {
        parts.add(what, guarded(&solver, &capture));
    }
    vec![kinds_row, parts, at_once(share)]
}

/// Solves whose plans hold other buffers or other sizes.
fn others() -> Vec<(&'static str, SolverOptions, Capture)> {
    let plain = || loaded().capture;
    let of_spots = || {
        let mut capture = plain();
        (capture.laser_spot, capture.sensor_spot) = (Some(0.2), Some(0.1));
        capture
    };
    let of_pulse = || {
        let mut capture = plain();
        capture.pulse = Some(Pulse::gaussian(0.08).expect("a pulse"));
        capture
    };
    let paper = || paper(Accumulation::Auto);
    let surface = || surface(Accumulation::Auto);
    vec![
        ("paper, a pulse", paper().into(), of_pulse()),
        ("surface, a pulse", surface().into(), of_pulse()),
        ("paper, spots", paper().into(), of_spots()),
        ("surface, spots", surface().into(), of_spots()),
        ("paper, noise by histogram", paper().with(|o| o.noise.term = NoiseTerm::Histogram).into(), plain()),
        ("paper, no noise", paper().with(|o| o.noise.term = NoiseTerm::Off).into(), plain()),
        ("paper, little room", paper().with(|o| o.domain.room = Some(0.02)).into(), plain()),
        ("paper, no doubling", paper().with(|o| o.domain.coarse_to_fine = false).into(), plain()),
        ("surface, one point", surface().with(|o| o.points = Some(1)).into(), plain()),
        ("surface, from a plane", surface().with(|o| o.begin = Begin::Plane).into(), plain()),
        ("surface, fixed support", surface().with(|o| o.grow = false).into(), plain()),
    ]
}

/// Two threads solve on one device: each gives the bits that it gives alone, and the validation layer, which watches
/// threads, too, has nothing to say.
fn at_once(share: Share) -> Row {
    let _alone = fixtures::device::alone();
    let mut row = Row::new("two solves at once on one device: the bits of one after the other");
    for (i, (kind, capture)) in kinds().into_iter().enumerate() {
        if !share.takes(i, 0) && i > 0 {
            continue;
        }
        let case = || -> Held {
            let gpu = open(Faults::default(), true);
            let all = solvers(Accumulation::Fixed);
            let run = |solver: &SolverOptions| {
                solve(&gpu, solver, &capture, None).map(|done| bits(&done)).map_err(|e| e.to_string())
            };
            let alone: Vec<_> = all.iter().map(|(_, solver)| run(solver)).collect::<Result<_, _>>()?;
            for _ in 0..3 {
                let together: Vec<Result<_, String>> = thread::scope(|scope| {
                    let threads = all.each_ref().map(|(_, solver)| scope.spawn(|| run(solver)));
                    threads.map(|t| t.join().unwrap_or_else(|_| Err("it panicked".into()))).into()
                });
                let together: Vec<_> = together.into_iter().collect::<Result<_, _>>()?;
                holds(together == alone, || "other bits".into())?;
            }
            let messages = gpu.close();
            holds(messages.is_empty(), || messages.join("\n")).map(|()| None)
        };
        row.add(kind, case());
    }
    row
}
