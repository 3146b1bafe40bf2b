//! Simulates captures: from a hidden scene of meshes to transient histograms and true maps.
//!
//! A [`Scene`] has objects (triangle mesh and albedo) and a square relay wall, flat at z = 0 or curved. Laser and
//! sensor scan the wall in a [`Layout`]. [`simulate`] renders the light transport by area sampling with true visibility
//! and adds photon noise if the scene has any; [`truth`] gives depth, normals, albedo and mask seen from the wall.
//!
//! ```
//! use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};
//! # fn main() -> thirdbounce_base::Result<()> {
//! let mut scene = Scene::named("letter:K")?;
//! scene.scan = 8;
//! let rendering = simulate(&scene, &RenderOptions::default())?;
//! assert_eq!(rendering.capture.scan, [8, 8]);
//! let maps = truth(&scene, 64)?;
//! assert!(maps.mask.iter().any(|&hit| hit));
//! # Ok(())
//! # }
//! ```

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod builtin;
mod coarse;
mod elements;
mod empty;
mod figure;
mod letters;
mod mesh;
#[cfg(feature = "formats")]
mod mesh_file;
mod moving;
mod noise;
mod offsets;
mod pairs;
mod pile_up;
mod render;
mod scene;
mod shapes;
mod truth;
mod visibility;
mod wall;

use thirdbounce_base::{Error, Kind, Result};
use thirdbounce_capture as capture;
use thirdbounce_maps::maps;

pub use capture::Reflectance;
pub use empty::EmptyRoom;
pub use figure::figure;
pub use letters::letter;
pub use mesh::{Mesh, MeshPlace, Placement};
#[cfg(feature = "formats")]
pub use mesh_file::load_mesh;
pub use moving::Motion;
pub use noise::{Dark, Exposure, photon_noise};
pub use pairs::{Layout, Pairs};
pub use pile_up::pile_up;
pub use render::{
    RenderOptions, RenderProgress, Rendering, render, render_pairs, simulate, simulate_empty,
    simulate_exposed, simulate_watched,
};
pub use scene::{Object, Scene};
pub use shapes::{capsule, ellipsoid, rectangle, sphere, torus};
pub use truth::{DEFAULT_RESOLUTION, truth};
pub use wall::WallShape;

/// A capture of a known scene, with its truth of `resolution` pixels per side.
///
/// # Errors
/// `Kind::Input` and `Kind::Options`: a scene or options out of range.
pub fn with_truth(
    scene: &Scene,
    options: &RenderOptions,
    resolution: usize,
) -> Result<(capture::Capture, maps::Truth)> {
    let truth = truth(scene, resolution)?;
    Ok((simulate(scene, options)?.capture, truth))
}
