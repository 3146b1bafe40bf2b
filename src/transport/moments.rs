//! Sums over measured values that are not on the host.

/// Sums of measured values and of their squares, bin by bin, over the first pairs of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    /// For some numbers of pairs, ascending: sum and sum of squares over the first so many, `[bin]`.
    parts: Vec<(usize, Vec<[f64; 2]>)>,
}

impl Moments {
    /// From the sums over the pairs up to each of `ends`, ascending, from the end before: `[part][bin]`.
    pub fn of(ends: &[usize], between: Vec<Vec<[f64; 2]>>) -> Moments {
        let mut parts: Vec<(usize, Vec<[f64; 2]>)> = vec![];
        for (end, mut own) in ends.iter().zip(between) {
            if let Some((_, before)) = parts.last() {
                own.iter_mut()
                    .zip(before)
                    .for_each(|(own, before)| *own = [own[0] + before[0], own[1] + before[1]]);
            }
            parts.push((*end, own));
        }
        Moments { parts }
    }

    /// Sum and sum of squares over the first `pairs` pairs, `[bin]`.
    ///
    /// # Panics
    /// They were not summed for so many pairs.
    pub fn first(&self, pairs: usize) -> &[[f64; 2]] {
        let part = self.parts.iter().find(|(end, _)| *end == pairs);
        &part.unwrap_or_else(|| panic!("nothing was summed over the first {pairs} pairs")).1
    }

    /// The same over all pairs.
    ///
    /// # Panics
    /// There are none.
    pub fn all(&self) -> &[[f64; 2]] {
        &self.parts.last().expect("a model has pairs").1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_to_the_first_pairs() {
        let moments =
            Moments::of(&[2, 5], vec![vec![[1.0, 2.0], [3.0, 4.0]], vec![[10.0, 20.0], [30.0, 40.0]]]);
        assert_eq!(moments.first(2), [[1.0, 2.0], [3.0, 4.0]]);
        assert_eq!(moments.first(5), [[11.0, 22.0], [33.0, 44.0]]);
        assert_eq!(moments.all(), moments.first(5));
    }
}
