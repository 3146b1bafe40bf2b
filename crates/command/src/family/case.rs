//! Cases of the family: a scene, how it is measured, and its words.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, dvec2, dvec3};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::{Kind, Result};
use thirdbounce_simulate::*;

use super::dice::{Dice, one_at};
use super::losses::Losses;
use super::things as parts_of;

/// Most values of a capture: with more, a reconstruction by the defaults takes longer than some 15 s on two CPU cores.
const MOST_VALUES: f64 = 1e6;

/// Seeds from here on are to train on: more kinds of scenes and of scans. Those below are to measure with, and never change.
pub const TRAINING: u64 = 100_000;

/// What the scenes are drawn from.
pub(super) struct Ranges {
    /// Smallest share of the truth's pixels that show something.
    pub(super) least_seen: f64,
    /// Numbers of things, by weights.
    pub(super) counts: &'static [(f64, usize)],
    /// Sizes of a thing that is the only one; the nearest depth, and how much deeper others are; the least depth of any point; walls.
    pub(super) size: [f64; 2],
    pub(super) depths: [f64; 2],
    pub(super) clear: f64,
    /// Shares of scenes of flat things only, and of scenes without room.
    pub(super) flat: f64,
    pub(super) alone: f64,
    /// Shares of things that are signs, and of other things whose parts differ in albedo.
    pub(super) signs: f64,
    pub(super) pieced: f64,
    /// Scan points per side, by weights.
    pub(super) scans: &'static [(f64, usize)],
    /// Most photons of the strongest bin.
    pub(super) photons: f64,
    /// Widths of impulse responses, walls.
    pub(super) pulse: [f64; 2],
}

const TO_MEASURE: Ranges = Ranges {
    least_seen: 0.06,
    counts: &[(0.3, 1), (0.35, 2), (0.2, 3), (0.15, 4)],
    size: [0.5, 0.9],
    depths: [0.45, 0.75],
    clear: 0.3,
    flat: 0.0,
    alone: 0.0,
    signs: 0.0,
    pieced: 0.0,
    scans: &[(0.3, 24), (0.6, 32), (0.07, 48), (0.03, 64)],
    photons: 1e5,
    pulse: [0.01, 0.06],
};

pub(super) const TO_TRAIN: Ranges = Ranges {
    least_seen: 0.02,
    counts: &[(0.45, 1), (0.3, 2), (0.15, 3), (0.1, 4)],
    size: [0.3, 1.0],
    depths: [0.25, 1.25],
    clear: 0.12,
    flat: 0.15,
    alone: 0.3,
    signs: 0.12,
    pieced: 0.25,
    scans: &[(0.1, 8), (0.15, 12), (0.2, 16), (0.25, 24), (0.2, 32), (0.06, 48), (0.04, 64)],
    photons: 1e6,
    pulse: [0.005, 0.08],
};

/// Samples of a coarse rendering, and points per side of the wall that shadows are traced to.
const COARSE_SAMPLES: usize = 2048;
const COARSE_NODES: usize = 6;

/// A capture to come, with its truth.
#[derive(Debug, Clone)]
pub struct FamilyCase {
    /// Things, room and scan. The things come first.
    pub scene: Scene,
    /// Number of the objects that are parts of things. The truth shows these alone; the others are the room, and what
    /// stands beside the box.
    pub parts: usize,
    /// Depth of a wall behind the things, metres. To show it or not is the reconstruction's choice.
    pub back: Option<f64>,
    /// Light of the room in every bin, as a share of the strongest bin: the mean over pairs.
    pub ambient: f64,
    /// Leave the pulse out of the file.
    pub hide_pulse: bool,
    /// Leave the number of laser pulses out of the file, if there is pile-up.
    pub hide_cycles: bool,
    /// What the instrument loses of the light.
    pub losses: Losses,
    /// How it is rendered.
    pub render: RenderOptions,
    /// What it is, in a few words.
    pub words: String,
}

/// Three shares from 0 to 1 that are spread evenly over seeds in a row: multiples of powers of the root of g⁴ = g + 1.
fn evenly(seed: u64) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_5;
    std::array::from_fn(|d| (0.5 + (seed % (1 << 32)) as f64 * ROOT.powi(-(d as i32) - 1)).fract())
}

