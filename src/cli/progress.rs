//! Shows progress on stderr: a bar on a terminal, plain lines elsewhere.

use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use thirdbounce::job::PREVIEW;
use thirdbounce::solve::{Doing, Progress};

use super::tables::number;

/// Least time between two plain lines.
const EVERY: Duration = Duration::from_secs(2);

/// More digits in a row are counted, not shown.
const MOST_DIGITS: usize = 40;

/// Writes a line to stderr, names in it harmless and numbers of many digits short. A closed stderr is not an error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", brief(&harmless(line, false)));
}

/// Says what is wrong, with a place in front or none, and how to mend it.
pub fn say_error(place: &str, what: &str, mend: &str) {
    say(&format!("error: {place}{what}"));
    say(&format!("  {mend}"));
}

/// The text without what moves a terminal's cursor, sets its colours or turns the direction of writing: any name may hold such
/// characters. They are shown as in JSON, which so stays whole. The ends of `lines` stay.
pub fn harmless(text: &str, lines: bool) -> String {
    let harms = |c: char| {
        (c.is_control() && !(lines && c == '\n'))
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if harms(c) { format!("\\u{:04x}", u32::from(c)) } else { c.into() }).collect()
}

fn brief(text: &str) -> String {
    let runs = text.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit());
    let short = |run: &[u8]| match String::from_utf8_lossy(run) {
        digits if run[0].is_ascii_digit() && run.len() > MOST_DIGITS => {
            format!("{}… ({} digits)", &digits[..12], run.len())
        }
        text => text.into(),
    };
    runs.map(short).collect()
}

/// Shows the progress of a solve.
pub struct Meter {
    bar: Option<ProgressBar>,
    quiet: bool,
    said: Option<Instant>,
}

impl Meter {
    pub fn new(quiet: bool) -> Meter {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template("{bar:16} {pos}/{len}  {wide_msg} {elapsed}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Meter { bar, quiet, said: None }
    }

    /// Shows a point of the trace. Cancels if Ctrl-C was pressed.
    pub fn hear(&mut self, progress: &Progress) -> ControlFlow<()> {
        let p = &progress.point;
        match progress.doing {
            Doing::Preview => self.note(&format!("{PREVIEW} shows a first picture after {:.1} s", p.seconds)),
            Doing::Trial => {
                self.bar.iter().for_each(|bar| bar.set_message("trying models and pulses"));
            }
            Doing::Solve => self.show(progress),
        }
        super::interrupt::asked()
    }

    /// Writes a line that stays.
    fn note(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None if !self.quiet => say(line),
            None => {}
        }
    }

    fn show(&mut self, progress: &Progress) {
        let p = &progress.point;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_does_nothing_to_a_terminal_and_is_short() {
        assert_eq!(
            harmless("a\u{1b}[31m\u{9b}\n\u{202e}é🦀\t", false),
            "a\\u001b[31m\\u009b\\u000a\\u202eé🦀\\u0009"
        );
        assert_eq!(harmless("two\nlines\r", true), "two\nlines\\u000d");
        let json = serde_json::to_string("\u{7f}\u{9b}\u{1b}").unwrap();
        assert_eq!(serde_json::from_str::<String>(&harmless(&json, true)).unwrap(), "\u{7f}\u{9b}\u{1b}");
        assert_eq!(brief(&format!("--peak is {}é", 1e299)), "--peak is 100000000000… (300 digits)é");
        let whole = format!("{} of 0x{}", u64::MAX, "7".repeat(40));
        assert_eq!(brief(&whole), whole);
    }
}
