//! Checkpoints: a solve that goes on from any of them gives the same bits, and every wrong one gives one clear error.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use thirdbounce::export::report::TraceEntry;
use thirdbounce::gpu::Faults;
use thirdbounce::job::state_file::{Kept, read, write};
use thirdbounce::job::{self, Input, Request, SolverOptions};
use thirdbounce::solve::{Accumulation, Checkpoint};
use thirdbounce::{Error, Kind};

use super::Share;
use super::ledger::{Held, Row, clear, holds};
use super::small::{bits, files, kinds, loaded, open, paper, solve, solvers, tree, vector};
use fixtures::keeping::solve_keeping;

pub fn rows(share: Share) -> Vec<Row> {
    vec![same_bits(share), same_files(), wrong_ones(), damaged(share)]
}

/// Solvers with options that change every part of a state.
fn all_sorts() -> Vec<(&'static str, SolverOptions)> {
    let repeatable = Accumulation::Repeatable;
    let published = paper(repeatable).with(|o| o.noise.term = thirdbounce::solve::NoiseTerm::Off);
    let narrow = paper(repeatable).with(|o| o.domain.room = Some(0.5));
    let stops = vector(repeatable).with(|o| {
        o.stop = true;
        o.iterations = 40;
    });
    vec![
        ("paper, noise term", paper(repeatable).into()),
        ("paper", published.into()),
        ("paper, room for a half", narrow.into()),
        ("vector", vector(repeatable).into()),
        ("vector, stops at the noise", stops.into()),
    ]
}

/// Goes on from the state after every iteration, on a device with poisoned memory: state that is missed would show.
fn same_bits(share: Share) -> Row {
    let mut row =
        Row::new("resumed after each iteration in turn: the bits of an unbroken run, trace and volume too");
    let poisoned = || open(Faults { poison: Some(0x7fc0_0000), ..Faults::default() }, false);
    let mut i = 0;
    for (k, (kind, capture)) in kinds().into_iter().enumerate().filter(|(k, _)| [0, 3, 4].contains(k)) {
        for (name, solver) in all_sorts() {
            // All solver settings on confocal pairs, the two main ones on the others.
            if k > 0 && name.contains(',') {
                continue;
            }
            let unbroken = solve(&poisoned(), &solver, &capture, None).expect("a solve of a small scene");
            let kept = solve_keeping(&poisoned(), &solver, &capture, 1, None);
            let (with_checkpoints, kept) = kept.expect("a solve that is kept");
            let unbroken = bits(&unbroken);
            let whole = holds(bits(&with_checkpoints) == unbroken, || "keeping changes bits".into());
            row.add(&format!("{name}, {kind}, kept"), whole.map(|()| None));
            assert!(kept.len() > 8, "{name}: {} states", kept.len());
            for state in kept {
                i += 1;
                if !share.takes(i, 0) {
                    continue;
                }
                let at = state.iteration;
                let case = || -> Held {
                    let resumed = solve_keeping(&poisoned(), &solver, &capture, 0, Some(state));
                    let (done, _) = resumed.map_err(|e| e.to_string())?;
                    holds(bits(&done) == unbroken, || "other bits".into()).map(|()| None)
                };
                row.add(&format!("{name}, {kind}, after {at}"), case());
            }
        }
    }
    row
}

/// Whole runs give the same files, including snapshots from before the checkpoint, and the same figures along the trace.
fn same_files() -> Row {
    let mut row = Row::new("a whole run resumed, with truth and snapshots: the same files, the same figures");
    for (name, solver) in solvers(Accumulation::Repeatable) {
        let case = || -> Held {
            let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
            let run = |out: &str, resume: Option<PathBuf>| {
                let request = Request {
                    truth: Some(files().truth()),
                    trace_every: Some(2),
                    snapshots: vec![3, 11],
                    checkpoint: Some(folder.path().join("state")),
                    checkpoint_every: 7,
                    resume,
                    ..Request::new(solver.clone(), folder.path().join(out))
                };
                job::run(&request, &loaded(), &mut |_| ControlFlow::Continue(())).map_err(|e| e.to_string())
            };
            let unbroken = run("unbroken", None)?;
            let resumed = run("resumed", Some(folder.path().join("state")))?;
            let told = |o: &job::Outcome| {
                let times = |e: &TraceEntry| TraceEntry { seconds: 0.0, gpu_seconds: None, ..e.clone() };
                o.report.trace.iter().map(times).collect::<Vec<_>>()
            };
            let figures = told(&unbroken);
            let early = |e: &TraceEntry| e.iteration < 7 && e.metrics.is_some();
            holds(figures.iter().any(early), || "no figures from before the checkpoint".into())?;
            holds(told(&resumed) == figures, || "another trace".into())?;
            let result = |out: &str| {
                let out = folder.path().join(out);
                let all = tree(&out)
                    .into_iter()
                    .map(|(p, b)| (p.strip_prefix(&out).unwrap_or(&p).to_path_buf(), b));
                all.filter(|(p, _)| !p.ends_with("report.json") && !p.ends_with("report.html"))
                    .collect::<Vec<_>>()
            };
            let whole = result("unbroken");
            holds(whole.len() == 24, || format!("{} files", whole.len()))?;
            holds(result("resumed") == whole, || "other files".into()).map(|()| None)
        };
        row.add(name, case());
    }
    row
}