impl FamilyCase {
    /// A scene of which all objects are things, rendered without noise of its own.
    pub fn plain(scene: Scene) -> FamilyCase {
        let render = RenderOptions::default();
        let (parts, words) = (scene.objects.len(), String::new());
        FamilyCase {
            scene,
            parts,
            back: None,
            ambient: 0.0,
            hide_pulse: false,
            hide_cycles: false,
            losses: Losses::default(),
            render,
            words,
        }
    }

    /// The case of a seed. Any twenty seeds in a row have all kinds of pairs, of reflectance and of light, each about as
    /// often as in the whole family.
    pub fn of(seed: u64) -> FamilyCase {
        let mut dice = Dice(Pcg64::seed_from_u64(seed ^ 0x6661_6d69_6c79));
        let ranges = if seed < TRAINING { TO_MEASURE } else { TO_TRAIN };
        let (mut objects, mut words) = things(&mut dice, &ranges);
        while seen(&objects) < ranges.least_seen {
            (objects, words) = things(&mut dice, &ranges);
        }
        let parts = objects.len();
        let (room, back) = match dice.maybe(ranges.alone) {
            true => (vec![], None),
            false => room(&mut dice, &objects, &mut words),
        };
        let mut scene = Scene::new(format!("family-{seed}"), objects);
        scene.seed = seed;
        scan(&mut dice, &mut scene, ranges.scans, !room.is_empty());
        scene.objects.extend(room);
        scene.objects.iter_mut().for_each(|o| o.mesh = scaled(&o.mesh, scene.wall));
        let ambient = if dice.so_often(0.4) { dice.log(3e-4, 0.05) } else { 0.0 };
        let light = evenly(seed)[2];
        if light < 0.75 {
            scene.photons = Some(ranges.photons.powf(light / 0.75));
            scene.dark = Dark::Fraction(if dice.so_often(0.5) { dice.log(1e-4, 0.03) } else { 0.0 });
            scene.pile_up = dice.so_often(0.25).then(|| dice.log(0.02, 0.5));
        }
        if dice.so_often(0.45) {
            let pulse =
                Pulse::gaussian(scene.wall * dice.log(ranges.pulse[0], ranges.pulse[1])).expect("a pulse");
            let tailed = |dice: &mut Dice| pulse.with_tail(16.0 * pulse.width * dice.of(0.2, 0.8));
            scene.pulse = Some(if dice.so_often(0.5) { tailed(&mut dice).expect("a tail") } else { pulse });
        }
        let [hide_pulse, hide_cycles] = [0.6, 0.5].map(|share| dice.so_often(share));
        let back = back.map(|z| z * scene.wall);
        let render = RenderOptions { noise: 0.02, max_samples: 1 << 17, seed: scene.seed, coarse: None };
        let losses = Losses::default();
        let mut case =
            FamilyCase { scene, parts, back, ambient, hide_pulse, hide_cycles, losses, render, words };
        case.words = format!("{}; {}", conditions(&case), case.words);
        case
    }

    /// The same scene, scanned by fewer points, and with fewer and wider bins if they are more than `bins`.
    pub fn small(mut self, scan: usize, bins: usize) -> FamilyCase {
        let all = self.scene.bin_count();
        let wider = (all as f64 / bins as f64).max(1.0);
        self.scene.scan = scan;
        self.scene.bin_width *= wider;
        self.scene.bins = Some((all as f64 / wider).ceil() as usize);
        self
    }

    /// The same things alone, without room, measured exactly: no noise, no light of the room, no impulse response.
    pub fn ideal(mut self) -> FamilyCase {
        self.scene.objects.truncate(self.parts);
        (self.back, self.ambient, self.losses) = (None, 0.0, Losses::default());
        let Scene { photons, dark, pile_up, pulse, .. } = &mut self.scene;
        (*photons, *dark, *pile_up, *pulse) = (None, Dark::Counts(0.0), None, None);
        self.described()
    }

    /// The same case with another number of scan points per side.
    pub fn scanned(mut self, scan: usize) -> FamilyCase {
        self.scene.scan = scan;
        self.described()
    }

    /// With the words of what it is now.
    fn described(mut self) -> FamilyCase {
        let things = self.words.split_once("; ").map_or("", |(_, things)| things);
        let things =
            if self.scene.objects.len() > self.parts { Some(things) } else { things.split(" + ").next() };
        self.words = format!("{}; {}", conditions(&self), things.unwrap_or_default());
        self
    }

    /// The same case rendered coarsely, in about a tenth of a second.
    pub fn coarse(mut self) -> FamilyCase {
        self.render =
            RenderOptions { max_samples: COARSE_SAMPLES, coarse: Some(COARSE_NODES), ..self.render };
        self
    }

