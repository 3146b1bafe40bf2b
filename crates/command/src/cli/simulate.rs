//! `thirdbounce simulate SCENE --out CAPTURE`.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{CommandFactory, FromArgMatches, Parser};
use glam::DVec2;
use thirdbounce::options::units::{length, number, path};
use thirdbounce::settings::{DevicePosition, Settings};
use thirdbounce::{Error, Result};
use thirdbounce_simulate::{
    DEFAULT_RESOLUTION, Dark, EmptyRoom, Layout, MeshPlace, Motion, Reflectance, RenderOptions, Scene,
    WallShape,
};

use crate::generate::{self, Generation, GenerationOptions};
use crate::simulated::{self, Simulation};

use super::progress::{self, RenderingProgress};
use super::settings::word;
use super::terminal::{print, say};
use super::{interrupt, tables};

#[derive(clap::Args)]
#[command(after_help = scenes())]
pub struct SimulateArgs {
    /// A built-in scene (listed below), or the path of a .obj or .ply mesh
    #[arg(required_unless_present_any = ["family", "measured"])]
    scene: Option<String>,
    /// Capture to write: .npz, or .hdf5 for y-tal. With --family a folder
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    /// Random scenes of the seeds from A to B - 1, each measured in a random way, for training. Of seed 7, the folder gets the
    /// capture c7.npz, the truth t7.npz, and last s7.json, a description. Seeds that are there already are left alone
    #[arg(long, value_name = "A..B", group = "seeds", value_parser = seeds, conflicts_with_all = ["scene", "fit", "moving", "truth", "truth_resolution",
        "pairs", "point", "grid", "wall_shape", "wall", "bin_width", "bins", "reflectance", "occlusion", "albedo", "pulse", "pile_up",
        "spot", "device_at", "photons", "dark", "seed", "noise"])]
    family: Option<Range<u64>>,
    /// As --family, but letters, plates, figures and the like in the light of published captures: their counts, background, scan, bins and
    /// impulse response, with gains of points, masked points, and photons that bins miss
    #[arg(long, value_name = "A..B", group = "seeds", value_parser = seeds, conflicts_with_all = ["scene", "fit", "moving", "truth",
        "truth_resolution", "pairs", "point", "grid", "wall_shape", "wall", "bin_width", "bins", "reflectance", "occlusion", "albedo",
        "pulse", "pile_up", "spot", "device_at", "photons", "dark", "seed", "noise"])]
    measured: Option<Range<u64>>,
    /// Render scenes of --family or --measured coarsely: in hundredths of a second
    #[arg(long, requires = "seeds", conflicts_with = "scene")]
    coarse: bool,
    /// Measure scenes of --family or --measured exactly, and without room: no noise, no impulse response, no other light
    #[arg(long, requires = "seeds", conflicts_with = "scene")]
    ideal: bool,
    /// Also write what the learned start sees of scenes of --family or --measured: i7.npy, float16 [5][64][64][96]
    #[arg(long, requires = "seeds", conflicts_with = "scene")]
    inputs: bool,
    /// Scale the scene about its centre so that its largest side is this long. A mesh is turned so that its +z side faces the wall, and
    /// centred at z = 0.8 m [default: a mesh keeps its metres, and its place if it is in front of the wall, z > 0]
    #[arg(long, value_name = "SIZE", value_parser = length)]
    fit: Option<f64>,
    /// Also measure the room without the object, with noise of its own, and write its capture to this file, .npz or .hdf5, for
    /// --empty of a reconstruction; the truth is then the object alone. With --family a folder, which gets e7.npz of seed 7, if that scene
    /// has a room or ambient light
    #[arg(long, value_name = "EMPTY")]
    empty_out: Option<PathBuf>,
    /// Photons of the empty room, as a share of those that its light has in the capture
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = number, requires = "empty_out")]
    empty_share: f64,
    /// How the light differs while the empty room is measured: POWER, by how much the laser is stronger, and RIPPLE, the amplitude of
    /// a gain that changes smoothly over the wall: 0.03,0.05
    #[arg(long, value_name = "POWER,RIPPLE", allow_hyphen_values = true, requires = "empty_out")]
    empty_drift: Option<String>,
    /// A mesh or a built-in scene that is the room of SCENE: the capture shows both, that of --empty-out the room alone
    #[arg(long, value_name = "ROOM", conflicts_with = "seeds")]
    room: Option<String>,
    /// Let the scene move on a circle, except its room, and write N frames to the folder CAPTURE: frame-0000.npz and so on, with
    /// --truth their truths to the folder TRUTH.npz
    #[arg(long, value_name = "N")]
    moving: Option<usize>,
    /// Distance that the scene moves from frame to frame: 1cm, metres as a plain number; 0: it rests
    #[arg(long, value_name = "M", default_value_t = 0.01, value_parser = length, requires = "moving")]
    step: f64,
    /// Radius of the circle [default: 0.12 of the wall's side]
    #[arg(long, value_name = "M", value_parser = length, requires = "moving")]
    circle: Option<f64>,
    /// First frame, from 0, in which the last object of the scene is there
    #[arg(long, value_name = "N", requires = "moving")]
    appear: Option<usize>,
    /// First frame, from 0, in which the last object of the scene is gone
    #[arg(long, value_name = "N", requires = "moving")]
    vanish: Option<usize>,
    /// Also write true depth, normals, albedo and mask, to this file
    #[arg(long, value_name = "TRUTH.npz")]
    truth: Option<PathBuf>,
    /// Pixels per side of the truth
    #[arg(long, value_name = "N", default_value_t = DEFAULT_RESOLUTION)]
    truth_resolution: usize,
    /// Scan points per side [default: 32; of --family and --measured random]
    #[arg(long, value_name = "N")]
    scan: Option<usize>,
    /// How laser and sensor points are paired. confocal: both at every scan point; one-laser, one-sensor: one of them
    /// fixed at --point; exhaustive: every laser point of --grid with every scan point; irregular: as many pairs as scan
    /// points, drawn over the wall with --seed
    #[arg(long, value_name = "KIND", default_value = "confocal",
        value_parser = PossibleValuesParser::new(["confocal", "one-laser", "one-sensor", "exhaustive", "irregular"]))]
    pairs: String,
    /// The fixed laser or sensor point in metres [default: 0,0, the wall's centre]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    point: Option<String>,
    /// Laser points per side of exhaustive pairs [default: as --scan]
    #[arg(long, value_name = "L")]
    grid: Option<usize>,
    /// Shape of the wall; bump is a Gaussian towards the scene, with a height of a tenth of the wall's side
    #[arg(long, value_name = "SHAPE", default_value = "flat",
        value_parser = PossibleValuesParser::new(["flat", "bump"]).map(wall_shape))]
    wall_shape: WallShape,
    /// Side of the square wall: 80cm, metres as a plain number
    #[arg(long, value_name = "SIZE", default_value_t = 1.0, value_parser = length)]
    wall: f64,
    /// Bin width: a time (20ps) or a path (6mm, metres as a plain number)
    #[arg(long, value_name = "WIDTH", default_value_t = 0.006, value_parser = path)]
    bin_width: f64,
    /// Number of bins [default: as many as the scene's paths need]
    #[arg(long, value_name = "N")]
    bins: Option<usize>,
    /// How surfaces reflect
    #[arg(long, visible_alias = "model", value_name = "NAME", default_value = "cosine",
        value_parser = word::<Reflectance>(&["cosine", "lambertian", "retroreflective", "isotropic"]))]
    reflectance: Reflectance,
    /// Whether surfaces hide what is behind them
    #[arg(long, value_name = "ON|OFF", default_value = "on", action = clap::ArgAction::Set,
        value_parser = PossibleValuesParser::new(["on", "off"]).map(|word| word == "on"))]
    occlusion: bool,
    /// Albedo of all surfaces [default: 1, except the floor of beyond]
    #[arg(long, value_name = "A", value_parser = number)]
    albedo: Option<f64>,
    /// Spread every path over time as an instrument does: the full width at half maximum of a Gaussian, as a time (60ps) or
    /// a path (metres as a plain number); the same and, behind a colon, the length over which its tail falls to 1/e; or an npz file with pulse,
    /// pulse_delta_t and pulse_t_start. The capture then holds the pulse
    #[arg(long, value_name = "M|M:TAIL|FILE", allow_hyphen_values = true)]
    pulse: Option<String>,
    /// Leave the pulse out of the capture: a reconstruction has to find it
    #[arg(long, requires = "pulse")]
    hide_pulse: bool,
    /// Record only the first photon of every laser pulse, as detectors with a long dead time do. Of the pair with the
    /// most light, MEAN photons of a laser pulse are detected on average, usually 0.01 to 0.1
    #[arg(long, value_name = "MEAN", value_parser = number)]
    pile_up: Option<f64>,
    /// Let laser and sensor see areas of the wall: the full width at half maximum of a Gaussian each, in metres on the
    /// wall; one number is both. The capture then holds the spots
    #[arg(long, value_name = "M|LASER,SENSOR", allow_hyphen_values = true)]
    spot: Option<String>,
    /// Let the laser's light on the wall fall as cos / distance² from a device at this position in metres, z > 0, as renderers with a
    /// point light do. The capture then names the position
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    device_at: Option<String>,
    /// Draw photon counts at random, with P expected in the strongest bin
    #[arg(long, value_name = "P", value_parser = number)]
    photons: Option<f64>,
    /// Mean dark counts of every bin; needs --photons
    #[arg(long, value_name = "D", default_value_t = 0.0, value_parser = number)]
    dark: f64,
    /// Seed of the samples and of the photon counts
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Sample until the rendering's noise (RMS error over RMS value) is below this
    #[arg(long, value_name = "BOUND", default_value_t = 0.01, value_parser = number)]
    noise: f64,
    /// Errors only
    #[arg(long, short)]
    quiet: bool,
}

