//! A plot of curves over one axis, both logarithmic or not.

use super::axis::{self, Axis, FRAME, INK, Labels};
use super::curves::COLOURS;
use super::drawing::{Anchor, Drawing};

/// Curves by name, each of points (x, y); what is not finite, or not above zero on a logarithmic axis, is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    pub title: String,
    /// What the axes count, with their units.
    pub x: String,
    pub y: String,
    /// Of x and of y.
    pub logarithmic: [bool; 2],
    pub curves: Vec<(String, Vec<[f64; 2]>)>,
    /// A dashed line at this y, with a name.
    pub mark: Option<(String, f64)>,
}

const LEFT: f64 = 90.0;
const TOP: f64 = 64.0;
const PANEL: [f64; 2] = [640.0, 360.0];
const LEGEND_LINE: f64 = 26.0;

impl Plot {
    /// The plot with its legend below, in pixels.
    pub fn drawing(&self) -> Drawing {
        let lines = self.curves.len() + usize::from(self.mark.is_some());
        let [w, h] = PANEL;
        let height = TOP + h + 76.0 + LEGEND_LINE * lines as f64;
        let mut drawing = Drawing::new((LEFT + w + 40.0) as usize, height.ceil() as usize);
        drawing.title(&self.title, [LEFT, 30.0], 14.0, Anchor::Start, INK);
        let fits = |p: &&[f64; 2]| {
            p.iter().zip(self.logarithmic).all(|(v, logarithmic)| v.is_finite() && (!logarithmic || *v > 0.0))
        };
        let points = || self.curves.iter().flat_map(|c| &c.1).filter(fits);
        let x = Axis::new(points().map(|p| p[0]), self.logarithmic[0]);
        let marked = self.mark.iter().map(|m| m.1);
        let y = Axis::new(points().map(|p| p[1]).chain(marked), self.logarithmic[1]);
        let place = |p: &[f64; 2]| [LEFT + w * x.share(p[0]), TOP + h * (1.0 - y.share(p[1]))];
        let plot = [LEFT, TOP, w, h];
        let labels = Labels { size: 10.5, below: 20.0, beside: 10.0, stroke: 0.0 };
        axis::grid(&mut drawing, plot, [&x, &y], &labels);
        drawing.text(&self.y, [LEFT, TOP - 12.0], 10.5, Anchor::Start, INK);
        drawing.text(&self.x, [LEFT + 0.5 * w, TOP + h + 44.0], 10.5, Anchor::Middle, INK);
        let mut line = TOP + h + 76.0;
        let mut legend = |drawing: &mut Drawing, name: &str| {
            drawing.text(name, [LEFT + 50.0, line], 10.5, Anchor::Start, INK);
            line += LEGEND_LINE;
            line - LEGEND_LINE - 5.0
        };
        if let Some((name, at)) = &self.mark {
            drawing.dashes(&[place(&[x.low, *at]), place(&[x.high, *at])], 1.4, FRAME);
            let y = legend(&mut drawing, name);
            drawing.dashes(&[[LEFT, y], [LEFT + 36.0, y]], 1.4, FRAME);
        }
        for (at, (name, points)) in self.curves.iter().enumerate() {
            let colour = COLOURS[at % COLOURS.len()];
            let points: Vec<_> = points.iter().filter(fits).map(place).collect();
            drawing.line(&points, 2.2, colour);
            if points.len() < 60 {
                points.iter().for_each(|p| drawing.disc(*p, 4.0, colour));
            }
            let y = legend(&mut drawing, name);
            drawing.line(&[[LEFT, y], [LEFT + 34.0, y]], 2.6, colour);
        }
        axis::frame(&mut drawing, plot);
        drawing
    }
}

#[cfg(test)]
mod tests {
    use super::super::drawing::Shape;
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
        let discs = plot.drawing().shapes.iter().filter(|s| matches!(s, Shape::Disc { .. })).count();
        assert_eq!(discs, 2);
        let inside = |s: &Shape| match s {
            Shape::Disc { centre, .. } => (LEFT..=LEFT + PANEL[0]).contains(&centre[0]),
            _ => true,
        };
        assert!(plot.drawing().shapes.iter().all(inside));
    }
}
