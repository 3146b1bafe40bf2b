//! Running the built command.
#![allow(dead_code)]

use std::process::{Command, Output};

pub fn thirdbounce(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_thirdbounce")).args(arguments).output().expect("the binary runs")
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
pub fn succeed(arguments: &[&str]) -> String {
    let output = thirdbounce(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}\n{}", stderr(&output));
    stdout(&output)
}

/// Runs what must fail: with that code, one message that holds `words`, nothing on stdout, no panic.
#[track_caller]
pub fn fail(arguments: &[&str], code: i32, words: &str) {
    let output = thirdbounce(arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{text}");
    assert!(text.contains(words), "{arguments:?}: {words:?} is not in\n{text}");
    assert_eq!(text.matches("error:").count(), 1, "{arguments:?}\n{text}");
    assert!(!text.contains("panicked") && !text.contains("internal error"), "{text}");
    if code == 1 {
        let mend = text.lines().skip_while(|l| !l.starts_with("error:")).nth(1);
        assert!(mend.is_some_and(|l| l.starts_with("  ") && l.len() > 4), "no mend in\n{text}");
    }
    assert_eq!(stdout(&output), "");
}
