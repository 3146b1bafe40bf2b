//! An order of pairs in which the first n pairs are spread over the whole wall, for every n. A solver can then work on
//! a part of the pairs without a copy of any data.

use glam::DVec3;

use super::{Geometry, Model, Rendered, Wall};

/// Other points of a product that are enough.
const ROWS: usize = 16;

/// Bits of a cell's number along one axis.
const BITS: u32 = 15;

/// The order for pairs whose points are `points`: one list, or two with two points per pair. Points are sorted along a
/// Z-order curve over the cells of the wall and taken from there in bit-reversed order: of n points the first n / 4^k
/// are every 4^k-th along the curve. On a lattice with 2^k points to a side of its blocks, those are every 2^k-th in x
/// and y; elsewhere, one of every 4^k neighbours.
pub fn spread_order(points: &[&[DVec3]]) -> Vec<usize> {
    let count = points.first().map_or(0, |side| side.len());
    let axes: Vec<Vec<usize>> =
        points.iter().flat_map(|side| [0, 1].map(|axis| cells(side, |p| p[axis]))).collect();
    let along = |i: usize| {
        let bit = |b: u32| axes.iter().fold(0u64, move |code, axis| code << 1 | (axis[i] as u64 >> b & 1));
        (0..BITS).rev().fold(0, |code, b| code << axes.len() | bit(b))
    };
    let mut curve: Vec<usize> = (0..count).collect();
    curve.sort_by_cached_key(|i| along(*i));
    let mut order: Vec<usize> = (0..count).collect();
    // Starts a third into a block of 2, 4, 8, ... points, not at its edge: coarse lattices lie nearer to the middle.
    const MIDDLE: u64 = 0x3333_3333_3333_3333;
    order.sort_by_key(|rank| (*rank as u64 ^ MIDDLE).reverse_bits());
    order.into_iter().map(|rank| curve[rank]).collect()
}

/// The cell of each point along one axis: its column if many points share one, else its rank, in as many steps as
/// there are points side by side. Ranks instead of lengths give the columns of a slightly distorted lattice too.
fn cells(points: &[DVec3], axis: impl Fn(&DVec3) -> f64) -> Vec<usize> {
    let mut sorted: Vec<usize> = (0..points.len()).collect();
    sorted.sort_by(|a, b| axis(&points[*a]).total_cmp(&axis(&points[*b])));
    let [low, high] = [sorted.first(), sorted.last()].map(|i| i.map_or(0.0, |i| axis(&points[*i])));
    // Points nearer than this share a coordinate.
    let near = 1e-6 * (high - low);
    let (mut column, mut at) = (0, low);
    let [mut columns, mut ranks] = [vec![0; points.len()], vec![0; points.len()]];
    for (rank, p) in sorted.iter().enumerate() {
        if axis(&points[*p]) - at > near {
            (column, at) = (column + 1, axis(&points[*p]));
        }
        (columns[*p], ranks[*p]) = (column, rank);
    }
    let most = 1 << BITS;
    if 2 * column < points.len() {
        return columns.into_iter().map(|c| c.min(most - 1)).collect();
    }
    let steps = ((points.len() as f64).sqrt().round() as usize).clamp(1, most);
    ranks.into_iter().map(|rank| rank * steps / points.len()).collect()
}

/// Picks some of the points of a side, or of what is listed beside them: their normals.
type Pick<'a> = dyn Fn(&[DVec3]) -> Vec<DVec3> + 'a;

impl Wall {
    /// The wall of the first `pairs` only.
    pub fn first(&self, pairs: usize) -> Wall {
        self.stretch(0, pairs)
    }

    /// The wall of `count` pairs from pair `first` on, in their order. Of a product: whole rows of scanned points, or a
    /// stretch of one row.
    pub fn stretch(&self, first: usize, count: usize) -> Wall {
        let row = self.scanned.len().max(1);
        let [scanned, others] = match self.geometry {
            Geometry::Confocal => [first..first + count, 0..0],
            Geometry::TwoPoints => [first..first + count, first..first + count],
            Geometry::Product if first.is_multiple_of(row) && count.is_multiple_of(row) => {
                [0..self.scanned.len(), first / row..(first + count) / row]
            }
            Geometry::Product => [first % row..first % row + count, first / row..first / row + 1],
        };
        let normals = |n: &Vec<DVec3>| {
            let (a, b) = n.split_at(self.scanned.len());
            [&a[scanned.clone()], &b[others.clone()]].concat()
        };
        Wall {
            geometry: self.geometry,
            normals: self.normals.as_ref().map(normals),
            scanned: self.scanned[scanned.clone()].to_vec(),
            others: self.others[others.clone()].to_vec(),
        }
    }

