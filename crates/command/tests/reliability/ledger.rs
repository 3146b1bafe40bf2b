//! The record of cases: what was tried, what held, which errors were given.

use std::collections::BTreeMap;
use std::sync::Mutex;

use thirdbounce::Error;

/// All cases of one kind.
#[derive(Debug, Default)]
pub struct Row {
    pub case: String,
    pub tried: usize,
    pub held: usize,
    /// Errors as the user reads them (what is wrong, how to fix it), and how often each came.
    pub errors: BTreeMap<(String, String), usize>,
    pub failures: Vec<String>,
}

/// The outcome of a case that held: nothing went wrong, or this error was given.
pub type Held = Result<Option<(String, String)>, String>;

impl Row {
    pub fn new(case: impl Into<String>) -> Row {
        Row { case: case.into(), ..Row::default() }
    }

    pub fn add(&mut self, what: &str, held: Held) {
        self.tried += 1;
        match held {
            Ok(said) => {
                self.held += 1;
                if let Some(said) = said {
                    *self.errors.entry(said).or_default() += 1;
                }
            }
            Err(why) => self.failures.push(format!("{} / {what}: {why}", self.case)),
        }
    }
}

/// The error as text if it is clear, or why it is not.
pub fn clear(error: &Error) -> Held {
    let hint = error.hint.to_string();
    if error.what.trim().len() < 8 || hint.trim().len() < 8 {
        return Err(format!("the error says too little: {error}"));
    }
    Ok(Some((error.what.clone(), hint)))
}

/// Holds if `truth`.
pub fn holds(truth: bool, why: impl FnOnce() -> String) -> Result<(), String> {
    if truth { Ok(()) } else { Err(why()) }
}

#[track_caller]
pub fn assert_held(rows: &[Row]) {
    assert!(rows.iter().any(|r| r.tried > 0), "nothing was tried");
    let failures: Vec<_> = rows.iter().flat_map(|r| r.failures.clone()).collect();
    let tried: usize = rows.iter().map(|r| r.tried).sum();
    assert!(failures.is_empty(), "{} of {tried} did not hold:\n{}", failures.len(), failures.join("\n"));
}

const COLUMNS: &str = "area\tcase\ttried\tpassed\terrors\tmost frequent error\tfix\n";

/// Replaces the rows of an area in benches/results/reliability.tsv. docs/accuracy.md has the sums.
pub fn write(area: &str, rows: &[Row]) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _one = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/results/reliability.tsv");
    let table = std::fs::read_to_string(path).unwrap_or_default();
    let others = table.lines().skip(1).filter(|line| line.split('\t').next() != Some(area));
    let mut lines: Vec<String> =
        others.map(str::to_string).chain(rows.iter().map(|row| line(area, row))).collect();
    lines.sort_by_cached_key(|line| line.split('\t').next().map(str::to_string));
    std::fs::write(path, COLUMNS.to_string() + &lines.join("\n") + "\n")
        .expect("benches/results can be written");
}

fn line(area: &str, row: &Row) -> String {
    let most = row.errors.iter().max_by_key(|(_, n)| **n).map(|(error, _)| error);
    let (what, fix) = most.map_or((String::new(), String::new()), |(what, fix)| (plain(what), plain(fix)));
    format!("{area}\t{}\t{}\t{}\t{}\t{what}\t{fix}", row.case, row.tried, row.held, row.errors.len())
}

/// Text for a cell of a table: one line without tabs, folder names without their temporary part.
fn plain(text: &str) -> String {
    let folder = std::env::temp_dir().display().to_string();
    let words = text.split_whitespace().map(|word| match word.find(&folder) {
        Some(at) => {
            let name = word.rsplit('/').next().unwrap_or("");
            format!("{}…/{name}", &word[..at])
        }
        None => word.to_string(),
    });
    let line = words.collect::<Vec<_>>().join(" ");
    let short: String = line.chars().take(180).collect();
    if short.len() < line.len() { format!("{short} …") } else { short }
}
