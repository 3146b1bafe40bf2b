//! A k-d tree that finds the nearest of many points.

use glam::DVec3;

/// Indices of the points in tree order. The middle index of every part splits it, along x, y and z in turn.
pub struct Tree<'a> {
    points: &'a [DVec3],
    order: Vec<usize>,
}

impl<'a> Tree<'a> {
    /// Builds the tree in O(n log n).
    pub fn new(points: &'a [DVec3]) -> Tree<'a> {
        let mut order: Vec<usize> = (0..points.len()).collect();
        split(points, &mut order, 0);
        Tree { points, order }
    }

    /// The `count` points nearest to `at`, as (squared distance, index), nearest first; fewer if there are
    /// fewer.
    pub fn nearest(&self, at: DVec3, count: usize) -> Vec<(f64, usize)> {
        let mut found = Vec::with_capacity(count + 1);
        self.search(&self.order, 0, at, count, &mut found);
        found
    }

    fn search(&self, part: &[usize], axis: usize, at: DVec3, count: usize, found: &mut Vec<(f64, usize)>) {
        let middle = part.len() / 2;
        let Some(&here) = part.get(middle) else { return };
        let full = |found: &[(f64, usize)], d: f64| found.len() >= count && found[count - 1].0 <= d;
        let distance = self.points[here].distance_squared(at);
        if !full(found, distance) {
            let place = found.partition_point(|f| f.0 <= distance);
            found.insert(place, (distance, here));
            found.truncate(count);
        }
        let (before, after) = (&part[..middle], &part[middle + 1..]);
        let off = at[axis] - self.points[here][axis];
        let (near, far) = if off < 0.0 { (before, after) } else { (after, before) };
        self.search(near, (axis + 1) % 3, at, count, found);
        if !full(found, off * off) {
            self.search(far, (axis + 1) % 3, at, count, found);
        }
    }
}

fn split(points: &[DVec3], part: &mut [usize], axis: usize) {
    if part.len() < 2 {
        return;
    }
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| points[a][axis].total_cmp(&points[b][axis]));
    let (before, after) = part.split_at_mut(middle);
    split(points, before, (axis + 1) % 3);
    split(points, &mut after[1..], (axis + 1) % 3);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn the_nearest_are_those_of_a_full_search() {
        // Irregular points, many of them with equal coordinates.
        let points: Vec<DVec3> = (0..500)
            .map(|k| {
                let f = |m: usize| (k * m % 101) as f64 / 101.0;
                dvec3(f(37), if k % 3 == 0 { 0.5 } else { f(71) }, 0.1 * f(13))
            })
            .collect();
        let tree = Tree::new(&points);
        for at in [dvec3(0.5, 0.5, 0.0), dvec3(-1.0, 2.0, 0.3), points[17]] {
            let mut all: Vec<f64> = points.iter().map(|p| p.distance_squared(at)).collect();
            all.sort_unstable_by(f64::total_cmp);
            let found: Vec<f64> = tree.nearest(at, 9).iter().map(|f| f.0).collect();
            assert_eq!(found, all[..9]);
        }
        assert_eq!(tree.nearest(DVec3::ZERO, 1000).len(), 500);
        assert!(Tree::new(&[]).nearest(DVec3::ZERO, 3).is_empty());
    }
}
