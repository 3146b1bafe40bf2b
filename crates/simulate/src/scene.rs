//! Scenes: objects, wall, scan, bins, reflectance, noise.

use super::{Dark, Layout, Mesh, Pairs, WallShape};
use crate::capture::{Pulse, Reflectance};
use crate::{Error, Kind, Result};
use glam::DVec3;

/// Largest capture that is rendered: 2³² histogram values (16 GiB).
const MOST_VALUES: f64 = 4_294_967_296.0;

/// A mesh with one albedo.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// The surface.
    pub mesh: Mesh,
    /// Albedo, 0 or above; 1 for the objects of the built-in scenes, ½ for a floor.
    pub albedo: f64,
}

/// A hidden scene and its measurement. All fields may be changed after [`Scene::named`].
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Short display name.
    pub name: String,
    /// Hidden objects at z > 0, in metres.
    pub objects: Vec<Object>,
    /// Number of the last objects that are the room, which an empty capture shows.
    pub room: usize,
    /// Side of the square wall in metres: it covers ±wall/2 in x and y at z = 0.
    pub wall: f64,
    /// Shape of the wall.
    pub wall_shape: WallShape,
    /// Scan points per side, at the centres of scan × scan cells of the wall.
    pub scan: usize,
    /// Pairing of laser and sensor points.
    pub layout: Layout,
    /// Whether surfaces occlude those behind them. The wall occludes nothing.
    pub occlusion: bool,
    /// Bin width in metres of path.
    pub bin_width: f64,
    /// Number of bins; `None`: enough for every path of the scene, and a multiple of 32.
    pub bins: Option<usize>,
    /// Leading edge of bin 0 in metres of path.
    pub t_start: f64,
    /// Reflectance model; formulas in [`super::render_pairs`].
    pub reflectance: Reflectance,
    /// Impulse response of the instrument; `None`: ideal.
    pub pulse: Option<Pulse>,
    /// Full widths at half maximum of the Gaussian laser and sensor spots on the wall, metres; 0: points.
    pub spots: [f64; 2],
    /// Position of a laser whose light on the wall falls as cos / distance² from there, metres, z > 0; `None`: all wall points are lit
    /// alike.
    pub device: Option<DVec3>,
    /// Mean number of detected photons per laser pulse for the brightest pair, if the detector records only the first
    /// of them; `None`: no dead time.
    pub pile_up: Option<f64>,
    /// Photons expected in the strongest bin before pile-up; `None`: no photon noise, radiometric values.
    pub photons: Option<f64>,
    /// Dark counts added to every bin; needs `photons`.
    pub dark: Dark,
    /// Seed of the photon noise.
    pub seed: u64,
}

impl Scene {
    /// A scene of the given objects with the default settings: a flat wall of 1 m, 32 × 32 points, confocal, bins of
    /// 6 mm from path 0, cosine reflectance, occlusion, no noise.
    pub fn new(name: impl Into<String>, objects: Vec<Object>) -> Scene {
        Scene {
            name: name.into(),
            objects,
            room: 0,
            wall: 1.0,
            wall_shape: WallShape::Flat,
            scan: 32,
            layout: Layout::Confocal,
            occlusion: true,
            bin_width: 0.006,
            bins: None,
            t_start: 0.0,
            reflectance: Reflectance::Cosine,
            pulse: None,
            pile_up: None,
            spots: [0.0; 2],
            device: None,
            photons: None,
            dark: Dark::Counts(0.0),
            seed: 0,
        }
    }

    /// Sets the albedo of every object.
    pub fn set_albedo(&mut self, albedo: f64) {
        self.objects.iter_mut().for_each(|o| o.albedo = albedo);
    }

    /// Number of bins of the capture: `bins`, or enough for any two points of the wall and the fixed point, if any.
    pub fn bin_count(&self) -> usize {
        self.bins.unwrap_or_else(|| {
            let half = 0.5 * self.wall;
            let wall = [(-half, -half), (half, -half), (-half, half), (half, half)];
            let wall = wall.map(|(x, y)| DVec3::new(x, y, 0.0));
            let corners = || self.objects.iter().flat_map(|o| o.mesh.triangles.iter().flatten());
            // The maximum distance from a triangle to the wall is between two corners; a bump is nearer.
            let from = |points: &[DVec3]| {
                corners().flat_map(|p| points.iter().map(|q| p.distance(*q))).fold(0.0, f64::max)
            };
            let far = from(&wall);
            let point = self.layout.point().map(|p| from(&[DVec3::new(p.x, p.y, 0.0)]));
            let longest = far + point.map_or(far, |point| point.max(far));
            // Spots are not truncated, but the number of bins is determined by their core.
            let [laser, sensor] = self.spots;
            let longest = longest + 1.5 * (laser + sensor);
            let tail = self.pulse.as_ref().map_or(0.0, |p| p.end().max(0.0));
            let bins = ((longest + tail - self.t_start) / self.bin_width).ceil().clamp(1.0, 1e12);
            (bins as usize + 1).next_multiple_of(32)
        })
    }

