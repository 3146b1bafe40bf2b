//! `thirdbounce evaluate DIR --truth TRUTH`.

use std::path::PathBuf;

use thirdbounce::{Result, job};

use super::{json, print, tables};

#[derive(clap::Args)]
pub struct Args {
    /// Folder that reconstruct wrote, or a maps.npz
    dir: PathBuf,
    /// True maps: npz with gt_depth, gt_normal, gt_mask, gt_extent
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// A pixel is surface above this share of the brightest albedo [default: as reconstructed]
    #[arg(long, value_name = "X")]
    mask_fraction: Option<f64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<()> {
    let (metrics, solve) = job::evaluate(&args.dir, &args.truth, args.mask_fraction)?;
    if args.json {
        print(&json(&metrics)?);
        return Ok(());
    }
    print(&tables::metrics(&metrics));
    if let Some(solve) = solve {
        print(&format!("time      solved in {}", tables::seconds(solve)));
    }
    Ok(())
}
