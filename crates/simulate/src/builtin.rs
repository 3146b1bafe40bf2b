//! The built-in scenes.

use super::{Mesh, MeshPlace, Object, Scene, figure, letter, rectangle, sphere, torus};
use crate::{Error, Result};
use glam::{DVec3, dvec3};

/// Name and description of each built-in scene.
const KNOWN: &[(&str, &str)] = &[
    ("letter-X", "a flat letter A-Z, 0.6 m high, at z = 0.6 m (also letter:X)"),
    (
        "letters-XY",
        "two or three flat letters from left to right, each 0.15 m farther, from z = 0.6 m (also letters:XY)",
    ),
    ("plane", "a square of 0.5 m facing the wall at z = 0.7 m"),
    ("sphere", "a sphere of radius 0.2 m at z = 0.7 m"),
    ("spheres", "two spheres of radius 0.14 m at z = 0.72 and 1.00 m"),
    ("torus", "a tilted torus of radius 0.2 m at z = 0.7 m"),
    ("occluder", "a plate at z = 0.5 m that hides part of a larger square at z = 0.9 m"),
    (
        "plates",
        "a plate of 0.24 m at z = 0.55 m before a tilted square of 0.68 m at z = 0.85 m (plates-front, plates-back: \
         each alone)",
    ),
    ("figure", "a standing figure with a raised arm, 0.85 m high, at z = 0.7 m"),
    (
        "beyond",
        "the figure aside, its raised arm beyond a wall of 1 m, on a floor that extends beyond it, with a plate there",
    ),
    ("within", "the part of beyond in front of a wall of 1 m: no raised arm, floor or plate"),
];

impl Scene {
    /// The scene that `spec` names: a built-in scene (see [`Scene::known`]) or the path of a .obj or .ply
    /// mesh in metres. A mesh in front of the wall, z > 0, keeps its coordinates; others are turned so that their
    /// +z side faces the wall, and centred at z = 0.8 m.
    ///
    /// # Errors
    /// An unknown name (the error lists the known ones) or a mesh that cannot be used.
    pub fn named(spec: &str) -> Result<Scene> {
        named(spec, false).map(|(scene, _)| scene)
    }

    /// [`Scene::named`] with the place of a mesh, which is [`MeshPlace::Centred`] if `centred`; `None` for a built-in scene.
    ///
    /// # Errors
    /// Those of [`Scene::named`].
    #[doc(hidden)]
    pub fn placed(spec: &str, centred: bool) -> Result<(Scene, Option<MeshPlace>)> {
        named(spec, centred)
    }

    /// The scene scaled about its centre so that its largest side is `size` metres.
    ///
    /// # Errors
    /// `Kind::Options` for a size that is no positive length, or a scene without extent.
    pub fn fitted(mut self, size: f64) -> Result<Scene> {
        let [low, high] = self.bounds().unwrap_or_default();
        let (centre, scale) = (low.midpoint(high), size / (high - low).max_element());
        if !(scale.is_finite() && scale > 0.0 && size.is_finite()) {
            return Err(Error::options(
                format!("the scene cannot be {size} m large"),
                "give a length above 0",
            ));
        }
        for corner in self.objects.iter_mut().flat_map(|object| object.mesh.triangles.iter_mut().flatten()) {
            *corner = centre + scale * (*corner - centre);
        }
        Ok(self)
    }

    /// Sides of the box around all objects, metres; `None` without any.
    pub fn size(&self) -> Option<DVec3> {
        self.bounds().map(|[low, high]| high - low)
    }

    fn bounds(&self) -> Option<[DVec3; 2]> {
        let corners =
            || self.objects.iter().flat_map(|object| object.mesh.triangles.iter().flatten().copied());
        Some([corners().reduce(DVec3::min)?, corners().reduce(DVec3::max)?])
    }

    /// Name and one-line description of each built-in scene.
    pub fn known() -> &'static [(&'static str, &'static str)] {
        KNOWN
    }
}

