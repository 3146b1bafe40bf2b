//! Plot axes: ranges, ticks and labels, and a panel between two axes.

use super::figure::{BODY, Colour, FRAME, Figure, GRID, INK, TITLE};

/// A range of values with ticks at round numbers.
#[derive(Clone)]
pub struct Axis {
    pub low: f64,
    pub high: f64,
    logarithmic: bool,
}

impl Axis {
    /// An axis covering all `values` with a margin. A logarithmic axis ignores values that are not positive.
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

    /// The axis from `low` to `high`.
    pub fn over(self, [low, high]: [f64; 2]) -> Axis {
        Axis { low, high, ..self }
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

    /// Ticks at `multiples` of the powers of ten inside a logarithmic axis.
    fn multiples(&self, multiples: &[f64]) -> Vec<f64> {
        let powers = (self.low.log10().floor() as i32)..=(self.high.log10().ceil() as i32);
        let all = powers.flat_map(|power| multiples.iter().map(move |m| rounded(m * 10f64.powi(power))));
        all.filter(|v| (self.low..=self.high).contains(v)).collect()
    }

    /// Labelled ticks of a logarithmic axis, denser for fewer decades.
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
        // With at most one round number on the axis, equal parts are marked.
        [0.25, 0.5, 0.75].map(|part| rounded(self.low * (self.high / self.low).powf(part))).into()
    }

    /// Ticks of a linear axis: multiples of 1, 2 or 5 times a power of ten, at most seven.
    pub fn even(&self) -> Vec<f64> {
        let span = self.high - self.low;
        let power = 10f64.powf((span / 7.0).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| span / step <= 7.0);
        let step = step.unwrap_or(span);
        let first = (self.low / step).ceil();
        (0..8).map(|i| (first + f64::from(i)) * step).take_while(|v| *v <= self.high).collect()
    }

    /// Labelled ticks.
    fn labels(&self) -> Vec<f64> {
        if self.logarithmic { self.labelled() } else { self.even() }
    }

    /// Grid lines.
    fn lines(&self) -> Vec<f64> {
        match self.logarithmic {
            true => {
                [self.labelled(), self.multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])].concat()
            }
            false => self.even(),
        }
    }
}

/// The value rounded to three digits.
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
pub struct Panel<'f> {
    figure: &'f mut Figure,
    /// Left, top, width and height.
    place: [f64; 4],
    axes: [Axis; 2],
}

impl Panel<'_> {
    /// Draws title, grid, labels and frame. The plot itself is at `[left, top, width, height]`. The title is above it, and the
    /// label `x` of the lower axis is below it.
    pub fn new<'f>(
        figure: &'f mut Figure,
        place: [f64; 4],
        [title, x]: [&str; 2],
        axes: [Axis; 2],
    ) -> Panel<'f> {
        let [left, top, width, height] = place;
        let (right, bottom) = (left + width, top + height);
        figure.text(title, TITLE, INK, [left, top - 15.0]);
        let panel = Panel { figure, place, axes };
        let [along, up] = panel.axes.clone();
        for value in along.lines() {
            let at = panel.at([value, up.low])[0];
            panel.figure.line(&[[at, top], [at, bottom]], 1.0, GRID);
        }
        for value in up.lines() {
            let at = panel.at([along.low, value])[1];
            panel.figure.line(&[[left, at], [right, at]], 1.0, GRID);
        }
        for value in along.labels() {
            let at = panel.at([value, up.low])[0];
            panel.figure.line(&[[at, bottom], [at, bottom + 5.0]], 1.0, FRAME);
            panel.figure.label(&plain(value), BODY, INK, [at, bottom + 16.0], 0.5);
        }
        for value in up.labels() {
            let at = panel.at([along.low, value])[1];
            panel.figure.line(&[[left - 5.0, at], [left, at]], 1.0, FRAME);
            panel.figure.label(&plain(value), BODY, INK, [left - 9.0, at], 1.0);
        }
        panel.figure.label(x, BODY, INK, [left + 0.5 * width, bottom + 40.0], 0.5);
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        panel.figure.line(&corners, 1.0, FRAME);
        panel
    }

    /// Position of a point.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, width, height] = self.place;
        [left + width * self.axes[0].share(x), top + height * (1.0 - self.axes[1].share(y))]
    }

    pub fn curve(&mut self, points: &[[f64; 2]], colour: Colour) {
        let points: Vec<_> = points.iter().map(|p| self.at(*p)).collect();
        self.figure.line(&points, 2.0, colour);
    }

    /// A line, dashed without a colour.
    pub fn steps(&mut self, points: &[[f64; 2]], colour: Option<Colour>) {
        let points: Vec<_> = points.iter().map(|p| self.at(*p)).collect();
        match colour {
            Some(colour) => self.figure.line(&points, 1.5, colour),
            None => self.figure.dashes(&points, FRAME),
        }
    }

    pub fn disc(&mut self, at: [f64; 2], radius: f64, colour: Colour) {
        let at = self.at(at);
        self.figure.disc(at, radius, colour);
    }

    /// Fills the area between two values of x and two of y.
    pub fn bar(&mut self, [from, to]: [f64; 2], [low, high]: [f64; 2], colour: Colour) {
        // Neighbours share an edge between pixels.
        let [a, b] = [[from, low], [to, high]].map(|p| self.at(p)).map(|[x, y]| [x.round(), y]);
        self.figure.bar(a, b, colour);
    }

    /// A dashed line at `y` over the whole width.
    pub fn dashes(&mut self, y: f64) {
        let [from, to] = [self.axes[0].low, self.axes[0].high].map(|x| self.at([x, y]));
        self.figure.dashes(&[from, to], FRAME);
    }
}

/// A legend entry: a stroke in a curve's colour, or dashes, and its name. `[x, y]` is the middle of the stroke's left
/// end.
pub fn legend(figure: &mut Figure, name: &str, colour: Option<Colour>, [x, y]: [f64; 2]) {
    let [from, to] = [[x, y], [x + 34.0, y]];
    match colour {
        Some(colour) => {
            figure.line(&[from, to], 2.5, colour);
            figure.disc(to, 5.0, colour);
        }
        None => figure.dashes(&[from, to], FRAME),
    }
    figure.text(name, BODY, INK, [x + 50.0, y]);
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
            let labels = axis.labels();
            assert!((2..=13).contains(&labels.len()), "{low} to {high}: {labels:?}");
            let all = labels.iter().copied().chain(axis.lines());
            assert!(all.into_iter().all(|v| (axis.low..=axis.high).contains(&v)), "{low} to {high}");
        }
        let axis = Axis::new([0.15, 90.0].into_iter(), true);
        assert_eq!(axis.labels().into_iter().map(plain).collect::<Vec<_>>(), ["1", "10", "100"]);
        assert!(Axis::new(std::iter::empty(), true).labels().len() > 1);
        assert_eq!((plain(0.1), plain(10.0), plain(2.5e-7)), ("0.1".into(), "10".into(), "2.5e-7".into()));
        assert!((axis.share(10.0) - 0.642).abs() < 0.01 && axis.share(1e9) == 1.0);
    }
}
