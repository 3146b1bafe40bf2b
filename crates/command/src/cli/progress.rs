//! Shows progress on stderr: a bar on a terminal, plain lines elsewhere.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use thirdbounce::engine::{Doing, Progress};
use thirdbounce::gpu::kernels_are_kept;
use thirdbounce::job::PREVIEW;
use thirdbounce_simulate::RenderProgress;

use super::interrupt;
use super::tables::{number, seconds};
use super::terminal::say;

/// Least time between two plain lines.
const EVERY: Duration = Duration::from_secs(2);

/// The bar of a terminal; `None` elsewhere, or if nothing is shown.
pub fn bar(quiet: bool, template: &str) -> Option<ProgressBar> {
    (!quiet && std::io::stderr().is_terminal()).then(|| {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar
    })
}

/// Share of a phase before which its rest is not forecast: the first steps also make kernels.
const FORECAST_FROM: f64 = 0.1;

/// The phase of a solve, and the largest share of it that was shown: the expected number of iterations may grow.
#[derive(Default)]
pub struct Phase {
    doing: Option<Doing>,
    share: f64,
    /// Whether no kernels are stored: the driver compiles them.
    compiles: bool,
}

impl Phase {
    /// A solve's progress as words that begin with the phase.
    pub fn state(&mut self, progress: &Progress) -> String {
        let p = &progress.point;
        if self.doing != Some(progress.doing) {
            *self = Phase { doing: Some(progress.doing), share: 0.0, ..*self };
        }
        self.share = self.share.max(p.iteration as f64 / progress.iterations.max(1) as f64).min(1.0);
        let left = match progress.remaining.filter(|s| *s >= 1.0) {
            Some(s) if self.share >= FORECAST_FROM => format!(", about {s:.0} s left"),
            _ if self.share < FORECAST_FROM && self.compiles => {
                ", kernels are compiled for the first time".into()
            }
            _ => String::new(),
        };
        match progress.doing {
            Doing::Preview => format!("preview: {PREVIEW} shows a first picture after {:.1} s", p.seconds),
            Doing::Trial => format!("estimates: {:.0} %{left}", (100.0 * self.share).floor()),
            Doing::Search => {
                format!(
                    "faults of the instrument: fit {} (--calibrate none leaves this search out)",
                    p.iteration
                )
            }
            Doing::Solve if is_closed_form(progress) => "closed form".into(),
            Doing::Solve if p.iteration == 0 => {
                format!("solve: first iteration of {}, {:.1} s", progress.iterations, p.seconds)
            }
            Doing::Solve => {
                let width = progress.iterations.to_string().len();
                format!(
                    "solve: iteration {:>width$}/{}  lateral {:<4} active {:>6.2} %  loss {:<8}  {:.1} s{left}",
                    p.iteration,
                    progress.iterations,
                    p.lateral,
                    100.0 * p.active_ratio,
                    number(p.loss),
                    p.seconds
                )
            }
        }
    }
}

/// Whether a method computes its result in one pass.
fn is_closed_form(progress: &Progress) -> bool {
    progress.iterations <= 1
}

/// Shows the progress of a solve: a line for each phase that is renewed, and one at its end.
pub struct Meter {
    bar: Option<ProgressBar>,
    quiet: bool,
    said: Option<Instant>,
    shown: Phase,
    /// The phase, its beginning, and its iterations: done, and of how many.
    phase: Option<(Doing, Instant, [usize; 2])>,
}

impl Meter {
    pub fn new(quiet: bool) -> Meter {
        let bar = bar(quiet, "{bar:16} {wide_msg} {elapsed}");
        Meter { bar, quiet, said: None, shown: Phase::default(), phase: None }
    }

    /// The meter of a run whose kernels are kept in this folder; the host compiles none.
    pub fn with_kernels(self, cache: Option<&Path>, is_host: bool) -> Meter {
        let compiles = !is_host && cache.is_some_and(|folder| !kernels_are_kept(folder));
        Meter { shown: Phase { compiles, ..self.shown }, ..self }
    }

