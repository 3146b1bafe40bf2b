//! Compares two builds of the command, case by case: random scenes, meshes, real captures, scenes with truth, few photons, few
//! scan points. Each case gets a file and nothing else. Prints a table for each group, then what changed.
//!
//!     cargo bench --bench builds -- [family|meshes|captures|scenes|photons|points|models|all ...] [--against PATH]
//!         [--program PATH] [--seeds A..B] [--only WORD,...] [--keep DIR] [--reuse] [--sheet FILE.png] [--json FILE]
//!         [-- OPTIONS OF reconstruct]
//!
//! `all` is every group but `models`: scenes by every model of reflectance and several kinds of pairs.
//!
//! | option | |
//! |---|---|
//! | `--against PATH` | build a, the reference. Without it, one build is measured |
//! | `--program PATH` | build b; without it, the one that cargo built |
//! | `--seeds A..B` | seeds of the family; 0..20 if none are given |
//! | `--only WORD,...` | cases whose names contain one of the words |
//! | `--keep DIR` | keeps rendered captures, truths, results and compiled kernels there; takes all but results of the builds from there |
//! | `--reuse` | takes results of the same build, capture and options from there, too, with the seconds of their time |
//! | `--sheet FILE.png` | writes pictures, a row for each case |
//! | `--json FILE` | writes every value, metric and report |
//!
//! THIRDBOUNCE_DATA names the folder of meshes and real captures. Develop on seeds 0..20; report others, and never look at
//! those before.
//!
//! Builds take turns case by case. Each has its own folder of compiled kernels, and a run that compiled some is repeated, so
//! seconds are those of a build that has run before. CPU seconds are of the whole process and all its threads.

mod arguments;
mod cases;
mod run;
mod sheet;
mod summary;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use arguments::Arguments;
use cases::{Case, Source};
use run::{Build, Run};
use serde_json::{Value, json};
use sheet::Sheet;
use summary::{COUNT, QUANTITIES, Row, Side, Values};
use thirdbounce::export::npz::read_truth;
use thirdbounce::job::benchmark::{CLOSED_FORMS, Consensus};
use thirdbounce::maps::{Maps, Truth};

/// Columns of a group: against truth, or agreement with closed-form methods; then costs.
fn columns(group: &str) -> Vec<usize> {
    use summary::{AGREEMENT, BESIDE, BEST, CPU, DEPTH, DEPTH_MM, ESTIMATES, FILES, MEMORY};
    use summary::{NORMALS, OWN, PAPER_DEPTH, PAPER_NORMALS, RMSE, SOLVE, WALL, WITHIN};
    let quality: &[usize] = match group {
        "captures" => &[AGREEMENT, BESIDE],
        "scenes" => &[OWN, BEST, DEPTH_MM, DEPTH, RMSE, NORMALS, PAPER_DEPTH, PAPER_NORMALS],
        "models" => &[OWN, BEST, DEPTH_MM, DEPTH, RMSE, NORMALS, WITHIN],
        _ => &[OWN, BEST, DEPTH_MM, DEPTH, RMSE, NORMALS],
    };
    [quality, &[CPU, WALL, ESTIMATES, SOLVE, FILES, MEMORY]].concat()
}

fn main() -> ExitCode {
    let done = tempfile::tempdir().map_err(|e| e.to_string()).and_then(|temporary| {
        let arguments = Arguments::read(temporary.path())?;
        Bench::new(&arguments, temporary.path())?.run()
    });
    done.map_or_else(
        |e| {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        },
        |()| ExitCode::SUCCESS,
    )
}

/// All that runs share.
struct Bench<'a> {
    arguments: &'a Arguments,
    /// a and b, or one alone.
    builds: Vec<Build>,
    /// The build that makes the results of closed-form methods.
    own: Build,
    /// A folder for results.
    out: PathBuf,
    /// Runs of cases that stand in several groups.
    done: HashMap<String, Vec<Result<Run, String>>>,
    rows: Vec<Row>,
    raw: Vec<Value>,
    sheet: Sheet,
}

