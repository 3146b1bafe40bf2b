//! Hypotheses on the points: another unit, half of the wall, other axes.

use crate::capture::{Capture, PairKind};

/// A capture with a hypothesis undone.
pub(super) struct Edit {
    pub what: String,
    pub hint: String,
    pub capture: Capture,
}

/// Factors of the points, and what explains them. Half the paths of one-way times have the same shape as twice the wall.
const FACTORS: [(f64, &str); 4] = [
    (0.3048, "as if points in feet were taken as metres"),
    (0.5, "as if times were one way, or the wall half as wide"),
    (2.0, "as if half the width of the wall was taken as the whole"),
    (1.0 / 0.3048, "as if points in metres were taken as feet"),
];

/// Points of another scale; of scans of one laser or sensor point, counts with other axes.
pub(super) fn edits(capture: &Capture) -> Vec<Edit> {
    let [x0, x1, y0, y1] = capture.wall_extent();
    let of_scale = |(factor, why): (f64, &str)| {
        let scaled = capture.clone().with(|c| {
            c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p *= factor);
            c.laser_spot.iter_mut().chain(&mut c.sensor_spot).for_each(|width| *width *= factor);
        });
        Edit {
            what: format!("the wall is {factor:.3} times as wide as its points say, {why}"),
            hint: format!(
                "check the units of points and times; the wall would be {:.3} x {:.3} m",
                factor * (x1 - x0),
                factor * (y1 - y0)
            ),
            capture: scaled,
        }
    };
    let mut edits: Vec<Edit> = FACTORS.into_iter().map(of_scale).collect();
    let [nx, ny] = capture.scan;
    if nx == ny && nx > 1 && matches!(capture.pair_kind(), PairKind::OneLaser | PairKind::OneSensor) {
        let order = |at: &dyn Fn(usize, usize) -> usize| -> Vec<usize> {
            (0..nx * ny).map(|pair| at(pair / ny, pair % ny)).collect()
        };
        let axes: [(&str, &str, Vec<usize>); 3] = [
            (
                "x and y of the counts are exchanged",
                "exchange the axes of the counts",
                order(&|x, y| y * ny + x),
            ),
            ("the counts run against x", "reverse the counts along x", order(&|x, y| (nx - 1 - x) * ny + y)),
            ("the counts run against y", "reverse the counts along y", order(&|x, y| x * ny + ny - 1 - y)),
        ];
        edits.extend(axes.map(|(what, hint, from)| {
            let histograms = from.iter().flat_map(|pair| capture.histogram(*pair)).copied().collect();
            Edit {
                what: what.into(),
                hint: hint.into(),
                capture: capture.outline().with(|c| c.histograms = histograms),
            }
        }));
    }
    edits
}
