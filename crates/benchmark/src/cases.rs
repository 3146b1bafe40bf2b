//! Cases by group, those of a folder, and their files.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3, dvec3};

use crate::agreement::agreed;
use crate::pages;
use thirdbounce::Result;
use thirdbounce::capture::{self, Pulse};
use thirdbounce::export::npz::write_truth;
use thirdbounce::files::staging::Staging;
use thirdbounce::job::load;
use thirdbounce::maps::Maps;
use thirdbounce::settings::Settings;
use thirdbounce_command::family;
use thirdbounce_command::found::{captures_in, ending, entries, stem};
use thirdbounce_command::record::ResultRecord;
use thirdbounce_simulate::{
    Dark, Layout, Mesh, Object, Reflectance, Scene, capsule, photon_noise, rectangle, sphere, torus,
};

/// Groups of cases.
pub const GROUPS: [&str; 8] =
    ["standard", "family", "meshes", "captures", "scenes", "photons", "points", "models"];

/// Photons of the strongest bin of the group of that name, and dark counts of every bin.
const PHOTONS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
const DARK: f64 = 0.05;

/// The folder of captures that are made.
const MADE: &str = "captures";

/// A capture, and its truth.
#[derive(Debug, Clone)]
pub struct Case {
    /// Its group; empty for a capture of the caller.
    pub group: &'static str,
    /// Unique name.
    pub name: String,
    /// Description in a few words.
    pub words: String,
    /// True reflectance model, if known.
    pub model: Option<&'static str>,
    /// Width of the wall in metres; NaN if it is that of the capture.
    pub wall: f64,
    /// Settings that the capture needs: key and value.
    pub options: Vec<(String, String)>,
    /// Origin of the capture.
    pub source: Source,
}

/// Origin of a capture.
#[derive(Debug, Clone)]
pub enum Source {
    /// A scene to simulate.
    Scene(Box<family::FamilyCase>),
    /// A file.
    File {
        /// The capture.
        file: PathBuf,
        /// Without one, closed-form methods stand in for the truth.
        truth: Option<PathBuf>,
        /// Photons to draw with a mean of this many in the strongest bin, and their seed.
        photons: Option<(f64, u64)>,
    },
}

/// The files of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Files {
    /// The capture.
    pub capture: PathBuf,
    /// The truth.
    pub truth: PathBuf,
}

impl Case {
    /// A capture of the caller.
    pub fn of_file(name: String, file: PathBuf, truth: Option<PathBuf>) -> Case {
        let source = Source::File { file, truth, photons: None };
        Case { group: "", name, words: String::new(), model: None, wall: f64::NAN, options: vec![], source }
    }

    /// A scene to simulate.
    pub fn of_scene(group: &'static str, name: impl Into<String>, scene: family::FamilyCase) -> Case {
        let s = &scene.scene;
        let light = s.photons.map_or("exact values".into(), |photons| format!("{photons} photons"));
        let words = match scene.words.is_empty() {
            true => {
                let bins = 1e3 * s.bin_width;
                format!(
                    "{} {} × {} points of {} m, bins of {bins:.0} mm, {light}",
                    family::kind(s),
                    s.scan,
                    s.scan,
                    s.wall
                )
            }
            false => scene.words.clone(),
        };
        let (model, wall) = (Some(s.reflectance.name()), s.wall);
        Case {
            group,
            name: name.into(),
            words,
            model,
            wall,
            options: vec![],
            source: Source::Scene(Box::new(scene)),
        }
    }

    /// Whether closed-form methods stand in for the truth.
    pub fn is_agreed(&self) -> bool {
        matches!(self.source, Source::File { truth: None, .. })
    }

    /// The case; of the family, also the same things alone and measured exactly: what is wrong there is not for want of light.
    pub fn with_ideal(self) -> Vec<Case> {
        let ideal = match &self.source {
            Source::Scene(scene) if self.group == "family" => Some(Case::of_scene(
                self.group,
                format!("{}-ideal", self.name),
                scene.as_ref().clone().ideal(),
            )),
            _ => None,
        };
        std::iter::once(self).chain(ideal).collect()
    }

