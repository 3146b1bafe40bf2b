//! The cases of each group, and their files.

use std::fmt::Debug;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use fixtures::family;
use glam::DVec2;
use thirdbounce::capture::{self, Capture, Pulse};
use thirdbounce::export::npz::write_truth;
use thirdbounce::simulate::{
    DEFAULT_RESOLUTION, Dark, Layout, Reflectance, RenderOptions, Scene, photon_noise, simulate, truth,
};
use thirdbounce::{Result, Settings, job};

/// Groups in the order in which they are run.
pub const GROUPS: [&str; 7] = ["family", "meshes", "captures", "scenes", "photons", "points", "models"];

/// The groups of `all`.
pub const USUAL: [&str; 6] = ["family", "meshes", "captures", "scenes", "photons", "points"];

/// Photons of the strongest bin of the group of that name, and dark counts of every bin.
const PHOTONS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
const DARK: f64 = 0.05;

/// Noise of the rendering of the models' scenes.
const NOISE: f64 = 0.015;

/// Photons that the strongest bin expects, and dark counts of every bin.
type Light = [f64; 2];

/// A case of a group.
pub struct Case {
    pub group: &'static str,
    pub name: String,
    pub words: String,
    /// The true model of reflectance, if it is known.
    pub model: Option<&'static str>,
    /// Width of the wall in metres; NaN if it is not known.
    pub wall: f64,
    /// Options that the capture needs.
    pub options: Vec<String>,
    /// Whether agreement with closed-form methods says anything.
    pub is_judged: bool,
    pub source: Source,
}

/// Where the files of a case are from.
pub enum Source {
    /// A seed of the random family.
    Family(Box<family::Case>),
    /// A scene and the noise of its rendering; exact values without `light`. The capture may lack the pulse.
    Scene { scene: Box<Scene>, noise: f64, light: Option<Light>, hide_pulse: bool },
    /// Files that are there.
    Files { capture: PathBuf, truth: Option<PathBuf> },
}

impl Case {
    /// What the runs of a case depend on: cases of two groups with the same text are run once.
    pub fn same_as(&self) -> String {
        let source = match &self.source {
            Source::Family(case) => format!("family {}", digest(case)),
            Source::Scene { scene, noise, light, hide_pulse } => {
                format!("scene {}", digest(&(scene, noise, light, hide_pulse)))
            }
            Source::Files { capture, .. } => capture.display().to_string(),
        };
        format!("{source} {:?}", self.options)
    }

    /// Capture and truth, made below `keep` unless they are there.
    ///
    /// # Errors
    /// A scene that cannot be rendered, files that cannot be written.
    pub fn files(&self, keep: &Path) -> Result<(PathBuf, Option<PathBuf>)> {
        match &self.source {
            Source::Files { capture, truth } => Ok((capture.clone(), truth.clone())),
            Source::Family(case) => {
                let folder = keep.join(format!("rendered/family-{}-{}", case.scene.seed, digest(case)));
                made(&folder, || Ok((case.capture()?, case.truth()?)))
            }
            Source::Scene { scene, noise, light, hide_pulse } => {
                let name = format!("rendered/{}-{}-{}", scene.name, scene.scan, digest(&(scene, noise)));
                let exact = keep.join(name);
                let (file, truth) = made(&exact, || {
                    let options = RenderOptions { noise: *noise, ..RenderOptions::default() };
                    Ok((simulate(scene, &options)?.capture, truth(scene, DEFAULT_RESOLUTION)?))
                })?;
                if light.is_none() && !hide_pulse {
                    return Ok((file, truth));
                }
                let changed = exact.join(format!("{}.npz", digest(&(light, hide_pulse))));
                if !changed.is_file() {
                    let whole = Settings { auto_gate: Some(false), ..Settings::default() };
                    let mut capture = job::load(&file, &whole)?.capture;
                    if let Some([photons, dark]) = light {
                        capture = photon_noise(&capture, *photons, Dark::Counts(*dark), None, scene.seed)?;
                    }
                    capture.pulse = capture.pulse.filter(|_| !hide_pulse);
                    capture::write(&capture, &changed)?;
                }
                Ok((changed, truth))
            }
        }
    }
}

