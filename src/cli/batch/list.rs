//! The captures of a batch: paths, patterns, and lists of both.

use std::io::Read;
use std::path::{Path, PathBuf};

use thirdbounce::{Error, Result};

/// The captures that the arguments name, in their order. A pattern that matches nothing stays a path: it fails by itself.
///
/// # Errors
/// A list that cannot be read; a pattern that is none.
pub fn captures(arguments: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = vec![];
    for argument in arguments {
        if argument.as_os_str() == "-" {
            let mut text = String::new();
            let read = std::io::stdin().read_to_string(&mut text);
            read.map_err(|e| {
                Error::input(format!("the list on stdin cannot be read: {e}"), "give it as text")
            })?;
            add_lines(&text, &mut all)?;
        } else if is_list(argument) {
            let text = std::fs::read_to_string(argument).map_err(|e| {
                Error::input(
                    format!("{}: the list cannot be read: {e}", argument.display()),
                    "check the path",
                )
            })?;
            add_lines(&text, &mut all)?;
        } else {
            add(argument, &mut all)?;
        }
    }
    if all.is_empty() {
        return Err(Error::input(
            "the batch has no captures",
            "give captures, a pattern, or a list with one a line",
        ));
    }
    Ok(all)
}

/// No capture format has this ending.
fn is_list(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("txt"))
}

/// One capture or pattern a line; paths are those of the current folder. Lines that begin with # are comments.
fn add_lines(text: &str, all: &mut Vec<PathBuf>) -> Result<()> {
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    lines.map(Path::new).try_for_each(|line| add(line, all))
}

fn add(path: &Path, all: &mut Vec<PathBuf>) -> Result<()> {
    let text = path.to_string_lossy();
    if path.exists() || !text.contains(['*', '?', '[']) {
        all.push(path.into());
        return Ok(());
    }
    let found = glob::glob(&text).map_err(|e| {
        Error::options(
            format!("{text}: the pattern is wrong: {e}"),
            "write it as a shell does: captures/*.npz",
        )
    })?;
    let before = all.len();
    all.extend(found.flatten());
    if all.len() == before {
        all.push(path.into());
    }
    Ok(())
}