    /// The same case with photon counts. `None`: it is judged by agreement, which the counts would change.
    pub fn with_photons(&self, mean: f64, seed: u64) -> Option<Case> {
        let mut case = Case { name: format!("{}-photons-{mean}", self.name), ..self.clone() };
        case.words = format!("{mean} photons");
        match &mut case.source {
            Source::File { truth: None, .. } => return None,
            Source::File { photons, .. } => *photons = Some((mean, seed)),
            // A scene with photons of its own keeps them, and is left out.
            Source::Scene(scene) if scene.scene.photons.is_some() => scene.scene.photons = Some(f64::NAN),
            Source::Scene(scene) => (scene.scene.photons, scene.scene.seed) = (Some(mean), seed),
        }
        Some(case)
    }

    /// The case of the page, without results.
    pub fn reported(&self) -> pages::CaseResults {
        pages::CaseResults {
            group: self.group.into(),
            name: self.name.clone(),
            words: self.words.clone(),
            model: self.model.map(String::from),
            agreed: self.is_agreed(),
            ..pages::CaseResults::default()
        }
    }

    /// Takes pixels that show the wall behind the things out of the maps.
    pub fn without_back(&self, maps: &mut Maps) {
        if let Source::Scene(scene) = &self.source {
            scene.without_back(maps);
        }
    }

    /// Settings that its capture needs.
    ///
    /// # Errors
    /// Those of [`Settings::set`].
    pub fn settings(&self) -> Result<Settings> {
        Settings::from_texts(self.options.iter().map(|(key, text)| (key.as_str(), text.as_str())))
    }

    /// Makes the files below `out` unless they are there.
    ///
    /// # Errors
    /// A scene that cannot be simulated, a capture that cannot be read, or files that cannot be written. `Ok(Err)`: there is no
    /// capture, and why.
    pub fn files(&self, out: &Path) -> Result<std::result::Result<Files, String>> {
        let folder = out.join(MADE);
        let counts = || Ok(Err("its values are counts already, so no photons are drawn from them".into()));
        let (file, truth, photons) = match &self.source {
            Source::Scene(scene) if scene.scene.photons.is_some_and(f64::is_nan) => return counts(),
            Source::Scene(scene) => return self.simulated(&folder, scene).map(Ok),
            Source::File { file, truth, photons } => (file, truth, *photons),
        };
        let agreed = || -> Result<PathBuf> {
            let name = format!("{}_agreed", self.name);
            let record = ResultRecord::of([&**file], &[format!("{:?}", self.options)]);
            let make = |staged: &[PathBuf]| write_truth(&staged[0], &agreed(file, &self.settings()?)?);
            Ok(made(&folder, &name, &record, &[""], make)?.remove(0))
        };
        let truth = truth.clone().map_or_else(agreed, Ok)?;
        let Some((mean, seed)) = photons else { return Ok(Ok(Files { capture: file.clone(), truth })) };
        let whole = Settings { auto_gate: Some(false), ..Settings::default() };
        let exact = load(file, &whole)?.capture;
        if exact.integer_counts {
            return counts();
        }
        let record = ResultRecord::of([&**file], &[format!("photons {mean} seed {seed}")]);
        let capture = made(&folder, &self.name, &record, &[""], |staged| {
            let noisy = photon_noise(&exact, mean, Dark::Counts(0.0), None, seed);
            capture::write(&noisy.map_err(|e| e.at(file.display()))?, &staged[0]).map(drop)
        })?;
        Ok(Ok(Files { capture: capture[0].clone(), truth }))
    }

    fn simulated(&self, folder: &Path, scene: &family::FamilyCase) -> Result<Files> {
        let record = ResultRecord::of([], &[digest(scene)]);
        let files = made(folder, &self.name, &record, &["_truth", ""], |staged| {
            write_truth(&staged[0], &scene.truth()?)?;
            capture::write(&scene.capture()?, &staged[1]).map(drop)
        })?;
        Ok(Files { capture: files[1].clone(), truth: files[0].clone() })
    }
}

/// A name for the content of a value.
pub fn digest(what: &impl std::fmt::Debug) -> String {
    let mut hash = DefaultHasher::new();
    format!("{what:?}").hash(&mut hash);
    format!("{:016x}", hash.finish())
}