    /// Renders it, and measures it as the case says.
    ///
    /// # Errors
    /// Those of [`simulate`].
    pub fn capture(&self) -> Result<Capture> {
        Ok(self.captures(None)?.0)
    }

    /// As [`FamilyCase::capture`], and the room without the things, with the exposure of the capture and noise of its own, if it is to be
    /// measured; `None` without room and ambient light.
    ///
    /// # Errors
    /// Those of [`simulate`].
    pub fn captures(&self, empty: Option<&EmptyRoom>) -> Result<(Capture, Option<Capture>)> {
        let (lit, strongest) = self.lit()?;
        let Scene { photons, dark, pile_up, seed, .. } = self.scene;
        let exposure = photons.map(|photons| Exposure::of(&lit, photons, dark, pile_up)).transpose()?;
        let room = match empty {
            Some(how) => self.light_of_room(&lit, strongest)?.map(|room| how.measured(room, exposure, seed)),
            None => None,
        };
        let mut capture = match exposure {
            Some(exposure) => exposure.draw(&lit, seed),
            None => lit,
        };
        self.losses.take(&mut capture, seed);
        Ok((self.recorded(capture), room.map(|room| self.recorded(room))))
    }

    /// The light without the things, beside that of the scene; `None` if there is none.
    fn light_of_room(&self, lit: &Capture, strongest: f64) -> Result<Option<Capture>> {
        let mut room = lit.clone();
        room.histograms.fill(0.0);
        let objects = self.scene.objects[self.parts..].to_vec();
        if !objects.is_empty() {
            match simulate(&Scene { objects, ..self.exact() }, &self.render) {
                Ok(rendering) => room.histograms = rendering.capture.histograms,
                // No light of the room is within the bins.
                Err(e) if e.kind == Kind::Input => {}
                Err(e) => return Err(e),
            }
        }
        self.add_ambient(&mut room, strongest);
        Ok(Some(room).filter(|room| room.histograms.iter().any(|value| *value != 0.0)))
    }

    fn exact(&self) -> Scene {
        Scene { photons: None, pile_up: None, dark: Dark::Counts(0.0), ..self.scene.clone() }
    }

    /// The light of the scene without noise, and its strongest value without ambient light.
    fn lit(&self) -> Result<(Capture, f64)> {
        let mut capture = simulate(&self.exact(), &self.render)?.capture;
        let strongest = f64::from(capture.histograms.iter().copied().fold(0.0, f32::max));
        self.add_ambient(&mut capture, strongest);
        self.losses.weaken(&mut capture, self.scene.seed);
        Ok((capture, strongest))
    }

    /// Adds the light of a lamp at one side of the wall, and of points of the wall that are darker than others.
    fn add_ambient(&self, capture: &mut Capture, strongest: f64) {
        let mut dice = Dice(Pcg64::seed_from_u64(self.scene.seed ^ 0x0061_6d62_6965_6e74));
        let (lamp, bins) = (DVec2::from_angle(dice.of(0.0, TAU)) * dice.of(0.0, 0.8), capture.bins);
        for (pair, histogram) in capture.histograms.chunks_exact_mut(bins).enumerate() {
            let at = capture.sensor[pair].truncate() / (0.5 * self.scene.wall);
            let light = self.ambient * strongest * (1.0 + 0.7 * lamp.dot(at)) * dice.log(0.5, 1.7);
            histogram.iter_mut().for_each(|value| *value += light as f32);
        }
    }

    /// The capture as its file has it.
    fn recorded(&self, mut capture: Capture) -> Capture {
        capture.pulse = capture.pulse.filter(|_| !self.hide_pulse);
        capture.cycles = capture.cycles.filter(|_| !self.hide_cycles);
        capture
    }

    /// The true maps of its things.
    ///
    /// # Errors
    /// Those of [`truth`].
    pub fn truth(&self) -> Result<Truth> {
        let objects = self.scene.objects[..self.parts].to_vec();
        truth(&Scene { objects, ..self.scene.clone() }, DEFAULT_RESOLUTION)
    }

    /// Takes pixels that show the wall behind the things out of the maps.
    pub fn without_back(&self, maps: &mut Maps) {
        let Some(back) = self.back else { return };
        for pixel in 0..maps.depth.len() {
            if f64::from(maps.depth[pixel]) > back - 0.1 * self.scene.wall {
                (maps.albedo[pixel], maps.mask[pixel]) = (0.0, false);
            }
        }
    }
}

