//! Shows progress on stderr: a bar on a terminal, plain lines elsewhere.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use thirdbounce::job::PREVIEW;
use thirdbounce::solve::{Doing, Progress};

use super::interrupt;
use super::tables::number;
use super::terminal::say;

/// Least time between two plain lines.
const EVERY: Duration = Duration::from_secs(2);

/// Shows the progress of a solve.
pub struct Meter {
    bar: Option<ProgressBar>,
    quiet: bool,
    said: Option<Instant>,
    /// Short fits of estimates that began.
    fits: usize,
}

impl Meter {
    pub fn new(quiet: bool) -> Meter {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template("{bar:16} {pos}/{len}  {wide_msg} {elapsed}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Meter { bar, quiet, said: None, fits: 0 }
    }

    /// Shows a point of the trace. Cancels if Ctrl-C was pressed.
    pub fn hear(&mut self, progress: &Progress) -> ControlFlow<()> {
        let p = &progress.point;
        match progress.doing {
            Doing::Preview => self.note(&format!("{PREVIEW} shows a first picture after {:.1} s", p.seconds)),
            Doing::Trial => self.show_fit(p.iteration),
            Doing::Solve => self.show(progress),
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

    /// Shows the number of short fits: each begins with its first iteration.
    fn show_fit(&mut self, iteration: usize) {
        self.fits += usize::from(iteration <= 1 || self.fits == 0);
        let state = format!("estimates: short fit {}", self.fits);
        if let Some(bar) = &self.bar {
            bar.set_message(state);
        } else if !self.quiet && self.said.is_none_or(|t| t.elapsed() >= EVERY) {
            say(&state);
            self.said = Some(Instant::now());
        }
    }

    fn show(&mut self, progress: &Progress) {
        let p = &progress.point;
        // The closed form before a fit has no loss.
        if p.iteration == 0 && progress.iterations > 0 {
            return;
        }
        let left = progress
            .remaining
            .filter(|s| *s >= 1.0)
            .map_or_else(String::new, |s| format!(", about {s:.0} s left"));
        let last = p.iteration == progress.iterations;
        let state = format!(
            "lateral {:<4} active {:>6.2} %  loss {:<8}",
            p.lateral,
            100.0 * p.active_ratio,
            number(p.loss)
        );
        if let Some(bar) = &self.bar {
            bar.set_length(progress.iterations as u64);
            bar.set_position(p.iteration as u64);
            bar.set_message(state + left.trim_start_matches(','));
            if last {
                bar.finish();
            }
        } else if !self.quiet && (last || self.said.is_none_or(|t| t.elapsed() >= EVERY)) {
            let width = progress.iterations.to_string().len();
            say(&format!(
                "iteration {:>width$}/{}  {state}  {:.1} s{left}",
                p.iteration, progress.iterations, p.seconds
            ));
            self.said = Some(Instant::now());
        }
    }

    /// Ends the bar and leaves it on the screen, so that later output starts on a line of its own.
    pub fn end(&self) {
        if let Some(bar) = self.bar.as_ref().filter(|bar| !bar.is_finished()) {
            bar.abandon();
        }
    }
}