fn wall_shape(name: String) -> WallShape {
    if name == "bump" { WallShape::Bump } else { WallShape::Flat }
}

fn seeds(text: &str) -> std::result::Result<Range<u64>, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    ends.filter(|seeds| !seeds.is_empty())
        .ok_or_else(|| "give seeds as A..B, for example 100000..100100".into())
}

/// The layout that the options ask for. Refuses an option of another kind of pairs.
fn layout(args: &SimulateArgs) -> Result<Layout> {
    let kind = args.pairs.as_str();
    let misplaced = |option: &str, value: String, kinds: &str| {
        Error::options(
            format!("--{option} {value} was given with --pairs {kind}"),
            format!("leave it out, or choose --pairs {kinds}"),
        )
    };
    let fixed = matches!(kind, "one-laser" | "one-sensor");
    if let Some(point) = args.point.as_ref().filter(|_| !fixed) {
        return Err(misplaced("point", point.clone(), "one-laser or one-sensor"));
    }
    if let Some(grid) = args.grid.filter(|_| kind != "exhaustive") {
        return Err(misplaced("grid", grid.to_string(), "exhaustive"));
    }
    let point = args.point.as_deref().map_or(Ok(DVec2::ZERO), point_of)?;
    Ok(match kind {
        "one-laser" => Layout::OneLaser { point },
        "one-sensor" => Layout::OneSensor { point },
        "exhaustive" => Layout::Exhaustive { lasers: args.grid.unwrap_or(scan_of(args)) },
        "irregular" => Layout::Irregular { seed: args.seed },
        _ => Layout::Confocal,
    })
}

