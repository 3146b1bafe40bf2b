//! The arrangement of wall points in x and y.

use glam::DVec3;

/// Points that take at least this share of a lattice's places form a lattice with holes; others are irregular.
const TAKEN: f64 = 0.5;

/// Lateral range of distinct points, and their number along x and y.
pub struct Lattice {
    /// [low, high] in x and in y, metres.
    pub range: [[f64; 2]; 2],
    /// Points along x and y: of their lattice, or of a square lattice of the same density.
    pub counts: [usize; 2],
    /// Distance of neighbours in x and y, `None` for a single row.
    pub spacing: [Option<f64>; 2],
    /// Column and row of each point, if the points form a lattice and none takes the place of another.
    places: Option<Vec<[usize; 2]>>,
}

impl Lattice {
    /// The lattice of `points`, which must be distinct.
    pub fn of(points: &[DVec3]) -> Lattice {
        let range = [0, 1].map(|axis| {
            let values = points.iter().map(|p| p[axis]);
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            if low <= high { [low, high] } else { [0.0, 0.0] }
        });
        let spans = range.map(|[a, b]| b - a);
        let tolerance = 1e-4 * spans[0].max(spans[1]);
        let [(columns, nx), (rows, ny)] = [0, 1].map(|axis| clusters(points, axis, tolerance));
        let places: Vec<[usize; 2]> = columns.into_iter().zip(rows).map(|(x, y)| [x, y]).collect();
        let mut sorted = places.clone();
        sorted.sort_unstable();
        sorted.dedup();
        let taken = sorted.len();
        let full = nx.saturating_mul(ny);
        if taken as f64 >= TAKEN * full as f64 {
            let counts = [nx, ny];
            let spacing = [0, 1].map(|axis| {
                let spacing = spans[axis] / (counts[axis].max(2) - 1) as f64;
                (counts[axis] > 1 && spacing > 0.0).then_some(spacing)
            });
            let places = (taken == points.len()).then_some(places);
            return Lattice { range, counts, spacing, places };
        }
        // The spacing d of a square lattice of as many points over the same range:
        // (width / d + 1) (height / d + 1) = n.
        let [w, h] = spans;
        let steps = points.len() as f64 - 1.0;
        let d = ((w + h) + ((w + h).powi(2) + 4.0 * w * h * steps).sqrt()) / (2.0 * steps);
        let counts = spans.map(|span| (span / d + 1.0).round().max(1.0) as usize);
        let spacing = counts.map(|n| (n > 1).then_some(d));
        Lattice { range, counts, spacing, places: None }
    }

    /// Column and row of each point, if every place of the lattice is taken exactly once.
    pub fn full(&self) -> Option<&[[usize; 2]]> {
        let [nx, ny] = self.counts;
        self.holed().filter(|places| places.len() == nx * ny)
    }

    /// Column and row of each point, if the points form a lattice, which may have holes, and no place is taken twice.
    pub fn holed(&self) -> Option<&[[usize; 2]]> {
        self.places.as_deref()
    }

    /// [`Lattice::range`] with half the spacing added on every side, as (xmin, xmax, ymin, ymax); `None` for a
    /// single point. A single row or column is as wide as its own spacing.
    pub fn cells(&self) -> Option<[f64; 4]> {
        let (dx, dy) = match self.spacing {
            [Some(dx), Some(dy)] => (dx, dy),
            [Some(d), None] | [None, Some(d)] => (d, d),
            [None, None] => return None,
        };
        let [[x0, x1], [y0, y1]] = self.range;
        Some([x0 - dx / 2.0, x1 + dx / 2.0, y0 - dy / 2.0, y1 + dy / 2.0])
    }
}

/// Groups the points by one coordinate. Returns the group of each point and the number of groups.
fn clusters(points: &[DVec3], axis: usize, tolerance: f64) -> (Vec<usize>, usize) {
    let mut order: Vec<(f64, usize)> = points.iter().map(|p| p[axis]).zip(0..).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut group = vec![0; points.len()];
    let (mut count, mut first) = (0, f64::NEG_INFINITY);
    for (at, p) in order {
        if count == 0 || at - first > tolerance {
            count += 1;
            first = at;
        }
        group[p] = count - 1;
    }
    (group, count)
}
