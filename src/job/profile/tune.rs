//! Finds the fastest sizes of workgroups, chunks and columns for a device and a kind of scene, and keeps them.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::super::sizes::{class_of, keep};
use super::super::{Loaded, Request, reconstruct};
use crate::gpu::DeviceKind;
use crate::settings::{ImpulseResponse, Model, Settings};
use crate::solve::Ready;
use crate::solve::option::OptionValue;
use crate::solve::{Method, Problem, Sizes, pass_of};
use crate::{Kind, Result};

/// One trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// The sizes of this trial.
    pub sizes: Sizes,
    /// Device seconds of all forward passes.
    pub forward_s: f64,
    /// Device seconds of all backward passes.
    pub backward_s: f64,
}

/// The result of tuning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tuned {
    /// Device, driver, solver, pairs and reflectance that it is for.
    pub class: String,
    /// All trials. The first has the default sizes of the device's kind.
    pub tried: Vec<Tried>,
    /// The fastest sizes.
    pub best: Sizes,
    /// Seconds of both passes with the best sizes, over those with the default sizes.
    pub ratio: f64,
    /// The file that keeps the best sizes; `None` if no cache folder is known, or if the default sizes are best.
    pub file: Option<PathBuf>,
}

/// Other sizes are taken if the time of a pass falls below this share.
const WORTH: f64 = 0.95;

/// Changes one size after the other, each time starting from the best sizes so far: first the sizes of the forward
/// pass, then those of the backward pass. The best sizes are kept for later runs of the class. `say` is called with a
/// line for every trial.
///
/// # Errors
/// Those of [`super::profile`], and a cache that cannot be written.
pub fn tune(request: &Request, loaded: &Loaded, say: &mut dyn FnMut(&str)) -> Result<Tuned> {
    request.settings.check()?;
    let mut resolved = request.resolved(&loaded.capture);
    // No fits before each profile: the sizes do not depend on estimates.
    resolved.solver.set("high_pass", &OptionValue::Number(0.0));
    let mut request = Request { timings: true, tuned: false, ..request.clone() };
    request.settings.model = Some(Model::Known(resolved.solver.common().reflectance));
    request.settings.pulse.get_or_insert(ImpulseResponse::None);
    let Ready { capture, grid, .. } = resolved.ready(Cow::Borrowed(&loaded.capture))?;
    let gpu = request.open()?;
    super::check_clock(&gpu)?;
    let mut tried: Vec<Tried> = vec![];
    let mut seen = vec![];
    // None if the device does not take the sizes, or if they divide the work as earlier sizes did.
    let mut run = |sizes: Sizes, tried: &mut Vec<Tried>| -> Result<Option<Tried>> {
        let solver = resolved.solver.with_sizes(sizes);
        let settings = Settings { method: Method::of(&solver), ..request.settings.clone() };
        let request = Request { settings, ..request.clone() };
        match solver.plan(&Problem::new(&capture, grid), &gpu.abilities()) {
            Ok(plan) if seen.contains(&plan.division.tuning) => return Ok(None),
            Ok(plan) => seen.push(plan.division.tuning),
            Err(e) if e.kind == Kind::Options && !tried.is_empty() => return Ok(None),
            Err(e) => return Err(e),
        }
        // The best of three runs: the driver may still compile in the first.
        let mut best = Tried { sizes, forward_s: f64::INFINITY, backward_s: f64::INFINITY };
        for _ in 0..3 {
            let mut hear = |_: &_| ControlFlow::Continue(());
            let done = reconstruct::solve(&request, loaded, &gpu, None, None, &mut hear)?.result;
            let of = |begins: &str| {
                let of_pass = |k: &&(&str, _)| pass_of(k.0).is_some_and(|p| p.report.starts_with(begins));
                done.kernels.iter().filter(of_pass).map(|k| k.1.seconds).sum::<f64>()
            };
            best.forward_s = best.forward_s.min(of("forward"));
            best.backward_s = best.backward_s.min(of("backward"));
        }
        gpu.take_recording();
        say(&format!(
            "{:<52} forward {:.4} s, backward {:.4} s",
            if sizes.is_default() { "the default sizes".into() } else { sizes.to_string() },
            best.forward_s,
            best.backward_s
        ));
        tried.push(best.clone());
        Ok(Some(best))
    };
    let own = run(resolved.solver.common().sizes, &mut tried)?.expect("the default sizes always run");
    let (mut best, mut forward_s, mut backward_s) = (own.sizes, own.forward_s, own.backward_s);
    for (forward, set, values) in steps(gpu.info.kind) {
        for value in values {
            let mut sizes = best;
            set(&mut sizes, *value);
            let Some(now) = run(sizes, &mut tried)? else { continue };
            let (new, old) =
                if forward { (now.forward_s, &mut forward_s) } else { (now.backward_s, &mut backward_s) };
            if new < WORTH * *old {
                (*old, best) = (new, now.sizes);
            }
        }
    }
    let class = class_of(&gpu, &resolved.solver, &loaded.capture);
    let file = if best.is_default() { None } else { keep(&class, best)? };
    let ratio = (forward_s + backward_s) / (own.forward_s + own.backward_s).max(1e-12);
    Ok(Tuned { class, tried, best, ratio, file })
}

/// One size: whether the forward pass decides on it (else the backward pass), how to set it, and the values to try.
type Step = (bool, fn(&mut Sizes, u32), &'static [u32]);

fn steps(kind: DeviceKind) -> [Step; 5] {
    let cpu = kind == DeviceKind::Cpu;
    let of = |on_cpu: &'static [u32], elsewhere: &'static [u32]| if cpu { on_cpu } else { elsewhere };
    [
        (true, |s, v| s.chunk = Some(v), of(&[4096, 8192, 16384, 32768], &[64, 128, 512, 1024])),
        (true, |s, v| s.lanes = Some(v), of(&[4, 8, 16, 32], &[32, 64, 128, 256])),
        (true, |s, v| s.window = Some(v), of(&[], &[0, 16, 32, 64, 128])),
        (false, |s, v| s.voxels = Some(v), of(&[8, 16, 32, 128], &[4, 16, 32])),
        (false, |s, v| s.slices = Some(v), of(&[], &[4, 8, 16])),
    ]
}