/// How the empty room is measured.
fn empty_room(args: &SimulateArgs) -> Result<EmptyRoom> {
    let numbers = args.empty_drift.as_deref().map(|text| {
        let numbers: Vec<Option<f64>> = text.split(',').map(|n| number(n).ok()).collect();
        match numbers[..] {
            [Some(power), Some(ripple)] => Ok([power, ripple]),
            _ => Err(Error::options(format!("--empty-drift is {text:?}"), "give POWER,RIPPLE: 0.03,0.05")),
        }
    });
    let [power, ripple] = numbers.unwrap_or(Ok([0.0; 2]))?;
    let how = EmptyRoom { share: args.empty_share, power, ripple };
    how.check()?;
    Ok(how)
}

fn scan_of(args: &SimulateArgs) -> usize {
    args.scan.unwrap_or(32)
}

fn point_of(text: &str) -> Result<DVec2> {
    let numbers: Vec<Option<f64>> = text.split(',').map(|n| length(n).ok()).collect();
    match numbers[..] {
        [Some(x), Some(y)] => Ok(DVec2::new(x, y)),
        _ => Err(Error::options(format!("--point is {text:?}"), "give x,y in metres: 0.1,-0.2")),
    }
}

fn scenes() -> String {
    let lines = Scene::known().iter().map(|(name, about)| format!("  {name:<12}{about}"));
    format!("Scenes:\n{}", lines.collect::<Vec<_>>().join("\n"))
}

