//! The command line.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use thirdbounce_benchmark::cases::GROUPS;

/// The groups of `all`.
const USUAL: [&str; 6] = ["family", "meshes", "captures", "scenes", "photons", "points"];

/// The group of stiff and extreme cases, which has a table of its own.
pub const STABILITY: &str = "stability";

/// What the command line asks for.
pub struct Arguments {
    /// Groups of cases.
    pub groups: Vec<&'static str>,
    /// Whether stiff and extreme cases are run.
    pub stability: bool,
    pub seeds: Range<u64>,
    pub program: PathBuf,
    pub against: Option<PathBuf>,
    pub keep: PathBuf,
    /// Take runs that are kept in place of new ones.
    pub reuse: bool,
    /// Folder of the page and of the cases.
    pub out: PathBuf,
    /// A `benchmark.json` for the pages of the repository; without groups, these are renewed only.
    pub pages: Option<PathBuf>,
    /// Cases whose names contain one of these words; all without any.
    pub only: Vec<String>,
    /// For `reconstruct`.
    pub options: Vec<String>,
}

impl Arguments {
    /// Whether builds run; else pages are renewed only.
    pub fn runs(&self) -> bool {
        self.stability || !self.groups.is_empty()
    }

    /// # Errors
    /// A word that is not known, or a value that is missing or wrong.
    pub fn read(temporary: &Path) -> Result<Arguments, String> {
        let mut all = Arguments {
            groups: vec![],
            stability: false,
            seeds: 0..20,
            program: PathBuf::new(),
            against: None,
            keep: temporary.into(),
            reuse: false,
            out: temporary.join("page"),
            pages: None,
            only: vec![],
            options: vec![],
        };
        // cargo adds --bench.
        let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
        let mut groups: Vec<String> = vec![];
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or(format!("{word} needs a value"));
            let mut folder = || std::path::absolute(value()?).map_err(|e| format!("{word}: {e}"));
            match word.as_str() {
                "--keep" => all.keep = folder()?,
                "--out" => all.out = folder()?,
                "--seeds" => all.seeds = seeds(&value()?)?,
                "--program" => all.program = value()?.into(),
                "--against" => all.against = Some(value()?.into()),
                "--reuse" => all.reuse = true,
                "--pages" => all.pages = Some(value()?.into()),
                "--only" => all.only = value()?.split(',').map(String::from).collect(),
                "--" => all.options = words.by_ref().collect(),
                STABILITY => all.stability = true,
                group if group == "all" || GROUPS.contains(&group) => groups.push(word),
                _ => {
                    return Err(format!(
                        "{word} is none of {}, {STABILITY}, all, or an option",
                        GROUPS.join(", ")
                    ));
                }
            }
        }
        if all.reuse && all.keep == temporary {
            return Err("--reuse needs the folder of --keep".into());
        }
        let is_all =
            groups.is_empty() && !all.stability && all.pages.is_none() || groups.iter().any(|g| g == "all");
        let is_wanted = |group: &&str| is_all && USUAL.contains(group) || groups.iter().any(|g| g == group);
        all.groups = GROUPS.into_iter().filter(is_wanted).collect();
        if all.runs() && all.program.as_os_str().is_empty() {
            all.program = built()?;
        }
        Ok(all)
    }
}

/// The command of this repository, built now.
fn built() -> Result<PathBuf, String> {
    let build = ["build", "--release", "--locked", "--bin", "thirdbounce"];
    let status = Command::new(env!("CARGO")).args(build).status().map_err(|e| format!("cargo: {e}"))?;
    // This bench is target/release/deps/builds-HASH.
    let own = std::env::current_exe().map_err(|e| e.to_string())?;
    let program = own.ancestors().nth(2).map(|folder| folder.join("thirdbounce"));
    program.filter(|_| status.success()).ok_or("the command was not built".into())
}

fn seeds(text: &str) -> Result<Range<u64>, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    ends.ok_or(format!("--seeds {text} is not A..B"))
}