    /// The wall of those points, with their normals, that `scanned` and `others` pick, in the order that they give.
    fn picked(&self, [scanned, others]: [&Pick; 2]) -> Wall {
        let normals = |n: &Vec<DVec3>| {
            let (a, b) = n.split_at(self.scanned.len());
            [scanned(a), others(b)].concat()
        };
        Wall {
            geometry: self.geometry,
            scanned: scanned(&self.scanned),
            others: others(&self.others),
            normals: self.normals.as_ref().map(normals),
        }
    }

    /// Whether pairs are made of as many points in the same way.
    fn is_like(&self, other: &Wall) -> bool {
        let parts = |wall: &Wall| (wall.geometry, wall.scanned.len(), wall.others.len());
        parts(self) == parts(other)
    }

    /// The order ([`spread_order`]) of the scanned and of the other points, and the pair that moves to each place.
    fn spread(&self) -> ([Vec<usize>; 2], Vec<usize>) {
        let (s, o) = (&self.scanned, &self.others);
        match self.geometry {
            Geometry::Confocal => {
                let order = spread_order(&[s]);
                ([order.clone(), vec![]], order)
            }
            Geometry::TwoPoints => {
                let order = spread_order(&[s, o]);
                ([order.clone(), order.clone()], order)
            }
            Geometry::Product => {
                let sides = [s, o].map(|side| spread_order(&[side]));
                let of_row = |row: usize| sides[0].iter().map(move |point| row * s.len() + point);
                let pairs = sides[1].iter().flat_map(|row| of_row(*row)).collect();
                (sides, pairs)
            }
        }
    }
}

impl Model {
    /// Reorders the pairs so that the first n are spread over the wall, for every n. In place, as histograms are large.
    /// Returns the pair that moved to each place.
    pub fn spread(&mut self) -> Vec<usize> {
        let (sides, pairs) = self
            .given
            .take()
            .filter(|given| given.is_like(&self.wall))
            .as_ref()
            .unwrap_or(&self.wall)
            .spread();
        let pick = |points: &[DVec3], order: &[usize]| order.iter().map(|i| points[*i]).collect::<Vec<_>>();
        self.wall = self.wall.picked([&|points| pick(points, &sides[0]), &|points| pick(points, &sides[1])]);
        if !self.measured.is_empty() {
            arrange(&mut self.measured, self.bins, &pairs);
        }
        self.rendered = self.rendered.take().map(|r| Rendered::of(&self.wall, r.spot));
        self.is_spread = true;
        pairs
    }

    /// Moves the first `count` pairs to the end, where they are held out. Of a product with several other points: all pairs of
    /// some of them. The model has no measured values yet. Returns the pair that moved to each place.
    pub fn hold_out(&mut self, count: usize) -> Vec<usize> {
        let several = self.wall.geometry == Geometry::Product && self.wall.others.len() > 1;
        let (row, pairs) = (self.wall.scanned.len(), self.pairs());
        let count = if several { count / row * row } else { count };
        let rotated = |points: &[DVec3], by: usize| [&points[by..], &points[..by]].concat();
        let by = match self.wall.geometry {
            Geometry::Confocal => [count, 0],
            Geometry::TwoPoints => [count, count],
            Geometry::Product if several => [0, count / row],
            Geometry::Product => [count, 0],
        };
        self.wall = self.wall.picked([&|points| rotated(points, by[0]), &|points| rotated(points, by[1])]);
        self.rendered = self.rendered.take().map(|r| Rendered::of(&self.wall, r.spot));
        self.held_out = count;
        (0..pairs).map(|place| (place + count) % pairs).collect()
    }

    /// Sufficient number of first pairs where `wanted` are required: the fewest of 1 in 1, 4, 16, ... that are as many,
    /// or nearly. Of a product they are whole rows, of at least 16 other points.
    pub fn enough(&self, wanted: usize) -> usize {
        // A few pairs of a scan may be missing: they were not measured.
        let least = (wanted - wanted / 10).max(1);
        let mut share = 1;
        while self.is_spread && self.pairs() / (4 * share) >= least {
            share *= 4;
        }
        let rows = self.wall.others.len();
        if self.wall.geometry != Geometry::Product || rows == 1 {
            return self.pairs().div_ceil(share);
        }
        rows.div_ceil(share).max(ROWS.min(rows)) * self.wall.scanned.len()
    }