impl<'a> Bench<'a> {
    fn new(arguments: &'a Arguments, temporary: &Path) -> Result<Bench<'a>, String> {
        let programs = arguments.against.iter().chain([&arguments.program]);
        let builds: Result<Vec<Build>, String> = programs.map(|p| Build::of(p, &arguments.keep)).collect();
        Ok(Bench {
            arguments,
            builds: builds?,
            own: Build::of(Path::new(env!("CARGO_BIN_EXE_thirdbounce")), &arguments.keep)?,
            out: temporary.join("out"),
            done: HashMap::new(),
            rows: vec![],
            raw: vec![],
            sheet: Sheet::default(),
        })
    }

    fn run(mut self) -> Result<(), String> {
        let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from);
        if data.is_none() {
            eprintln!("note: THIRDBOUNCE_DATA is not set: cases from files are left out");
        }
        for (name, build) in ["a", "b"].iter().zip(&self.builds) {
            println!("{name}: `{}` ({})", build.program.display(), build.digest);
        }
        if self.builds.len() == 2 {
            println!("Cells are a → b, or one value where both builds have the same.");
        }
        let arguments = self.arguments;
        for group in &arguments.groups {
            let all =
                cases::of(group, arguments.seeds.clone(), data.as_deref()).map_err(|e| e.to_string())?;
            let is_wanted = |case: &Case| {
                arguments.only.is_empty() || arguments.only.iter().any(|word| case.name.contains(word))
            };
            self.group(group, all.into_iter().filter(is_wanted).collect());
            self.write()?;
        }
        if self.rows.is_empty() {
            return Err("no case is selected: check --only, --seeds and THIRDBOUNCE_DATA".into());
        }
        if self.builds.len() == 2 {
            let rows: Vec<&Row> = self.rows.iter().collect();
            println!("\n## a to b, all groups\n\n{}", summary::table(&distinct(&rows)));
            let [results, clock] = summary::regressions(&distinct(&rows));
            list("Regressions", &results);
            list("Regressions on the clock, where other programs count, too", &clock);
        }
        Ok(())
    }

    /// Writes what there is so far.
    fn write(&self) -> Result<(), String> {
        if let Some(file) = &self.arguments.sheet {
            self.sheet.write(file).map_err(|e| e.to_string())?;
        }
        if let Some(file) = &self.arguments.json {
            let programs: Vec<Value> = (self.builds.iter())
                .map(|build| json!({ "program": build.program, "digest": build.digest }))
                .collect();
            let all = json!({ "builds": programs, "options": self.arguments.options, "cases": self.raw });
            std::fs::write(file, format!("{all:#}\n")).map_err(|e| format!("{}: {e}", file.display()))?;
        }
        Ok(())
    }

    fn group(&mut self, group: &'static str, cases: Vec<Case>) {
        if cases.is_empty() {
            return;
        }
        let columns = &columns(group);
        let names: Vec<&str> = columns.iter().map(|place| QUANTITIES[*place].name).collect();
        println!("\n## {group}\n\n| case | what | model | {} |", names.join(" | "));
        println!("|---|---|---|{}", "--:|".repeat(names.len()));
        let from = self.rows.len();
        for case in cases {
            let row = self.case(&case, columns);
            println!("{}", line(&row, columns));
            self.rows.push(row);
        }
        let rows: Vec<&Row> = self.rows[from..].iter().collect();
        totals(&rows, columns, self.builds.len()).iter().for_each(|line| println!("{line}"));
    }

    /// Runs a case by every build, and measures the results.
    fn case(&mut self, case: &Case, columns: &[usize]) -> Row {
        let row = |sides| Row {
            group: case.group,
            name: case.name.clone(),
            words: case.words.clone(),
            model: case.model,
            sides,
        };
        let files = case.files(&self.arguments.keep).map_err(|e| e.to_string());
        let truth = files.and_then(|(capture, truth)| {
            let truth = truth.map(|file| read_truth(&file).map_err(|e| e.to_string())).transpose()?;
            Ok((capture, truth))
        });
        let (capture, truth) = match truth {
            Ok(files) => files,
            Err(e) => {
                return row(self.builds.iter().map(|_| Side::failed(e.clone(), columns)).collect());
            }
        };
        let key = case.same_as();
        let runs = self.done.remove(&key).unwrap_or_else(|| self.runs(case, &capture));
        let closed = if truth.is_none() { self.closed_forms(case, &capture) } else { vec![] };
        let shown: Vec<&Maps> = closed.iter().filter_map(|run| Some(&run.1.as_ref()?.maps)).collect();
        let consensus = Consensus::of(&shown);
        let mut raw = vec![];
        let sides: Vec<Side> = runs
            .iter()
            .map(|run| {
                let (side, value) = judged(run, case, truth.as_ref(), consensus.as_ref(), columns);
                raw.push(value);
                side
            })
            .collect();
        self.raw.push(json!({
            "group": case.group, "name": case.name, "what": case.words, "true_model": case.model,
            "capture": capture, "runs": raw,
        }));
        self.draw(case, truth.as_ref(), &runs, &closed);
        self.done.insert(key, runs);
        row(sides)
    }

