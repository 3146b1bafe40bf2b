//! Compares two builds of the command with the cases, tables and page of `thirdbounce benchmark`, where the sides are builds. Prints
//! a table for each group, then all changes.
//!
//!     cargo bench --bench builds -- [standard|family|meshes|captures|scenes|photons|points|models|stability|all ...]
//!         [--against PATH] [--program PATH] [--seeds A..B] [--only WORD,...] [--out DIR] [--keep DIR] [--reuse]
//!         [--pages FILE] [-- OPTIONS OF reconstruct]
//!
//! `all` is every group but `standard`, `models` and `stability`.
//!
//! | option | |
//! |---|---|
//! | `--against PATH` | build a, the reference. Without it, one build is measured |
//! | `--program PATH` | build b; without it, the one of this repository, which is built first |
//! | `--seeds A..B` | seeds of the family; 0..20 by default |
//! | `--only WORD,...` | cases whose names contain one of the words |
//! | `--out DIR` | writes `benchmark.html` and `benchmark.json` there, and continues an interrupted comparison of the same builds |
//! | `--keep DIR` | keeps results and compiled kernels of the builds there |
//! | `--reuse` | takes results of the same build, capture and options from there, too, with their seconds |
//! | `--pages FILE` | adds the table of stability to this `benchmark.json`, stores it, and renews the pages that show it |
//!
//! THIRDBOUNCE_DATA names the folder of meshes and measured captures. Develop on seeds 0..20; report others, and never look at
//! those before.
//!
//! Builds take turns case by case. Each has its own folder of compiled kernels, and a run that compiled some is repeated, so
//! seconds are those of a build that has run before. CPU seconds are of the whole process and all its threads.

mod arguments;
mod pages;
mod run;
mod stability;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use arguments::Arguments;
use run::{Build, Run};
use thirdbounce::export::npz::read_truth;
use thirdbounce::maps::{Maps, Truth};
use thirdbounce_benchmark::cases::{self, Case, Files};
use thirdbounce_benchmark::pages::{self as results, Page, SideResults};
use thirdbounce_benchmark::run::{Benchmark, Mark, Sides, benchmark, finish};

fn main() -> ExitCode {
    // Cargo runs benches in the folder of their package; paths are given from the repository's.
    std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .expect("the repository is there");
    let done = tempfile::tempdir().map_err(|e| e.to_string()).and_then(|temporary| {
        let arguments = Arguments::read(temporary.path())?;
        compare(&arguments, temporary.path())
    });
    done.map_or_else(
        |e| {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        },
        |()| ExitCode::SUCCESS,
    )
}

fn compare(arguments: &Arguments, temporary: &Path) -> Result<(), String> {
    let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from);
    let programs = arguments.against.iter().chain([&arguments.program]).filter(|_| arguments.runs());
    let builds: Result<Vec<Build>, String> = programs.map(|p| Build::of(p, &arguments.keep)).collect();
    let builds = builds?;
    for (name, build) in ["a", "b"].iter().zip(&builds) {
        println!("{name}: `{}` ({})", build.program.display(), build.digest);
    }
    let mut page = Page::default();
    if !arguments.groups.is_empty() {
        if data.is_none() {
            eprintln!("note: THIRDBOUNCE_DATA is not set: cases from files are left out");
        }
        let mut cases = cases::all(&arguments.groups, arguments.seeds.clone(), data.as_deref())
            .map_err(|e| e.to_string())?;
        cases
            .retain(|c| arguments.only.is_empty() || arguments.only.iter().any(|word| c.name.contains(word)));
        let digests = builds.iter().map(|build| format!("build {}", build.digest));
        let options = digests.chain(arguments.options.iter().cloned()).collect();
        let what = Benchmark { cases, out: arguments.out.clone(), options, beside: vec![] };
        let mut programs = Programs { arguments, builds: &builds, out: temporary.join("out") };
        page = benchmark(&what, &mut programs).map_err(|e| e.to_string())?.page;
        report(&page, &arguments.groups);
    }
    if arguments.stability {
        for (name, build) in ["a", "b"].iter().zip(&builds) {
            page.stability = stability::run(build, temporary);
            println!("\n## stability of {name}\n\n{}", page.stability_table().markdown());
        }
    }
    arguments.pages.as_ref().map_or(Ok(()), |file| pages::renew(file, page.stability))
}