/// Things before a wall of 1 m, and their names.
pub(super) fn things(dice: &mut Dice, ranges: &Ranges) -> (Vec<Object>, String) {
    let count = dice.one(ranges.counts);
    let is_flat = dice.maybe(ranges.flat);
    let (mut objects, mut names) = (vec![], vec![]);
    // Side by side, in any order, each at a depth of its own.
    let from = dice.of(0.0, 1.0);
    for i in 0..count {
        let is_sign = dice.maybe(ranges.signs);
        let (name, parts) = match is_sign {
            true => parts_of::sign(dice),
            false if is_flat => parts_of::flat(dice),
            false => parts_of::any(dice),
        };
        let size = match count {
            1 => dice.of(ranges.size[0], ranges.size[1]),
            2 => dice.of(0.3, 0.6),
            _ => dice.of(0.22, 0.42),
        };
        let column = (i as f64 + 0.5) / count as f64 - 0.5;
        let mut at = dvec2(0.8 * column + dice.of(-0.1, 0.1), dice.of(-0.5, 0.5) * (1.0 - size).max(0.15));
        let aside = dice.so_often(0.2);
        if aside {
            at[usize::from(dice.so_often(0.5))] = dice.sign() * dice.of(0.38, 0.5);
        }
        let [near, deeper] = ranges.depths;
        let depth = near + deeper * ((from + i as f64 / count as f64 + dice.of(0.0, 0.2)) % 1.0);
        let parts = parts_of::placed(&parts, size, at.extend(depth), ranges.clear);
        let albedo = dice.of(0.3, 1.0);
        let is_pieced = is_sign || dice.maybe(ranges.pieced);
        objects.extend(parts.into_iter().enumerate().map(|(part, mesh)| {
            let share = if is_pieced && part > 0 { dice.log(0.05, 1.5) } else { 1.0 };
            Object { mesh, albedo: (albedo * share).min(1.0) }
        }));
        names.push(format!("{name}{}", if aside { " (partly outside)" } else { "" }));
    }
    (objects, names.join(", "))
}

/// Share of the pixels before a wall of 1 m that show something.
pub(super) fn seen(objects: &[Object]) -> f64 {
    let truth = truth(&Scene::new("things", objects.to_vec()), 48).expect("things before the wall");
    truth.mask.iter().filter(|m| **m).count() as f64 / truth.mask.len() as f64
}

/// Floor, ceiling, walls, and things that stand beside a wall of 1 m. Also the depth of a wall behind the things.
fn room(dice: &mut Dice, things: &[Object], words: &mut String) -> (Vec<Object>, Option<f64>) {
    let bounds = |object: &Object| object.mesh.bounds();
    let low = things.iter().filter_map(bounds).fold(DVec3::MAX, |all, b| all.min(b.0));
    let high = things.iter().filter_map(bounds).fold(DVec3::MIN, |all, b| all.max(b.1));
    let (mut room, mut back) = (vec![], None);
    let mut add = |mesh: Mesh, albedo: f64, name: &str| {
        room.push(Object { mesh, albedo });
        *words += &format!(" + {name}");
    };
    let reach = 1.6;
    let along = DVec3::Z * 0.9;
    if dice.so_often(0.25) {
        let y = low.y.min(-dice.of(0.42, 0.6)) - 0.01;
        add(rectangle(dvec3(0.0, y, 1.1), along, DVec3::X * reach), dice.of(0.2, 0.7), "floor");
    }
    if dice.so_often(0.12) {
        let y = high.y.max(dice.of(0.5, 0.8)) + 0.01;
        add(rectangle(dvec3(0.0, y, 1.1), DVec3::X * reach, along), dice.of(0.2, 0.7), "ceiling");
    }
    if dice.so_often(0.15) {
        let (x, up) = (low.x.min(-dice.of(0.6, 1.0)) - 0.01, DVec3::Y * 0.8);
        add(rectangle(dvec3(x, 0.0, 1.1), up, along), dice.of(0.2, 0.7), "side wall");
    }
    if dice.so_often(0.15) {
        let z = high.z + dice.of(0.2, 0.6);
        add(rectangle(dvec3(0.0, 0.0, z), DVec3::Y * 0.9, DVec3::X * reach), dice.of(0.2, 0.7), "back wall");
        back = Some(z);
    }
    if dice.so_often(0.25) {
        let (name, parts) = parts_of::any(dice);
        let size = dice.of(0.3, 0.7);
        let at = dvec3(
            dice.sign() * (0.58 + 0.5 * size + dice.of(0.0, 0.3)),
            dice.of(-0.2, 0.2),
            dice.of(0.5, 1.2),
        );
        let albedo = dice.of(0.4, 1.0);
        let parts = parts_of::placed(&parts, size, at, 0.3);
        room.extend(parts.into_iter().map(|mesh| Object { mesh, albedo }));
        *words += &format!(" + {name} beside");
    }
    (room, back)
}

