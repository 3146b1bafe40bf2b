//! Error against run time, of one case or as means over cases.

use serde::{Deserialize, Serialize};

use super::{BEST, CaseResults, DEPTH, NORMALS, OWN, Values, names};
use thirdbounce::export::axis::{Axis, Panel, legend};
use thirdbounce::export::figure::{BODY, COLOURS, Colour, FRAME, Figure, HEADING, INK};

/// Start of the time axis, seconds.
const FROM: f64 = 0.02;
const PANEL: [f64; 2] = [400.0, 260.0];
const LEFT: f64 = 70.0;
const TOP: f64 = 46.0;
/// Offset between the corners of adjacent panels.
const STEP: [f64; 2] = [490.0, 360.0];
const LEGEND: [f64; 2] = [165.0, 26.0];

/// A metric of the curves.
pub struct Metric {
    /// Its place among the quantities.
    pub place: usize,
    /// Unit of the quantity over that of the curve.
    pub unit: f64,
    title: &'static str,
    logarithmic: bool,
}

/// The metrics of the curves: as a user gets the maps, with their own masks, except for the best IoU.
pub const METRICS: [Metric; 4] = [
    Metric { place: OWN, unit: 1.0, title: "IoU of the maps' own mask", logarithmic: false },
    Metric { place: BEST, unit: 1.0, title: "best IoU over mask fractions", logarithmic: false },
    Metric { place: DEPTH, unit: 100.0, title: "depth MAE over the width of the wall", logarithmic: true },
    Metric { place: NORMALS, unit: 1.0, title: "normal error (degrees)", logarithmic: false },
];

/// The metrics of an empty map.
pub const WORST: [f64; 4] = [0.0, 0.0, 1.0, 90.0];

/// The metrics at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 5]", into = "[f64; 5]")]
pub struct CurvePoint {
    /// Seconds since the start of the method.
    pub seconds: f64,
    /// Values of [`METRICS`].
    pub values: [f64; 4],
}

impl From<[f64; 5]> for CurvePoint {
    fn from([seconds, a, b, c, d]: [f64; 5]) -> CurvePoint {
        CurvePoint { seconds, values: [a, b, c, d] }
    }
}

impl From<CurvePoint> for [f64; 5] {
    fn from(CurvePoint { seconds, values: [a, b, c, d] }: CurvePoint) -> [f64; 5] {
        [seconds, a, b, c, d]
    }
}

impl CurvePoint {
    /// The metrics at a time, rounded for storage; those of an empty map where there are none.
    pub fn new(seconds: f64, values: &Values) -> CurvePoint {
        let rounded = |v: f64| (1e5 * v).round() / 1e5;
        let of = |(metric, worst): (&Metric, f64)| {
            let value = values[metric.place] / metric.unit;
            rounded(if value.is_finite() { value } else { worst })
        };
        let mut all = METRICS.iter().zip(WORST).map(of);
        CurvePoint {
            seconds: rounded(seconds),
            values: std::array::from_fn(|_| all.next().unwrap_or(f64::NAN)),
        }
    }
}

/// The better one of two values of metric `k`.
fn better(k: usize, a: f64, b: f64) -> f64 {
    if WORST[k] == 0.0 { a.max(b) } else { a.min(b) }
}

/// A curve of a side.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// The preview, if it shows one: the first of its points, or the mean of those.
    pub preview: Option<CurvePoint>,
    /// Samples in order of time; one for a closed form. Values last until the next sample.
    pub points: Vec<CurvePoint>,
    is_iterative: bool,
}

/// The last of `points` until a time; an empty map before the first.
fn at(points: &[CurvePoint], seconds: f64) -> [f64; 4] {
    points.iter().rev().find(|p| p.seconds <= seconds).map_or(WORST, |p| p.values)
}

fn mean(all: impl Iterator<Item = [f64; 4]>, count: usize) -> [f64; 4] {
    let sum = all.fold([0.0; 4], |sum, v| std::array::from_fn(|k| sum[k] + v[k]));
    sum.map(|v| v / count.max(1) as f64)
}

