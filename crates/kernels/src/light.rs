//! Light from samples of the hidden surface to pairs of wall points, as in `glsl/include/transport.glsl`: along two arms,
//!   value = albedo · cosines · falloff_a · falloff_b   at path distance_a + distance_b.
//! Samples are handled in blocks of [`LANES`], component by component, so that loops over a block are vectorised.

use super::shared::PADDING;
use super::{Call, Real, V3};

/// Samples of a block.
pub const LANES: usize = 64;

/// Cosines of a reflectance: none.
pub const PLAIN: u32 = 0;
/// One, toward the scanned point.
pub const COSINE: u32 = 1;
/// Both of the surface and both of the wall.
pub const LAMBERTIAN: u32 = 2;

/// Reflectance models by their number in `glsl/include/reflectance.glsl`.
const MODELS: [u32; 4] = [COSINE, LAMBERTIAN, PLAIN, PLAIN];
pub const RETROREFLECTIVE: u32 = 2;

/// Ways in which wall points make pairs, by their number in `glsl/include/transport.glsl`.
const CONFOCAL: u32 = 0;
pub const PRODUCT: u32 = 2;

/// Share of a row that paths are moved up where they are not shared between bins.
const EDGE: f64 = 1.0 / 4_194_304.0;

/// Samples of a block, component by component: position (metres), albedo, unit normal.
#[derive(Debug, Clone)]
pub struct SampleBlock<A> {
    pub point: [[A; LANES]; 3],
    pub albedo: [A; LANES],
    pub normal: [[A; LANES]; 3],
}

impl<A: Real> SampleBlock<A> {
    /// Blocks of the samples in `points` and `normals`, empty without normals. The last block is filled up by copies of the
    /// last sample with albedo 0.
    pub fn all<F: Real>(points: &[[F; 4]], normals: &[[F; 4]]) -> Vec<SampleBlock<A>> {
        let blocks = points.chunks(LANES).enumerate();
        blocks
            .map(|(i, points)| {
                let at = |lane: usize| points[lane.min(points.len() - 1)];
                let facing = [F::zero(), F::zero(), -F::one(), F::one()];
                let normal = |lane: usize| {
                    normals.get(i * LANES + lane.min(points.len() - 1)).copied().unwrap_or(facing)
                };
                let part = |of: &dyn Fn(usize) -> F| std::array::from_fn(|lane| convert(of(lane)));
                SampleBlock {
                    point: std::array::from_fn(|k| part(&|lane| at(lane)[k])),
                    albedo: part(&|lane| if lane < points.len() { points[lane][3] } else { F::zero() }),
                    normal: std::array::from_fn(|k| part(&|lane| normal(lane)[k])),
                }
            })
            .collect()
    }
}

/// The number in another float type.
#[inline(always)]
pub fn convert<F: Real, A: Real>(value: F) -> A {
    A::of(value.wide())
}

/// The two points of a pair, metres, and the wall's unit normals there.
#[derive(Debug, Clone, Copy)]
pub struct Ends<A> {
    pub points: [V3<A>; 2],
    pub normals: [V3<A>; 2],
}

/// Wall points and how they make pairs, and the numbers of arms and places.
#[derive(Debug, Clone, Copy)]
pub struct WallLight<'w, F, A> {
    wall: &'w [[F; 4]],
    geometry: u32,
    scanned: usize,
    curved: bool,
    points: usize,
    /// Cosines: [`PLAIN`], [`COSINE`] or [`LAMBERTIAN`].
    pub cosines: u32,
    /// Whether a pair has two arms.
    pub two_arms: bool,
    pub numbers: LightNumbers<A>,
}

/// Numbers of arms and places.
#[derive(Debug, Clone, Copy)]
pub struct LightNumbers<A> {
    /// Length that scales distances in the falloff, metres.
    reference: A,
    /// Square of the distance below which a sample gives no light.
    nearest: A,
    /// Whether the falloff of an arm is the distance's inverse instead of its square.
    pub retro: bool,
    /// Bins per metre of path.
    pub bins_per_metre: A,
    /// Cell of path 0 in a row, less half a bin where contributions are shared.
    start: A,
    /// Last place.
    last: A,
    /// 1 if contributions are shared between two bins, else 0.
    shared: A,
}

