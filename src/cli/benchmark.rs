//! `thirdbounce benchmark [DIR]`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use thirdbounce::Result;
use thirdbounce::export::benchmark::Case;
use thirdbounce::files::atomic;
use thirdbounce::job::benchmark::{Caller, Scene, Source, benchmark, family, found_in};
use thirdbounce::job::{self, Benchmark, Comparison, Input, Loaded, Turn};
use thirdbounce::solve::Progress;

use super::compare::{HowArgs, METHODS, Turns};
use super::terminal::{print, say, say_error};
use super::{advice, interrupt, methods};

/// Exit code after Ctrl-C, as for the other verbs.
const STOPPED: u8 = 130;

#[derive(clap::Args)]
#[command(after_help = METHODS)]
pub struct Args {
    /// Folder of scenes: captures (the truth of NAME.npz is NAME_truth.npz, truth_NAME.npz or truth/NAME.npz; without one,
    /// methods are judged by what closed-form methods agree on), and NAME.scene with the arguments of simulate, or with
    /// family and the seed of a random scene, whose captures are made
    folder: Option<PathBuf>,
    /// Scenes of the program's own, beside those of the folder: random ones, and two with 8 × 8 to 64 × 64 points [default:
    /// without a folder]
    #[arg(long)]
    own: bool,
    /// Folder for the page, a folder for each case, and the captures that are made [default: benchmark, in DIR if there is
    /// one]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A method (see below). May be repeated, or separate several with ; [default: all, with
    /// 300 iterations of paper if there are scenes of the program's own]
    #[arg(long, visible_alias = "methods", value_name = "METHOD", value_delimiter = ';')]
    method: Vec<String>,
    /// Draw photon counts from every scene that has exact values, with a mean of P in the strongest bin; one case for
    /// each P
    #[arg(long, value_name = "P,...", value_delimiter = ',')]
    photons: Vec<f64>,
    /// Run every method R times, in turns; times are medians
    #[arg(long, value_name = "R", default_value_t = 1)]
    repeats: usize,
    #[command(flatten)]
    how: HowArgs,
}

/// The scenes of the program's own: names, and what stands in their files. Two scanned at more and more points, then others,
/// then seeds of the random family that nothing was tuned to, without walls behind their things.
fn own() -> Vec<(String, String)> {
    let scanned = |n: usize| {
        ["figure", "torus"].map(|of| {
            (format!("{of}-{n:02}x{n:02}"), format!("{of} --scan {n} --bin-width 1cm --model lambertian\n"))
        })
    };
    let mut all: Vec<_> = [8, 16, 32, 64].into_iter().flat_map(scanned).collect();
    all.sort();
    let others = [
        ("letters-SU", "letters-SU --model lambertian"),
        ("spheres", "spheres --model lambertian"),
        ("figure-10-photons", "figure --model lambertian --photons 10 --dark 0.05"),
    ];
    all.extend(others.map(|(name, text)| (name.into(), format!("{text}\n"))));
    let seeds = (40..).filter(|seed| family::Case::of(*seed).back.is_none()).take(4);
    all.extend(seeds.map(|seed| (format!("family-{seed}"), format!("family {seed}\n"))));
    all
}

/// Writes the files of the program's own scenes, but for those that are there already.
fn write_own(folder: &Path) -> Result<()> {
    for (name, text) in own() {
        let file = folder.join(format!("{name}.scene"));
        if !std::fs::read_to_string(&file).is_ok_and(|there| there == text) {
            atomic::write(&file, text.as_bytes())?;
        }
    }
    Ok(())
}

/// What a file of a scene asks for.
fn source_of(file: PathBuf) -> Result<Source> {
    let text = std::fs::read_to_string(&file).unwrap_or_default();
    let words: Vec<&str> = text.split_whitespace().collect();
    if let ["family", seed] = words[..]
        && let Ok(seed) = seed.parse()
    {
        return Ok(Source::Family { file, seed });
    }
    let what = Box::new(super::simulate::scene_of(&file)?);
    Ok(Source::Simulation { file, what })
}

/// The scenes of a folder.
fn scenes_of(folder: &Path) -> Result<Vec<Scene>> {
    let found = found_in(folder)?;
    let there = found
        .captures
        .into_iter()
        .map(|(name, file, truth)| Ok(Scene { name, source: Source::Capture { file, truth } }));
    let made = found.scenes.into_iter().map(|(name, file)| Ok(Scene { name, source: source_of(file)? }));
    there.chain(made).collect()
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let how = &args.how;
    let owns = args.own || args.folder.is_none();
    // A thousand iterations of every scene would take hours.
    let usual: &[&str] = if owns { &["all", "paper:iterations=300,name=paper"] } else { &["all"] };
    let specs = how.specs(&args.method, usual)?;
    how.check()?;
    Comparison::check_repeats(args.repeats)?;
    let mut scenes = args.folder.as_deref().map(scenes_of).transpose()?.unwrap_or_default();
    let out = args.out.clone().unwrap_or_else(|| {
        args.folder.as_deref().map_or_else(|| "benchmark".into(), |folder| folder.join("benchmark"))
    });
    if owns {
        let folder = out.join("scenes");
        write_own(&folder)?;
        scenes.extend(scenes_of(&folder)?);
    }
    let mut options = how.told(&specs)?;
    options.push(format!("repeats {}", args.repeats));
    let what =
        Benchmark { scenes, photons: args.photons.clone(), seed: how.solver.choice().seed(), out, options };
    interrupt::stop_in_order();
    let mut running = Running { args, specs, turns: Turns::new(how.quiet) };
    let done = benchmark(&what, &mut running);
    running.turns.end();
    let done = done?;
    print(&done.page.summary());
    let files: Vec<_> = done.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("\nwrote     {}", files.join("\n          ")));
    Ok(match done.page.cases.iter().any(|case| case.failed) {
        _ if done.stopped => ExitCode::from(STOPPED),
        true => ExitCode::from(1),
        false => ExitCode::SUCCESS,
    })
}

struct Running<'a> {
    args: &'a Args,
    specs: Vec<methods::Spec>,
    turns: Turns,
}

impl Caller for Running<'_> {
    fn comparison(&mut self, capture: &Path, truth: &Path) -> Result<(Loaded, Comparison)> {
        let how = &self.args.how;
        let preset = how.solver.preset;
        let loaded = job::load(&Input { path: capture.into(), preset, ..Input::default() })?;
        how.say(&loaded.notes);
        let comparison = how.comparison(&self.specs, &loaded, truth, &|usual| usual)?;
        Ok((loaded, Comparison { repeats: self.args.repeats, ..comparison }))
    }

    fn hear(&mut self, case: &str, progress: Option<(&Turn<'_>, &Progress)>) -> ControlFlow<()> {
        match progress {
            Some((turn, progress)) => self.turns.hear(turn, progress),
            None => {
                self.turns.end();
                if !self.args.how.quiet {
                    say(&format!("case {case}"));
                }
                interrupt::asked()
            }
        }
    }

    fn tell(&mut self, case: &Case) {
        self.turns.end();
        let quiet = self.args.how.quiet;
        match &case.why {
            Some(why) if case.failed => {
                let mend = case.remedy.as_ref().map_or_else(String::new, advice::text);
                say_error(&format!("{}: ", case.folder), why, &mend);
            }
            Some(why) if !quiet => say(&format!("note: {} is left out: {why}", case.folder)),
            None if !quiet && case.was_there => say(&format!("{} is done already", case.folder)),
            None if !quiet => say(&format!("{} is done after {:.1} s", case.folder, case.seconds)),
            _ => {}
        }
    }
}
