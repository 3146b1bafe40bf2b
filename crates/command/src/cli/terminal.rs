//! What is written to stdout and stderr: it does nothing to a terminal.

use std::io::Write;

use thirdbounce::{Error, Result};

/// More digits in a row are counted, not shown.
const MOST_DIGITS: usize = 40;

/// Writes a line to stderr, names in it harmless and numbers of many digits short. A closed stderr is not an error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", brief(&harmless(line, false)));
}

/// Says what is wrong, with a place in front or none, and how to fix it. Lines of a hint, such as those of a program, stay.
pub fn say_error(place: &str, what: &str, hint: &str) {
    say(&format!("error: {place}{what}"));
    let _ = writeln!(std::io::stderr().lock(), "  {}", brief(&harmless(hint, true)));
}

/// Prints lines to stdout, names in them harmless. A closed stdout (`| head`) is not an error: the work itself is done.
pub fn print(text: &str) {
    let _ = writeln!(std::io::stdout().lock(), "{}", harmless(text.trim_end(), true));
}

/// The value as indented JSON.
pub fn json(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(value)
        .map_err(|e| Error::output(format!("cannot be written as JSON: {e}"), "please report this as a bug"))
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