fn named(spec: &str, centred: bool) -> Result<(Scene, Option<MeshPlace>)> {
    #[cfg(not(feature = "formats"))]
    let _ = centred;
    let name = spec.trim();
    #[cfg(feature = "formats")]
    if let Some(mesh) = super::mesh_file::scene(std::path::Path::new(name), centred) {
        return mesh.map(|(stem, mesh, place)| (Scene::new(stem, objects(vec![mesh])), Some(place)));
    }
    let lower = name.to_ascii_lowercase();
    let after = |stem: &str| lower.strip_prefix(stem).and_then(|rest| rest.strip_prefix(['-', ':']));
    let meshes = if let Some(text) = after("letters").or_else(|| after("letter")) {
        letters(text)?
    } else {
        match lower.as_str() {
            "plane" => vec![rectangle(dvec3(0.0, 0.0, 0.7), DVec3::Y * 0.25, DVec3::X * 0.25)],
            "sphere" => vec![sphere(dvec3(0.0, 0.0, 0.7), 0.2)],
            "spheres" => vec![sphere(dvec3(-0.18, 0.10, 0.72), 0.14), sphere(dvec3(0.20, -0.12, 1.00), 0.14)],
            "torus" => vec![torus(dvec3(0.0, 0.0, 0.7), dvec3(0.25, 0.45, -1.0), 0.2, 0.07)],
            "occluder" => vec![
                rectangle(dvec3(0.0, 0.0, 0.9), DVec3::Y * 0.35, DVec3::X * 0.35),
                rectangle(dvec3(0.18, 0.05, 0.5), DVec3::Y * 0.2, DVec3::X * 0.12),
            ],
            "plates" => vec![front_plate(), back_plate()],
            "plates-front" => vec![front_plate()],
            "plates-back" => vec![back_plate()],
            "figure" => figure(dvec3(0.0, 0.0, 0.7), 0.85),
            "beyond" => return Ok((beyond(), None)),
            "within" => aside().0,
            _ => return Err(unknown(spec)),
        }
    };
    Ok((Scene::new(lower.replace(':', "-"), objects(meshes)), None))
}

/// The figure, shifted along +x and down: its part in front of a 1 m wall, and its raised arm beyond the edge.
fn aside() -> (Vec<Mesh>, Vec<Mesh>) {
    let before = |mesh: &Mesh| mesh.bounds().is_some_and(|(low, _)| low.x < 0.5);
    figure(dvec3(0.34, -0.1, 0.7), 0.85).into_iter().partition(before)
}

/// A figure in front of the wall except for its raised arm, on a floor just below the scanned area. The floor extends
/// to both sides and behind; a plate stands on it beside the scanned area.
fn beyond() -> Scene {
    let (before, arm) = aside();
    let plate = rectangle(dvec3(-0.85, -0.15, 1.1), DVec3::Y * 0.38, DVec3::X * 0.2);
    let floor = rectangle(dvec3(0.0, -0.53, 1.2), DVec3::Z * 0.6, DVec3::X * 1.3);
    let mut scene = Scene::new("beyond", objects([before, arm, vec![plate]].concat()));
    scene.objects.push(Object { mesh: floor, albedo: 0.5 });
    // Plate and floor.
    scene.room = 2;
    scene
}

/// The plates of the scene `plates`.
fn front_plate() -> Mesh {
    rectangle(dvec3(0.0, 0.0, 0.55), DVec3::Y * 0.12, DVec3::X * 0.12)
}

fn back_plate() -> Mesh {
    rectangle(dvec3(0.0, 0.0, 0.85), DVec3::Y * 0.34, dvec3(0.33, 0.0, 0.08))
}

fn objects(meshes: Vec<Mesh>) -> Vec<Object> {
    meshes.into_iter().map(|mesh| Object { mesh, albedo: 1.0 }).collect()
}

fn letters(text: &str) -> Result<Vec<Mesh>> {
    let count = text.chars().count();
    if count == 0 || count > 3 {
        return Err(Error::options(
            format!("{text:?} is not one to three letters"),
            "name the scene letter-Z, letters-SU or the like",
        ));
    }
    // One letter fills most of the width of a 1 m wall; several letters share it.
    let (height, pitch) = [(0.6, 0.0), (0.45, 0.46), (0.34, 0.33)][count - 1];
    let place = |i: usize| dvec3((0.5 * (count - 1) as f64 - i as f64) * pitch, 0.0, 0.6 + 0.15 * i as f64);
    text.chars().enumerate().map(|(i, name)| letter(name, place(i), height)).collect()
}

fn unknown(spec: &str) -> Error {
    let names: Vec<&str> = KNOWN.iter().map(|(name, _)| *name).collect();
    Error::options(
        format!("there is no scene named {spec:?}"),
        format!("choose one of {}, or the path of a .obj or .ply mesh", names.join(", ")),
    )
}
