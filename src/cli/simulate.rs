//! `thirdbounce simulate SCENE --out CAPTURE`.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use thirdbounce::Result;
use thirdbounce::job::{self, Simulation};
use thirdbounce::simulate::{DEFAULT_RESOLUTION, Dark, Reflectance, RenderOptions, Scene};

use super::progress::say;
use super::{interrupt, print, tables};

#[derive(clap::Args)]
#[command(after_help = scenes())]
pub struct Args {
    /// A built-in scene (listed below), or the path of a .obj or .ply mesh
    scene: String,
    /// Capture to write, npz or y-tal HDF5 by its ending
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    /// Write true depth, normals and mask too
    #[arg(long, value_name = "TRUTH.npz")]
    truth: Option<PathBuf>,
    /// Pixels of the truth's side
    #[arg(long, value_name = "N", default_value_t = DEFAULT_RESOLUTION)]
    truth_resolution: usize,
    /// Scan points per side
    #[arg(long, value_name = "N", default_value_t = 32)]
    scan: usize,
    /// Side of the square wall in metres
    #[arg(long, value_name = "SIZE", default_value_t = 1.0)]
    wall: f64,
    /// Bin width in metres of path
    #[arg(long, value_name = "M", default_value_t = 0.006)]
    bin_width: f64,
    /// Number of bins [default: as many as the scene's paths take]
    #[arg(long, value_name = "N")]
    bins: Option<usize>,
    /// How surfaces reflect
    #[arg(long, value_name = "NAME", default_value = "cosine",
        value_parser = PossibleValuesParser::new(["cosine", "lambertian"]).map(reflectance))]
    model: Reflectance,
    /// Albedo of everything
    #[arg(long, value_name = "A", default_value_t = 1.0)]
    albedo: f64,
    /// Draw photon counts, so many expected in the strongest bin
    #[arg(long, value_name = "P")]
    photons: Option<f64>,
    /// Mean dark counts of every bin; needs --photons
    #[arg(long, value_name = "D", default_value_t = 0.0)]
    dark: f64,
    /// Seed of the samples and of the photon counts
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Sample until the rendering's noise (RMS error over RMS value) is below this
    #[arg(long, value_name = "BOUND", default_value_t = 0.01)]
    noise: f64,
    /// Errors only
    #[arg(long, short)]
    quiet: bool,
}

fn reflectance(name: String) -> Reflectance {
    if name == "lambertian" { Reflectance::Lambertian } else { Reflectance::Cosine }
}

fn scenes() -> String {
    let lines = Scene::known().iter().map(|(name, about)| format!("  {name:<12}{about}"));
    format!("Scenes:\n{}", lines.collect::<Vec<_>>().join("\n"))
}

pub fn run(args: &Args) -> Result<()> {
    let mut scene = Scene::named(&args.scene)?;
    scene.set_albedo(args.albedo);
    (scene.scan, scene.wall) = (args.scan, args.wall);
    (scene.bin_width, scene.bins) = (args.bin_width, args.bins);
    (scene.photons, scene.dark) = (args.photons, Dark::Counts(args.dark));
    (scene.reflectance, scene.seed) = (args.model, args.seed);
    let simulation = Simulation {
        scene,
        render: RenderOptions { noise: args.noise, seed: args.seed, ..RenderOptions::default() },
        out: args.out.clone(),
        truth: args.truth.clone().map(|file| (file, args.truth_resolution)),
    };
    let done = job::simulate(&simulation, &mut interrupt::take_care)?;
    if !done.converged && !args.quiet {
        say(&format!(
            "note: the noise is {:.4}, above the bound of {}, after the most samples that are taken",
            done.noise, args.noise
        ));
    }
    print(&done.summary.to_string());
    print(&format!(
        "rendered  in {} with {} samples, noise {:.4}",
        tables::seconds(done.seconds),
        done.samples,
        done.noise
    ));
    let files: Vec<_> = done.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("wrote     {}", files.join("\n          ")));
    Ok(())
}
