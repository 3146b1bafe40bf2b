//! `thirdbounce benchmark DIR`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use thirdbounce::Result;
use thirdbounce::export::benchmark::Case;
use thirdbounce::job::benchmark::{Caller, Scene, Source, benchmark, found_in};
use thirdbounce::job::{self, Benchmark, Comparison, Input, Loaded, Turn};
use thirdbounce::solve::Progress;

use super::compare::{HowArgs, METHODS, Turns};
use super::progress::{say, say_error};
use super::{advice, interrupt, methods, print};

/// Exit code after Ctrl-C, as for the other verbs.
const STOPPED: u8 = 130;

#[derive(clap::Args)]
#[command(after_help = METHODS)]
pub struct Args {
    /// Folder of scenes: captures with a truth beside them (the truth of NAME.npz is NAME_truth.npz, truth_NAME.npz or
    /// truth/NAME.npz), and NAME.scene with the arguments of simulate, whose captures are made
    folder: PathBuf,
    /// Folder for the page, a folder for each case, and the captures that are made [default: benchmark in DIR]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A method (see below). May be repeated, or separate several with ; [default: all]
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

pub fn run(args: &Args) -> Result<ExitCode> {
    let how = &args.how;
    let specs = how.specs(&args.method, &["all"])?;
    how.check()?;
    Comparison::check_repeats(args.repeats)?;
    let found = found_in(&args.folder)?;
    let without = found.without_truth.iter().map(|file| format!("{} has no truth beside it", file.display()));
    how.say(&without.collect::<Vec<_>>());
    let there = found
        .captures
        .into_iter()
        .map(|(name, file, truth)| Ok(Scene { name, source: Source::Capture { file, truth } }));
    let made = found.scenes.into_iter().map(|(name, file)| {
        let what = Box::new(super::simulate::scene_of(&file)?);
        Ok(Scene { name, source: Source::Simulation { file, what } })
    });
    let mut options = how.told(&specs)?;
    options.push(format!("repeats {}", args.repeats));
    let what = Benchmark {
        scenes: there.chain(made).collect::<Result<_>>()?,
        photons: args.photons.clone(),
        seed: how.solver.choice().seed(),
        out: args.out.clone().unwrap_or_else(|| args.folder.join("benchmark")),
        options,
    };
    interrupt::take_care();
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
