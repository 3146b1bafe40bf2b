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
    let mut number = 0;
    // Whole lines where they lie in the buffer.
    loop {
        let buffer = file.fill_buf().map_err(super::unreadable)?;
        if let Some(end) = buffer.iter().rposition(|b| *b == b'\n') {
            for line in buffer[..end].split(|b| *b == b'\n') {
                number += 1;
                take(line, number, true, &mut columns, inputs, passed, &mut hear)?;
            }
            file.consume(end + 1);
        }
        // What is left of the block begins a line, of which the next block has the end.
        let mut line = vec![];
        (&mut file).take(LONGEST).read_until(b'\n', &mut line).map_err(super::unreadable)?;
        if line.is_empty() {
            return Ok(());
        }
        number += 1;
        let whole = line.ends_with(b"\n") || line.len() as u64 == LONGEST;
        take(&line, number, whole, &mut columns, inputs, passed, &mut hear)?;
    }
}

/// Takes a line. `whole`: it has an end, or is longer than any.
fn take(
    line: &[u8],
    number: u64,
    whole: bool,
    columns: &mut Columns,
    inputs: &Inputs,
    passed: &mut Passed,
    hear: &mut impl FnMut(Record),
) -> Result<()> {
    let usual = (columns.channel, columns.time) == (0, 1);
    if let Some((channel, time)) = usual.then(|| plain(line)).flatten() {
        passed.records += 1;
        hear(inputs.record(channel, time));
        return Ok(());
    }
    let text = line.trim_ascii();
    if text.is_empty() || text[0] == b'#' {
        return Ok(());
    }
    match tag(text, columns) {
        Some((channel, time)) => {
            passed.records += 1;
            hear(inputs.record(channel, time));
        }
        None if passed.records == 0 && named(text, columns) => {}
        // The end of a file that is still written, or was cut.
        None if !whole => passed.notes.push(format!("line {number}, the last, is cut and left out")),
        None => {
            let shown: String = String::from_utf8_lossy(text).chars().take(60).collect();
            return Err(Error::input(
                format!("line {number} is no time tag: {shown:?}"),
                "write a line for each: channel, time in picoseconds; a first line may name the columns channel and time",
            ));
        }
    }
    Ok(())
}

/// The commonest line, in one pass: `digits,digits`.
fn plain(line: &[u8]) -> Option<(i32, i64)> {
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    if line.len() > 24 {
        return None;
    }
    let (mut channel, mut value, mut commas) = (0, 0i64, 0);
    for byte in line {
        match byte {
            b'0'..=b'9' => value = value.wrapping_mul(10).wrapping_add(i64::from(byte - b'0')),
            b',' if commas == 0 => {
                (channel, value, commas) = (value, 0, 1);
            }
            _ => return None,
        }
    }
    // A time of 18 digits at most: it fits.
    let digits = line.len() - line.iter().position(|b| *b == b',')? - 1;
    let fits = commas == 1 && (1..19).contains(&digits) && line[0] != b',';
    Some((i32::try_from(channel).ok()?, value)).filter(|_| fits)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Result<(Vec<Record>, Passed)> {
        let (mut heard, mut passed) = (vec![], Passed::default());
        let inputs = Inputs { sync: 0, markers: vec![7, -7] };
        read(text.as_bytes(), &inputs, &mut passed, |record| heard.push(record))?;
        Ok((heard, passed))
    }

    #[test]
    fn lines_are_tags() {
        let wanted = [
            Record::Sync { time: 10 },
            Record::Photon { channel: 1, time: 12, delay: 0 },
            Record::Marker { bits: 2, time: -13 },
        ];
        for text in [
            "0,10\n1,12\n-7,-13\n",
            "# made by hand\n\n0;10\r\n1; 12\r\n-7;-13",
            "index,Timestamp (ps),Channel\n".replace(" (ps)", "_ps").as_str(),
        ] {
            let rows = if text.starts_with("index") {
                format!("{text}0,10,0\n1,12.2,1\n2,-1.3e1,-7\n")
            } else {
                text.to_string()
            };
            assert_eq!(all(&rows).unwrap().0, wanted, "{rows}");
        }
        // Longer than a block, its last line cut or not.
        let long: String = (0..200_000).map(|i| format!("{},{}\n", 1 + i % 2, 1000 + i)).collect();
        for cut in [0, 1] {
            let (heard, passed) = all(&long[..long.len() - cut]).unwrap();
            assert!(heard.len() == 200_000 && passed.notes.is_empty());
            assert!(heard.iter().enumerate().all(|(i, record)| {
                *record == Record::Photon { channel: 1 + i as i32 % 2, time: 1000 + i as i64, delay: 0 }
            }));
        }
        for (line, wanted) in
            [("1,999999999999999999", Some(999_999_999_999_999_999)), ("1,9999999999999999999", None)]
        {
            assert_eq!(
                all(&format!("{line}\n")).ok().map(|(heard, _)| heard[0]),
                wanted.map(|time| { Record::Photon { channel: 1, time, delay: 0 } })
            );
        }
        let (heard, passed) = all("0,10\n1,12\n-7").unwrap();
        assert!(heard.len() == 2 && passed.notes[0].contains("line 3, the last, is cut"), "{passed:?}");
        for (text, words) in
            [("0,10\n1,x\n2,3\n", "line 2"), ("one,two\n0,1\n", "line 1"), ("0\n1\n", "line 1")]
        {
            assert!(all(text).unwrap_err().what.contains(words), "{text}");
        }
    }
}