    /// The pairs of the scan.
    pub fn pairs(&self) -> Pairs {
        Pairs::new(self.layout, self.scan, self.wall, self.wall_shape)
    }

    /// (xmin, xmax, ymin, ymax) of the wall in metres.
    pub fn extent(&self) -> [f64; 4] {
        let half = 0.5 * self.wall;
        [-half, half, -half, half]
    }

    /// Checks that the scene can be rendered.
    ///
    /// # Errors
    /// Settings that are not finite or out of range, no triangles, a corner that is not finite or not in front of the
    /// whole wall (z > 0 for a flat wall), a negative albedo, dark counts without photons, or a capture that is too
    /// large.
    pub fn check(&self) -> Result<()> {
        let positive = |what: &str, value: f64, unit: &str| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::options(format!("the {what} is {value}"), format!("give a {what} above 0, in {unit}")))
        };
        positive("wall size", self.wall, "metres")?;
        positive("bin width", self.bin_width, "metres of path")?;
        if !self.t_start.is_finite() {
            return Err(Error::options(
                format!("the start of bin 0 is {}", self.t_start),
                "give it in metres of path; 0 is the laser's arrival at the wall",
            ));
        }
        if self.scan == 0 || self.bins == Some(0) {
            return Err(Error::options(
                format!(
                    "{} x {} scan points and {:?} bins contain no measurement",
                    self.scan, self.scan, self.bins
                ),
                "give at least one scan point and one bin",
            ));
        }
        if let Some(point) = self.layout.point().filter(|s| !s.is_finite()) {
            return Err(Error::options(
                format!("the fixed laser or sensor point is at {point}"),
                "give x,y in metres, as 0.1,-0.2",
            ));
        }
        if self.layout == (Layout::Exhaustive { lasers: 0 }) {
            return Err(Error::options(
                "0 x 0 laser points contain no measurement",
                "give at least one laser point",
            ));
        }
        self.check_objects()?;
        if let Some(pulse) = &self.pulse {
            pulse.check()?;
            pulse.taps_of_bins(self.bin_width)?;
        }
        for (side, width) in [("laser", self.spots[0]), ("sensor", self.spots[1])] {
            if !(width.is_finite() && width >= 0.0) {
                return Err(Error::options(
                    format!("the {side} spot is {width} m wide"),
                    "give its full width at half maximum on the wall in metres, 0 for a point",
                ));
            }
        }
        super::noise::check(self.photons, self.dark)?;
        super::pile_up::check(self.pile_up)?;
        let pairs = self.layout.pair_count(self.scan);
        let values = pairs * self.bin_count() as f64;
        if values > MOST_VALUES {
            return Err(Error::new(
                Kind::Memory,
                format!(
                    "{pairs} pairs with {} bins need {:.0} GiB",
                    self.bin_count(),
                    values / 2f64.powi(28)
                ),
                "scan fewer points, widen the bins or set their number",
            ));
        }
        Ok(())
    }

    fn check_objects(&self) -> Result<()> {
        if self.objects.iter().all(|o| o.mesh.triangles.is_empty()) {
            return Err(Error::input(
                format!("the scene {:?} has no triangles", self.name),
                "add an object with a mesh to it",
            ));
        }
        for (i, object) in self.objects.iter().enumerate() {
            if !(object.albedo.is_finite() && object.albedo >= 0.0) {
                return Err(Error::options(
                    format!("object {i} has the albedo {}", object.albedo),
                    "give an albedo of 0 or above, usually at most 1",
                ));
            }
            let mesh = &object.mesh;
            if mesh.normals.len() != mesh.triangles.len() {
                return Err(Error::input(
                    format!(
                        "object {i} has {} triangles but {} normals",
                        mesh.triangles.len(),
                        mesh.normals.len()
                    ),
                    "give every triangle three unit normals",
                ));
            }
            if !mesh.triangles.iter().chain(&mesh.normals).flatten().all(|p| p.is_finite()) {
                return Err(Error::input(
                    format!("object {i} has a vertex or normal that is not finite"),
                    "repair the mesh",
                ));
            }
            let front = self.wall_shape.front(self.wall);
            if let Some((lo, hi)) = mesh.bounds().filter(|(lo, _)| lo.z <= front) {
                return Err(Error::input(
                    format!(
                        "object {i} spans z = {:.4} to {:.4} m, into the wall at z = {front}",
                        lo.z, hi.z
                    ),
                    format!("move it to z > {front}, where the hidden scene is"),
                ));
            }
        }
        Ok(())
    }
}