/// The files NAME and these endings, made beside their places unless the record says that they are there.
fn made(
    folder: &Path,
    name: &str,
    record: &ResultRecord,
    endings: &[&str],
    make: impl FnOnce(&[PathBuf]) -> Result<()>,
) -> Result<Vec<PathBuf>> {
    let files: Vec<PathBuf> = endings.iter().map(|end| folder.join(format!("{name}{end}.npz"))).collect();
    if record.is_done(&folder.join(name), "made_from.json") && files.iter().all(|file| file.is_file()) {
        return Ok(files);
    }
    let staging = Staging::new(folder)?;
    let staged: Vec<PathBuf> =
        files.iter().map(|file| staging.path().join(file.file_name().unwrap_or_default())).collect();
    make(&staged)?;
    staging.commit(&staged)?;
    record.write(&folder.join(name))?;
    Ok(files)
}

/// The cases of a folder, captures before scenes, sorted by name. The truth of `NAME.npz` is `NAME_truth.npz`, `truth_NAME.npz` or
/// `truth/NAME.npz`. A scene is `NAME.scene`, which `scene` reads.
///
/// # Errors
/// A folder that cannot be read; those of `scene`.
pub fn found_in(folder: &Path, scene: &dyn Fn(String, &Path) -> Result<Case>) -> Result<Vec<Case>> {
    let scenes = entries(folder)?.into_iter().filter(|path| path.is_file() && ending(path) == "scene");
    let scenes = scenes.map(|path| scene(stem(&path), &path)).collect::<Result<Vec<_>>>()?;
    let captures = captures_in(folder)?.into_iter().map(|path| {
        let truth = truth_of(&path);
        Case::of_file(stem(&path), path, truth)
    });
    Ok(captures.chain(scenes).collect())
}

/// The truth of `NAME.npz` beside it: `NAME_truth.npz`, `truth_NAME.npz` or `truth/NAME.npz`.
pub fn truth_of(capture: &Path) -> Option<PathBuf> {
    let name = stem(capture);
    let truths = [format!("{name}_truth.npz"), format!("truth_{name}.npz"), format!("truth/{name}.npz")];
    truths.iter().map(|truth| capture.with_file_name(truth)).find(|truth| truth.is_file())
}

/// The cases of a group. `seeds` are those of the family, `data` the folder of meshes and measured captures.
///
/// # Errors
/// A mesh that cannot be read.
fn of(group: &str, seeds: Range<u64>, data: Option<&Path>) -> Result<Vec<Case>> {
    let random = |seed| Case::of_scene("family", format!("family-{seed}"), family::FamilyCase::of(seed));
    Ok(match group {
        "standard" => standard()?,
        "family" => seeds.map(random).collect(),
        "meshes" => meshes(data)?,
        "captures" => data.map_or(vec![], captures),
        "scenes" => scenes(data)?,
        "photons" => photons()?,
        "points" => points("points")?,
        _ => models()?,
    })
}