impl<'w, F: Real, A: Real> WallLight<'w, F, A> {
    /// The light of a dispatch to its wall points.
    pub fn of(call: &Call<'_>, wall: &'w [[F; 4]]) -> WallLight<'w, F, A> {
        let s = &call.scene;
        let reflectance = call.constant("REFLECTANCE", 0);
        // In float64 as on the host that made the parts: their sums have more bits than fp32.
        let grain = f64::from(s.grain);
        let per_metre = (f64::from(s.bins_per_grain) + f64::from(s.bins_per_grain_rest)) / grain;
        let before = f64::from(s.start_bins) + f64::from(s.start_bins_rest);
        let split = call.constant("SPLIT", 1) != 0;
        // A path on an edge belongs to the bin that begins there, though fp32 may round it a little lower.
        let edge = if split { 0.0 } else { EDGE * f64::from(s.stride) };
        let nearest = f64::from(s.nearest).powi(2).max(f64::from(f32::MIN_POSITIVE));
        let geometry = call.constant("GEOMETRY", 0);
        let numbers = LightNumbers {
            reference: A::from32(s.reference),
            nearest: A::of(nearest),
            retro: reflectance == RETROREFLECTIVE,
            bins_per_metre: A::of(per_metre),
            start: A::of(f64::from(PADDING) - before + edge),
            // Both of its cells are padding; an integer might be the one before it, the last bin, and 1.
            last: A::of(f64::from(s.stride) + 0.5),
            shared: if split { A::one() } else { A::zero() },
        };
        WallLight {
            wall,
            geometry,
            scanned: s.scanned as usize,
            curved: call.is("CURVED"),
            points: (s.scanned + s.others) as usize,
            cosines: MODELS[reflectance as usize],
            two_arms: geometry != CONFOCAL,
            numbers,
        }
    }

    /// The ends of a pair.
    pub fn ends(&self, pair: usize) -> Ends<A> {
        let [a, b] = match self.geometry {
            CONFOCAL => [pair, pair],
            PRODUCT => [pair % self.scanned, self.scanned + pair / self.scanned],
            _ => [pair, self.scanned + pair],
        };
        let point = |at: usize| V3::of(self.wall[at].map(convert));
        let level = V3 { x: A::zero(), y: A::zero(), z: A::one() };
        let normal = |at: usize| if self.curved { point(self.points + at) } else { level };
        Ends { points: [point(a), point(b)], normals: [normal(a), normal(b)] }
    }
}

/// An arm from a sample to a wall point.
#[derive(Debug, Clone, Copy)]
pub struct LightArm<A> {
    /// Unit vector to the wall point.
    pub toward: V3<A>,
    /// Metres, and the inverse; both are 0 for a degenerate pair.
    pub distance: A,
    pub inverse: A,
    /// (reference / distance)², or its root for retroreflective surfaces.
    pub falloff: A,
}

impl<A: Real> LightArm<A> {
    /// The arm of lane `j` of a block to `point`.
    #[inline(always)]
    pub fn new(b: &SampleBlock<A>, j: usize, point: V3<A>, n: &LightNumbers<A>) -> LightArm<A> {
        let way = point - V3 { x: b.point[0][j], y: b.point[1][j], z: b.point[2][j] };
        let squared = way.dot(way);
        let distance = squared.sqrt();
        let is_near = squared < n.nearest;
        let inverse = if is_near { A::zero() } else { A::one() / distance };
        let distance = if is_near { A::zero() } else { distance };
        LightArm { distance, ..LightArm::by(way * inverse, inverse, n) }
    }

    #[inline(always)]
    fn by(toward: V3<A>, inverse: A, n: &LightNumbers<A>) -> LightArm<A> {
        let scaled = n.reference * inverse;
        let falloff = scaled * if n.retro { A::one() } else { scaled };
        LightArm { toward, distance: A::zero(), inverse, falloff }
    }

    /// Puts direction and inverse length of lane `j` into arrays.
    #[inline(always)]
    pub fn keep(&self, to: &mut [[A; LANES]; 4], j: usize) {
        to[0][j] = self.toward.x;
        to[1][j] = self.toward.y;
        to[2][j] = self.toward.z;
        to[3][j] = self.inverse;
    }

    /// The arm that was kept for lane `j`, without its distance.
    #[inline(always)]
    pub fn kept(from: &[[A; LANES]; 4], j: usize, n: &LightNumbers<A>) -> LightArm<A> {
        LightArm::by(V3 { x: from[0][j], y: from[1][j], z: from[2][j] }, from[3][j], n)
    }
}

