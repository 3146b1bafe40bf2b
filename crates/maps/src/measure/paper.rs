//! The paper's measure: errors over all pixels of the picture.

use serde::{Deserialize, Serialize};

/// The paper's measure, inferred from its table: errors over all pixels of the picture, inside and outside the mask.
/// Absent pixels have depth 0 and normal (0, 0, 0). `None`: unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PaperMeasure {
    /// Mean absolute error of depth, metres.
    pub depth_mae: Option<f64>,
    /// Root mean square error of depth, metres.
    pub depth_rmse: Option<f64>,
    /// Mean absolute error of the normals' components.
    pub normal_mae: Option<f64>,
    /// Root mean square error of the normals' components.
    pub normal_rmse: Option<f64>,
}

impl PaperMeasure {
    /// The measure over depths and normals of pixels, estimated and true. A normal that is not finite is (0, 0, 0).
    pub(super) fn of(pixels: impl Iterator<Item = [(f32, [f32; 3]); 2]>) -> PaperMeasure {
        let (mut depth, mut normal) = (Sums::default(), Sums::default());
        for pair in pixels {
            let [(found, n), (real, m)] = pair.map(|(depth, normal)| {
                let is_known = normal.iter().all(|v| v.is_finite());
                (f64::from(depth), if is_known { normal.map(f64::from) } else { [0.0; 3] })
            });
            depth.add(found - real);
            (0..3).for_each(|c| normal.add(n[c] - m[c]));
        }
        PaperMeasure {
            depth_mae: depth.absolute.get(),
            depth_rmse: depth.square.get().map(f64::sqrt),
            normal_mae: normal.absolute.get(),
            normal_rmse: normal.square.get().map(f64::sqrt),
        }
    }
}

#[derive(Default)]
pub(super) struct Sums {
    pub absolute: Mean,
    pub square: Mean,
}

impl Sums {
    /// Adds an error, unless it is not finite (a pixel without a true depth inside the mask).
    pub fn add(&mut self, error: f64) {
        if error.is_finite() {
            self.absolute.add(error.abs());
            self.square.add(error * error);
        }
    }
}

#[derive(Default)]
pub(super) struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    pub fn get(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}