    fn runs(&self, case: &Case, capture: &Path) -> Vec<Result<Run, String>> {
        let options = [&case.options[..], &self.arguments.options].concat();
        let run = |build: &Build| {
            let mut run = self.kept_or_new(build, capture, &options)?;
            if let Source::Family(family) = &case.source {
                family.without_back(&mut run.maps);
            }
            Ok(run)
        };
        self.builds.iter().map(run).collect()
    }

    /// Takes a run from the folder of what is kept, if that is wanted, or runs the build and keeps the result.
    fn kept_or_new(&self, build: &Build, capture: &Path, options: &[String]) -> Result<Run, String> {
        let data = std::fs::metadata(capture).map_err(|e| format!("{}: {e}", capture.display()))?;
        let what = cases::digest(&(capture, data.len(), data.modified().ok(), options));
        let folder = self.arguments.keep.join("runs").join(&build.digest).join(what);
        if let Some(run) = self.arguments.reuse.then(|| Run::kept(&folder)).flatten() {
            return Ok(run);
        }
        let run = build.reconstruct(capture, &self.out, options)?;
        run.keep(&self.out, &folder)?;
        Ok(run)
    }

    /// Results of the closed-form methods, kept once they are there; `None` for one that refuses the capture.
    fn closed_forms(&self, case: &Case, capture: &Path) -> Vec<(&'static str, Option<Run>)> {
        let run = |method: &str| {
            let folder = self.arguments.keep.join(format!("closed/{}/{method}", case.name));
            let options = [&case.options[..], &["--solver".into(), method.into()]].concat();
            Run::read(&folder).or_else(|_| self.own.reconstruct(capture, &folder, &options)).ok()
        };
        CLOSED_FORMS.map(|method| (method, run(method))).into()
    }

    fn draw(
        &mut self,
        case: &Case,
        truth: Option<&Truth>,
        runs: &[Result<Run, String>],
        closed: &[(&str, Option<Run>)],
    ) {
        if self.arguments.sheet.is_none() {
            return;
        }
        let maps: Vec<Option<&Maps>> = runs.iter().map(|run| Some(&run.as_ref().ok()?.maps)).collect();
        let words = format!("{} {}: {}", case.group, case.name, case.words);
        match truth {
            Some(truth) => self.sheet.judged(&words, truth, &maps),
            None => {
                let others: Vec<_> =
                    closed.iter().map(|(name, run)| (*name, run.as_ref().map(|run| &run.maps))).collect();
                self.sheet.captured(&words, &maps, &others);
            }
        }
    }
}

fn list(heading: &str, lines: &[String]) {
    println!("{heading}: {}{}", lines.len(), if lines.is_empty() { ".\n" } else { "\n" });
    lines.iter().for_each(|line| println!("- {line}"));
    if !lines.is_empty() {
        println!();
    }
}

/// Rows without those that stand in a group before, too: cases of the points are scenes as well.
fn distinct<'r>(rows: &[&'r Row]) -> Vec<&'r Row> {
    let mut all: Vec<&Row> = vec![];
    for row in rows {
        if !all.iter().any(|r| r.name == row.name && r.words == row.words) {
            all.push(row);
        }
    }
    all
}