/// Means over curves of cases, at all their times.
fn means(all: &[Vec<CurvePoint>]) -> Vec<CurvePoint> {
    let mut times: Vec<f64> = all.iter().flatten().map(|p| p.seconds).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let point = |seconds| CurvePoint {
        seconds,
        values: mean(all.iter().map(|points| at(points, seconds)), all.len()),
    };
    times.into_iter().map(point).collect()
}

/// The mean point of points of `count` cases. Cases without one count as empty maps.
fn middle(points: &[CurvePoint], count: usize) -> Option<CurvePoint> {
    let seconds = points.iter().map(|p| p.seconds).sum::<f64>() / points.len() as f64;
    let missing = std::iter::repeat_n(WORST, count - points.len());
    let values = mean(points.iter().map(|p| p.values).chain(missing), count);
    (!points.is_empty()).then_some(CurvePoint { seconds, values })
}

/// The curves of all sides: of a single case, or their means over the cases, in which a side that does not take a case counts as an
/// empty map.
pub fn curves(cases: &[&CaseResults]) -> Vec<Curve> {
    let of = |name: &str| {
        let sides: Vec<_> = cases.iter().filter_map(|case| case.side(name)).collect();
        let previews: Vec<CurvePoint> =
            sides.iter().filter(|s| s.preview).filter_map(|s| s.points.first().copied()).collect();
        let is_iterative = sides.iter().any(|side| side.points.len() > 1);
        let points = match is_iterative {
            true => means(
                &cases.iter().map(|c| c.side(name).map_or(vec![], |s| s.points.clone())).collect::<Vec<_>>(),
            ),
            false => {
                let each: Vec<CurvePoint> = sides.iter().filter_map(|s| s.points.last().copied()).collect();
                middle(&each, cases.len()).into_iter().collect()
            }
        };
        let preview = middle(&previews, previews.len());
        Curve { name: name.into(), preview, points, is_iterative }
    };
    names(cases).into_iter().map(of).filter(|curve| !curve.points.is_empty()).collect()
}

/// The best that any side has at a time, for each metric; its mean over the cases. `closed`: of closed forms only.
pub fn hull(cases: &[&CaseResults], closed: bool) -> Vec<CurvePoint> {
    let of = |case: &&CaseResults| {
        let sides = case.sides.iter().filter(|s| !(s.foreign || closed && s.points.len() > 1));
        let mut points: Vec<CurvePoint> = sides.flat_map(|s| s.points.iter().copied()).collect();
        points.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let mut best = WORST;
        for point in &mut points {
            best = std::array::from_fn(|k| better(k, best[k], point.values[k]));
            point.values = best;
        }
        points
    };
    means(&cases.iter().map(of).collect::<Vec<_>>())
}

/// The first side against the hull of the closed forms, by the IoU of its own mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wins {
    /// Seconds from which on it is above; `None`: not at its end.
    pub from: Option<f64>,
    /// Difference of IoU at the end of both.
    pub at_end: f64,
}

/// The mean over the cases of the first side against the hull of the closed forms.
pub fn wins(cases: &[&CaseResults]) -> Option<Wins> {
    let first = curves(cases).into_iter().next()?;
    let others = hull(cases, true);
    let end = others.last()?.seconds.max(first.points.last()?.seconds);
    let above = |seconds: f64| at(&first.points, seconds)[0] - at(&others, seconds)[0];
    let mut times: Vec<f64> = first.points.iter().chain(&others).map(|p| p.seconds).collect();
    times.sort_by(f64::total_cmp);
    let below = times.iter().rposition(|t| above(*t) <= 0.0);
    let from = below.map_or(times.first(), |last| times.get(last + 1)).copied();
    Some(Wins { from, at_end: above(end) })
}

