//! Time tags as text: a line for each, `channel, time in picoseconds`.
//!
//! Columns are separated by comma, semicolon, tab or spaces. A first line of words names them: one holds `channel`, one
//! `time`, in any order, and others are not read. Empty lines, and those that begin with `#`, are not read either.

use std::io::{BufRead, BufReader, Read};

use super::{BLOCK, Inputs, Passed, Record};
use crate::error::{Error, Result};

/// Places of the columns.
struct Columns {
    channel: usize,
    time: usize,
}

/// Longest line, bytes: beyond it a file is no text.
const LONGEST: u64 = 4096;

/// Calls `hear` with every line's tag.
pub(super) fn read(
    file: impl Read,
    inputs: &Inputs,
    passed: &mut Passed,
    mut hear: impl FnMut(Record),
) -> Result<()> {
    let mut file = BufReader::with_capacity(BLOCK, file);
    let mut columns = Columns { channel: 0, time: 1 };
    let mut line = vec![];
    for number in 1.. {
        line.clear();
        (&mut file).take(LONGEST).read_until(b'\n', &mut line).map_err(super::unreadable)?;
        if line.is_empty() {
            break;
        }
        let text = line.trim_ascii();
        if text.is_empty() || text[0] == b'#' {
            continue;
        }
        match tag(text, &columns) {
            Some((channel, time)) => {
                passed.records += 1;
                hear(inputs.record(channel, time));
            }
            None if passed.records == 0 && named(text, &mut columns) => {}
            // The end of a file that was cut.
            None if !line.ends_with(b"\n") && (line.len() as u64) < LONGEST => {
                passed.notes.push(format!("line {number}, the last, is cut and left out"));
            }
            None => {
                let shown: String = String::from_utf8_lossy(text).chars().take(60).collect();
                return Err(Error::input(
                    format!("line {number} is no time tag: {shown:?}"),
                    "write a line for each: channel, time in picoseconds; a first line may name the columns channel and time",
                ));
            }
        }
    }
    Ok(())
}

fn parts(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|b| matches!(b, b',' | b';' | b'\t' | b' ')).filter(|part| !part.is_empty())
}

fn tag(text: &[u8], columns: &Columns) -> Option<(i32, i64)> {
    let (mut channel, mut time) = (None, None);
    for (at, part) in parts(text).enumerate() {
        if at == columns.channel {
            channel = i32::try_from(whole(part)?).ok();
        } else if at == columns.time {
            time = whole(part);
        }
        if channel.is_some() && time.is_some() {
            break;
        }
    }
    Some((channel?, time?))
}

/// A whole number. One with a decimal point or an exponent is rounded.
fn whole(text: &[u8]) -> Option<i64> {
    let (sign, digits) = match text {
        [b'-', rest @ ..] => (-1, rest),
        [b'+', rest @ ..] => (1, rest),
        _ => (1, text),
    };
    if !digits.is_empty() && digits.len() < 19 && digits.iter().all(u8::is_ascii_digit) {
        return Some(sign * digits.iter().fold(0, |n, d| 10 * n + i64::from(d - b'0')));
    }
    let real: f64 = std::str::from_utf8(text).ok()?.parse().ok()?;
    (real.abs() < 1e18).then_some(real.round() as i64)
}

/// Takes the columns from a line of names.
fn named(text: &[u8], columns: &mut Columns) -> bool {
    let names: Vec<String> = parts(text).map(|p| String::from_utf8_lossy(p).to_lowercase()).collect();
    let place = |word: &str| names.iter().position(|name| name.contains(word));
    match (place("channel"), place("time")) {
        (Some(channel), Some(time)) if channel != time => {
            *columns = Columns { channel, time };
            true
        }
        _ => false,
    }
}
