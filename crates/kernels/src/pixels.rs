//! The surface as height fields (`glsl/include/heights.glsl`): pixels with a depth and an albedo, in one or two layers. The
//! columns of the second layer follow those of the first.

use super::{Call, Real, SceneGrid, V2, V3};

/// Slope between two pixels that halves their bond.
const EDGE: f64 = 2.5;

/// Share of the iterations after which a pixel uses its own gradient only.
const NARROWED: f64 = 0.6;

/// Sigma, pixels, below which a Gaussian has no weight beyond its centre.
const NARROW: f64 = 0.35;

/// The eight neighbours of a pixel in the order of its stencils; seen from neighbour k, the pixel is number 7 - k.
pub const AROUND: [[i32; 2]; 8] = [[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]];

/// Column without a pixel.
pub const NOWHERE: u32 = u32::MAX;

/// The pixels of a surface: the buffers `pixels` and `pixel_of`.
#[derive(Debug, Clone, Copy)]
pub struct PixelField<'p, F> {
    pub grid: SceneGrid<F>,
    /// Column of every pixel.
    pub pixels: &'p [u32],
    /// Pixel of every column.
    pub pixel_of: &'p [u32],
    /// Distances between neighbours, metres.
    pub pitch: V2<F>,
    /// Side of a square with a pixel's area, metres.
    pub size: F,
}

impl<'p, F: Real> PixelField<'p, F> {
    pub fn new(call: &Call<'_>, pixels: &'p [u32], pixel_of: &'p [u32]) -> PixelField<'p, F> {
        let grid = call.grid::<F>();
        let pitch = V2 { x: grid.pitch.x, y: grid.pitch.y };
        PixelField { grid, pixels, pixel_of, pitch, size: (pitch.x * pitch.y).sqrt() }
    }

    /// Columns of a layer.
    pub fn of_layer(&self) -> usize {
        self.grid.n[0] * self.grid.n[1]
    }

    /// Columns before those of a pixel's layer, and its lateral position.
    pub fn place(&self, pixel: usize) -> (usize, [usize; 2]) {
        let column = self.pixels[pixel] as usize;
        let at = column % self.of_layer();
        (column - at, [at / self.grid.n[1], at % self.grid.n[1]])
    }

    /// A pixel's neighbours; [`NOWHERE`] where there is none.
    pub fn neighbours(&self, pixel: usize) -> [u32; 8] {
        let [nx, ny] = [self.grid.n[0], self.grid.n[1]];
        let (layer, [x, y]) = self.place(pixel);
        let own = &self.pixel_of[layer..layer + nx * ny];
        AROUND.map(|[dx, dy]| {
            let (x, y) = (x.wrapping_add_signed(dx as isize), y.wrapping_add_signed(dy as isize));
            if x < nx && y < ny { own[x * ny + y] } else { NOWHERE }
        })
    }

    /// Offset of a pixel's k-th neighbour, metres.
    pub fn offset(&self, k: usize) -> V2<F> {
        V2::of(AROUND[k].map(|d| F::of(d.into()))).times(self.pitch)
    }

    /// The gradient of a pixel's depth and albedo: its own, and the gradients of all slopes that use its depth.
    pub fn pulled(&self, pixel: usize, stencils: &[[F; 2]], gradient: &[[F; 4]]) -> [F; 2] {
        let [x, y, depth, albedo] = gradient[pixel];
        let own = V2 { x, y };
        let mut sum = depth;
        for (k, other) in
            self.neighbours(pixel).into_iter().enumerate().filter(|(_, other)| *other != NOWHERE)
        {
            let [x, y, ..] = gradient[other as usize];
            let through = V2::of(stencils[8 * other as usize + 7 - k]).dot(V2 { x, y });
            sum = sum + through - V2::of(stencils[8 * pixel + k]).dot(own);
        }
        [sum, albedo]
    }

    /// Centre of a pixel, metres.
    pub fn centre(&self, pixel: usize) -> V2<F> {
        let (_, [x, y]) = self.place(pixel);
        let at = V2 { x: F::of(x as f64), y: F::of(y as f64) };
        V2 { x: self.grid.origin.x, y: self.grid.origin.y } + at.times(self.pitch)
    }

    /// Offset of a pixel's k-th point (of 1 or 4) from its centre, metres.
    pub fn part(&self, k: usize, points: usize) -> V2<F> {
        let quarter = |k: usize| F::of([-0.25, 0.25][k]);
        match points {
            1 => V2::default(),
            _ => V2 { x: quarter(k / 2), y: quarter(k % 2) }.times(self.pitch),
        }
    }

    /// Bond, 0 to 1, of a pixel and its k-th neighbour whose depths differ by `step`: it almost vanishes across an edge.
    pub fn bond(&self, k: usize, step: F) -> F {
        let near = AROUND[k].iter().map(|d| d * d).sum::<i32>();
        F::of((-0.5 * f64::from(near)).exp()) * stops(step, self.edge())
    }

    /// Inverse of the step of depth that halves a bond, per metre.
    pub fn edge(&self) -> F {
        F::one() / (F::of(EDGE) * self.size)
    }
}

/// The part of a bond that stops at edges.
#[inline(always)]
pub fn stops<F: Real>(step: F, edge: F) -> F {
    let steep = step * edge;
    let steep = steep * steep;
    F::one() / (F::one() + steep * steep)
}

/// Unit normal, toward the wall, of a pixel with these slopes.
pub fn facing<F: Real>(slope: V2<F>) -> V3<F> {
    V3 { x: slope.x, y: slope.y, z: -F::one() } * (F::one() / (F::one() + slope.dot(slope)).sqrt())
}

/// Whether light depends on normals.
pub fn has_normals(call: &Call<'_>) -> bool {
    call.constant("REFLECTANCE", 0) <= 1
}

/// Area of a pixel's surface over its lateral area. Without normals, albedo is per lateral area, and this is 1.
pub fn stretch<F: Real>(has_normals: bool, slope: V2<F>) -> F {
    if has_normals { (F::one() + slope.dot(slope)).sqrt() } else { F::one() }
}

/// Sigma, pixels, of the Gaussian that averages gradients at step `number` (from 1): it narrows to the pixel itself.
pub fn sigma_at<F: Real>([first, iterations]: [F; 2], number: u32) -> Option<f64> {
    let sigma = first.wide() * (1.0 - f64::from(number - 1) / iterations.wide() / NARROWED);
    (sigma >= NARROW).then_some(sigma)
}