pub fn run(args: &SimulateArgs) -> Result<ExitCode> {
    if let Some(seeds) = args.family.as_ref().or(args.measured.as_ref()) {
        return family(args, seeds.clone());
    }
    let simulation = simulation(args)?;
    match args.moving {
        Some(frames) => moving(args, &simulation, frames),
        None => one(args, &simulation),
    }
    .map(|()| ExitCode::SUCCESS)
}

/// Reads the file of a scene: the arguments of `simulate` but for files, over as many lines as one likes; # begins a comment.
/// The path of a mesh is that from the file's folder.
///
/// # Errors
/// A file that cannot be read, arguments that `simulate` does not take, or files among them.
pub fn scene_of(file: &Path) -> Result<Simulation> {
    #[derive(Parser)]
    #[command(no_binary_name = true, disable_help_flag = true)]
    struct SceneLine {
        #[command(flatten)]
        args: SimulateArgs,
    }
    let at = |e: Error| e.at(file.display());
    let hint =
        "write the arguments of simulate without files, for example: letter-Z --scan 32 --bin-width 6mm";
    let text =
        std::fs::read_to_string(file).map_err(|e| at(Error::input(format!("cannot be read: {e}"), hint)))?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let mut words: Vec<String> = lines.flat_map(str::split_whitespace).map(String::from).collect();
    let is_own = |word: &String| {
        [
            "--out",
            "--truth",
            "--empty-out",
            "--moving",
            "--circle",
            "--appear",
            "--vanish",
            "--family",
            "--measured",
        ]
        .iter()
        .any(|own| word.starts_with(own))
    };
    if let Some(word) = words.iter().find(|word| is_own(word)) {
        return Err(at(Error::input(
            format!("{word} does not fit here: the benchmark writes the files"),
            hint,
        )));
    }
    if let Some(first) = words.first_mut() {
        let mesh = file.with_file_name(&*first);
        if mesh.is_file() {
            *first = mesh.display().to_string();
        }
    }
    words.extend(["--out".into(), "capture.npz".into()]);
    let command = SceneLine::command().mut_args(|arg| {
        let takes = arg.get_action().takes_values() && !arg.is_positional();
        if takes { arg.allow_negative_numbers(true) } else { arg }
    });
    let parsed = command.try_get_matches_from(words).and_then(|m| SceneLine::from_arg_matches(&m));
    let line = parsed.map_err(|e| {
        let said = e.to_string();
        at(Error::input(said.lines().next().unwrap_or("").trim_start_matches("error: ").to_string(), hint))
    })?;
    simulation(&line.args).map_err(at)
}

/// The scene, which is not scaled yet, and where a mesh is.
fn scene_and_place(args: &SimulateArgs) -> Result<(Scene, Option<MeshPlace>)> {
    Scene::placed(args.scene.as_deref().unwrap_or_default(), args.fit.is_some())
}

/// What the arguments ask for.
fn simulation(args: &SimulateArgs) -> Result<Simulation> {
    let (mut scene, _) = scene_and_place(args)?;
    if let Some(size) = args.fit {
        scene = scene.fitted(size)?;
    }
    if let Some(room) = &args.room {
        let room = Scene::named(room)?.objects;
        scene.room += room.len();
        scene.objects.extend(room);
    }
    args.albedo.into_iter().for_each(|albedo| scene.set_albedo(albedo));
    (scene.scan, scene.wall) = (scan_of(args), args.wall);
    (scene.bin_width, scene.bins) = (args.bin_width, args.bins);
    let set = |key: &str, text: &Option<String>| {
        let mut settings = Settings::default();
        text.as_deref().map_or(Ok(()), |text| settings.set(key, text))?;
        Ok::<_, Error>(settings)
    };
    scene.pulse = set("pulse", &args.pulse)?.pulse.map_or(Ok(None), |pulse| pulse.samples())?;
    scene.spots = set("spot", &args.spot)?.spot.unwrap_or_default();
    scene.device = match set("device_at", &args.device_at)?.device_at {
        Some(DevicePosition::At(at)) => Some(at),
        _ => None,
    };
    (scene.photons, scene.dark, scene.pile_up) = (args.photons, Dark::Counts(args.dark), args.pile_up);
    (scene.reflectance, scene.seed) = (args.reflectance, args.seed);
    (scene.layout, scene.wall_shape, scene.occlusion) = (layout(args)?, args.wall_shape, args.occlusion);
    Ok(Simulation {
        scene,
        hide_pulse: args.hide_pulse,
        render: RenderOptions { noise: args.noise, seed: args.seed, ..RenderOptions::default() },
        out: args.out.clone(),
        truth: args.truth.clone().map(|file| (file, args.truth_resolution)),
        empty: args.empty_out.clone().map(|file| Ok::<_, Error>((file, empty_room(args)?))).transpose()?,
        is_truth_of_things: args.empty_out.is_some(),
        exposure: None,
    })
}

