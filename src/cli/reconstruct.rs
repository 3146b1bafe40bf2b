//! `thirdbounce reconstruct CAPTURE --out DIR`.

use std::path::{Path, PathBuf};

use thirdbounce::job::{self, Loaded, Request};
use thirdbounce::{Result, tags};

use super::histogram::FromTags;
use super::input::{CaptureArgs, DeviceArgs, VolumeArgs, check, load_file, load_with};
use super::progress::Meter;
use super::solver::SolverArgs;
use super::terminal::{print, say};
use super::{interrupt, tables, units};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub capture: CaptureArgs,
    /// Folder for the results: maps.npz, maps.exr, pictures, points.ply, mesh.ply, report.html, report.json
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Measure the result against this truth
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// A pixel is surface above this share of the brightest albedo [default: the method's own mask; paper: its domain threshold, 0.05 confocal, else 0.03]
    #[arg(long, value_name = "X", value_parser = units::number)]
    mask_fraction: Option<f64>,
    /// Add a point to the report's trace after every Nth iteration, with the figures if there is truth; 0: figures only
    /// at the end. Measuring does not count as solving [default: 10 with --truth, else 0]
    #[arg(long, value_name = "N")]
    trace_every: Option<usize>,
    /// Also keep maps and pictures of these iterations, in DIR/snapshots/000100 and so on
    #[arg(long, value_name = "I,I,...", value_delimiter = ',')]
    snapshots: Vec<usize>,
    /// Do not show preview.png in DIR while it runs (it goes when the result is there)
    #[arg(long)]
    no_preview: bool,
    /// Open report.html in a browser at the end
    #[arg(long)]
    open: bool,
    /// Print the time per kernel at the end (`thirdbounce profile` prints more)
    #[arg(long)]
    timings: bool,
    /// No progress and no notes, errors only
    #[arg(long, short)]
    pub quiet: bool,
    #[command(flatten)]
    tags: FromTags,
    #[command(flatten)]
    solver: SolverArgs,
    #[command(flatten)]
    grid: VolumeArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
}

impl Args {
    /// Refuses options that no capture makes good.
    pub fn check(&self) -> Result<()> {
        check(&self.solver, &self.grid, &self.device)
    }

    /// Reads a capture, or makes one of time tags, as the options say. Makes a request of those that other verbs have, too.
    pub fn load(&self, path: &Path) -> Result<(Loaded, Request)> {
        if self.tags.are_given() || tags::is_picoquant(path) {
            let read = |input: &job::Input| {
                let scan = self.tags.scan(input.wall)?;
                let asked = self.tags.asked(input.bin_width, input.turn)?;
                job::load_tags(input, &scan, &asked)
            };
            return load_with(path, &self.capture.part, &self.solver, &self.grid, &self.device, read);
        }
        load_file(path, &self.capture.part, &self.solver, &self.grid, &self.device)
    }

    /// The request with the options that only this verb has.
    pub fn over(&self, request: Request) -> Request {
        Request {
            timings: self.timings,
            truth: self.truth.clone(),
            mask_fraction: self.mask_fraction.or(request.mask_fraction),
            trace_every: self.trace_every,
            snapshots: self.snapshots.clone(),
            out: self.out.clone(),
            preview: !self.no_preview,
            ..request
        }
    }
}

pub fn run(args: &Args) -> Result<()> {
    let inputs = || std::iter::once(args.capture.capture.as_path()).chain(args.truth.as_deref());
    job::check_inputs(inputs(), &args.out)?;
    let (loaded, request) = args.load(&args.capture.capture)?;
    if !args.quiet {
        loaded.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let request = args.over(request);
    request.volume_file.iter().try_for_each(|file| job::check_not_input(file, inputs()))?;
    interrupt::stop_in_order();
    let mut meter = Meter::new(args.quiet);
    let outcome = job::run(&request, &loaded, &mut |progress| meter.hear(progress));
    meter.end();
    let outcome = outcome?;
    outcome.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    if !args.quiet {
        outcome.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    outcome.warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
    print(&tables::report(&outcome.report));
    if args.timings {
        print(&format!("\n{}", tables::kernels(&outcome.kernels)));
    }
    let files: Vec<_> = outcome.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("wrote     {}", files.join("\n          ")));
    if args.open {
        show(&args.out.join("report.html"));
    }
    Ok(())
}

/// Opens a page in the browser. A failure is non-fatal: the result is written.
fn show(page: &Path) {
    let page = page.canonicalize().unwrap_or_else(|_| page.into());
    match open::that_detached(&page) {
        Ok(()) => print(&format!("opened    {}", page.display())),
        Err(e) => say(&format!("note: no program opens {} ({e}); any browser shows it", page.display())),
    }
}
