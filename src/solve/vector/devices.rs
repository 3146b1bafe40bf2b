//! One solve on several devices: each takes a share of the pairs, and all of them the same steps.
//!
//! A thread drives each device through the whole solve, with the levels, voxels and schedules of a solve on one device.
//! The sums over pairs are added up where the schedules say so ([`crate::solve::together`]), so that all devices hold the
//! same volume to the bit. The first one tells progress, and gives the result.

use std::any::Any;
use std::ops::ControlFlow;
use std::thread;

use super::prepared::{Member, prepare_member};
use super::{Frames, VectorOptions, reconstruct};
use crate::advice::{Advice, advice};
use crate::gpu::{Exchange, Gpu, is_left};
use crate::solve::drive::{Beside, Progress, Watch};
use crate::solve::plan::Share;
use crate::solve::{Prepared, Problem, Reconstruction};
use crate::{Error, Kind, Result, panic_message};

/// Runs the solver on `gpus`, which share the pairs: devices of one kind and driver, or one device several times. Takes
/// the other arguments of [`reconstruct`]. The result is that of one device to rounding, and
/// its plan that of the first device's share.
///
/// # Errors
/// As [`reconstruct`]. Devices are not of one kind, pairs have spots or are fewer than the devices, counts lie in a
/// caller's buffer, or checkpoints are asked for. Where a device fails, all end, with its error.
pub fn reconstruct_on<'b, 'w: 'b>(
    gpus: &[Gpu],
    problem: &Problem<'_>,
    options: &VectorOptions,
    beside: impl Into<Beside<'b, 'w>>,
) -> Result<Reconstruction> {
    let beside = beside.into();
    match gpus {
        [one] => return reconstruct(one, problem, options, beside),
        [] => return Err(Error::options("no device is named for the solve", advice!["name one " Device])),
        _ => {}
    }
    options.check()?;
    problem.capture.check()?;
    check_same(gpus)?;
    let watch = taken(beside, gpus.len())?;
    let solve = |gpu: &Gpu, exchange: Exchange, watch: &mut Watch<'_>| {
        let share = Share { number: exchange.number(), of: gpus.len() };
        let own = Problem { with_volume: problem.with_volume && share.number == 0, ..*problem };
        let member = Member { share, exchange: Some(exchange) };
        prepare_member(gpu, &own, options, Frames::default(), Some(member))?.solve(own.capture, watch.into())
    };
    one_of(on_all(gpus, watch, solve))
}

/// What `solve` gives on each device, all at the same time: on the first one in this thread, with `watch`.
fn on_all<R: Send>(
    gpus: &[Gpu],
    watch: &mut Watch<'_>,
    solve: impl Fn(&Gpu, Exchange, &mut Watch<'_>) -> Result<R> + Sync,
) -> Vec<Result<R>> {
    let (solve, maps_every, maps_at) = (&solve, watch.maps_every, watch.maps_at);
    let mut members = gpus.iter().zip(Exchange::among(gpus.len()));
    let own = members.next();
    thread::scope(|scope| {
        let start = |(gpu, exchange): (_, Exchange)| {
            let named = thread::Builder::new().name(format!("device {}", exchange.number()));
            let follow = move || {
                // Maps are made where the first device makes them, so that blocks end there, too.
                let mut hear = |_: &Progress| ControlFlow::Continue(());
                solve(gpu, exchange, &mut Watch { hear: &mut hear, maps_every, maps_at })
            };
            named.spawn_scoped(scope, follow)
        };
        let others: Vec<_> = members.map(start).collect();
        let mut all: Vec<_> = own.into_iter().map(|(gpu, exchange)| solve(gpu, exchange, watch)).collect();
        all.extend(others.into_iter().map(|other| match other {
            Ok(other) => other.join().unwrap_or_else(|panic| Err(defect(&*panic))),
            Err(e) => Err(Error::device(
                format!("no thread can be started for a device ({e})"),
                advice!["end other programs, or name fewer devices with " Device],
            )),
        }));
        all
    })
}

fn defect(panic: &(dyn Any + Send)) -> Error {
    Error::device(
        format!("the solve stopped at a defect ({})", panic_message(panic).unwrap_or("no message")),
        "report the defect with the capture and the options",
    )
}

/// The result of the first device, or the error that ended all.
fn one_of(done: Vec<Result<Reconstruction>>) -> Result<Reconstruction> {
    let count = done.len();
    let mut first = None;
    let mut ended: Option<(usize, Error)> = None;
    for (i, done) in done.into_iter().enumerate() {
        match done {
            Ok(result) if i == 0 => first = Some(result),
            Ok(_) => {}
            // The others only say that one broke off.
            Err(e) if ended.as_ref().is_none_or(|(_, before)| is_left(before) && !is_left(&e)) => {
                ended = Some((i, e));
            }
            Err(_) => {}
        }
    }
    match (ended, first) {
        (None, Some(result)) => Ok(result),
        (Some((i, e)), _) if matches!(e.kind, Kind::Device | Kind::Memory) => {
            Err(e.at(format!("device {} of {count}", i + 1)))
        }
        (Some((_, e)), _) => Err(e),
        (None, None) => unreachable!("the first device has a result or an error"),
    }
}

/// All must round alike: each decides for itself which voxels stay active, and all must decide the same.
fn check_same(gpus: &[Gpu]) -> Result<()> {
    let of = |gpu: &Gpu| format!("{} ({})", gpu.info.name, gpu.info.driver);
    match gpus.windows(2).find(|two| of(&two[0]) != of(&two[1])) {
        Some(two) => Err(Error::options(
            format!("{} and {} are to share a solve, and they round differently", of(&two[0]), of(&two[1])),
            advice!["name devices of one kind and driver, or one " Device],
        )),
        None => Ok(()),
    }
}

/// The watch of a solve that nothing else accompanies.
fn taken<'b, 'w>(beside: Beside<'b, 'w>, devices: usize) -> Result<&'b mut Watch<'w>> {
    let refused = |what: &str, mend: Advice| {
        Err(Error::options(format!("{devices} devices are to share a solve, and {what}"), mend))
    };
    if beside.lent.is_some() {
        return refused("its counts lie in a buffer of one of them", advice!["name one " Device].into());
    }
    if beside.keep.is_some_and(|keep| keep.every > 0 || keep.from.is_some()) {
        return refused(
            "its state is to be saved or resumed, which is done on one",
            advice!["leave checkpoints and " Resume " out, or name one " Device].into(),
        );
    }
    Ok(beside.watch)
}