/// Writes scenes of the random family.
fn family(args: &SimulateArgs, seeds: Range<u64>) -> Result<ExitCode> {
    let empty = args.empty_out.as_ref().map(|_| empty_room(args)).transpose()?;
    let empty = empty.map(|EmptyRoom { share, power, ripple }| [share, power, ripple]);
    let generation = Generation {
        options: GenerationOptions {
            coarse: args.coarse,
            measured: args.measured.is_some(),
            ideal: args.ideal,
            scan: args.scan,
            empty,
        },
        seeds,
        inputs: args.inputs,
        out: args.out.clone(),
        empty_out: args.empty_out.clone(),
    };
    let bar = progress::bar(args.quiet, "{bar:16} {wide_msg} {elapsed}");
    interrupt::stop_in_order();
    let made = generate::generate(&generation, &|done, of| {
        if let Some(bar) = &bar {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{done} of {of} scenes"));
        }
        interrupt::asked()
    });
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    let made = made?;
    made.failed.iter().for_each(|(seed, e)| say(&format!("seed {seed}: left out: {e}")));
    if !args.quiet {
        let [written, there, failed] = [made.written, made.there, made.failed.len()];
        print(&format!(
            "wrote     {}: {written} scenes, {there} were there, {failed} left out",
            args.out.display()
        ));
    }
    if made.stopped {
        say("stopped: the same command goes on");
        return Ok(ExitCode::from(130));
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the frames of a sequence.
fn moving(args: &SimulateArgs, all: &Simulation, frames: usize) -> Result<()> {
    let motion =
        Motion { frames, step: args.step, circle: args.circle, appears: args.appear, vanishes: args.vanish };
    let mut exposure = None;
    for (i, scene) in all.scene.sequence(&motion)?.into_iter().enumerate() {
        let name = format!("frame-{i:04}.npz");
        let truth = all.truth.as_ref().map(|(folder, pixels)| (folder.join(&name), *pixels));
        // The room rests: the first frame measures it.
        let empty = all.empty.clone().filter(|_| i == 0);
        let frame = Simulation { scene, out: all.out.join(&name), truth, empty, exposure, ..all.clone() };
        let meter = RenderingProgress::new(args.quiet, &format!("frame {} of {frames}: ", i + 1));
        let done = simulated::simulate(&frame, &|progress| meter.hear(progress), &mut || {});
        meter.end();
        // All frames are measured as long as the first one.
        exposure = done?.exposure;
        if !args.quiet {
            print(&format!("wrote     {}", frame.out.display()));
        }
    }
    Ok(())
}

fn one(args: &SimulateArgs, simulation: &Simulation) -> Result<()> {
    let meter = RenderingProgress::new(args.quiet, "");
    let done =
        simulated::simulate(simulation, &|progress| meter.hear(progress), &mut interrupt::stop_in_order);
    meter.end();
    let done = done?;
    if args.quiet {
        return Ok(());
    }
    if !done.converged {
        say(&format!(
            "note: the noise is {:.4}, above the bound of {}, after the largest number of samples",
            done.noise, args.noise
        ));
    }
    done.notes.iter().for_each(|note| say(&format!("note: {note}")));
    print(&done.summary.to_string());
    if let Some(size) = simulation.scene.size() {
        let how = if args.fit.is_some() { "fitted" } else { "not scaled" };
        let how = match scene_and_place(args)?.1 {
            None => how.into(),
            Some(MeshPlace::OfFile) => format!("{how}, where the file has it"),
            Some(MeshPlace::Centred) => format!("{how}, turned to the wall and centred at z = 0.8 m"),
        };
        print(&format!("scene     {:.3} x {:.3} x {:.3} m, {how}", size.x, size.y, size.z));
    }
    print(&format!(
        "rendered  in {} with {} samples, noise {}",
        tables::seconds(done.seconds),
        done.samples,
        tables::number(done.noise)
    ));
    let files: Vec<_> = done.files.iter().map(|f| f.display().to_string()).collect();
    print(&format!("wrote     {}", files.join("\n          ")));
    Ok(())
}
