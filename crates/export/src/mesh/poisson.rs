//! Screened Poisson reconstruction (Kazhdan and Hoppe 2013) on a narrow band of a regular grid.
//!
//! Finds a function χ that is zero on the surface and positive behind it, with a gradient close to the field V of the
//! points' normals. χ minimises Σ over the grid's edges of (∂χ − V)² + α Σ over the points of area · χ(point)². Only
//! nodes near a point contribute, and the band's rim is free, because everything far from all points is trimmed
//! later. A few thousand nodes suffice, instead of millions in the whole box.

use glam::{DVec3, IVec3, dvec3, ivec3};

/// A point of the surface.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    pub at: DVec3,
    /// Unit, outward: towards the wall.
    pub normal: DVec3,
    /// Area represented by the point, square metres.
    pub area: f64,
}

/// Weight α of the points against the normals, for areas in squares of the grid's pitch.
const SCREENING: f64 = 10.0;
/// Extent of the band around the cell of a point along every axis, cells.
const BAND: i32 = 3;
const ITERATIONS: usize = 200;
/// Relative residual at which the iteration ends.
const TOLERANCE: f64 = 1e-4;

pub const CORNERS: [IVec3; 8] = [
    ivec3(0, 0, 0),
    ivec3(0, 0, 1),
    ivec3(0, 1, 0),
    ivec3(0, 1, 1),
    ivec3(1, 0, 0),
    ivec3(1, 0, 1),
    ivec3(1, 1, 0),
    ivec3(1, 1, 1),
];
pub const AXES: [IVec3; 3] = [IVec3::X, IVec3::Y, IVec3::Z];
const NONE: u32 = u32::MAX;

/// χ on the nodes of the band.
pub struct Field {
    pitch: f64,
    /// Grid coordinates of the nodes, in order of x, y, z.
    pub nodes: Vec<IVec3>,
    pub chi: Vec<f64>,
    places: Places,
    next: Vec<[u32; 3]>,
}

impl Field {
    pub fn node(&self, at: IVec3) -> Option<usize> {
        self.places.find(at)
    }

    /// The next node along an axis.
    pub fn next(&self, node: usize, axis: usize) -> Option<usize> {
        Some(self.next[node][axis]).filter(|next| *next != NONE).map(|next| next as usize)
    }

    /// Position of a node, or of a point between nodes, in metres.
    pub fn position(&self, at: DVec3) -> DVec3 {
        at * self.pitch
    }

    /// Values at the corners of the cell whose lowest corner is `node`, if all are in the band.
    pub fn cell(&self, node: usize) -> Option<[f64; 8]> {
        let [x, y] = [self.next(node, 0)?, self.next(node, 1)?];
        let columns = [node, y, x, self.next(x, 1)?];
        let mut values = [0.0; 8];
        for (pair, low) in values.chunks_exact_mut(2).zip(columns) {
            pair.copy_from_slice(&[self.chi[low], self.chi[self.next(low, 2)?]]);
        }
        Some(values)
    }
}

/// Numbers of the nodes by their coordinates: the distinct x, of each the distinct y, of each the z.
struct Places {
    x: Vec<i32>,
    /// Where the y of each x begin, and their end.
    of_x: Vec<usize>,
    y: Vec<i32>,
    of_y: Vec<usize>,
    z: Vec<i32>,
}

impl Places {
    /// Of sorted nodes.
    fn of(nodes: &[IVec3]) -> Places {
        let mut places = Places { x: vec![], of_x: vec![], y: vec![], of_y: vec![], z: vec![] };
        let mut last = None;
        for node in nodes {
            if last != Some([node.x, node.y]) {
                if last.is_none_or(|[x, _]| x != node.x) {
                    places.of_x.push(places.y.len());
                    places.x.push(node.x);
                }
                places.of_y.push(places.z.len());
                places.y.push(node.y);
                last = Some([node.x, node.y]);
            }
            places.z.push(node.z);
        }
        places.of_x.push(places.y.len());
        places.of_y.push(places.z.len());
        places
    }

    fn find(&self, at: IVec3) -> Option<usize> {
        let x = place(&self.x, at.x)?;
        let (from, to) = (self.of_x[x], self.of_x[x + 1]);
        let y = from + place(&self.y[from..to], at.y)?;
        let (from, to) = (self.of_y[y], self.of_y[y + 1]);
        Some(from + place(&self.z[from..to], at.z)?)
    }
}

/// Where a value is in a sorted list, which mostly has no gaps.
fn place(sorted: &[i32], value: i32) -> Option<usize> {
    let guess = usize::try_from(i64::from(value) - i64::from(*sorted.first()?)).ok()?;
    if sorted.get(guess) == Some(&value) { Some(guess) } else { sorted.binary_search(&value).ok() }
}

/// Cell of a position in units of the pitch, and the offset inside it.
fn cell_of(place: DVec3) -> (IVec3, DVec3) {
    let low = place.floor();
    (low.as_ivec3(), place - low)
}

fn weight(corner: IVec3, into: DVec3) -> f64 {
    let along = |c: i32, t: f64| if c == 1 { t } else { 1.0 - t };
    along(corner.x, into.x) * along(corner.y, into.y) * along(corner.z, into.z)
}

