//! `thirdbounce info CAPTURE`.

use std::path::PathBuf;
use std::process::ExitCode;

use thirdbounce::capture::formats::recognised::hold_tags;
use thirdbounce::capture::scan::decimals;
use thirdbounce::{Result, export, job};

use crate::inspect::{Inspection, inspect};

use super::program::HostArgs;
use super::settings::CaptureArgs;
use super::terminal::{json, print, say};
use super::{advice, beside, interrupt, tables};

#[derive(clap::Args)]
pub struct InfoArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Also list how light is added up, what the scene does not need, and every buffer
    #[arg(long, conflicts_with = "json")]
    plan: bool,
    /// Draw the mean histogram, and maps of the scan with the path of each peak and the sum of counts: into this .png
    /// file, or into capture.png in this folder
    #[arg(long, value_name = "DIR or FILE")]
    png: Option<PathBuf>,
}

/// Ends with 1 if there is a problem with the capture or the plan. Of time tags it shows what they hold.
pub fn run(args: &InfoArgs, host: &HostArgs) -> Result<ExitCode> {
    if hold_tags(&args.capture.capture) {
        return beside::about_tags(&args.capture.capture, args.json, host);
    }
    let (loaded, request) = args.capture.load()?;
    let mut found = inspect(&request, &loaded)?;
    found.problems.iter_mut().for_each(|problem| *problem = advice::text(problem).into());
    if let Some(place) = &args.png {
        let named = place.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) && !place.is_dir();
        let path = if named { place.clone() } else { place.join("capture.png") };
        interrupt::stop_in_order();
        export::inspection::write(&path, &loaded.capture)?;
        say(&format!("wrote {}", path.display()));
    }
    print(&if args.json { json(&found)? } else { text(&found, args.plan) });
    Ok(if found.problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn text(found: &Inspection, with_plan: bool) -> String {
    let [nx, ny, nz] = found.grid;
    let b = &found.volume;
    let d = decimals(4, (b[1] - b[0]).max(b[3] - b[2]));
    let mm = found.voxel.map(|m| format!("{:.*}", d - 2, 1000.0 * m)).join(" x ");
    let mut out = format!("{}\n", found.capture);
    found.notes.iter().for_each(|note| out += &format!("note      {note}\n"));
    found.warnings.iter().for_each(|warning| out += &format!("warning   {warning}\n"));
    out += &format!("\nsolver    {}\ngrid      {nx} x {ny} x {nz} voxels of {mm} mm\n", found.options.name());
    out += &format!(
        "box       x {:.d$} to {:.d$} m, y {:.d$} to {:.d$} m, z {:.d$} to {:.d$} m\n",
        b[0], b[1], b[2], b[3], b[4], b[5]
    );
    let on = &found.device;
    out += &format!("device    {}\n", tables::device(&on.name, &on.kind.to_string(), &on.driver));
    found.problems.iter().for_each(|problem| out += &format!("problem   {problem}\n"));
    let Some(plan) = &found.plan else { return out };
    let list = |all: &[usize]| all.iter().map(|n| n.to_string()).collect::<Vec<_>>().join(", ");
    out += &format!("levels    {} lateral voxels", list(&plan.levels));
    if plan.level_pairs.iter().any(|n| *n < found.capture.pairs) {
        out += &format!(", with {} pairs", list(&plan.level_pairs));
    }
    if let Some(pixels) = plan.surface {
        out += &format!("; then a surface of {pixels} x {pixels} pixels");
    }
    out += "\n";
    let device = tables::bytes(plan.total_bytes);
    out += &format!("memory    {device} on the device and for copies to and from it\n");
    if !with_plan {
        return out;
    }
    out += &format!("adding    {}\n", job::plain(&plan.accumulation));
    out += &format!("left out  {}\n", plan.left_out.join("\n          "));
    out += "buffers\n";
    let mut buffers: Vec<_> = plan.buffers.iter().collect();
    buffers.sort_by_key(|(_, bytes)| std::cmp::Reverse(**bytes));
    for (name, bytes) in buffers {
        out += &format!("          {name:<18}{:>12}\n", tables::bytes(*bytes));
    }
    out
}