/// What is compared of a run, and everything raw.
fn judged(
    run: &Result<Run, String>,
    case: &Case,
    truth: Option<&Truth>,
    consensus: Option<&Consensus>,
    columns: &[usize],
) -> (Side, Value) {
    let consensus = consensus.filter(|_| case.is_judged);
    // A run that fails agrees with nothing, if there is something to agree with.
    let is_shown = |place: &usize| *place != summary::AGREEMENT || consensus.is_some();
    let columns: Vec<usize> = columns.iter().copied().filter(is_shown).collect();
    let failed = |e: &str| (Side::failed(e, &columns), json!({ "error": e }));
    let run = match run {
        Ok(run) => run,
        Err(e) => return failed(e),
    };
    let mut values = run.costs();
    let metrics = match truth.map(|truth| run.metrics(truth)).transpose() {
        Ok(metrics) => metrics,
        Err(e) => return failed(&e),
    };
    if let Some(m) = &metrics {
        let or_nan = |v: Option<f64>| v.unwrap_or(f64::NAN);
        values[summary::OWN] = m.iou.unwrap_or(0.0);
        values[summary::BEST] = m.best_iou.unwrap_or(0.0);
        values[summary::DEPTH_MM] = 1e3 * or_nan(m.depth_mae);
        values[summary::DEPTH] = 100.0 * or_nan(m.depth_mae) / case.wall;
        values[summary::RMSE] = 1e3 * or_nan(m.depth_rmse);
        // Light that comes back to where it is from tells no normals.
        let has_normals = case.model != Some("retroreflective");
        values[summary::NORMALS] = if has_normals { or_nan(m.normal_error_deg) } else { f64::NAN };
        values[summary::WITHIN] = or_nan(m.within_depth_error);
        values[summary::PAPER_DEPTH] = or_nan(m.paper.depth_mae);
        values[summary::PAPER_NORMALS] = or_nan(m.paper.normal_mae);
    }
    if let Some(consensus) = consensus {
        values[summary::AGREEMENT] = consensus.agreement(&run.maps);
        values[summary::BESIDE] = consensus.beside(&run.maps);
    }
    let raw = json!({
        "values": named(&values), "model": run.model(), "metrics": metrics, "report": run.report,
        "kernels_compiled_before": run.again, "reused": run.reused,
    });
    let shown: Values =
        std::array::from_fn(|place| if columns.contains(&place) { values[place] } else { f64::NAN });
    (Side { values: shown, model: run.model(), error: None, reused: run.reused }, raw)
}

/// Values by name; null for NaN.
fn named(values: &Values) -> Value {
    (0..COUNT).map(|place| (QUANTITIES[place].key.to_string(), json!(values[place]))).collect()
}

/// A cell: the texts of both builds, or one where they are the same.
fn cell(texts: &[String]) -> String {
    match texts {
        [a, b] if a != b => format!("{a} → {b}"),
        _ => texts.first().cloned().unwrap_or_default(),
    }
}

/// The line of a case.
fn line(row: &Row, columns: &[usize]) -> String {
    let models: Vec<String> = row.sides.iter().map(|s| s.model.clone().unwrap_or("-".into())).collect();
    let model = row.model.map_or(String::new(), |model| format!("{model}: ")) + &cell(&models);
    let cells = columns.iter().map(|&place| {
        cell(&row.sides.iter().map(|s| QUANTITIES[place].text(s.values[place])).collect::<Vec<_>>())
    });
    let sides = row.sides.iter().zip(["a", "b"]);
    let remarks: Vec<String> = sides
        .filter_map(|(side, name)| match &side.error {
            Some(error) => Some(format!(" **{name} failed: {error}**")),
            None => side.reused.then(|| format!(" ({name} kept)")),
        })
        .collect();
    format!(
        "| {} | {}{} | {model} | {} |",
        row.name,
        row.words,
        remarks.concat(),
        cells.collect::<Vec<_>>().join(" | ")
    )
}

/// Means and worst tenths of a group. Means of two builds are over the cases of which both have a value.
fn totals(rows: &[&Row], columns: &[usize], builds: usize) -> Vec<String> {
    let right = |side: usize| rows.iter().filter(|row| row.is_right(side) == Some(true)).count();
    let known = rows.iter().filter(|row| row.model.is_some()).count();
    let models = if known == 0 {
        String::new()
    } else {
        format!("{} of {known} right", cell(&(0..builds).map(|k| right(k).to_string()).collect::<Vec<_>>()))
    };
    let of = |sum: &dyn Fn(usize, &mut dyn Iterator<Item = f64>) -> f64| {
        let cells = columns.iter().map(|&place| {
            let both = |row: &&&Row| row.sides.iter().all(|side| !side.values[place].is_nan());
            let side = |k: usize| {
                let mut values = rows.iter().filter(both).map(|row| row.sides[k].values[place]);
                QUANTITIES[place].text(sum(place, &mut values))
            };
            cell(&(0..builds).map(side).collect::<Vec<_>>())
        });
        cells.collect::<Vec<_>>().join(" | ")
    };
    let changes = || {
        let cells = columns.iter().map(|&place| {
            let total = summary::total(rows, place);
            if total.judged == 0 { String::new() } else { format!("{} / {}", total.better, total.worse) }
        });
        format!("| **better / worse** | | | {} |", cells.collect::<Vec<_>>().join(" | "))
    };
    let mut all = vec![
        format!("| **mean** | {} cases | {models} | {} |", rows.len(), of(&|_, v| summary::mean(v))),
        format!("| **worst tenth** | | | {} |", of(&|place, v| summary::worst_tenth(place, v))),
    ];
    if builds > 1 {
        all.push(changes());
    }
    all
}