/// Capture and truth in a folder. The truth is written last: with it the folder is whole.
fn made(
    folder: &Path,
    make: impl FnOnce() -> Result<(Capture, thirdbounce::maps::Truth)>,
) -> Result<(PathBuf, Option<PathBuf>)> {
    let [file, truth_file] = ["capture.npz", "truth.npz"].map(|name| folder.join(name));
    if !truth_file.is_file() {
        let cannot = |e: std::io::Error| {
            thirdbounce::Error::output(
                format!("{}: {e}", folder.display()),
                "give another folder with --keep",
            )
        };
        fs::create_dir_all(folder).map_err(cannot)?;
        let (made, truth) = make()?;
        capture::write(&made, &file)?;
        write_truth(&truth_file, &truth)?;
    }
    Ok((file, Some(truth_file)))
}

/// A name for what a value says of itself.
pub fn digest(what: &impl Debug) -> String {
    let mut hash = DefaultHasher::new();
    format!("{what:?}").hash(&mut hash);
    format!("{:016x}", hash.finish())
}

/// The cases of a group. `data`: the folder of THIRDBOUNCE_DATA.
///
/// # Errors
/// A mesh that cannot be read.
pub fn of(group: &'static str, seeds: std::ops::Range<u64>, data: Option<&Path>) -> Result<Vec<Case>> {
    Ok(match group {
        "family" => seeds.map(random).collect(),
        "meshes" => meshes(data)?,
        "captures" => data.map_or(vec![], captures),
        "scenes" => scenes(data)?,
        "photons" => photons()?,
        "points" => points()?,
        _ => models()?,
    })
}

fn random(seed: u64) -> Case {
    let case = family::Case::of(seed);
    Case {
        group: "family",
        name: seed.to_string(),
        words: case.words.clone(),
        model: Some(case.scene.reflectance.name()),
        wall: case.scene.wall,
        options: vec![],
        is_judged: true,
        source: Source::Family(Box::new(case)),
    }
}

/// A scene of one model of reflectance before a wall of 1 m.
fn rendered(group: &'static str, name: String, scene: Scene, noise: f64, light: Option<Light>) -> Case {
    let light_text =
        light.map_or("exact".into(), |[photons, dark]| format!("{photons} photons, {dark} dark"));
    Case {
        group,
        name,
        words: format!("{}², 1 m, {:.0} mm, {light_text}", scene.scan, 1e3 * scene.bin_width),
        model: Some(scene.reflectance.name()),
        wall: scene.wall,
        options: vec![],
        is_judged: true,
        source: Source::Scene { scene: Box::new(scene), noise, light, hide_pulse: false },
    }
}

/// The same of a matt scene.
fn matt(group: &'static str, name: String, scene: Scene, noise: f64, light: Option<Light>) -> Case {
    rendered(group, name, Scene { reflectance: Reflectance::Lambertian, ..scene }, noise, light)
}

fn meshes(data: Option<&Path>) -> Result<Vec<Case>> {
    let files = data.and_then(|data| fs::read_dir(data.join("meshes")).ok());
    let mut paths: Vec<PathBuf> = files.into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "obj" || ending == "ply"));
    paths.sort();
    let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let built_in = ["plane", "sphere", "occluder", "plates", "within", "beyond"];
    let all = names.iter().map(String::as_str).chain(built_in);
    all.map(|spec| {
        let scene = Scene::named(spec)?;
        let scene = if built_in.contains(&spec) { scene } else { scene.fitted(0.6)? };
        Ok(matt("meshes", scene.name.clone(), scene, 0.02, None))
    })
    .collect()
}

