//! Depths for pixels of the true mask that a result does not show, as others count them.

use std::collections::VecDeque;

/// The depth of the nearest pixel that has one, for every pixel of a picture of `nx` x `ny`, by steps to the eight neighbours; `None`
/// without any.
pub fn nearest(found: &[Option<f64>], [nx, ny]: [usize; 2]) -> Option<Vec<f64>> {
    let mut depth: Vec<Option<f64>> = found.to_vec();
    let mut queue: VecDeque<usize> = (0..depth.len()).filter(|p| depth[*p].is_some()).collect();
    while let Some(pixel) = queue.pop_front() {
        let (x, y) = (pixel / ny, pixel % ny);
        for (i, j) in (x.saturating_sub(1)..nx.min(x + 2))
            .flat_map(|i| (y.saturating_sub(1)..ny.min(y + 2)).map(move |j| (i, j)))
        {
            if depth[i * ny + j].is_none() {
                depth[i * ny + j] = depth[pixel];
                queue.push_back(i * ny + j);
            }
        }
    }
    depth.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_gets_the_depth_of_the_nearest() {
        let mut found = vec![None; 5 * 7];
        (found[0], found[34]) = (Some(1.0), Some(2.0));
        let all = nearest(&found, [5, 7]).unwrap();
        assert_eq!([all[1], all[7], all[33], all[27]], [1.0, 1.0, 2.0, 2.0]);
        assert_eq!(nearest(&[None; 4], [2, 2]), None);
    }
}
