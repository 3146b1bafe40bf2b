//! The relay wall's shape.

use glam::{DVec3, dvec3};

/// Height and standard deviation of the bump, as shares of the wall's side.
const BUMP_HEIGHT: f64 = 0.1;
const BUMP_WIDTH: f64 = 0.2;

/// The shape of the relay wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WallShape {
    /// The plane z = 0.
    #[default]
    Flat,
    /// A Gaussian bump toward the hidden scene in the wall's middle. Its height is a tenth of the wall's side, its
    /// standard deviation a fifth.
    Bump,
}

impl WallShape {
    /// The point at (x, y) of a wall of the given side, all in metres.
    pub fn point(self, x: f64, y: f64, side: f64) -> DVec3 {
        dvec3(x, y, self.height(x, y, side))
    }

    /// The wall's unit normal at (x, y), toward the hidden scene; `None` for a flat wall.
    pub fn normal(self, x: f64, y: f64, side: f64) -> Option<DVec3> {
        let width = BUMP_WIDTH * side;
        let slope = self.height(x, y, side) / (width * width);
        // dz/dx = -z x / σ².
        (self == WallShape::Bump).then(|| dvec3(slope * x, slope * y, 1.0).normalize())
    }

    /// The largest z of the wall, metres.
    pub fn front(self, side: f64) -> f64 {
        self.height(0.0, 0.0, side)
    }

    fn height(self, x: f64, y: f64, side: f64) -> f64 {
        let width = BUMP_WIDTH * side;
        match self {
            WallShape::Flat => 0.0,
            WallShape::Bump => BUMP_HEIGHT * side * (-(x * x + y * y) / (2.0 * width * width)).exp(),
        }
    }
}