/// Captures without truth: file below THIRDBOUNCE_DATA, what it is, options for what it lacks.
const CAPTURES: [(&str, &str, &[&str]); 11] = [
    ("statue_confocal_64.npz", "white statue, 2 m, 32 ps", &[]),
    ("su_confocal_64.npz", "retroreflective S and U, 0.7 m", &[]),
    ("z_captured_confocal_64.npz", "letter Z, 0.8 m", &[]),
    ("tx_captured_confocal_51.npz", "cardboard T above X, 51², 1 m, 64 ps", &[]),
    ("diffuse_s_confocal_64.npz", "matt S of paper, 0.7 m", &[]),
    ("native/lct_data_exit_sign.mat", "retroreflective exit sign, 0.8 m, 4 ps", &[]),
    (
        "native/ccsocr_figure4",
        "figure 4, one sensor point, 16 ps",
        &["--wall", "1.26", "--bin-width", "0.0048"],
    ),
    ("sim_U_nonconfocal_64.npz", "letter U, one sensor point, simulated by others", &[]),
    ("native/lct_data_s_u.mat", "retroreflective S and U, 0.7 m, 4 ps", &[]),
    ("native/z_v73.mat", "letter Z, 0.8 m, 5 ps", &["--wall", "0.8", "--bin-width", "0.0015"]),
    ("native/ccsocr_statue", "statue, 2 m, 32 ps", &["--wall", "2"]),
];

/// A capture of which no method shows a recognisable part: its result is drawn and timed, but not judged.
const UNJUDGED: (&str, &str, &[&str]) =
    ("native/km_mannequin.mat", "mannequin over 1.43 km, not judged", &[]);

fn captures(data: &Path) -> Vec<Case> {
    let case = |(file, words, options): &(&str, &str, &[&str])| Case {
        group: "captures",
        name: Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        words: (*words).into(),
        model: None,
        wall: f64::NAN,
        options: options.iter().map(|word| (*word).to_string()).collect(),
        is_judged: true,
        source: Source::Files { capture: data.join(file), truth: None },
    };
    let unjudged = Case { is_judged: false, ..case(&UNJUDGED) };
    CAPTURES.iter().map(case).chain([unjudged]).collect()
}

/// Captures of other renderers: name, capture, truth, what it is, and the strides at which it is taken.
const PATH_TRACED: [(&str, &str, &str, &str, &[usize]); 6] = [
    ("bunny", "native/znlos_bunny_32.mat", "truth_znlos_bunny.npz", "Z-NLOS bunny 32²", &[1, 2, 4]),
    ("z-16", "z_confocal_16.npz", "truth_z_confocal_16.npz", "letter Z 16², path-traced", &[1]),
    ("z-32", "z_confocal_32.npz", "truth_z_confocal_32.npz", "letter Z 32², path-traced", &[1]),
    ("z-64", "z_confocal_64.npz", "truth_z_confocal_64.npz", "letter Z 64², path-traced", &[1]),
    (
        "spheres-rendered",
        "spheres_confocal_32.npz",
        "truth_spheres_confocal_32.npz",
        "spheres 32², path-traced",
        &[1],
    ),
    (
        "z-bumpwall",
        "z_bumpwall_confocal_32.npz",
        "truth_z_bumpwall_confocal_32.npz",
        "letter Z 32², curved wall, path-traced",
        &[1],
    ),
];

/// The scenes of `thirdbounce benchmark` but for its seeds of the family, which are held out, and rendered captures.
fn scenes(data: Option<&Path>) -> Result<Vec<Case>> {
    let mut all = points()?;
    for (name, spec, light) in [
        ("letters-SU", "letters-SU", None),
        ("spheres", "spheres", None),
        ("figure-10-photons", "figure", Some([10.0, DARK])),
    ] {
        all.push(matt("scenes", name.into(), Scene::named(spec)?, 0.01, light));
    }
    for (name, file, truth, words, strides) in data.map_or(&[][..], |_| &PATH_TRACED[..]) {
        let folder = data.unwrap_or(Path::new(""));
        all.extend(strides.iter().map(|stride| Case {
            group: "scenes",
            name: if *stride > 1 { format!("{name}-stride-{stride}") } else { (*name).into() },
            words: if *stride > 1 { format!("{words}, stride {stride}") } else { (*words).into() },
            model: Some("lambertian"),
            wall: 1.0,
            options: if *stride > 1 { vec!["--stride".into(), stride.to_string()] } else { vec![] },
            is_judged: true,
            source: Source::Files { capture: folder.join(file), truth: Some(folder.join(truth)) },
        }));
    }
    all.iter_mut().for_each(|case| case.group = "scenes");
    Ok(all)
}