/// Graphs of these of [`METRICS`] over one logarithmic time axis: staircases with a disc at every sample for iterative methods, a
/// disc for each closed form, a ring for the preview, and the dashed hull.
pub fn figure(cases: &[&CaseResults], title: &str, metrics: &[usize], with_legend: bool) -> Figure {
    let (curves, hull) = (curves(cases), hull(cases, false));
    let columns = metrics.len().min(2);
    let rows = metrics.len().div_ceil(2);
    let named: Vec<(String, Option<Colour>)> = coloured(&curves)
        .map(|(curve, colour)| (curve.name.clone(), Some(colour)))
        .chain(std::iter::once(("hull".into(), None)))
        .collect();
    let width = LEFT + STEP[0] * (columns - 1) as f64 + PANEL[0] + 30.0;
    let top = if title.is_empty() { TOP } else { TOP + 34.0 };
    let in_a_row = ((width - LEFT) / LEGEND[0]) as usize;
    let lines = if with_legend { named.len().div_ceil(in_a_row) + 1 } else { 0 };
    let below = top + STEP[1] * (rows - 1) as f64 + PANEL[1] + 62.0;
    let mut figure = Figure::new([width, below + LEGEND[1] * lines as f64]);
    figure.text(title, HEADING, INK, [LEFT, 26.0]);
    let end = curves.iter().flat_map(|c| &c.points).map(|p| p.seconds).fold(1.0, f64::max);
    let time = Axis::new([FROM, end].into_iter(), true).over([FROM, 1.1 * end]);
    for (number, &k) in metrics.iter().enumerate() {
        let corner = [LEFT + STEP[0] * (number % 2) as f64, top + STEP[1] * (number / 2) as f64];
        let metric = &METRICS[k];
        let values = || curves.iter().flat_map(|c| &c.points).map(|p| p.values[k]);
        let axis = match metric.place {
            OWN | BEST => Axis::new(values(), false).over([0.0, 1.0]),
            _ => Axis::new(values(), metric.logarithmic),
        };
        let mut panel = Panel::new(
            &mut figure,
            [corner[0], corner[1], PANEL[0], PANEL[1]],
            [metric.title, "run time (s)"],
            [time.clone(), axis],
        );
        panel.steps(&staircase(&hull, k, end), None);
        for (curve, colour) in coloured(&curves) {
            if curve.is_iterative {
                panel.steps(
                    &staircase(&curve.points, k, curve.points.last().map_or(end, |p| p.seconds)),
                    Some(colour),
                );
            }
            let radius = if curve.is_iterative { 2.5 } else { 5.0 };
            curve.points.iter().for_each(|p| panel.disc([p.seconds, p.values[k]], radius, colour));
            if let Some(preview) = &curve.preview {
                panel.disc([preview.seconds, preview.values[k]], 6.0, colour);
                panel.disc([preview.seconds, preview.values[k]], 3.5, [255; 3]);
            }
        }
    }
    if with_legend {
        for (i, (name, colour)) in named.iter().enumerate() {
            let at = [LEFT + LEGEND[0] * (i % in_a_row) as f64, below + LEGEND[1] * (i / in_a_row) as f64];
            legend(&mut figure, name, *colour, at);
        }
        let at = [LEFT, below + LEGEND[1] * (lines - 1) as f64];
        figure.text("ring: preview; single disc: closed form; hull: best of all at each time; values last until the next sample", BODY, FRAME, at);
    }
    figure
}

/// Curves with their colours.
pub(super) fn coloured(curves: &[Curve]) -> impl Iterator<Item = (&Curve, Colour)> {
    curves.iter().zip(COLOURS.into_iter().cycle())
}

/// The corners of the steps of metric `k`, until a time.
fn staircase(points: &[CurvePoint], k: usize, until: f64) -> Vec<[f64; 2]> {
    let mut corners: Vec<[f64; 2]> = vec![];
    for point in points {
        if let Some(last) = corners.last().copied() {
            corners.push([point.seconds, last[1]]);
        }
        corners.push([point.seconds, point.values[k]]);
    }
    corners.extend(corners.last().map(|last| [until, last[1]]));
    corners
}
