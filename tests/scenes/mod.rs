//! What the tests of the simulator share.

use glam::DVec3;
use thirdbounce::simulate::*;

pub fn scene(meshes: Vec<Mesh>) -> Scene {
    let objects = meshes.into_iter().map(|mesh| Object { mesh, albedo: 0.5 }).collect();
    let mut scene = Scene::new("test", objects);
    scene.scan = 6;
    scene
}

/// A rectangle facing the wall.
pub fn plate(centre: DVec3, half: f64) -> Mesh {
    rectangle(centre, DVec3::Y * half, DVec3::X * half)
}