/// Solves for χ on a grid of this pitch, whose nodes are multiples of it.
pub fn solve(samples: &[SurfacePoint], pitch: f64) -> Field {
    let nodes = band(samples, pitch);
    // For every node, the next node along each axis.
    let places = Places::of(&nodes);
    let next: Vec<[u32; 3]> =
        (nodes.iter()).map(|n| AXES.map(|axis| places.find(*n + axis).map_or(NONE, |i| i as u32))).collect();
    let mut field = vec![[0.0f64; 3]; nodes.len()];
    let mut screens = Vec::with_capacity(samples.len());
    for sample in samples {
        let place = sample.at / pitch;
        let area = sample.area / (pitch * pitch);
        let (cell, into) = cell_of(place);
        let corners = CORNERS.map(|c| (places.find(cell + c).unwrap_or(0), weight(c, into)));
        screens.push((SCREENING * area, corners));
        for (axis, step) in AXES.iter().enumerate() {
            // The normal's component along an axis belongs to the edges, half a cell further. χ increases inward.
            let rise = -sample.normal[axis] * area;
            let (cell, into) = cell_of(place - 0.5 * step.as_dvec3());
            for corner in CORNERS {
                if let Some(node) = places.find(cell + corner) {
                    field[node][axis] += rise * weight(corner, into);
                }
            }
        }
    }
    let mut right = vec![0.0; nodes.len()];
    let edges = || {
        let all = next.iter().enumerate();
        all.flat_map(|(i, n)| {
            (0..3).filter(|axis| n[*axis] != NONE).map(move |axis| (i, n[axis] as usize, axis))
        })
    };
    for (low, high, axis) in edges() {
        right[high] += field[low][axis];
        right[low] -= field[low][axis];
    }
    let mut diagonal = vec![0.0; nodes.len()];
    edges().for_each(|(low, high, _)| {
        diagonal[low] += 1.0;
        diagonal[high] += 1.0;
    });
    for (alpha, corners) in &screens {
        corners.iter().for_each(|(node, w)| diagonal[*node] += alpha * w * w);
    }
    // Nodes before and after each one, itself where there is none: no rise.
    let mut around: Vec<[u32; 6]> = (0..nodes.len() as u32).map(|i| [i; 6]).collect();
    for (low, high, axis) in edges() {
        around[high][axis] = low as u32;
        around[low][3 + axis] = high as u32;
    }
    let apply = |x: &[f64], y: &mut [f64]| {
        for ((y, own), around) in y.iter_mut().zip(x).zip(&around) {
            let [x0, y0, z0, x1, y1, z1] = around.map(|node| x[node as usize]);
            *y = 0.0 + (own - x0) + (own - y0) + (own - z0) - (x1 - own) - (y1 - own) - (z1 - own);
        }
        for (alpha, corners) in &screens {
            let value: f64 = corners.iter().map(|(node, w)| w * x[*node]).sum();
            corners.iter().for_each(|(node, w)| y[*node] += alpha * w * value);
        }
    };
    let chi = conjugate_gradients(apply, &diagonal, right);
    Field { pitch, nodes, chi, places, next }
}

/// The nodes near the points, in order.
fn band(samples: &[SurfacePoint], pitch: f64) -> Vec<IVec3> {
    let mut cells: Vec<[i32; 3]> = samples.iter().map(|s| cell_of(s.at / pitch).0.to_array()).collect();
    cells.sort_unstable();
    cells.dedup();
    // Axis by axis, which produces fewer duplicates.
    for axis in 0..3 {
        let reach = -BAND..=BAND + 1;
        cells = cells.iter().flat_map(|c| reach.clone().map(move |d| shifted(*c, axis, d))).collect();
        cells.sort_unstable();
        cells.dedup();
    }
    cells.into_iter().map(IVec3::from_array).collect()
}

fn shifted(mut cell: [i32; 3], axis: usize, by: i32) -> [i32; 3] {
    cell[axis] += by;
    cell
}

/// The sum of products, in parts that do not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const PARTS: usize = 8;
    let ((a, last_a), (b, last_b)) = (a.as_chunks::<PARTS>(), b.as_chunks::<PARTS>());
    let mut sums = [0.0; PARTS];
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    let last: f64 = last_a.iter().zip(last_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + last
}

/// Starts from zero, with a diagonal preconditioner.
fn conjugate_gradients(apply: impl Fn(&[f64], &mut [f64]), diagonal: &[f64], right: Vec<f64>) -> Vec<f64> {
    let inverse: Vec<f64> = diagonal.iter().map(|d| 1.0 / d.max(f64::MIN_POSITIVE)).collect();
    let scale = |r: &[f64], to: &mut [f64]| {
        to.iter_mut().zip(r.iter().zip(&inverse)).for_each(|(to, (r, inverse))| *to = r * inverse);
    };
    let [mut x, mut product, mut better] = [(); 3].map(|()| vec![0.0; right.len()]);
    let enough = TOLERANCE * TOLERANCE * dot(&right, &right);
    let mut rest = right;
    scale(&rest, &mut better);
    let mut along = better.clone();
    let mut size = dot(&rest, &along);
    for _ in 0..ITERATIONS {
        if dot(&rest, &rest) <= enough {
            break;
        }
        apply(&along, &mut product);
        let step = size / dot(&along, &product);
        for (((x, r), d), p) in x.iter_mut().zip(&mut rest).zip(&along).zip(&product) {
            *x += step * d;
            *r -= step * p;
        }
        scale(&rest, &mut better);
        let next = dot(&rest, &better);
        let keep = next / size;
        size = next;
        along.iter_mut().zip(&better).for_each(|(d, b)| *d = b + keep * *d);
    }
    x
}

/// The gradient of χ in a cell, at the offset `into` from its lowest corner. Lengths are in units of the pitch.
pub fn gradient(values: &[f64; 8], into: DVec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (value, c) in values.iter().zip(CORNERS) {
        let along = |c: i32, t: f64| if c == 1 { [t, 1.0] } else { [1.0 - t, -1.0] };
        let ([x, dx], [y, dy], [z, dz]) = (along(c.x, into.x), along(c.y, into.y), along(c.z, into.z));
        sum += *value * dvec3(dx * y * z, x * dy * z, x * y * dz);
    }
    sum
}
