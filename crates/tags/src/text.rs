//! Time tags as text: one line each, with a channel and a time.
//!
//! Columns are separated by commas, semicolons, tabs or spaces. A line of names, which may be a comment, selects the columns and the
//! unit of time (`time_ns`); columns without names are selected by their first values. Read are ASCII and UTF-16 with or without a
//! byte-order mark, quotes, decimal commas between semicolons or tabs, and every kind of line end.

use std::io::{BufRead, BufReader, Chain, Cursor, Read};

use super::{BLOCK, Inputs, Passed, Record};
use crate::advice::advice;
use crate::error::{Error, Result};

/// Columns of a text and the unit of its times.
#[derive(Debug, Clone, Copy)]
pub(super) struct TextColumns {
    /// A space stands for any number of them.
    separator: u8,
    channel: usize,
    time: usize,
    /// Whether a line of names comes before the first tag.
    named: bool,
    /// Times are 10^power ticks.
    power: i32,
    /// Whether the unit is an assumption.
    assumed: bool,
}

/// Longest line, bytes: beyond it a file is no text.
const LONGEST: u64 = 4096;
/// Bytes and lines from which the layout is found.
const SAMPLE: u64 = 1 << 18;
const ROWS: usize = 2000;
/// Most distinct values of a column of channels.
const MOST_CHANNELS: usize = 64;
/// Times of numbers with an exponent may be rounded to this many picoseconds.
const ROUNDED: f64 = 100.0;
/// A step of all times that is reported, picoseconds.
const COARSE: u64 = 50;

/// Units of time by their names at the end of a column's name, and their powers of ten in picoseconds.
const UNITS: [(&str, i32); 12] = [
    ("picoseconds", 0),
    ("nanoseconds", 3),
    ("microseconds", 6),
    ("milliseconds", 9),
    ("seconds", 12),
    ("ps", 0),
    ("ns", 3),
    ("us", 6),
    ("µs", 6),
    ("ms", 9),
    ("sec", 12),
    ("s", 12),
];

/// Returns the power of ten of a unit relative to picoseconds. `unit`: seconds. `None` unless the power is a multiple of 3 up to 12.
pub(super) fn power_of(unit: f64) -> Option<i32> {
    [0, 3, 6, 9, 12].into_iter().find(|power| (unit / 10f64.powi(power - 12) - 1.0).abs() < 1e-9)
}

/// Text as ASCII with line feeds: without byte-order mark, one byte of each character of UTF-16, LF for CR and CR LF.
pub(super) struct Plain<R> {
    inner: Chain<Cursor<Vec<u8>>, R>,
    /// UTF-16: which of two bytes is the low one.
    low: Option<bool>,
    second: bool,
    after_cr: bool,
}

impl<R: Read> Plain<R> {
    pub(super) fn new(mut inner: R) -> Result<Plain<R>> {
        let mut head = vec![];
        (&mut inner).take(4).read_to_end(&mut head).map_err(super::unreadable)?;
        let (mark, low) = match head[..] {
            [0xEF, 0xBB, 0xBF, ..] => (3, None),
            [0xFF, 0xFE, ..] => (2, Some(false)),
            [0xFE, 0xFF, ..] => (2, Some(true)),
            [a, 0, b, 0] if a > 0 && b > 0 => (0, Some(false)),
            [0, a, 0, b] if a > 0 && b > 0 => (0, Some(true)),
            _ => (0, None),
        };
        let inner = Cursor::new(head.split_off(mark)).chain(inner);
        Ok(Plain { inner, low, second: false, after_cr: false })
    }
}

impl<R: Read> Read for Plain<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let read = self.inner.read(out)?;
            let as_it_is = self.low.is_none() && !self.after_cr && !out[..read].contains(&b'\r');
            if read == 0 || as_it_is {
                return Ok(read);
            }
            let mut kept = 0;
            for at in 0..read {
                let byte = out[at];
                let second = self.second;
                self.second = !second;
                if self.low.is_some_and(|low| low != second) {
                    continue;
                }
                if !(std::mem::replace(&mut self.after_cr, byte == b'\r') && byte == b'\n') {
                    out[kept] = if byte == b'\r' { b'\n' } else { byte };
                    kept += 1;
                }
            }
            if kept > 0 {
                return Ok(kept);
            }
        }
    }
}

impl TextColumns {
    /// Ticks of a unit of the times.
    pub(super) fn ticks(self) -> i64 {
        10i64.pow(u32::try_from(self.power.clamp(0, 12)).unwrap_or(0))
    }

    /// Whether the unit of times is an assumption.
    pub(super) fn is_assumed(self) -> bool {
        self.assumed
    }