fn a_state() -> (SolverOptions, Checkpoint) {
    let solver: SolverOptions = vector(Accumulation::Repeatable).into();
    let (_, kept) = solve_keeping(&open(Faults::default(), false), &solver, &loaded().capture, 7, None)
        .expect("a solve that is kept");
    (solver, kept.into_iter().next().expect("a state"))
}

fn refused(result: Result<impl Sized, Error>, kind: Kind, word: &str) -> Held {
    let error = result.err().ok_or("it was taken")?;
    holds(error.kind == kind, || format!("{:?}: {error}", error.kind))?;
    holds(error.to_string().contains(word), || format!("{word:?} is not in: {error}"))?;
    clear(&error)
}

/// States of other captures, options, grids.
fn wrong_ones() -> Row {
    let mut row = Row::new("a checkpoint of another capture, other options, another grid or version");
    let (solver, state) = a_state();
    let gpu = open(Faults::default(), false);
    let capture = loaded().capture;
    let mut case = |what: &str, solver: &SolverOptions, capture, state: Checkpoint, word: &str| {
        let resumed = solve_keeping(&gpu, solver, capture, 0, Some(state));
        row.add(what, refused(resumed, Kind::Options, word));
    };
    let SolverOptions::Vector(options) = &solver else { unreachable!("as made above") };
    let longer = options.clone().with(|o| o.iterations = 99).into();
    case("other iterations", &longer, &capture, state.clone(), "iterations");
    case("another solver", &paper(Accumulation::Repeatable).into(), &capture, state.clone(), "checkpoint");
    let finer = solver.with_lateral(24);
    case("another lateral", &finer, &capture, state.clone(), "lateral");
    let mut brighter = capture.clone();
    // The brightest bin, so that the scale changes with it.
    let peak = brighter.histograms.iter_mut().max_by(|a, b| a.total_cmp(b)).expect("bins");
    *peak *= 1.01;
    case("another capture", &solver, &brighter, state.clone(), "another capture");
    let gated = job::load(&Input {
        path: files().capture(),
        gate: Some(thirdbounce::capture::Gate::parse("0.9:1.9").expect("a gate")),
        ..Input::default()
    });
    let gated = gated.expect("it loads").capture;
    case("another gate", &solver, &gated, state.clone(), "checkpoint");
    let mut other = state.clone();
    other.identity.version = "0.0.0".into();
    case("another version", &solver, &capture, other, "0.0.0");
    let mut other = state;
    other.buffers.remove("raw");
    let resumed = solve_keeping(&gpu, &solver, &capture, 0, Some(other));
    row.add("a buffer is missing", refused(resumed, Kind::Input, "damaged"));
    row
}

/// Files that are cut short, changed, or of another kind.
fn damaged(share: Share) -> Row {
    let mut row = Row::new("a checkpoint file that is cut off, damaged or none");
    let (_, state) = a_state();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("state");
    let kept = Kept { state, along: Default::default(), snapshots: vec![], found: Default::default() };
    write(&path, &kept).expect("it is written");
    let whole =
        holds(read(&path).is_ok_and(|back| back == kept), || "it does not come back as it went".into());
    row.add("whole", whole.map(|()| None));
    let good = std::fs::read(&path).expect("it is there");
    let mut case = |what: String, bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a file");
        let held = refused(read(&path), Kind::Input, &path.display().to_string());
        row.add(&what, held);
    };
    for i in (0..200).filter(|i| share.takes(*i, 0)) {
        let at = i * good.len() / 200;
        case(format!("cut to {at} bytes"), &good[..at]);
        let mut flipped = good.clone();
        flipped[at] ^= 1 << (i % 8);
        case(format!("a bit of byte {at} flipped"), &flipped);
    }
    case("longer".into(), &[&good[..], b"more"].concat());
    for (what, place) in [("missing", folder.path().join("none")), ("a folder", folder.path().into())] {
        row.add(what, refused(read(&place), Kind::Input, &place.display().to_string()));
    }
    row.add("a capture", refused(read(Path::new(&files().capture())), Kind::Input, "not a checkpoint"));
    row
}