/// The cases of several groups. Those of a name that an earlier group has are left out.
///
/// # Errors
/// A mesh that cannot be read.
pub fn all(groups: &[&'static str], seeds: Range<u64>, data: Option<&Path>) -> Result<Vec<Case>> {
    let mut all: Vec<Case> = vec![];
    for group in groups {
        for case in of(group, seeds.clone(), data)? {
            if !all.iter().any(|other| other.name == case.name) {
                all.push(case);
            }
        }
    }
    Ok(all)
}

/// A scene of diffuse surfaces.
fn matt(group: &'static str, name: impl Into<String>, scene: Scene) -> Case {
    Case::of_scene(
        group,
        name,
        family::FamilyCase::plain(Scene { reflectance: Reflectance::Lambertian, ..scene }),
    )
}

/// A built-in scene by number of points.
fn scanned(name: &str, scan: usize) -> Result<Scene> {
    Ok(Scene { scan, bin_width: 0.01, ..Scene::named(name)? })
}

fn lit(scene: Scene, photons: f64, dark: f64) -> Scene {
    Scene { photons: Some(photons), dark: Dark::Counts(dark), ..scene }
}

fn one_laser(scene: Scene) -> Scene {
    Scene { layout: Layout::OneLaser { point: DVec2::ZERO }, ..scene }
}

fn irregular(scene: Scene) -> Scene {
    Scene { layout: Layout::Irregular { seed: 0 }, ..scene }
}

/// The scene with another object, which the truth does not show: a wall behind its things, or a floor below them.
fn with_room(scene: Scene, mesh: Mesh, back: Option<f64>) -> family::FamilyCase {
    let mut case = family::FamilyCase { back, ..family::FamilyCase::plain(scene) };
    case.scene.reflectance = Reflectance::Lambertian;
    case.scene.objects.push(Object { mesh, albedo: 0.4 });
    case
}

/// A wall behind the things at a depth.
fn before_wall(scene: Scene, depth: f64) -> family::FamilyCase {
    with_room(scene, rectangle(dvec3(0.0, 0.0, depth), DVec3::Y * 0.8, DVec3::X * 0.8), Some(depth))
}

/// The cases of the benchmark that one waits for.
fn standard() -> Result<Vec<Case>> {
    let things = vec![
        sphere(dvec3(-0.25, 0.17, 0.65), 0.13),
        torus(dvec3(0.22, 0.17, 0.85), dvec3(0.25, 0.45, -1.0), 0.13, 0.05),
        capsule(dvec3(-0.1, -0.28, 0.7), 0.08, dvec3(0.2, -0.12, 0.75), 0.08),
    ];
    let things = things.into_iter().map(|mesh| Object { mesh, albedo: 1.0 }).collect();
    let things = Scene { bin_width: 0.01, ..Scene::new("things", things) };
    let of = |name: &str, scene| matt("standard", name, scene);
    Ok(vec![
        of("figure-32x32", scanned("figure", 32)?),
        of("figure-8x8", scanned("figure", 8)?),
        of("one-laser", one_laser(scanned("figure", 32)?)),
        of("10-photons", lit(scanned("figure", 32)?, 10.0, DARK)),
        Case::of_scene("standard", "three-before-wall", before_wall(things, 1.2)),
        of("letter-R", scanned("letter-R", 32)?),
        // Counts, background, bins and impulse response of two published captures: a matt letter, and a statue.
        hidden_pulse(of(
            "letter-S-as-measured",
            Scene {
                scan: 64,
                bin_width: 0.0135,
                pulse: Some(Pulse::gaussian(0.08)?.with_tail(0.04)?),
                ..lit(Scene::named("letter-S")?, 30.0, 5.0)
            },
        )),
        hidden_pulse(of(
            "figure-as-measured",
            Scene {
                scan: 64,
                bin_width: 0.005,
                pulse: Some(Pulse::gaussian(0.01)?),
                ..lit(Scene::named("figure")?, 9.0, 1.1)
            },
        )),
    ])
}

/// The case without its impulse response in the file.
fn hidden_pulse(mut case: Case) -> Case {
    if let Source::Scene(scene) = &mut case.source {
        scene.hide_pulse = true;
    }
    case
}

/// A scene under conditions that every group has rows for.
fn conditions(group: &'static str, name: &str, scene: &Scene) -> Result<Vec<Case>> {
    let of = |what: &str, scene| matt(group, format!("{name}-{what}"), scene);
    let low = scene.objects.iter().filter_map(|o| o.mesh.bounds()).map(|b| b.0.y).fold(f64::MAX, f64::min);
    let floor = rectangle(dvec3(0.0, low - 0.02, 0.9), DVec3::Z * 0.6, DVec3::X * 0.8);
    let pulsed =
        hidden_pulse(of("hidden-pulse", Scene { pulse: Some(Pulse::gaussian(0.03)?), ..scene.clone() }));
    Ok(vec![
        of("one-laser", one_laser(scene.clone())),
        of("irregular", irregular(scene.clone())),
        of("10-photons", lit(scene.clone(), 10.0, DARK)),
        Case::of_scene(group, format!("{name}-floor"), with_room(scene.clone(), floor, None)),
        Case::of_scene(group, format!("{name}-back-wall"), before_wall(scene.clone(), 1.3)),
        pulsed,
    ])
}

fn meshes(data: Option<&Path>) -> Result<Vec<Case>> {
    let files = data.and_then(|data| fs::read_dir(data.join("meshes")).ok());
    let mut paths: Vec<PathBuf> = files.into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "obj" || ending == "ply"));
    paths.sort();
    let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let built_in = ["plane", "sphere", "occluder", "plates", "within", "beyond"];
    let of = |spec: &str| {
        let scene = Scene::named(spec)?;
        let scene = if built_in.contains(&spec) { scene } else { scene.fitted(0.6)? };
        let mut case = matt("meshes", scene.name.clone(), scene);
        if let Source::Scene(scene) = &mut case.source {
            scene.render.noise = 0.02;
        }
        Ok(case)
    };
    let all: Result<Vec<Case>> = names.iter().map(String::as_str).chain(built_in).map(of).collect();
    Ok([all?, conditions("meshes", "sphere", &Scene::named("sphere")?)?].concat())
}

