//! `thirdbounce reconstruct CAPTURE --out DIR`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use thirdbounce::gpu::DeviceKind;
use thirdbounce::job::{Loaded, Request};
use thirdbounce::learned::LEAST_PAIRS;
use thirdbounce::{Error, Result, job};

use super::progress::Meter;
use super::settings::{self, CaptureArgs};
use super::terminal::{json, print, say};
use super::{interrupt, tables};

/// Endings of files in the folder of a result.
const FILES: [&str; 8] = ["npz", "mat", "exr", "svg", "png", "ply", "html", "json"];

#[derive(clap::Args)]
pub struct ReconstructArgs {
    #[command(flatten)]
    pub capture: CaptureArgs,
    /// Folder for the results: maps.npz, maps.mat, maps.exr, maps.svg, pictures, points.ply, mesh.ply, report.html, report.json
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Measure the result against this truth
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Add a point to the report's trace after every Nth iteration, with the figures if there is truth; 0: figures only
    /// at the end. Measuring does not count as solving [default: 10 with --truth, else 0]
    #[arg(long, value_name = "N")]
    trace_every: Option<usize>,
    /// Do not show preview.png in DIR while it runs (it goes when the result is there)
    #[arg(long)]
    no_preview: bool,
    /// Open report.html in a browser at the end
    #[arg(long)]
    open: bool,
    /// Print the time per kernel at the end (`thirdbounce profile` prints more)
    #[arg(long)]
    timings: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
    /// Print the report as JSON in place of a table
    #[arg(long)]
    pub json: bool,
    /// Write the volume to this file, .npz or .hdf5
    #[arg(long, value_name = "FILE")]
    pub volume_file: Option<PathBuf>,
    /// Write what is known of every pixel to this file, .npz, for training (learn/README.md)
    #[arg(long, value_name = "FILE", hide = true)]
    pub layers: Option<PathBuf>,
}

impl ReconstructArgs {
    /// Refuses options that no capture makes good.
    pub fn check(&self) -> Result<()> {
        let ending = self.out.extension().filter(|_| !self.out.is_dir()).and_then(|ending| ending.to_str());
        if let Some(ending) = ending.filter(|ending| FILES.contains(ending)) {
            return Err(Error::options(
                format!("--out {} has the name of a file", self.out.display()),
                format!(
                    "give the name of a folder, which will hold a .{ending}: --out {}",
                    self.out.with_extension("").display()
                ),
            ));
        }
        self.capture.settings.settings().map(drop)
    }

    /// Reads a capture as the options say.
    pub fn load(&self, path: &Path) -> Result<(Loaded, Request)> {
        let CaptureArgs { settings, device, .. } = &self.capture;
        let (loaded, request) = settings::load(path, settings, device)?;
        let request = Request {
            timings: self.timings,
            truth: self.truth.clone(),
            trace_every: self.trace_every,
            out: self.out.clone(),
            volume_file: self.volume_file.clone(),
            layers_file: self.layers.clone(),
            preview: !self.no_preview,
            ..request
        };
        Ok((loaded, request))
    }
}

pub fn run(args: &ReconstructArgs) -> Result<()> {
    args.check()?;
    let CaptureArgs { settings, device, .. } = &args.capture;
    let early = Request { timings: args.timings, ..settings::request(settings, device)? };
    let beside = early.settings.clone();
    let inputs =
        || std::iter::once(args.capture.capture.as_path()).chain(args.truth.as_deref()).chain(beside.files());
    job::check_inputs(inputs(), &args.out)?;
    // A Vulkan loader takes as long as a file of counts.
    let clock = Instant::now();
    let (loaded, gpu) = std::thread::scope(|scope| {
        let gpu = scope.spawn(|| early.open());
        (args.load(&args.capture.capture), gpu.join())
    });
    let (mut loaded, request) = loaded?;
    // The later one of both is waited for.
    loaded.seconds = clock.elapsed().as_secs_f64();
    if !args.quiet {
        loaded.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    request.volume_file.iter().try_for_each(|file| job::check_not_input(file, inputs()))?;
    interrupt::stop_in_order();
    let is_host = matches!(&gpu, Ok(Ok(gpu)) if gpu.info.kind == DeviceKind::Host);
    let mut meter = Meter::new(args.quiet).with_kernels(request.pipeline_cache.as_deref(), is_host);
    let open = || gpu.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let outcome = job::run_on(&request, &loaded, open, &mut |progress| meter.hear(progress));
    meter.end(outcome.is_ok());
    let outcome = outcome?;
    outcome.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    if !args.quiet {
        outcome.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let pairs = loaded.capture.pair_count();
    if !args.quiet && pairs <= LEAST_PAIRS {
        say(&format!(
            "hint: {pairs} pairs make no picture: `thirdbounce track` says where an object is, with the error"
        ));
    }
    if !args.quiet {
        outcome.warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
    }
    if args.json {
        print(&json(&outcome.report)?);
    } else if !args.quiet {
        print(&tables::report(&outcome.report));
        if args.timings {
            print(&format!("\n{}", tables::kernels(&outcome.kernels)));
        }
        let files: Vec<_> = outcome.files.iter().map(|f| f.display().to_string()).collect();
        print(&format!("wrote     {}", files.join("\n          ")));
    }
    if args.open {
        show(&args.out.join("report.html"));
    }
    Ok(())
}

/// Opens a page in the browser. A failure is non-fatal: the result is written.
fn show(page: &Path) {
    let page = page.canonicalize().unwrap_or_else(|_| page.into());
    match open::that_detached(&page) {
        Ok(()) => {}
        Err(e) => say(&format!("note: no program opens {} ({e}); any browser shows it", page.display())),
    }
}
