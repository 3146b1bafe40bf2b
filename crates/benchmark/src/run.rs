//! Cases × sides, where a side is a method or a build of the program: results of each case in a folder, and one page of all.
//! Finished cases are skipped.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::cases::{Case, Files};
use crate::pages::{self, Page, SideResults};
use thirdbounce::files::staging;
use thirdbounce::job::places;
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::{Error, Kind, Result};
use thirdbounce_command::overview;
use thirdbounce_command::record::{ResultRecord, check_place};

/// The file of a case, which is written last.
pub const WHOLE: &str = "case.json";

/// Cases, and where their results go.
#[derive(Debug, Clone)]
pub struct Benchmark {
    /// The cases, with distinct names.
    pub cases: Vec<Case>,
    /// Folder for the page, the captures that are made, and a folder for each case.
    pub out: PathBuf,
    /// Every option that changes results: a case that was made with others is made anew.
    pub options: Vec<String>,
    /// Other files on which results depend, such as maps of other programs.
    pub beside: Vec<PathBuf>,
}

/// Claims the folder of a case.
pub type Mark<'m> = &'m dyn Fn() -> Result<()>;

/// What is compared on a case.
pub trait Sides {
    /// Runs all sides on a case, writes its folder and returns it with its results ([`finish`]). `mark` claims the folder, once
    /// everything is checked and before anything is written.
    ///
    /// # Errors
    /// The capture cannot be used: the case fails, the benchmark continues.
    fn run(
        &mut self,
        case: &Case,
        files: &Files,
        folder: &Path,
        mark: Mark<'_>,
    ) -> Result<pages::CaseResults>;

    /// Expected seconds of a case on two cores, without knowledge of the machine.
    fn expected(&self, case: &Case) -> f64;

    /// Called at the beginning of a case, with the expected seconds until the end of the benchmark. May stop it.
    fn begin(&mut self, case: &Case, remaining: f64) -> ControlFlow<()>;

    /// Called at the end of a case.
    fn end(&mut self, case: &pages::CaseResults);
}

/// The result of a benchmark.
#[derive(Debug, Clone)]
pub struct Benched {
    /// All cases that were reached.
    pub page: Page,
    /// Whether it was stopped.
    pub stopped: bool,
    /// The files of the page.
    pub files: Vec<PathBuf>,
}

/// Seconds of the cases to come: their expected seconds, by the ratio of both for those that were computed.
#[derive(Default)]
struct Forecast {
    expected: f64,
    measured: f64,
}

impl Forecast {
    fn of(&self, rest: f64) -> f64 {
        if self.expected > 0.0 { rest * self.measured / self.expected } else { rest }
    }
}

/// Compares the sides on every case, and writes `benchmark.json` and `benchmark.html` after each.
///
/// # Errors
/// Before anything is computed: no case, two of one name, or a folder that cannot be written. A case's errors are reported, and
/// the benchmark continues, unless there is no other case. Later: a page that cannot be written.
pub fn benchmark(what: &Benchmark, sides: &mut dyn Sides) -> Result<Benched> {
    what.check()?;
    let is_alone = what.cases.len() == 1;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let version = env!("CARGO_PKG_VERSION").into();
    let mut page = Page { version, host: (processor(), cores), ..Page::default() };
    let (mut files, mut forecast) = (vec![], Forecast::default());
    for (at, case) in what.cases.iter().enumerate() {
        let rest = what.cases[at..].iter().filter(|case| !what.is_done(case));
        // The sum of nothing is -0.
        let rest = rest.fold(0.0, |sum, case| sum + sides.expected(case));
        let start = Instant::now();
        if sides.begin(case, forecast.of(rest)).is_break() {
            return Ok(Benched { page, stopped: true, files });
        }
        let done = match what.case(case, sides) {
            Err(e) if e.kind == Kind::Cancelled => return Ok(Benched { page, stopped: true, files }),
            Err(e) if is_alone => return Err(e),
            Err(e) => case.reported().without(&e, true),
            Ok(done) => done,
        };
        if !done.was_there && done.why.is_none() {
            forecast.expected += sides.expected(case);
            forecast.measured += start.elapsed().as_secs_f64();
        }
        sides.end(&done);
        page.seconds += done.seconds;
        page.cases.push(done);
        // Random scenes by quality, worst first.
        if page.cases.iter().all(|case| case.group == "family") {
            let own = |case: &pages::CaseResults| {
                case.sides.first().map_or(f64::INFINITY, |side| side.values[pages::OWN])
            };
            page.cases.sort_by(|a, b| own(a).total_cmp(&own(b)));
        }
        files = page.write(&what.out)?;
    }
    Ok(Benched { page, stopped: false, files })
}

impl Benchmark {
    fn check(&self) -> Result<()> {
        if self.cases.is_empty() {
            return Err(Error::input(
                "the benchmark has no scenes",
                "give a capture, or a folder with captures beside their truths (NAME.npz and NAME_truth.npz) or scenes to \
                 simulate (NAME.scene with the arguments of simulate)",
            ));
        }
        let mut names: Vec<&str> = self.cases.iter().map(|case| case.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::input(
                format!("two scenes of the benchmark have the name {:?}", twice[0]),
                "rename one of the files, or select one of the groups",
            ));
        }
        places::check_folder(&self.out)
    }

    /// Whether an earlier invocation left results of a case; those of other options count, too.
    fn is_done(&self, case: &Case) -> bool {
        self.out.join(&case.name).join(WHOLE).is_file()
    }

    /// Makes a case, or takes it from its folder.
    fn case(&self, case: &Case, sides: &mut dyn Sides) -> Result<pages::CaseResults> {
        let start = Instant::now();
        let folder = self.out.join(&case.name);
        let files = match case.files(&self.out)? {
            Ok(files) => files,
            Err(why) => return Ok(case.reported().without(&Error::input(why, ""), false)),
        };
        let options =
            [&self.options[..], &[format!("truth {} {:?}", files.truth.display(), case.options)]].concat();
        let made_of = [&files.capture, &files.truth].into_iter().chain(&self.beside).map(PathBuf::as_path);
        let record = ResultRecord::of(made_of, &options);
        if record.is_done(&folder, WHOLE) {
            let done: pages::CaseResults = pages::read_json(&folder.join(WHOLE))?;
            return Ok(pages::CaseResults { was_there: true, ..done });
        }
        check_place(&folder)?;
        // The case's file comes last, so a folder without it is made anew.
        let mark = || staging::remove(&folder.join(WHOLE)).and_then(|()| record.write(&folder));
        let done = sides.run(case, &files, &folder, &mark)?;
        Ok(pages::CaseResults { seconds: start.elapsed().as_secs_f64(), ..done })
    }
}

/// Writes the pictures of all sides, and last the case itself, into its folder.
///
/// # Errors
/// Files that cannot be written.
pub fn finish(
    folder: &Path,
    case: pages::CaseResults,
    sides: Vec<(SideResults, Option<Maps>)>,
    truth: &Truth,
) -> Result<pages::CaseResults> {
    let named: Vec<(&str, &Maps)> =
        sides.iter().filter_map(|(side, maps)| Some((side.name.as_str(), maps.as_ref()?))).collect();
    if !named.is_empty() {
        overview::write_all(&folder.join("pictures.png"), &named, truth)?;
    }
    let case = pages::CaseResults { sides: sides.into_iter().map(|(side, _)| side).collect(), ..case };
    pages::write_json(&folder.join(WHOLE), &case)?;
    Ok(case)
}

/// The model of the processor, where the system reports it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    model.map_or_else(|| std::env::consts::ARCH.to_string(), |(_, name)| name.trim().to_string())
}
