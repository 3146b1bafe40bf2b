//! Two things that may differ between runs change no result: the first content of memory and the order of workgroups.

use thirdbounce::engine::{Accumulation, Reconstruction};
use thirdbounce::gpu::Faults;
use thirdbounce::methods::SolverOptions;

use super::Share;
use super::ledger::{Held, Row, holds};
use super::small::{bits, kinds, open, solve, solvers};

/// NaN, all bits, one, a large integer.
const POISON: [u32; 4] = [0x7fc0_0000, 0xffff_ffff, 0x3f80_0000, 0x7f00_00ff];

pub fn rows(share: Share) -> Vec<Row> {
    let poison = |word| Faults { poison: Some(word), ..Faults::default() };
    let shuffle = |seed| Faults { shuffle: Some(seed), poison: Some(POISON[0]), ..Faults::default() };
    let cases: Vec<(&str, Vec<Faults>)> = vec![
        ("fresh memory full of NaN, ones or other words", POISON.map(poison).into()),
        ("workgroups in another order", vec![shuffle(1), shuffle(2)]),
        ("run again", vec![Faults::default(); 2]),
    ];
    let mut rows: Vec<Row> =
        cases.iter().map(|(what, _)| Row::new(format!("--deterministic, {what}: the same bits"))).collect();
    let mut drift = Row::new("without --deterministic, run again: the same to rounding");
    let mut i = 0;
    for (kind, capture) in kinds() {
        let repeatable = [Accumulation::Fixed, Accumulation::Owned];
        for (name, solver) in repeatable.into_iter().flat_map(solvers) {
            i += 1;
            if !share.takes(i, 0) {
                continue;
            }
            let sound = solve(&open(Faults::default(), false), &solver, &capture, None);
            let sound = bits(&sound.expect("a solve of a small scene"));
            for ((_, all), row) in cases.iter().zip(&mut rows) {
                for faults in all {
                    let case = || -> Held {
                        let done = solve(&open(*faults, false), &solver, &capture, None);
                        let done = done.map_err(|e| e.to_string())?;
                        holds(bits(&done) == sound, || "other bits".into()).map(|()| None)
                    };
                    row.add(&format!("{name}, {kind}, {faults:x?}"), case());
                }
            }
            // Rounding may change which round of the support is the best.
            let other = match solver.clone().with_accumulation(Accumulation::Auto) {
                SolverOptions::Surface(o) => o.with(|o| o.grow = false).into(),
                paper => paper,
            };
            let case = || -> Held {
                let gpu = open(Faults::default(), false);
                let run = || solve(&gpu, &other, &capture, None).map_err(|e| e.to_string());
                near(&run()?, &run()?).map(|()| None)
            };
            drift.add(&format!("{name}, {kind}"), case());
        }
    }
    rows.push(drift);
    rows
}

/// The loss agrees to a thousandth throughout: fp32 sums in another order, fed back through a dozen iterations.
fn near(a: &Reconstruction, b: &Reconstruction) -> Result<(), String> {
    holds(a.trace.len() == b.trace.len(), || "traces of other lengths".into())?;
    for (p, q) in a.trace.iter().zip(&b.trace) {
        let difference = (p.loss - q.loss).abs() / p.loss.abs().max(1e-12);
        holds(difference < 1e-3, || format!("the loss differs by {difference:.1e} at {}", p.iteration))?;
    }
    Ok(())
}
