//! `thirdbounce evaluate DIR [--truth TRUTH]`.

use std::path::PathBuf;

use thirdbounce::Result;

use crate::evaluate::evaluate;

use super::settings::number;
use super::tables;
use super::terminal::{json, print};

#[derive(clap::Args)]
pub struct EvaluateArgs {
    /// Folder that reconstruct wrote, or a maps.npz file
    dir: PathBuf,
    /// True maps: npz with gt_depth, gt_normal, gt_mask, gt_extent [default: what can be said without truth]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// A pixel is surface above this share of the brightest albedo [default: that of the reconstruction]
    #[arg(long, value_name = "X", value_parser = number)]
    mask_fraction: Option<f64>,
    /// Do not draw depth_difference.png into the folder
    #[arg(long)]
    no_pictures: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &EvaluateArgs) -> Result<()> {
    let found = evaluate(&args.dir, args.truth.as_deref(), args.mask_fraction, !args.no_pictures)?;
    if args.json {
        let text = found.metrics.as_ref().map_or_else(|| json(&found.parts), json)?;
        print(&text);
        return Ok(());
    }
    if let Some(metrics) = &found.metrics {
        print(&tables::metrics(metrics));
    }
    print(&tables::parts(&found.parts));
    if let Some(solve) = found.solve_s {
        print(&format!("time      solved in {}", tables::seconds(solve)));
    }
    if let Some(picture) = found.picture {
        print(&format!("wrote     {}", picture.display()));
    }
    Ok(())
}