    /// Uses the first `count` pairs only. The model has no measured values yet.
    pub fn use_first(&mut self, count: usize) {
        self.unused = self.pairs() - count;
        self.elements = self.elements_of(count);
        self.wall = self.wall.first(count);
        self.rendered = self.rendered.take().map(|r| Rendered::of(&self.wall, r.spot));
    }
}

/// Moves row `from[i]` of `length` values to row i, for all i, along the cycles of the permutation.
fn arrange(rows: &mut [f32], length: usize, from: &[usize]) {
    let mut done = vec![false; from.len()];
    let mut first = vec![0.0; length];
    for start in 0..from.len() {
        if done[start] || from[start] == start {
            continue;
        }
        first.copy_from_slice(&rows[start * length..][..length]);
        let mut to = start;
        while from[to] != start {
            rows.copy_within(from[to] * length..(from[to] + 1) * length, to * length);
            done[to] = true;
            to = from[to];
        }
        rows[to * length..][..length].copy_from_slice(&first);
        done[to] = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Capture;
    use crate::transport::Reflectance;
    use glam::dvec3;

    fn lattice(nx: usize, ny: usize, jitter: f64) -> Vec<DVec3> {
        // Repeatable noise.
        let noise = |i: usize| jitter * ((i as f64 * 12.9898).sin() * 43758.5453).fract();
        (0..nx * ny)
            .map(|i| dvec3((i / ny) as f64 + noise(i), (i % ny) as f64 + noise(i + 7919), 0.0) * 0.01)
            .collect()
    }

    #[test]
    fn an_order_is_a_permutation() {
        for points in [lattice(7, 5, 0.0), lattice(16, 16, 0.3), lattice(100, 1, 0.0), lattice(1, 1, 0.0)] {
            let mut order = spread_order(&[&points]);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..points.len()));
        }
        assert!(spread_order(&[&[]]).is_empty());
    }

    #[test]
    fn beginnings_of_a_lattice_are_coarser_lattices() {
        // Also if points are slightly displaced, and if x and y have different numbers of points.
        for (nx, ny, jitter) in [(64, 64, 0.0), (64, 64, 0.3), (96, 96, 0.0), (128, 32, 0.0)] {
            let points = lattice(nx, ny, jitter);
            let order = spread_order(&[&points]);
            for step in [2, 4] {
                let places: Vec<[usize; 2]> =
                    order[..nx * ny / step / step].iter().map(|i| [i / ny, i % ny]).collect();
                let [x, y] = places[0].map(|c| c % step);
                assert!(x > 0 || step == 2, "nearer to the middle of its block than its edge: {x}");
                assert!(
                    places.iter().all(|[a, b]| a % step == x && b % step == y),
                    "{nx} {ny} {jitter} {step}"
                );
            }
        }
    }

    #[test]
    fn beginnings_of_scattered_points_leave_no_hole() {
        let points: Vec<DVec3> = {
            let one = |i: usize, by: f64| (i as f64 * by).fract();
            // Two irrational steps: no lattice, but an even density.
            (0..4000).map(|i| dvec3(one(i, 0.754_877_666), one(i, 0.569_840_291), 0.0)).collect()
        };
        let order = spread_order(&[&points]);
        for count in [250, 1000, 1500] {
            // Counts in 7 x 7 squares of the wall differ less than by chance, where the variance is the mean.
            let mut held = [[0usize; 7]; 7];
            for i in &order[..count] {
                held[(points[*i].x * 7.0) as usize][(points[*i].y * 7.0) as usize] += 1;
            }
            let share = count as f64 / 49.0;
            let variance = held.iter().flatten().map(|n| (*n as f64 - share).powi(2)).sum::<f64>() / 49.0;
            assert!(variance < 0.45 * share, "{count}: {}", variance / share);
        }
    }

    #[test]
    fn pairs_of_two_points_are_spread_over_both() {
        // Every laser with every sensor point, as a general plan has them: one laser after the other.
        let side = lattice(8, 8, 0.0);
        let (lasers, sensors): (Vec<DVec3>, Vec<DVec3>) =
            side.iter().flat_map(|l| side.iter().map(move |s| (*l, *s))).unzip();
        let order = spread_order(&[&lasers, &sensors]);
        let first = &order[..256];
        for points in [&lasers, &sensors] {
            let mut met: Vec<_> = first.iter().map(|i| points[*i].to_array().map(f64::to_bits)).collect();
            met.sort_unstable();
            met.dedup();
            assert_eq!(met.len(), 16, "every second point in x and y");
        }
    }

    /// A model whose measured values tell their pair and bin, off a wall whose normals tell their point.
    fn numbered(geometry: Geometry, scanned: usize, others: usize) -> Model {
        let points = |count: usize, y: f64| (0..count).map(|i| dvec3(0.1 * i as f64, y, 0.0)).collect();
        let [own, other]: [Vec<DVec3>; 2] = [points(scanned, 0.0), points(others, 0.3)];
        let normals = own.iter().chain(&other).map(|p| dvec3(p.x, p.y, 1.0)).collect();
        let wall = Wall { geometry, scanned: own, others: other, normals: Some(normals) };
        let capture = Capture::new([1, 1], vec![DVec3::ZERO], vec![DVec3::ZERO], 2, 0.01, vec![1.0; 2]);
        let pairs = wall.pairs();
        Model {
            measured: (0..2 * pairs).map(|i| i as f32).collect(),
            elements: 3 * pairs,
            wall,
            ..Model::new(&capture, Reflectance::Lambertian, 1.0, false)
        }
    }

    /// Every pair: its two points, their normals, and its measured values.
    fn rows_of(model: &Model) -> Vec<String> {
        let wall = &model.wall;
        let normal = |i: usize| wall.normals.as_ref().map(|n| n[i]);
        let row = |pair: usize| {
            let [s, o] = match wall.geometry {
                Geometry::Confocal => [pair, pair],
                Geometry::TwoPoints => [pair, wall.scanned.len() + pair],
                Geometry::Product => {
                    [pair % wall.scanned.len(), wall.scanned.len() + pair / wall.scanned.len()]
                }
            };
            let point = |i: usize| {
                if i < wall.scanned.len() { wall.scanned[i] } else { wall.others[i - wall.scanned.len()] }
            };
            let values = &model.measured[2 * pair..][..2];
            format!("{:?} {:?} {:?} {:?} {values:?}", point(s), point(o), normal(s), normal(o))
        };
        (0..wall.pairs()).map(row).collect()
    }

    /// Sheared points have another order of their own.
    #[test]
    fn moved_points_keep_the_order_of_those_that_were_given() {
        let given = lattice(16, 16, 0.0);
        let sheared: Vec<DVec3> = given.iter().map(|p| dvec3(p.x + 0.3 * p.y, p.y, 0.0)).collect();
        let of = |points: &[DVec3], given: Option<&[DVec3]>| {
            let capture = Capture::new([16, 16], points.to_vec(), points.to_vec(), 2, 0.01, vec![1.0; 512]);
            let capture =
                capture.with(|c| c.given = given.map(|g| std::sync::Arc::new([g.to_vec(), g.to_vec()])));
            let mut model = Model::new(&capture, Reflectance::Cosine, 1.0, false);
            let order = model.spread();
            assert_eq!(model.wall.scanned[3], points[order[3]], "points go with their pairs");
            order
        };
        let order = of(&given, None);
        assert_eq!(of(&sheared, Some(&given)), order);
        assert_ne!(of(&sheared, None), order);
        // Other points than those of the pairs say nothing.
        assert_eq!(of(&sheared, Some(&given[..9])), of(&sheared, None));
    }

    #[test]
    fn pairs_that_are_held_out_are_the_last_ones_with_their_points() {
        for (geometry, scanned, others, asked, held) in [
            (Geometry::Confocal, 6, 0, 2, 2),
            (Geometry::TwoPoints, 6, 6, 2, 2),
            (Geometry::Product, 6, 1, 2, 2),
            // All pairs of an other point, or none.
            (Geometry::Product, 4, 3, 7, 4),
            (Geometry::Product, 4, 3, 3, 0),
        ] {
            let mut model = numbered(geometry, scanned, others);
            let before = rows_of(&model);
            let order = model.hold_out(asked);
            let pairs = order.len();
            assert_eq!((model.held_out, model.fitted()), (held, pairs - held), "{geometry:?}");
            // The measured values stay where they are: only points move.
            let points = |row: &String| row.rsplit_once('[').expect("values").0.to_owned();
            let moved: Vec<String> = order.iter().map(|from| points(&before[*from])).collect();
            assert_eq!(rows_of(&model).iter().map(points).collect::<Vec<_>>(), moved, "{geometry:?}");
            assert_eq!(order[pairs - held..], (0..held).collect::<Vec<_>>(), "{geometry:?}");
        }
    }

    #[test]
    fn rows_go_where_the_order_says() {
        let mut rows: Vec<f32> = (0..15).map(|v| v as f32).collect();
        arrange(&mut rows, 3, &[2, 0, 1, 3, 4]);
        assert_eq!(rows, [6, 7, 8, 0, 1, 2, 3, 4, 5, 9, 10, 11, 12, 13, 14].map(|v| v as f32));
    }
}