    /// Finds the layout by the first lines. Notes say what was assumed.
    ///
    /// # Errors
    /// `Kind::Input` for ambiguous columns, and for times with too few digits.
    pub(super) fn find(file: impl Read, inputs: &Inputs, notes: &mut Vec<String>) -> Result<TextColumns> {
        let mut text = vec![];
        Plain::new(file)?.take(SAMPLE).read_to_end(&mut text).map_err(super::unreadable)?;
        let lines = || text.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty());
        let is_names = |line: &&[u8]| {
            let words = line.split(|b| b";\t, \"'".contains(b));
            words.into_iter().any(|word| word.first().is_some_and(u8::is_ascii_alphabetic))
        };
        let first = lines().find(|line| line[0] != b'#');
        let named = first.as_ref().is_some_and(is_names);
        // A comment may name the columns.
        let comment = lines().take_while(|line| line[0] == b'#').last().map(|line| line[1..].trim_ascii());
        let separator =
            first.map_or(b',', |line| *b";\t,".iter().find(|s| line.contains(s)).unwrap_or(&b' '));
        let given = inputs.unit.map(|unit| power_of(unit).unwrap_or(0));
        let layout = TextColumns {
            separator,
            channel: 0,
            time: 1,
            named,
            power: given.unwrap_or(0),
            assumed: given.is_none(),
        };
        let of_names = |line: &[u8]| layout.of_names(line, given);
        let found = if named { first.and_then(of_names) } else { comment.and_then(of_names) };
        let rows: Vec<Vec<f64>> = lines()
            .filter(|line| line[0] != b'#')
            .skip(usize::from(named))
            .take(ROWS)
            .map_while(|line| layout.fields(line).map(real).collect())
            .collect();
        let layout = match found {
            Some(layout) => layout,
            None if named => TextColumns { named: false, ..layout },
            None => layout.of_values(&rows, notes)?,
        };
        layout.check_digits(lines().skip(usize::from(named)).take(ROWS), notes)?;
        Ok(layout)
    }

    /// The columns by their names; `None` where a name is missing. The finest unit is taken where there are several.
    fn of_names(&self, line: &[u8], given: Option<i32>) -> Option<TextColumns> {
        let names: Vec<String> =
            self.fields(line).map(|name| String::from_utf8_lossy(name).to_lowercase()).collect();
        let is_channel =
            |name: &String| name.contains("chan") || ["ch", "input", "detector"].contains(&&**name);
        let channel = names.iter().position(is_channel)?;
        let is_time = |name: &str| {
            ["time", "stamp", "tag"].iter().any(|word| name.contains(word))
                || name == "t"
                || name.starts_with("t_")
        };
        let unit = |name: &str| {
            let name = name.trim_end_matches([')', ']']);
            UNITS.iter().find(|(unit, _)| {
                name.strip_suffix(unit)
                    .is_some_and(|rest| rest.ends_with(['_', '(', '[', ' ', '/', '-', '.']))
            })
        };
        let times = names.iter().enumerate().filter(|(at, name)| *at != channel && is_time(name));
        let times = times.map(|(at, name)| (unit(name).is_none(), unit(name).map_or(0, |unit| unit.1), at));
        let (assumed, power, time) = times.min()?;
        Some(TextColumns {
            channel,
            time,
            power: given.unwrap_or(power),
            assumed: assumed && given.is_none(),
            ..*self
        })
    }

    /// The columns by their values.
    fn of_values(&self, rows: &[Vec<f64>], notes: &mut Vec<String>) -> Result<TextColumns> {
        let columns = rows.iter().map(Vec::len).min().unwrap_or(0);
        let value = |column: usize| rows.iter().map(move |row| row[column]);
        let is_index = |column: &usize| {
            rows.len() > 2 && value(*column).zip(value(*column).skip(1)).all(|(a, b)| b == a + 1.0)
        };
        let is_channel = |column: usize| {
            let mut values: Vec<f64> = value(column).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            values.len() <= MOST_CHANNELS && values.iter().all(|v| v.fract() == 0.0 && v.abs() < 1e6)
        };
        let left: Vec<usize> = (0..columns).filter(|c| columns < 3 || !is_index(c)).collect();
        let (channel, time) = match left[..] {
            [a, b] if rows.len() > MOST_CHANNELS && is_channel(b) && !is_channel(a) => (b, a),
            [a, b] => (a, b),
            _ if columns < 2 => (0, 1),
            _ => {
                return Err(Error::input(
                    format!("{columns} columns have no names"),
                    "name them in a first line, one of them channel and one time_ps, time_ns or time_s",
                ));
            }
        };
        if columns > 2 || channel > time {
            notes.push(format!(
                "column {} is read as the channel and column {} as the time",
                channel + 1,
                time + 1
            ));
        }
        Ok(TextColumns { channel, time, ..*self })
    }

    /// Refuses times with an exponent and too few digits, and reports a large step of all times.
    fn check_digits<'t>(&self, lines: impl Iterator<Item = &'t [u8]>, notes: &mut Vec<String>) -> Result<()> {
        let (mut rows, mut rounded, mut widest, mut step, mut first) = (0u32, 0u32, 0f64, 0u64, None);
        for field in lines.filter_map(|line| self.fields(line).nth(self.time)) {
            rows += 1;
            if let Some(digits) = field.iter().position(|b| b"eE".contains(b)) {
                let fraction = field[..digits].iter().rev().take_while(|b| b.is_ascii_digit()).count();
                let exponent =
                    std::str::from_utf8(&field[digits + 1..]).ok().and_then(|e| e.parse().ok()).unwrap_or(0);
                let last = 10f64.powi(exponent + self.power - fraction as i32);
                rounded += u32::from(last >= ROUNDED);
                widest = widest.max(last);
            }
            if let Some(time) = number(field, self.power) {
                let difference = time.abs_diff(*first.get_or_insert(time));
                step = gcd(step, difference);
            }
        }
        if 2 * rounded > rows {
            return Err(Error::input(
                format!(
                    "times are rounded to {widest:.0} ps: they have an exponent and few digits, as from a spreadsheet"
                ),
                "write the times with all digits, from the program that recorded them",
            ));
        }
        if rows > 100 && step >= COARSE {
            notes.push(format!("all times are multiples of {step} ps: narrower bins hold no more detail"));
        }
        Ok(())
    }

    /// The values of a line without quotes.
    fn fields<'t>(&self, line: &'t [u8]) -> impl Iterator<Item = &'t [u8]> + use<'t> {
        let separator = self.separator;
        let parts = line.split(move |b| *b == separator || separator == b' ' && *b == b'\t');
        let quote = |b: &u8| b"\"' \t".contains(b);
        let bare = move |part: &'t [u8]| {
            let from = part.iter().position(|b| !quote(b)).unwrap_or(part.len());
            let to = part.iter().rposition(|b| !quote(b)).map_or(from, |at| at + 1);
            &part[from..to]
        };
        parts.map(bare).filter(move |part| separator != b' ' || !part.is_empty())
    }

    fn tag(&self, line: &[u8]) -> Option<(i32, i64)> {
        let (mut channel, mut time) = (None, None);
        for (at, part) in self.fields(line).enumerate() {
            if at == self.channel {
                channel = i32::try_from(number(part, 0)?).ok();
            } else if at == self.time {
                time = number(part, self.power);
            }
            if channel.is_some() && time.is_some() {
                break;
            }
        }
        Some((channel?, time?))
    }

    /// Calls `hear` with every line's tag.
    pub(super) fn read(
        &self,
        file: impl Read,
        inputs: &Inputs,
        passed: &mut Passed,
        mut hear: impl FnMut(Record),
    ) -> Result<()> {
        let mut file = BufReader::with_capacity(BLOCK, Plain::new(file)?);
        let mut named = self.named;
        let mut line = vec![];
        for number in 1.. {
            line.clear();
            (&mut file).take(LONGEST).read_until(b'\n', &mut line).map_err(super::unreadable)?;
            if line.is_empty() {
                break;
            }
            let text = line.trim_ascii();
            if text.is_empty() || text[0] == b'#' || std::mem::take(&mut named) {
                continue;
            }
            match self.tag(text) {
                Some((channel, time)) => {
                    passed.records += 1;
                    hear(inputs.record(channel, time));
                }
                // The end of a file that was cut.
                None if !line.ends_with(b"\n") && (line.len() as u64) < LONGEST && passed.records > 0 => {
                    passed.cut(format!("line {number}, the last, is cut and left out"));
                }
                None => {
                    let shown: String = String::from_utf8_lossy(text).chars().take(60).collect();
                    return Err(Error::input(
                        format!("line {number} is no time tag: {shown:?}"),
                        advice![
                            "write a line for each: channel, time in picoseconds or the unit of " TagUnit
                            "; a first line may name the columns channel and time_ps"
                        ],
                    ));
                }
            }
        }
        Ok(())
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A number, with a decimal point or comma.
pub(super) fn real(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?;
    text.parse().or_else(|_| text.replacen(',', ".", 1).parse()).ok().filter(|v: &f64| v.is_finite())
}

/// A number times a power of ten, rounded; exact for numbers without exponent of up to 18 digits.
fn number(text: &[u8], power: i32) -> Option<i64> {
    let (sign, digits) = match text {
        [b'-', rest @ ..] => (-1, rest),
        [b'+', rest @ ..] => (1, rest),
        _ => (1, text),
    };
    let point = digits.iter().position(|b| b".,".contains(b));
    let fraction = point.map_or(0, |at| digits.len() - at - 1) as i32;
    let whole = digits.iter().enumerate().filter(|(at, _)| Some(*at) != point).map(|(_, b)| b);
    let shift = power - fraction;
    if whole.clone().count() > 0 && digits.len() < 19 && whole.clone().all(u8::is_ascii_digit) {
        let mantissa = whole.fold(0i64, |n, d| n.saturating_mul(10).saturating_add(i64::from(d - b'0')));
        let scale = 10i64.pow(shift.unsigned_abs().min(18));
        let value = if shift >= 0 { mantissa.checked_mul(scale)? } else { (mantissa + scale / 2) / scale };
        return (value < 1_000_000_000_000_000_000).then_some(sign * value);
    }
    let value = real(text)? * 10f64.powi(power);
    (value.abs() < 1e18).then_some(value.round() as i64)
}