    /// Shows a point of the trace. Cancels if Ctrl-C was pressed.
    pub fn hear(&mut self, progress: &Progress) -> ControlFlow<()> {
        let p = &progress.point;
        let state = self.shown.state(progress);
        if progress.doing == Doing::Preview {
            self.note(&state);
            return interrupt::asked();
        }
        if self.phase.is_none_or(|(doing, ..)| doing != progress.doing) {
            self.end_phase(true);
            self.phase = Some((progress.doing, Instant::now(), [0; 2]));
        }
        let reached = [p.iteration, progress.iterations];
        self.phase.iter_mut().for_each(|(.., done)| *done = reached);
        let is_last =
            progress.doing == Doing::Solve && !is_closed_form(progress) && p.iteration == progress.iterations;
        if let Some(bar) = &self.bar {
            bar.set_length(1000);
            bar.set_position((1000.0 * self.shown.share) as u64);
            bar.set_message(state);
        } else if !self.quiet && (is_last || self.said.is_none_or(|t| t.elapsed() >= EVERY)) {
            say(&state);
            self.said = Some(Instant::now());
        }
        interrupt::asked()
    }

    /// Writes a line that stays.
    fn note(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None if !self.quiet => say(line),
            None => {}
        }
    }

    fn end_phase(&mut self, is_whole: bool) {
        let Some((doing, since, [done, of])) = self.phase.take().filter(|_| is_whole) else { return };
        let took = seconds(since.elapsed().as_secs_f64());
        match doing {
            Doing::Preview => {}
            Doing::Trial => self.note(&format!("estimates done in {took}")),
            Doing::Search => self.note(&format!("faults of the instrument: searched for {took}")),
            Doing::Solve if of <= 1 => self.note(&format!("closed form done in {took}")),
            Doing::Solve if done < of => self.note(&format!(
                "solve done in {took}: converged at {done} of {of} iterations (the support is stable, or pairs held out improve no more)"
            )),
            Doing::Solve => self.note(&format!("solve done in {took}: all {of} iterations")),
        }
    }

    /// Ends the last phase, which `is_whole` unless the solve failed.
    pub fn end(&mut self, is_whole: bool) {
        self.end_phase(is_whole);
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

/// Shows the progress of a rendering.
pub struct RenderingProgress {
    bar: Option<ProgressBar>,
    quiet: bool,
    place: String,
    /// When something was shown, which begins with the rendering: quick ones show nothing.
    said: Mutex<Instant>,
    begun: Instant,
}

impl RenderingProgress {
    /// `place` precedes every line.
    pub fn new(quiet: bool, place: &str) -> RenderingProgress {
        let bar = bar(quiet, "{bar:16} {wide_msg} {elapsed}");
        RenderingProgress {
            bar,
            quiet,
            place: place.into(),
            said: Mutex::new(Instant::now()),
            begun: Instant::now(),
        }
    }

    pub fn hear(&self, progress: RenderProgress) {
        let RenderProgress { samples, done, of } = progress;
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let every = if self.bar.is_some() { EVERY / 10 } else { EVERY };
        if self.quiet || said.elapsed() < every {
            return;
        }
        *said = Instant::now();
        let left = self.begun.elapsed().as_secs_f64() * (of - done) as f64 / done as f64;
        let is_known = left >= 1.0 && done as f64 >= FORECAST_FROM * of as f64;
        let left = if is_known { format!(", about {left:.0} s left") } else { String::new() };
        let state = format!("{}rendered {done} of {of} pairs with {samples} samples{left}", self.place);
        match &self.bar {
            Some(bar) => {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
                bar.set_message(state);
            }
            None => say(&state),
        }
    }

    pub fn end(&self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

#[cfg(test)]
mod tests {
    use thirdbounce::engine::TracePoint;

    use super::*;

    #[test]
    fn the_rest_is_forecast_from_a_tenth_on_and_first_kernels_are_named_before() {
        let progress = |iteration| Progress {
            doing: Doing::Trial,
            point: TracePoint {
                iteration,
                seconds: 0.0,
                gpu_seconds: 0.0,
                lateral: 8,
                pairs: 1,
                active: 1,
                active_ratio: 1.0,
                loss: 1.0,
                data_loss: 1.0,
            },
            iterations: 100,
            remaining: Some(527.0),
            maps: None,
        };
        let mut kept = Phase::default();
        assert_eq!(kept.state(&progress(9)), "estimates: 9 %");
        assert_eq!(kept.state(&progress(10)), "estimates: 10 %, about 527 s left");
        let mut first = Phase { compiles: true, ..Phase::default() };
        assert_eq!(first.state(&progress(0)), "estimates: 0 %, kernels are compiled for the first time");
        assert_eq!(first.state(&progress(10)), "estimates: 10 %, about 527 s left");
    }
}