/// A built-in list: file below the folder of data, its truth if there is one, description, and settings that the file lacks.
type Listed = (&'static str, Option<&'static str>, &'static str, &'static [(&'static str, &'static str)]);

/// Measured captures, and those of other renderers without truth.
const MEASURED: [Listed; 11] = [
    ("statue_confocal_64.npz", None, "white statue, 2 m, 32 ps", &[]),
    ("su_confocal_64.npz", None, "retroreflective S and U, 0.7 m", &[]),
    ("z_captured_confocal_64.npz", None, "letter Z, 0.8 m", &[]),
    ("tx_captured_confocal_51.npz", None, "cardboard T above X, 51², 1 m, 64 ps", &[]),
    ("diffuse_s_confocal_64.npz", None, "matt S of paper, 0.7 m", &[]),
    ("native/lct_data_exit_sign.mat", None, "retroreflective exit sign, 0.8 m, 4 ps", &[]),
    (
        "native/ccsocr_figure4",
        None,
        "figure 4, one sensor point, 16 ps",
        &[("wall", "1.26"), ("bin_width", "0.0048")],
    ),
    ("sim_U_nonconfocal_64.npz", None, "letter U, one sensor point, simulated by others", &[]),
    ("native/lct_data_s_u.mat", None, "retroreflective S and U, 0.7 m, 4 ps", &[]),
    ("native/z_v73.mat", None, "letter Z, 0.8 m, 5 ps", &[("wall", "0.8"), ("bin_width", "0.0015")]),
    ("native/ccsocr_statue", None, "statue, 2 m, 32 ps", &[("wall", "2")]),
];

/// Captures of other renderers.
const PATH_TRACED: [Listed; 8] = [
    ("native/znlos_bunny_32.mat", Some("truth_znlos_bunny.npz"), "Z-NLOS bunny 32²", &[]),
    ("native/znlos_bunny_32.mat", Some("truth_znlos_bunny.npz"), "Z-NLOS bunny 32²", &[("stride", "2")]),
    ("native/znlos_bunny_32.mat", Some("truth_znlos_bunny.npz"), "Z-NLOS bunny 32²", &[("stride", "4")]),
    ("z_confocal_16.npz", Some("truth_z_confocal_16.npz"), "letter Z 16², path-traced", &[]),
    ("z_confocal_32.npz", Some("truth_z_confocal_32.npz"), "letter Z 32², path-traced", &[]),
    ("z_confocal_64.npz", Some("truth_z_confocal_64.npz"), "letter Z 64², path-traced", &[]),
    ("spheres_confocal_32.npz", Some("truth_spheres_confocal_32.npz"), "spheres 32², path-traced", &[]),
    (
        "z_bumpwall_confocal_32.npz",
        Some("truth_z_bumpwall_confocal_32.npz"),
        "letter Z 32², curved wall, path-traced",
        &[],
    ),
];

/// A case of a built-in list.
fn listed(group: &'static str, data: &Path, (file, truth, words, options): &Listed) -> Case {
    let changes: String =
        options.iter().filter(|o| o.0 == "stride").map(|o| format!("-stride-{}", o.1)).collect();
    Case {
        group,
        words: (*words).into(),
        model: truth.map(|_| "lambertian"),
        wall: if truth.is_some() { 1.0 } else { f64::NAN },
        options: options.iter().map(|(key, text)| ((*key).into(), (*text).into())).collect(),
        ..Case::of_file(stem(Path::new(file)) + &changes, data.join(file), truth.map(|t| data.join(t)))
    }
}