/// Figure and torus by number of points.
fn scanned(name: &str, scan: usize) -> Result<Scene> {
    Ok(Scene { scan, bin_width: 0.01, ..Scene::named(name)? })
}

fn points() -> Result<Vec<Case>> {
    let each = ["figure", "torus"].into_iter().flat_map(|name| [8, 16, 32, 64].map(|scan| (name, scan)));
    each.map(|(name, scan)| {
        Ok(matt("points", format!("{name}-{scan:02}x{scan:02}"), scanned(name, scan)?, 0.01, None))
    })
    .collect()
}

fn photons() -> Result<Vec<Case>> {
    let mut all = vec![];
    for name in ["figure", "torus"] {
        for scan in [32, 64] {
            for photons in PHOTONS {
                let words = format!("{name}-{scan}x{scan}-photons-{photons}");
                all.push(matt("photons", words, scanned(name, scan)?, 0.01, Some([photons, DARK])));
            }
        }
    }
    Ok(all)
}

/// Scenes by every model of reflectance that their pairs can tell, and scenes with instruments that are not ideal.
fn models() -> Result<Vec<Case>> {
    use Reflectance::{Cosine, Lambertian, Retroreflective};
    let one_laser = |scene| Scene { layout: Layout::OneLaser { point: DVec2::ZERO }, ..scene };
    let exhaustive = |scene| Scene { layout: Layout::Exhaustive { lasers: 8 }, scan: 8, ..scene };
    let irregular = |scene| Scene { layout: Layout::Irregular { seed: 0 }, ..scene };
    let [figure, torus] = [Scene::named("figure")?, Scene::named("torus")?];
    let scenes = [
        ("figure", figure.clone(), None),
        ("figure-one-laser", one_laser(figure.clone()), None),
        ("figure-exhaustive", exhaustive(figure.clone()), None),
        ("figure-100-photons", figure.clone(), Some([100.0, 0.1])),
        ("figure-10-photons", figure.clone(), Some([10.0, 0.1])),
        ("figure-1-photon", figure.clone(), Some([1.0, 0.1])),
        ("torus", torus.clone(), None),
        ("torus-irregular", irregular(torus.clone()), None),
        ("torus-10-photons", torus, Some([10.0, 0.1])),
        ("spheres", Scene::named("spheres")?, None),
        ("letter-R", Scene::named("letter-R")?, None),
        ("letters-SU", Scene::named("letters-SU")?, None),
    ];
    let mut all = vec![];
    for (name, scene, light) in scenes {
        let models = [Cosine, Lambertian, Retroreflective].into_iter();
        // A retroreflective surface sends no light to another point of the wall.
        for model in models.filter(|m| *m != Retroreflective || scene.layout == Layout::Confocal) {
            let scene = Scene { reflectance: model, ..scene.clone() };
            all.push(rendered("models", format!("{name}-{}", model.name()), scene, NOISE, light));
        }
    }
    let pulse = Pulse::gaussian(0.03)?;
    let tailed = Some(pulse.clone().with_tail(0.012)?);
    let others = [
        ("figure-pulse", Scene { pulse: Some(pulse), ..figure.clone() }, None),
        ("figure-spot", Scene { spots: [0.06; 2], ..figure }, None),
        ("plates", Scene::named("plates")?, None),
        ("beyond-tail", Scene { pulse: tailed, ..Scene::named("beyond")? }, Some([1000.0, 5.0])),
    ];
    for (name, scene, light) in others {
        let is_pulsed = scene.pulse.is_some();
        let mut case = rendered("models", name.into(), scene, NOISE, light);
        if let Source::Scene { hide_pulse, .. } = &mut case.source {
            *hide_pulse = is_pulsed;
        }
        all.push(case);
    }
    Ok(all)
}