/// Prints a table for each group, and the changes from a to b.
fn report(page: &Page, groups: &[&str]) {
    for group in groups {
        let cases = page.cases.iter().filter(|case| case.group == *group).cloned().collect::<Vec<_>>();
        if !cases.is_empty() {
            println!("\n## {group}\n\n{}", Page { cases, ..Page::default() }.table().markdown());
        }
    }
    let cases = page.compared();
    if cases.iter().all(|case| case.sides.len() == 2) {
        println!("\n## a to b, all groups\n\n{}", results::changes(&cases).markdown());
        let [all, clock] = results::regressions(&cases);
        for (heading, lines) in [
            ("Regressions", all),
            ("Regressions of wall-clock seconds, which other programs change, too", clock),
        ] {
            println!("{heading}: {}.\n", lines.len());
            lines.iter().for_each(|line| println!("- {line}"));
        }
    }
}

/// Builds as the sides of a benchmark.
struct Programs<'a> {
    arguments: &'a Arguments,
    /// a and b, or one alone.
    builds: &'a [Build],
    /// A folder for results.
    out: PathBuf,
}

impl Programs<'_> {
    /// Takes a run from the folder of what is kept, if that is wanted, or runs the build and keeps the result.
    fn kept_or_new(&self, build: &Build, capture: &Path, options: &[String]) -> Result<Run, String> {
        let data = std::fs::metadata(capture).map_err(|e| format!("{}: {e}", capture.display()))?;
        let name = capture.file_name().unwrap_or_default();
        let what = cases::digest(&(name, data.len(), data.modified().ok(), options));
        let folder = self.arguments.keep.join("runs").join(&build.digest).join(what);
        if let Some(run) = self.arguments.reuse.then(|| Run::kept(&folder)).flatten() {
            return Ok(run);
        }
        let run = build.reconstruct(capture, &self.out, options)?;
        run.keep(&self.out, &folder)?;
        Ok(run)
    }

    /// Runs a build on a case, and measures the result.
    fn side(
        &self,
        build: &Build,
        case: &Case,
        files: &Files,
        truth: &Truth,
    ) -> Result<(SideResults, Maps), String> {
        let own = case
            .options
            .iter()
            .flat_map(|(key, text)| [format!("--{}", key.replace('_', "-")), text.clone()]);
        let options: Vec<String> = own.chain(self.arguments.options.iter().cloned()).collect();
        let mut run = self.kept_or_new(build, &files.capture, &options)?;
        case.without_back(&mut run.maps);
        let wall = if case.wall.is_nan() { truth.extent[1] - truth.extent[0] } else { case.wall };
        let mut values = run.values(truth, wall)?;
        // Light that comes back to its origin carries no information on normals.
        if case.model == Some("retroreflective") {
            values[results::NORMALS] = f64::NAN;
        }
        let device = |key: &str| run.report["device"][key].as_str().unwrap_or_default().to_string();
        let last = run.report["trace"].as_array().and_then(|trace| trace.last()?["iteration"].as_u64());
        let side = SideResults {
            spec: format!("{}{}", build.program.display(), if run.reused { ", kept" } else { "" }),
            model: run.model(),
            runs_on: device("name"),
            iterations: last.unwrap_or(0) as usize,
            values,
            points: vec![results::CurvePoint::new(values[results::SOLVE], &values)],
            ..SideResults::default()
        };
        Ok((side, run.maps))
    }
}

impl Sides for Programs<'_> {
    fn run(
        &mut self,
        case: &Case,
        files: &Files,
        folder: &Path,
        mark: Mark<'_>,
    ) -> thirdbounce::Result<results::CaseResults> {
        mark()?;
        let truth = read_truth(&files.truth)?;
        let side = |(name, build): (&&str, &Build)| match self.side(build, case, files, &truth) {
            Ok((side, maps)) => (SideResults { name: (*name).into(), ..side }, Some(maps)),
            Err(e) => (SideResults::failed(name, e), None),
        };
        let sides: Vec<_> = ["a", "b"].iter().zip(self.builds).map(side).collect();
        let device = sides.iter().map(|(side, _)| side.runs_on.clone()).next().unwrap_or_default();
        finish(folder, results::CaseResults { device, ..case.reported() }, sides, &truth)
    }

    fn expected(&self, _: &Case) -> f64 {
        6.0 * self.builds.len() as f64
    }

    fn begin(&mut self, case: &Case, remaining: f64) -> ControlFlow<()> {
        eprintln!("{} {}; about {remaining:.0} s remain", case.group, case.name);
        ControlFlow::Continue(())
    }

    fn end(&mut self, case: &results::CaseResults) {
        case.why.iter().for_each(|(why, _)| eprintln!("{} is left out: {why}", case.name));
    }
}