fn captures(data: &Path) -> Vec<Case> {
    MEASURED.iter().map(|case| listed("captures", data, case)).collect()
}

/// Scenes by number of points, others, one under all conditions, and rendered captures.
fn scenes(data: Option<&Path>) -> Result<Vec<Case>> {
    let mut all = points("scenes")?;
    for spec in ["letters-SU", "spheres"] {
        all.push(matt("scenes", spec, Scene::named(spec)?));
    }
    all.extend(conditions("scenes", "figure", &scanned("figure", 32)?)?);
    all.extend(data.iter().flat_map(|data| PATH_TRACED.iter().map(|case| listed("scenes", data, case))));
    Ok(all)
}

fn points(group: &'static str) -> Result<Vec<Case>> {
    let each = ["figure", "torus"].into_iter().flat_map(|name| [8, 16, 32, 64].map(|scan| (name, scan)));
    let of = |(name, scan)| Ok(matt(group, format!("{name}-{scan:02}x{scan:02}"), scanned(name, scan)?));
    let all: Result<Vec<Case>> = each.map(of).collect();
    Ok([all?, conditions(group, "torus-16x16", &scanned("torus", 16)?)?].concat())
}

fn photons() -> Result<Vec<Case>> {
    let mut all = vec![];
    for name in ["figure", "torus"] {
        for scan in [32, 64] {
            for photons in PHOTONS {
                let words = format!("{name}-{scan}x{scan}-photons-{photons}");
                all.push(matt("photons", words, lit(scanned(name, scan)?, photons, DARK)));
            }
        }
    }
    all.extend(conditions("photons", "torus-100-photons", &lit(scanned("torus", 32)?, 100.0, DARK))?);
    Ok(all)
}

/// Scenes by every model of reflectance that their pairs can tell, and scenes with instruments that are not ideal.
fn models() -> Result<Vec<Case>> {
    use Reflectance::{Cosine, Lambertian, Retroreflective};
    let exhaustive = |scene| Scene { layout: Layout::Exhaustive { lasers: 8 }, scan: 8, ..scene };
    let [figure, torus] = [Scene::named("figure")?, Scene::named("torus")?];
    let scenes = [
        ("figure", figure.clone()),
        ("figure-one-laser", one_laser(figure.clone())),
        ("figure-exhaustive", exhaustive(figure.clone())),
        ("figure-100-photons", lit(figure.clone(), 100.0, 0.1)),
        ("figure-10-photons", lit(figure.clone(), 10.0, 0.1)),
        ("figure-1-photon", lit(figure.clone(), 1.0, 0.1)),
        ("torus", torus.clone()),
        ("torus-irregular", irregular(torus.clone())),
        ("torus-10-photons", lit(torus, 10.0, 0.1)),
        ("spheres", Scene::named("spheres")?),
        ("letter-R", Scene::named("letter-R")?),
        ("letters-SU", Scene::named("letters-SU")?),
    ];
    let mut all = vec![];
    for (name, scene) in scenes {
        let models = [Cosine, Lambertian, Retroreflective].into_iter();
        // A retroreflective surface sends no light to another point of the wall.
        for model in models.filter(|m| *m != Retroreflective || scene.layout == Layout::Confocal) {
            let scene = family::FamilyCase::plain(Scene { reflectance: model, ..scene.clone() });
            all.push(Case::of_scene("models", format!("{name}-{}", model.name()), scene));
        }
    }
    let mut tailed =
        Scene { pulse: Some(Pulse::gaussian(0.03)?.with_tail(0.012)?), ..Scene::named("beyond")? };
    tailed = lit(tailed, 1000.0, 5.0);
    let others = [
        ("figure-spot", Scene { spots: [0.06; 2], ..figure.clone() }),
        ("plates", Scene::named("plates")?),
        ("beyond-tail", tailed),
    ];
    for (name, scene) in others {
        let hide_pulse = scene.pulse.is_some();
        all.push(Case::of_scene(
            "models",
            name,
            family::FamilyCase { hide_pulse, ..family::FamilyCase::plain(scene) },
        ));
    }
    all.extend(conditions("models", "figure-lambertian", &figure)?);
    Ok(all)
}
