//! Every device call that may fail fails in turn.

use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::{Faults, Point};
use thirdbounce::{Kind, job};

use super::Share;
use super::ledger::{Held, Row, clear, holds};
use super::small::{bits, files, loaded, open, solve, solvers, tree};

fn what(point: Point) -> &'static str {
    match point {
        Point::Allocation => "memory refused",
        Point::Object => "kernel, set, pool or command buffer refused",
        Point::Submission => "device lost at a submission",
        Point::Wait => "device lost while computing",
    }
}

fn failing(point: Point, number: u64) -> Faults {
    Faults { fail: Some((point, number)), ..Faults::default() }
}

pub fn rows(share: Share) -> Vec<Row> {
    let _alone = fixtures::device::alone();
    let mut rows = vec![];
    let capture = loaded().capture;
    for (s, (name, solver)) in solvers(Accumulation::Repeatable).into_iter().enumerate() {
        // Counts how often each call comes. The other runs are compared with this one.
        let gpu = open(failing(Point::Allocation, u64::MAX), true);
        let sound = bits(&solve(&gpu, &solver, &capture, None).expect("a solve without faults"));
        for (p, point) in Point::ALL.into_iter().enumerate() {
            let count = gpu.reached(point);
            let mut row =
                Row::new(format!("{name}: {}, {count} times in a solve, each in turn", what(point)));
            assert!(count > 3, "{name} reaches {point:?} {count} times only");
            for number in (0..count).filter(|n| share.takes(*n as usize, 7 * p + 3 * s)) {
                let case = || -> Held {
                    let gpu = open(failing(point, number), true);
                    let Err(error) = solve(&gpu, &solver, &capture, None) else {
                        return Err("the fault was not noticed".into());
                    };
                    let lost = matches!(point, Point::Submission | Point::Wait);
                    let kind = if lost { Kind::Device } else { Kind::Memory };
                    holds(error.kind == kind, || format!("{:?}: {error}", error.kind))?;
                    holds(gpu.allocated() == 0, || format!("{} bytes stay allocated", gpu.allocated()))?;
                    // A lost device stays lost. Otherwise the same device must work again.
                    let again = if lost {
                        let second = solve(&gpu, &solver, &capture, None);
                        holds(second.is_err_and(|e| e.what.contains("lost")), || "it came back".into())?;
                        solve(&open(Faults::default(), false), &solver, &capture, None)
                    } else {
                        solve(&gpu, &solver, &capture, None)
                    };
                    let again = again.map_err(|e| format!("the next solve: {e}"))?;
                    holds(bits(&again) == sound, || "the next solve gives other bits".into())?;
                    let messages = gpu.close();
                    holds(messages.is_empty(), || format!("left behind: {}", messages.join("\n")))?;
                    clear(&error)
                };
                row.add(&format!("number {number}"), case());
            }
            rows.push(row);
        }
    }
    rows.push(whole_runs(share));
    rows
}

/// The first failure of each kind in whole runs with files: an older result stays as it was.
fn whole_runs(share: Share) -> Row {
    let mut row = Row::new("a whole run over an older result, any of these");
    let out = tempfile::tempdir().expect("a folder");
    let (_, solver) = solvers(Accumulation::Repeatable)[1].clone();
    let request = job::Request { truth: Some(files().truth()), ..job::Request::new(solver, out.path()) };
    let loaded = loaded();
    let mut hear = |_: &thirdbounce::engine::Progress| std::ops::ControlFlow::Continue(());
    job::run(&request, &loaded, &mut hear).expect("a run without faults");
    let before = tree(out.path());
    for (i, (point, number)) in Point::ALL.into_iter().flat_map(|p| (0..14).map(move |n| (p, n))).enumerate()
    {
        if !share.takes(i, 5) {
            continue;
        }
        let request = job::Request { faults: failing(point, number), ..request.clone() };
        let mut case = || -> Held {
            let error = job::run(&request, &loaded, &mut hear).err().ok_or("the fault was not noticed")?;
            holds(tree(out.path()) == before, || "the older result changed".into())?;
            clear(&error)
        };
        row.add(&format!("{point:?} {number}"), case());
    }
    row
}