/// Sets wall, scan, bins and reflectance of things that stand before a wall of 1 m.
fn scan(dice: &mut Dice, scene: &mut Scene, scans: &[(f64, usize)], room: bool) {
    let wall = dice.log(0.4, 2.0);
    scene.scan = dice.one(scans);
    let [reflectance, layout, _] = evenly(scene.seed);
    let models =
        [(0.65, Reflectance::Lambertian), (0.2, Reflectance::Cosine), (0.15, Reflectance::Retroreflective)];
    scene.reflectance = one_at(reflectance, &models);
    let point = wall * dvec2(dice.of(-0.4, 0.4), dice.of(-0.4, 0.4));
    let kinds = [
        (0.5, Layout::Confocal),
        (0.18, Layout::OneLaser { point }),
        (0.12, Layout::OneSensor { point }),
        (0.2, Layout::Irregular { seed: scene.seed }),
    ];
    scene.layout = one_at(layout, &kinds);
    // Surfaces send light back to the laser: another point of the wall gets none.
    if scene.reflectance == Reflectance::Retroreflective {
        scene.layout = Layout::Confocal;
    }
    let low = scene.objects.iter().filter_map(|o| o.mesh.bounds()).map(|b| b.0.z).fold(f64::MAX, f64::min);
    let start = if dice.so_often(0.4) { dice.of(0.2, 0.8) * 2.0 * low } else { 0.0 };
    let longer = if room { dice.of(1.0, 1.3) } else { 1.0 };
    let width = dice.log(0.001, 0.02).clamp(wall / 800.0, wall / 40.0);
    // Paths before a wall of 1 m, in bins of a millimetre.
    let fine =
        Scene { wall: 1.0, bin_width: 0.001, t_start: start, layout: Layout::Confocal, ..scene.clone() };
    let path = longer * 0.001 * fine.bin_count() as f64 * wall;
    let most = MOST_VALUES / scene.layout.pair_count(scene.scan);
    scene.bin_width = width.max(path / most).max(0.001);
    scene.bins = Some((path / scene.bin_width).ceil() as usize);
    (scene.wall, scene.t_start) = (wall, start * wall);
}

/// The mesh of a wall of 1 m before a wall of `side` metres.
fn scaled(mesh: &Mesh, side: f64) -> Mesh {
    let placement = Placement { scale: side, ..Placement::default() };
    mesh.clone().placed(&placement).expect("a mesh of plain numbers")
}

/// The kind of a scene's pairs.
pub fn kind(scene: &Scene) -> &'static str {
    match scene.layout {
        Layout::Confocal => "confocal",
        Layout::OneLaser { .. } => "one laser",
        Layout::OneSensor { .. } => "one sensor",
        Layout::Exhaustive { .. } => "exhaustive",
        Layout::Irregular { .. } => "irregular",
    }
}

/// Scan and noise in a few words.
pub(super) fn conditions(case: &FamilyCase) -> String {
    let s = &case.scene;
    let kind = kind(s);
    let mut words = format!(
        "{kind} {}², {:.2} m, {} x {:.1} mm",
        s.scan,
        s.wall,
        s.bins.unwrap_or_default(),
        1e3 * s.bin_width
    );
    words += &s.photons.map_or(", exact".into(), |p| format!(", {p:.0} ph"));
    let hidden = |hidden: bool| if hidden { " hidden" } else { "" };
    if s.pulse.is_some() {
        words += &format!(", pulse{}", hidden(case.hide_pulse));
    }
    if case.ambient > 0.0 {
        words += &format!(", ambient {:.4}", case.ambient);
    }
    match s.dark {
        Dark::Fraction(dark) if dark > 0.0 => words += &format!(", dark {dark:.4}"),
        Dark::Counts(dark) if dark > 0.0 => words += &format!(", {dark:.1} dark a bin"),
        _ => {}
    }
    if let Some(mean) = s.pile_up {
        words += &format!(", pile-up {mean:.2}{}", hidden(case.hide_cycles));
    }
    words + &case.losses.words()
}
