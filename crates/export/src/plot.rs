//! A plot of curves. Each axis is linear or logarithmic.

use super::axis::{Axis, Panel, legend};
use super::figure::{BODY, COLOURS, Figure, HEADING, INK};

/// A plot of named curves. Points that are not finite, or not positive on a logarithmic axis, are omitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// Title, above the plot.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x: String,
    /// Label of the y axis, with its unit.
    pub y: String,
    /// Whether the x axis and the y axis are logarithmic.
    pub logarithmic: [bool; 2],
    /// Name and points (x, y) of each curve.
    pub curves: Vec<(String, Vec<[f64; 2]>)>,
    /// A named dashed line at this y.
    pub mark: Option<(String, f64)>,
}

/// Left, top, width and height of the panel.
const PANEL: [f64; 4] = [90.0, 78.0, 640.0, 360.0];
const LEGEND_LINE: f64 = 26.0;

impl Plot {
    /// Visible points of a curve.
    fn shown(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let fits = |p: &&[f64; 2]| {
            p.iter().zip(self.logarithmic).all(|(v, logarithmic)| v.is_finite() && (!logarithmic || *v > 0.0))
        };
        points.iter().filter(fits).copied().collect()
    }

    /// The plot as a drawing.
    pub fn figure(&self) -> Figure {
        let [left, top, width, height] = PANEL;
        let lines = self.curves.len() + usize::from(self.mark.is_some());
        let mut figure = Figure::new([left + width + 40.0, top + height + 62.0 + LEGEND_LINE * lines as f64]);
        figure.text(&self.title, HEADING - 2.0, INK, [left, 30.0]);
        figure.text(&self.y, BODY, INK, [left, top - 15.0]);
        let curves: Vec<_> = self.curves.iter().map(|(name, points)| (name, self.shown(points))).collect();
        let points = || curves.iter().flat_map(|c| &c.1);
        let marked = self.mark.iter().map(|m| m.1);
        let x = Axis::new(points().map(|p| p[0]), self.logarithmic[0]);
        let y = Axis::new(points().map(|p| p[1]).chain(marked), self.logarithmic[1]);
        let mut panel = Panel::new(&mut figure, PANEL, ["", &self.x], [x, y]);
        if let Some((_, at)) = &self.mark {
            panel.dashes(*at);
        }
        let coloured = || curves.iter().zip(COLOURS.into_iter().cycle());
        for ((_, points), colour) in coloured() {
            panel.curve(points, colour);
            if points.len() < 60 {
                points.iter().for_each(|p| panel.disc(*p, 4.0, colour));
            }
        }
        let names = self.mark.iter().map(|(name, _)| (name, None));
        let names = names.chain(coloured().map(|((name, _), colour)| (*name, Some(colour))));
        for (i, (name, colour)) in names.enumerate() {
            legend(&mut figure, name, colour, [left, top + height + 70.0 + LEGEND_LINE * i as f64]);
        }
        figure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_shown_is_left_out() {
        let plot = Plot {
            title: "t".into(),
            x: "x".into(),
            y: "y".into(),
            logarithmic: [true, true],
            curves: vec![("a".into(), vec![[1.0, 1e-3], [2.0, f64::NAN], [0.0, 1.0], [10.0, 1e-1]])],
            mark: Some(("goal".into(), 1e-2)),
        };
        let svg = plot.figure().svg();
        // Two points, and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 3, "{svg}");
        let nothing = Plot { curves: vec![("a".into(), vec![])], mark: None, ..plot };
        assert_eq!(nothing.figure().svg().matches("<circle").count(), 1);
    }
}