/// The arms from a sample to a pair, and the cosines at both of their ends.
#[derive(Debug, Clone, Copy)]
pub struct PairView<A, const COSINES: u32, const TWO: bool> {
    pub arms: [LightArm<A>; 2],
    /// Product of both falloffs.
    pub falloff: A,
    /// Cosines of the surface toward both points, and of the wall toward the sample; none below zero.
    pub surface: [A; 2],
    pub wall: [A; 2],
}

impl<A: Real, const COSINES: u32, const TWO: bool> PairView<A, COSINES, TWO> {
    /// The pair at `ends` as lane `j` of a block sees it.
    #[inline(always)]
    pub fn new(b: &SampleBlock<A>, j: usize, ends: &Ends<A>, n: &LightNumbers<A>) -> Self {
        let first = LightArm::new(b, j, ends.points[0], n);
        PairView::by([first, if TWO { LightArm::new(b, j, ends.points[1], n) } else { first }], b, j, ends)
    }

    /// The pair with these arms.
    #[inline(always)]
    pub fn by(arms: [LightArm<A>; 2], b: &SampleBlock<A>, j: usize, ends: &Ends<A>) -> Self {
        let normal = V3 { x: b.normal[0][j], y: b.normal[1][j], z: b.normal[2][j] };
        let (zero, one) = (A::zero(), A::one());
        let cosine = |k: usize| normal.dot(arms[k].toward).at_least(zero);
        let surface = match COSINES {
            PLAIN => [one; 2],
            COSINE => [cosine(0), one],
            _ => [cosine(0), cosine(1)],
        };
        let at_wall = |k: usize| (-ends.normals[k].dot(arms[k].toward)).at_least(zero);
        let wall = if COSINES == LAMBERTIAN { [at_wall(0), at_wall(1)] } else { [one; 2] };
        PairView { arms, falloff: arms[0].falloff * arms[1].falloff, surface, wall }
    }

    /// All cosines.
    #[inline(always)]
    pub fn cosines(&self) -> A {
        match COSINES {
            PLAIN => A::one(),
            COSINE => self.surface[0],
            _ => self.surface[0] * self.surface[1] * (self.wall[0] * self.wall[1]),
        }
    }

    /// Length of the path, metres.
    #[inline(always)]
    pub fn metres(&self) -> A {
        self.arms[0].distance + self.arms[1].distance
    }

    /// The value that the lane's sample adds, and its path.
    #[inline(always)]
    pub fn light(&self, b: &SampleBlock<A>, j: usize) -> (A, A) {
        (b.albedo[j] * self.falloff * self.cosines(), self.metres())
    }
}

/// Place of a path of `metres` in a row: its cell, and the share of the next cell. Where contributions are shared, the cell is
/// the first of the two whose centres bracket the path. Every path is in the row or in the padding at its ends, a NaN path in
/// its first padding.
#[inline(always)]
pub fn place<A: Real>(metres: A, n: &LightNumbers<A>) -> (u32, A) {
    let (cell, share) = (metres * n.bins_per_metre + n.start).at_least(A::one()).at_most(n.last).split();
    (cell, share * n.shared)
}

/// A loop over pairs and blocks, compiled for every kind of cosines and for one or two arms.
pub trait Loop {
    /// Runs the loop. Implementations are always inlined.
    fn run<const COSINES: u32, const TWO: bool>(self);
}

impl<F: Real, A: Real> WallLight<'_, F, A> {
    /// Runs a loop in the widest vectors of the processor.
    pub fn run(&self, inner: impl Loop) {
        pulp::Arch::new().dispatch(Wide { inner, cosines: self.cosines, two_arms: self.two_arms });
    }
}

struct Wide<L> {
    inner: L,
    cosines: u32,
    two_arms: bool,
}

impl<L: Loop> pulp::WithSimd for Wide<L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        match (self.cosines, self.two_arms) {
            (PLAIN, false) => self.inner.run::<PLAIN, false>(),
            (PLAIN, true) => self.inner.run::<PLAIN, true>(),
            (COSINE, false) => self.inner.run::<COSINE, false>(),
            (COSINE, true) => self.inner.run::<COSINE, true>(),
            (_, false) => self.inner.run::<LAMBERTIAN, false>(),
            (_, true) => self.inner.run::<LAMBERTIAN, true>(),
        }
    }
}

/// Runs a function for a dispatch with the float type of its arithmetic: float64 for paths of more bins than fp32 resolves.
macro_rules! with_arithmetic {
    ($call:ident, $float:ident, $run:ident($($argument:expr),* $(,)?)) => {
        if $call.is("FINE") { $run::<$float, f64>($($argument),*) } else { $run::<$float, $float>($($argument),*) }
    };
}
