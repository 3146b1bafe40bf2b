//! The record of cases: what was tried, what held, which errors were given.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::process::Command;
use std::sync::Mutex;

use thirdbounce::Error;

/// All cases of one kind.
#[derive(Debug, Default)]
pub struct Row {
    pub case: String,
    pub tried: usize,
    pub held: usize,
    /// Errors as the user reads them (what is wrong, how to mend it), and how often each came.
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
    let mend = error.mend.to_string();
    if error.what.trim().len() < 8 || mend.trim().len() < 8 {
        return Err(format!("the error says too little: {error}"));
    }
    Ok(Some((error.what.clone(), mend)))
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

const HEAD: &str = "# Reliability\n\n\
    Faults that tests cause in the engine, and the outcome. `make soak` runs every case and writes this page area by \
    area (`cargo test --release --locked --test reliability -- --ignored`); `make test` runs a sample of the same \
    cases.\n\n\
    A case holds if it ends within its time limit, in success or in one clear error that says how to fix it. No file \
    may be half-written, no memory may stay allocated, and the next solve in the same process must work as before. \
    *Errors* is the number of different errors; the most frequent one follows with its fix. Each area says of which \
    commit it tells, and when it was written.\n";

/// What a program prints, as a line.
fn said(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    output.map_or("unknown".into(), |output| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

/// Replaces the section of an area in docs/reliability.md.
pub fn write(area: &str, rows: &[Row]) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _one = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reliability.md");
    let page = std::fs::read_to_string(path).unwrap_or_default();
    let mut sections: BTreeMap<String, String> = page
        .split("\n## ")
        .skip(1)
        .filter_map(|s| s.split_once('\n').map(|(name, text)| (name.to_string(), text.trim().to_string())))
        .collect();
    sections.insert(area.into(), section(rows));
    let counts: Vec<[usize; 2]> = sections.values().flat_map(|s| s.lines()).filter_map(counts).collect();
    let [tried, held] = [0, 1].map(|k| counts.iter().map(|c| c[k]).sum::<usize>());
    let mut page = format!("{HEAD}\n{tried} cases were tried, {held} held, {} did not.\n", tried - held);
    sections.iter().for_each(|(name, text)| page += &format!("\n## {name}\n\n{text}\n"));
    std::fs::write(path, page).expect("docs can be written");
}

fn section(rows: &[Row]) -> String {
    let changed = said("git", &["status", "--porcelain", "--", ":!docs"]);
    let mut text = format!(
        "Commit {}{}, {}.\n\n",
        said("git", &["rev-parse", "--short=8", "HEAD"]),
        if changed.is_empty() { "" } else { " with changes" },
        said("date", &["-u", "+%F"])
    );
    text += "| case | tried | held | errors | most frequent | fix |\n|---|---|---|---|---|---|\n";
    for row in rows {
        let most = row.errors.iter().max_by_key(|(_, n)| **n).map(|(said, _)| said);
        let (what, mend) = most.map_or(("–".into(), "–".into()), |(w, m)| (plain(w), plain(m)));
        let kinds = row.errors.len();
        let _ = writeln!(text, "| {} | {} | {} | {kinds} | {what} | {mend} |", row.case, row.tried, row.held);
    }
    let failures: Vec<_> = rows.iter().flat_map(|r| &r.failures).collect();
    if !failures.is_empty() {
        text += "\nDoes not hold:\n\n";
        failures.iter().for_each(|f| text += &format!("- {}\n", plain(f)));
    }
    text
}

/// The numbers tried and held in a line of a table.
fn counts(line: &str) -> Option<[usize; 2]> {
    let mut cells = line.split('|').skip(2).map(|c| c.trim().parse().ok());
    Some([cells.next()??, cells.next()??])
}

/// Text for a line of a table: no line breaks, no bars, no folder names that change from run to run.
fn plain(text: &str) -> String {
    let folder = std::env::temp_dir().display().to_string();
    let words = text.split_whitespace().map(|word| match word.find(&folder) {
        Some(at) => {
            let name = word.rsplit('/').next().unwrap_or("");
            format!("{}…/{name}", &word[..at])
        }
        None => word.to_string(),
    });
    let line = words.collect::<Vec<_>>().join(" ").replace('|', "/").replace('<', "&lt;");
    let short: String = line.chars().take(180).collect();
    if short.len() < line.len() { format!("{short} …") } else { short }
}
