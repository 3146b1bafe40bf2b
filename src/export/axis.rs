//! Axes of plots: ranges, marks and their labels.

use super::drawing::{Anchor, Drawing};

/// Inks that all plots share.
pub const INK: [u8; 3] = [40, 40, 46];
pub const GRID: [u8; 3] = [226, 226, 230];
pub const FRAME: [u8; 3] = [120, 120, 128];

/// How a grid's marks are labelled, in pixels.
pub struct Labels {
    pub size: f64,
    /// From the plot's bottom down to the text's foot, and from its left side to the text's end.
    pub below: f64,
    pub beside: f64,
    /// Length of a stroke at every labelled mark; 0 for none.
    pub stroke: f64,
}

/// Draws the grid of a plot at (x, y, width, height) with the labels of its marks.
pub fn grid(drawing: &mut Drawing, [x, y, w, h]: [f64; 4], [along, up]: [&Axis; 2], labels: &Labels) {
    let &Labels { size, below, beside, stroke } = labels;
    for (value, label) in along.ticks() {
        let at = x + w * along.share(value);
        drawing.line(&[[at, y], [at, y + h]], 1.0, GRID);
        if let Some(label) = label {
            if stroke > 0.0 {
                drawing.line(&[[at, y + h], [at, y + h + stroke]], 1.2, FRAME);
            }
            drawing.text(&label, [at, y + h + below], size, Anchor::Middle, INK);
        }
    }
    for (value, label) in up.ticks() {
        let at = y + h * (1.0 - up.share(value));
        drawing.line(&[[x, at], [x + w, at]], 1.0, GRID);
        if let Some(label) = label {
            if stroke > 0.0 {
                drawing.line(&[[x - stroke, at], [x, at]], 1.2, FRAME);
            }
            drawing.text(&label, [x - beside, at + 5.0], size, Anchor::End, INK);
        }
    }
}

/// Draws the frame of such a plot.
pub fn frame(drawing: &mut Drawing, [x, y, w, h]: [f64; 4]) {
    drawing.line(&[[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]], 1.2, FRAME);
}

/// A range of values with marks at plain numbers.
pub struct Axis {
    pub low: f64,
    pub high: f64,
    logarithmic: bool,
}

impl Axis {
    /// Holds all `values`, with a little room around them; of a logarithmic axis those above zero.
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

    /// Where a value lies, 0 at the low end and 1 at the high one.
    pub fn share(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value.max(1e-300) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.clamp(0.0, 1.0)
    }

    /// Marks, some with a label.
    pub fn ticks(&self) -> Vec<(f64, Option<String>)> {
        let within = |v: &f64| (self.low..=self.high).contains(v);
        if !self.logarithmic {
            let raw = (self.high - self.low) / 5.0;
            let power = 10f64.powf(raw.log10().floor());
            let step =
                [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(raw);
            let first = (self.low / step).ceil() as i64;
            let marks = (first..first + 12).map(|i| i as f64 * step).filter(within);
            return marks.map(|v| (v, Some(plain(v)))).collect();
        }
        let decades = (self.high / self.low).log10();
        // The fewer decades, the more of their marks have labels.
        let labelled: &[f64] = match decades {
            d if d > 2.2 => &[1.0],
            d if d > 1.2 => &[1.0, 2.0, 5.0],
            d if d > 0.8 => &[1.0, 2.0, 3.0, 5.0, 7.0],
            _ => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        let mut marks: Vec<f64> = (1..10).map(f64::from).chain(labelled.iter().copied()).collect();
        marks.sort_unstable_by(f64::total_cmp);
        marks.dedup();
        let powers = (self.low.log10().floor() as i32)..=(self.high.log10().ceil() as i32);
        let all = powers.flat_map(|power| marks.iter().map(move |m| (*m, m * 10f64.powi(power))));
        let label = |m: f64, v: f64| labelled.contains(&m).then(|| plain(rounded(v)));
        let mut ticks: Vec<(f64, Option<String>)> =
            all.filter(|(_, v)| within(v)).map(|(m, v)| (v, label(m, v))).collect();
        if ticks.iter().filter(|t| t.1.is_some()).count() < 2 {
            // Hardly a mark within: even parts.
            let part = |i: u32| self.low * (self.high / self.low).powf(f64::from(i) / 4.0);
            ticks = [1, 2, 3].map(part).map(|v| (v, Some(plain(rounded(v))))).into();
        }
        ticks
    }
}

/// Three figures.
pub fn rounded(v: f64) -> f64 {
    if v == 0.0 || !v.is_finite() {
        return v;
    }
    let unit = 10f64.powf(v.abs().log10().floor() - 2.0);
    (v / unit).round() * unit
}

/// A number as short as it goes.
pub fn plain(v: f64) -> String {
    if v != 0.0 && !(1e-4..1e5).contains(&v.abs()) {
        return format!("{v:.0e}");
    }
    let text = format!("{v:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let ticks = axis.ticks();
            let labels: Vec<_> = ticks.iter().filter_map(|t| t.1.as_ref()).collect();
            assert!((2..=13).contains(&labels.len()), "{low} to {high}: {labels:?}");
            assert!(ticks.iter().all(|t| (axis.low..=axis.high).contains(&t.0)));
        }
        let axis = Axis::new([0.15, 90.0].into_iter(), true);
        let labels: Vec<_> = axis.ticks().into_iter().filter_map(|t| t.1).collect();
        assert_eq!(labels, ["1", "10", "100"]);
        assert!(Axis::new(std::iter::empty(), true).ticks().len() > 1);
        assert_eq!((plain(0.1), plain(10.0), plain(2.5e-7)), ("0.1".into(), "10".into(), "2e-7".into()));
    }
}
