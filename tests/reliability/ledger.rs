//! What was tried, what held, what was said.

use std::collections::BTreeMap;
use std::fmt::Write;

use thirdbounce::Error;

/// Cases of a kind.
#[derive(Debug, Default)]
pub struct Row {
    pub case: String,
    pub tried: usize,
    pub held: usize,
    /// Errors as the user reads them, what is wrong and how to mend it, and how often.
    pub errors: BTreeMap<(String, String), usize>,
    pub failures: Vec<String>,
}

/// What came of a case that held: nothing went wrong, or this was said.
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

/// A clear error, or why it is none.
pub fn clear(error: &Error) -> Held {
    if error.what.trim().len() < 8 || error.mend.trim().len() < 8 {
        return Err(format!("the error says too little: {error}"));
    }
    Ok(Some((error.what.clone(), error.mend.clone())))
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

/// Writes the page.
pub fn write(areas: &[(&str, Vec<Row>, f64)]) {
    let total = |f: fn(&Row) -> usize| areas.iter().flat_map(|(_, rows, _)| rows).map(f).sum::<usize>();
    let (tried, held) = (total(|r| r.tried), total(|r| r.held));
    let mut page = format!(
        "# Reliability\n\n\
         Faults that are done to the engine, and what comes of them. Written by `make soak` (`cargo test --release \
         --locked --test reliability -- --ignored`); `make test` runs a sample of the same cases.\n\n\
         A case holds if it ends within its time limit in success or in one clear error that says how to mend it, with \
         nothing half-written, nothing left allocated, and the next solve in the same process as good as ever. *Said* \
         is an error of that kind and the advice that comes with it; there are as many kinds as the number before says.\n\n\
         {tried} cases were tried, {held} held, {} did not.\n",
        tried - held
    );
    for (name, rows, _) in areas {
        let _ = write!(
            page,
            "\n## {}\n\n| case | tried | held | errors | said | fix |\n|---|---|---|---|---|---|\n",
            upper(name)
        );
        for row in rows {
            let most = row.errors.iter().max_by_key(|(_, n)| **n).map(|(said, _)| said);
            let (what, mend) = most.map_or(("–".into(), "–".into()), |(w, m)| (plain(w), plain(m)));
            let kinds = row.errors.len();
            let _ =
                writeln!(page, "| {} | {} | {} | {kinds} | {what} | {mend} |", row.case, row.tried, row.held);
        }
    }
    let failures: Vec<_> = areas.iter().flat_map(|(_, rows, _)| rows).flat_map(|r| &r.failures).collect();
    if !failures.is_empty() {
        page += "\n## What does not hold\n\n";
        failures.iter().for_each(|f| page += &format!("- {}\n", plain(f)));
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reliability.md");
    std::fs::write(path, page).expect("docs can be written");
}

fn upper(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

/// A line for a table: no breaks, no bars, no folders that change from run to run.
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
