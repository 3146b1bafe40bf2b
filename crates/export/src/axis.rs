//! Axes of plots: ranges, marks and their labels, and a panel between two axes.

use std::ops::Range;

use super::figure::{Area, BODY, Canvas, Drawn, FINE, FRAME, GRID, INK, TITLE, font, line_of_text, px};
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{KeyPointHint, KeyPointWeight, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::element::{Circle, DashedPathElement, PathElement, Rectangle};
use plotters::prelude::{Color, DashedLineSeries};
use plotters::style::RGBColor;

/// A range of values with marks at round numbers.
#[derive(Clone)]
pub struct Axis {
    pub low: f64,
    pub high: f64,
    logarithmic: bool,
}

impl Axis {
    /// An axis for all `values`, with a little room around them. A logarithmic axis ignores values that are not above
    /// zero.
    pub fn new(values: impl Iterator<Item = f64>, logarithmic: bool) -> Axis {
        let fits = |v: &f64| v.is_finite() && (!logarithmic || *v > 0.0);
        let (low, high) = values.filter(fits).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        if low > high {
            return Axis { low: if logarithmic { 0.1 } else { 0.0 }, high: 1.0, logarithmic };
        }
        if logarithmic {
            let room = ((high / low).powf(0.05)).max(1.1);
            return Axis { low: low / room, high: high * room, logarithmic };
        }
        let room = (0.06 * (high - low)).max(1e-3 * high.abs().max(1e-9));
        let low = if low >= 0.0 { (low - room).max(0.0) } else { low - room };
        Axis { low, high: high + room, logarithmic }
    }

    /// Position of a value on the axis: 0 at the low end, 1 at the high end.
    fn share(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value.max(1e-300) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.clamp(0.0, 1.0)
    }

    /// Marks at `multiples` of the powers of ten within a logarithmic axis.
    fn multiples(&self, multiples: &[f64]) -> Vec<f64> {
        let powers = (self.low.log10().floor() as i32)..=(self.high.log10().ceil() as i32);
        let all = powers.flat_map(|power| multiples.iter().map(move |m| rounded(m * 10f64.powi(power))));
        all.filter(|v| (self.low..=self.high).contains(v)).collect()
    }

    /// The marks of a logarithmic axis that have labels. Fewer decades get more labels.
    fn labelled(&self) -> Vec<f64> {
        let marks = self.multiples(match (self.high / self.low).log10() {
            d if d > 2.2 => &[1.0],
            d if d > 1.2 => &[1.0, 2.0, 5.0],
            d if d > 0.8 => &[1.0, 2.0, 3.0, 5.0, 7.0],
            _ => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
        });
        if marks.len() > 1 {
            return marks;
        }
        // At most one round number is on the axis, so even parts are marked.
        [0.25, 0.5, 0.75].map(|part| rounded(self.low * (self.high / self.low).powf(part))).into()
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        low + (self.share(*value) * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match (self.logarithmic, hint.weight()) {
            (false, _) => {
                let marks = RangedCoordf64::from(self.low..self.high).key_points(hint.bold_points());
                marks.into_iter().map(|v| v.clamp(self.low, self.high)).collect()
            }
            (true, KeyPointWeight::Bold) => self.labelled(),
            (true, KeyPointWeight::Any) => self.multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        }
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format(value: &f64) -> String {
        plain(*value)
    }
}

/// The value with three digits.
pub fn rounded(v: f64) -> f64 {
    format!("{v:.2e}").parse().unwrap_or(v)
}

/// The shortest text for a number.
pub fn plain(v: f64) -> String {
    if v != 0.0 && !(1e-4..1e5).contains(&v.abs()) {
        return format!("{:e}", rounded(v));
    }
    let text = format!("{v:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// A plot between two axes.
pub struct Panel<'a, B: Canvas>(ChartContext<'a, B, Cartesian2d<Axis, Axis>>);

impl<B: Canvas> Panel<'_, B> {
    /// Draws title, grid, labels and frame. The plot itself is at `[left, top, width, height]` in pixels. The title is
    /// above it, and the label `x` of the lower axis is below it.
    pub fn new<'a>(
        area: &Area<B>,
        [left, top, width, height]: [f64; 4],
        [title, x]: [&str; 2],
        [along, up]: [Axis; 2],
    ) -> Result<Panel<'a, B>, DrawingAreaErrorKind<B::ErrorType>> {
        // Room for the labels.
        const BELOW: f64 = 52.0;
        const BESIDE: f64 = 76.0;
        line_of_text(area, title, &font(TITLE, INK), [left, top - 15.0])?;
        let around =
            area.clone().shrink((px(left - BESIDE), px(top)), (px(width + BESIDE), px(height + BELOW)));
        let mut chart = ChartBuilder::on(&around)
            .x_label_area_size(px(BELOW))
            .y_label_area_size(px(BESIDE))
            .build_cartesian_2d(along, up)?;
        let (grid, frame) = (GRID.stroke_width(FINE), FRAME.stroke_width(FINE));
        chart
            .configure_mesh()
            .x_labels(7)
            .y_labels(7)
            .bold_line_style(grid)
            .light_line_style(grid)
            .axis_style(frame)
            .label_style(font(BODY, INK))
            .x_desc(x)
            .set_all_tick_mark_size(px(5.0))
            .draw()?;
        let plot = chart.plotting_area().strip_coord_spec();
        let (w, h) = plot.dim_in_pixel();
        plot.draw(&Rectangle::new([(0, 0), (w as i32 - 1, h as i32 - 1)], frame))?;
        Ok(Panel(chart))
    }

    pub fn curve(&mut self, points: &[[f64; 2]], colour: RGBColor) -> Drawn<B> {
        let points: Vec<_> = points.iter().map(|p| (p[0], p[1])).collect();
        self.0.draw_series([PathElement::new(points, colour.stroke_width(px(2.0) as u32))])?;
        Ok(())
    }

    pub fn disc(&mut self, [x, y]: [f64; 2], radius: f64, colour: RGBColor) -> Drawn<B> {
        self.0.draw_series([Circle::new((x, y), px(radius), colour.filled())])?;
        Ok(())
    }

    /// Fills the area between two values of x and two of y.
    pub fn bar(&mut self, [from, to]: [f64; 2], [low, high]: [f64; 2], colour: RGBColor) -> Drawn<B> {
        self.0.draw_series([Rectangle::new([(from, low), (to, high)], colour.filled())])?;
        Ok(())
    }

    /// A dashed line at `y` over the whole width.
    pub fn dashes(&mut self, y: f64) -> Drawn<B> {
        let x = self.0.x_range();
        let line =
            DashedLineSeries::new([(x.start, y), (x.end, y)], px(7.0), px(7.0), FRAME.stroke_width(FINE));
        self.0.draw_series(line)?;
        Ok(())
    }
}

/// A legend's line: a stroke in a curve's colour, and its name. `[x, y]` is the middle of the stroke's left end, in
/// pixels.
pub fn legend<B: Canvas>(area: &Area<B>, name: &str, stroke: Stroke, [x, y]: [f64; 2]) -> Drawn<B> {
    let [from, to] = [(px(x), px(y)), (px(x + 34.0), px(y))];
    match stroke {
        Stroke::Curve(colour) => {
            area.draw(&PathElement::new([from, to], colour.stroke_width(px(2.5) as u32)))?;
            area.draw(&Circle::new(to, px(5.0), colour.filled()))?;
        }
        Stroke::Dashes => {
            let dashes = DashedPathElement::new([from, to], px(7.0), px(7.0), FRAME.stroke_width(FINE));
            area.draw(&dashes)?;
        }
    }
    line_of_text(area, name, &font(BODY, INK), [x + 50.0, y])
}

/// The stroke in a legend's line.
pub enum Stroke {
    Curve(RGBColor),
    Dashes,
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn axes_have_a_handful_of_labels_within() {
        for (low, high, logarithmic) in [
            (0.1, 100.0, true),
            (0.0123, 0.0125, true),
            (5.1, 16.3, true),
            (1e-6, 1e6, true),
            (3.0, 3.0, true),
            (0.0, 1.0, false),
            (-4.0, 7.0, false),
            (0.5, 0.5, false),
            (0.0, 0.0, false),
        ] {
            let axis = Axis::new([low, high].into_iter(), logarithmic);
            assert!(axis.low < low.max(1e-300) && axis.high > high || low == 0.0, "{low} {high}");
            let labels = axis.key_points(BoldPoints(7));
            assert!((2..=13).contains(&labels.len()), "{low} to {high}: {labels:?}");
            let all = labels.iter().copied().chain(axis.key_points(70));
            assert!(all.into_iter().all(|v| (axis.low..=axis.high).contains(&v)), "{low} to {high}");
        }
        let axis = Axis::new([0.15, 90.0].into_iter(), true);
        assert_eq!(
            axis.key_points(BoldPoints(7)).iter().map(Axis::format).collect::<Vec<_>>(),
            ["1", "10", "100"]
        );
        assert!(Axis::new(std::iter::empty(), true).key_points(BoldPoints(7)).len() > 1);
        assert_eq!((plain(0.1), plain(10.0), plain(2.5e-7)), ("0.1".into(), "10".into(), "2.5e-7".into()));
        assert_eq!((axis.map(&10.0, (300, 0)), axis.map(&1e9, (300, 0))), (107, 0));
    }
}
