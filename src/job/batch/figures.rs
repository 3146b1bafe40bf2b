//! The key figures of a result, for one line of a table.

use serde::Serialize;

use super::super::run::Outcome;
use crate::maps::percentile;

/// Key figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// The solver.
    pub solver: String,
    /// How surfaces reflect.
    pub model: String,
    /// Iterations that were done.
    pub iterations: usize,
    /// ‖Av − h‖ / ‖h‖ at the end; null if it is not known.
    pub residual: Option<f64>,
    /// Share of the pixels that are surface.
    pub surface: f64,
    /// Median depth of the surface, metres; null without surface.
    pub depth: Option<f32>,
    /// Median of the expected depth errors, metres; null without surface.
    pub confidence: Option<f32>,
    /// Seconds of solving.
    pub solve_s: f64,
    /// Overlap of the surface with the truth's; null without truth.
    pub iou: Option<f64>,
    /// Mean absolute depth error, metres; null without truth.
    pub depth_mae: Option<f64>,
    /// Mean angle between normals, degrees; null without truth.
    pub normal_error_deg: Option<f64>,
}

impl Figures {
    /// The figures of a solve.
    pub(super) fn of(solved: &Outcome) -> Figures {
        let (report, maps) = (&solved.report, &solved.maps);
        let median = |values: &[f32]| {
            let surface: Vec<f32> =
                values.iter().zip(&maps.mask).filter(|(_, m)| **m).map(|(v, _)| *v).collect();
            percentile(&surface, 50.0)
        };
        let word = |key: &str| report.settings[key].as_str().unwrap_or_default().to_string();
        let last = report.trace.last();
        let metrics = report.metrics.as_ref();
        Figures {
            solver: word("solver"),
            model: word("model"),
            iterations: last.map_or(0, |p| p.iteration),
            residual: last.and_then(|p| p.residual),
            surface: maps.mask.iter().filter(|m| **m).count() as f64 / maps.mask.len().max(1) as f64,
            depth: median(&maps.depth),
            confidence: maps.confidence.as_deref().and_then(median),
            solve_s: report.totals.solve_s,
            iou: metrics.and_then(|m| m.iou),
            depth_mae: metrics.and_then(|m| m.depth_mae),
            normal_error_deg: metrics.and_then(|m| m.normal_error_deg),
        }
    }
}
