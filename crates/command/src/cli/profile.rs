//! `thirdbounce profile CAPTURE`.

use std::path::PathBuf;

use serde::Serialize;
use thirdbounce::export::report::Device;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::job::plain;
use thirdbounce::{Error, Kind, Result};

use crate::json::write_json;
use crate::profile::{self, DeviceLimits, KernelProfile, Profile, ProfileRequest, check, device_of, limits};

use super::progress::Meter;
use super::settings::{ALL, DeviceArgs, SettingsArgs, load, request};
use super::tables::{bytes, number, seconds};
use super::terminal::{print, say};
use super::{compiled, interrupt};

#[derive(clap::Args)]
pub struct ProfileArgs {
    /// Capture: a file (npz, HDF5 or MATLAB), or the folder of a capture with several files
    #[arg(required_unless_present_any = ["check", "compile"])]
    capture: Option<PathBuf>,
    /// Write the profile as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the timeline of host and device, for Perfetto (ui.perfetto.dev) and chrome://tracing
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Folder for the maps [default: they are not written]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Check the device, without a capture: compare the kernels of all solvers with their float64 reference, on every
    /// accumulation path of the device, and measure the device's limits
    #[arg(long, conflicts_with_all = ["capture", "trace", "out"])]
    pub check: bool,
    /// Compile the kernels of the solve and print what the driver says of each: registers, shared memory, spills,
    /// instructions, occupancy. Nothing runs and no buffer is made. Without a capture, for a scan of 32 x 32 points
    #[arg(long, conflicts_with_all = ["trace", "out", "check"])]
    pub compile: bool,
    /// Folder for the driver's listings of the compiled kernels, down to machine code
    #[arg(long, value_name = "DIR", requires = "compile")]
    listings: Option<PathBuf>,
    /// No progress and no notes, errors only
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    settings: SettingsArgs<ALL>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &ProfileArgs) -> Result<()> {
    if args.compile {
        return compile(args);
    }
    let Some(capture) = &args.capture else { return check_device(args) };
    let (loaded, request) = load(capture, &args.settings, &args.device)?;
    if !args.quiet {
        loaded.notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let mut tell = |text: &str| {
        if !args.quiet {
            say(text);
        }
    };
    let (json, trace, out) = (args.json.clone(), args.trace.clone(), args.out.clone());
    let what = ProfileRequest { request, json, trace, out };
    interrupt::stop_in_order();
    let mut meter = Meter::new(args.quiet);
    let done = profile::profile(&what, &loaded, &mut tell, &mut |progress| meter.hear(progress));
    meter.end(done.is_ok());
    let done = done?;
    done.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    print(&table(&done));
    let files = [&args.json, &args.trace, &args.out].into_iter().flatten();
    let files: Vec<_> = files.map(|f| f.display().to_string()).collect();
    if !files.is_empty() {
        print(&format!("wrote     {}", files.join("\n          ")));
    }
    Ok(())
}

fn compile(args: &ProfileArgs) -> Result<()> {
    if let Some(file) = &args.json {
        thirdbounce::job::check_file(file)?;
    }
    let (capture, request, notes) = match &args.capture {
        Some(given) => {
            let (loaded, request) = load(given, &args.settings, &args.device)?;
            (loaded.capture, request, loaded.notes)
        }
        None => (profile::compile::usual_capture()?, request(&args.settings, &args.device)?, vec![]),
    };
    if !args.quiet {
        notes.iter().for_each(|note| say(&format!("note: {note}")));
    }
    let done = profile::compile::compile(&request, &capture, args.listings.as_deref())?;
    done.validation.iter().for_each(|message| say(&format!("validation: {message}")));
    print(&compiled::table(&done));
    match &args.json {
        Some(file) => write_json(file, &done, true),
        None => Ok(()),
    }
}

/// The report of `--check`.
#[derive(Serialize)]
struct CheckReport {
    device: Device,
    limits: DeviceLimits,
    checks: Vec<check::Checked>,
}

fn check_device(args: &ProfileArgs) -> Result<()> {
    if let Some(file) = &args.json {
        thirdbounce::job::check_file(file)?;
    }
    let device = args.settings.settings()?.device;
    let open = |robust| {
        let options = GpuOptions {
            device: device.clone(),
            validation: args.device.validation,
            robust,
            pipeline_cache: args.device.pipeline_cache(),
            ..GpuOptions::default()
        };
        Gpu::open(&options)
    };
    let checked = open(true)?;
    let checks = check::check(&checked)?;
    checked.close().iter().for_each(|message| say(&format!("validation: {message}")));
    // Limits are measured as runs use the device: without checks of bounds.
    let gpu = open(false)?;
    let limits = limits::measure(&gpu)?;
    let mut text = format!("device    {} ({})\n", gpu.info.name, gpu.info.driver);
    text += &format!("{:<22}{:<10}{:<30}{:>14}{:>10}\n", "case", "adding", "kernel", "error", "allowed");
    for c in &checks {
        let error = format!("{:.1e}{}", c.error, if c.passed() { "" } else { " WRONG" });
        text +=
            &format!("{:<22}{:<10}{:<30}{error:>14}{:>10.0e}\n", c.solver, c.accumulation, c.pass, c.allowed);
    }
    let (all, wrong) = (checks.len(), checks.iter().filter(|c| !c.passed()).count());
    text += &limits_text(&limits);
    text += &format!("checked   {} of {all} comparisons with float64 references pass", all - wrong);
    print(&text);
    gpu.validation_messages().iter().for_each(|message| say(&format!("validation: {message}")));
    if let Some(file) = &args.json {
        write_json(file, &CheckReport { device: device_of(&gpu), limits, checks }, true)?;
    }
    if wrong > 0 {
        return Err(Error::new(
            Kind::Device,
            format!("{} computes {wrong} passes wrong", gpu.info.name),
            "update its driver, or choose another device with --device; if that does not help, report it",
        ));
    }
    Ok(())
}

fn limits_text(l: &DeviceLimits) -> String {
    let known = |rate: f64| if rate > 0.0 { number(rate) } else { "-".into() };
    let of_set = |(set, rate): (&u64, f64)| format!("{} {}/s", bytes(*set), bytes(rate as u64));
    let sets: Vec<String> = limits::SETS.iter().zip(l.set_bytes_per_s).map(of_set).collect();
    format!(
        "limits    per second: fma {}, additions to histograms {};\n\
        \x20         memory {}/s, within {}; a dispatch {}\n",
        known(l.fma_per_s),
        known(l.scattered_atomic_per_s),
        bytes(l.copy_bytes_per_s as u64),
        sets.join(", "),
        micro(l.dispatch_s),
    )
}

fn micro(s: f64) -> String {
    if s < 1e-3 { format!("{:.1} us", 1e6 * s) } else { seconds(s) }
}

fn table(p: &Profile) -> String {
    let (t, g, i) = (&p.totals, &p.gaps, &p.iterations);
    let mut out = format!("device    {} ({})\n{}\n", p.device.name, p.device.driver, limits_text(&p.limits));
    out += &format!(
        "{:<28}{:>7}{:>11}{:>9}{:>12}{:>12}{:>24}  {}\n",
        "kernel", "calls", "seconds", "share", "pairs", "pairs/s", "of its limit", "registers, shared memory"
    );
    p.kernels.iter().for_each(|k| out += &line(k));
    out += &format!("{:<28}{:>7}{:>11.4}\n\n", "all", "", t.device_s);
    let per = |whole: f64| 100.0 * whole / t.solve_s.max(1e-12);
    out += &format!(
        "time      solved in {}; the device computed {} ({:.1} %), load {}, preparation {}\n",
        seconds(t.solve_s),
        seconds(t.device_s),
        per(t.device_s),
        seconds(t.load_s),
        seconds(t.prepare_s),
    );
    out += &format!(
        "idle      {} between dispatches, largest {}; {} between submissions, largest {}\n",
        micro(g.within_s),
        micro(g.largest_within_s),
        micro(g.between_s),
        micro(g.largest_between_s)
    );
    out += &format!(
        "iteration {} on average over {}: passes over pairs {}, the rest {}\n",
        micro(i.seconds),
        i.count,
        micro(i.pass_s),
        micro(i.overhead_s)
    );
    let host: Vec<_> = p.host.iter().map(|(what, h)| format!("{what} {}", micro(h.seconds))).collect();
    out + &format!("host      {}\nmemory    {}\n", host.join(", "), bytes(t.peak_device_bytes))
}

fn line(k: &KernelProfile) -> String {
    let dash = || "-".to_string();
    let pairs = if k.pairs > 0.0 { format!("{:.3e}", k.pairs) } else { dash() };
    let rate = k.pairs_per_s.filter(|r| *r > 0.0).map_or_else(dash, |r| format!("{r:.3e}"));
    let limit = k.limit.zip(k.share_of_limit);
    let limit = limit.map_or_else(dash, |(name, share)| format!("{} {:.1} %", plain(&name), 100.0 * share));
    let statistics = k.statistics.iter().filter(|(n, _)| tells(n)).map(|(n, v)| format!("{n} {v}"));
    let notes: Vec<String> = statistics.collect();
    format!(
        "{:<28}{:>7}{:>11.4}{:>7.1} %{pairs:>12}{rate:>12}{limit:>24}  {}\n",
        k.name,
        k.calls,
        k.seconds,
        100.0 * k.share,
        notes.join(", ")
    )
}

/// Whether a driver's statistic is about registers, shared memory or spills.
fn tells(name: &str) -> bool {
    let name = name.to_lowercase();
    ["register", "gpr", "shared", "lds", "spill", "local memory", "scratch", "occupancy"]
        .iter()
        .any(|word| name.contains(word))
}
