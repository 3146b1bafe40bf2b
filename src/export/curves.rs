//! The plot of error against run time: four panels over one logarithmic time axis.

use super::comparison::{Comparison, MethodReport};
use super::drawing::{Anchor, Drawing};
use super::report::TraceEntry;

const INK: [u8; 3] = [40, 40, 46];
const GRID: [u8; 3] = [226, 226, 230];
const FRAME: [u8; 3] = [120, 120, 128];
/// Colours that people of all kinds of colour vision tell apart (Okabe and Ito).
const COLOURS: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [70, 70, 70],
];
const WIDTH: f64 = 1200.0;
const PANEL: [f64; 2] = [500.0, 300.0];
const LEFT: f64 = 80.0;
const TOP: f64 = 108.0;
/// From a panel's corner to the next one's.
const STEP: [f64; 2] = [585.0, 388.0];
const LEGEND_LINE: f64 = 28.0;

/// A panel's figure.
struct Panel {
    title: &'static str,
    logarithmic: bool,
    /// The value at a point of the trace, in the unit of the title.
    value: fn(&TraceEntry) -> Option<f64>,
}

const PANELS: [Panel; 4] = [
    Panel { title: "relative residual", logarithmic: true, value: |e| e.residual },
    Panel {
        title: "depth error (mm), MAE at the best IoU",
        logarithmic: true,
        value: |e| e.metrics.as_ref().and_then(|m| m.at_best?.depth_mae).map(|v| 1000.0 * v),
    },
    Panel {
        title: "IoU of the surface, best over mask fractions",
        logarithmic: false,
        value: |e| e.metrics.as_ref().and_then(|m| m.best_iou),
    },
    Panel {
        title: "normal error (degrees), mean at the best IoU",
        logarithmic: false,
        value: |e| e.metrics.as_ref().and_then(|m| m.at_best?.normal_error_deg),
    },
];

/// Draws residual, depth error, best IoU and normal error of every method over solve time, a disc at each end,
/// and a dashed line at the first method's final value.
pub fn error_vs_time(comparison: &Comparison) -> Drawing {
    let legend = LEGEND_LINE * (comparison.methods.len() + 1) as f64;
    let height = TOP + STEP[1] + PANEL[1] + 70.0 + legend;
    let mut drawing = Drawing::new(WIDTH as usize, height.ceil() as usize);
    let name = comparison.capture_file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
    drawing.title("Error against run time", [LEFT, 34.0], 16.0, Anchor::Start, INK);
    let about = format!("{name}, {} pairs, {}", comparison.capture.pairs, comparison.device.name.trim());
    drawing.text(&shortened(&about, 130), [LEFT, 60.0], 10.5, Anchor::Start, FRAME);
    let times = comparison.methods.iter().flat_map(|m| &m.trace).map(|e| e.seconds);
    let time = Axis::new(times, true);
    for (at, panel) in PANELS.iter().enumerate() {
        let corner = [LEFT + STEP[0] * (at % 2) as f64, TOP + STEP[1] * (at / 2) as f64];
        draw_panel(&mut drawing, corner, panel, &time, &comparison.methods);
    }
    for (at, method) in comparison.methods.iter().enumerate() {
        let y = height - legend - 12.0 + LEGEND_LINE * at as f64 + 0.5 * LEGEND_LINE;
        let colour = COLOURS[at % COLOURS.len()];
        drawing.line(&[[LEFT, y - 5.0], [LEFT + 34.0, y - 5.0]], 2.6, colour);
        drawing.disc([LEFT + 34.0, y - 5.0], 5.0, colour);
        let text = format!(
            "{}: {} iterations in {} s",
            shortened(&method.name, 90),
            method.iterations,
            plain(rounded(method.seconds))
        );
        drawing.text(&text, [LEFT + 50.0, y], 11.0, Anchor::Start, INK);
    }
    if let Some(first) = comparison.methods.first() {
        let y = height - 12.0 - 0.5 * LEGEND_LINE;
        drawing.dashes(&[[LEFT, y - 5.0], [LEFT + 36.0, y - 5.0]], 1.2, FRAME);
        let text = format!("dashed: where {} ends", shortened(&first.name, 90));
        drawing.text(&text, [LEFT + 50.0, y], 11.0, Anchor::Start, INK);
    }
    drawing
}

fn draw_panel(drawing: &mut Drawing, [x, y]: [f64; 2], panel: &Panel, time: &Axis, methods: &[MethodReport]) {
    let [w, h] = PANEL;
    let value = |e: &TraceEntry| (panel.value)(e).filter(|v| v.is_finite());
    let axis = Axis::new(methods.iter().flat_map(|m| &m.trace).filter_map(value), panel.logarithmic);
    let place = |seconds: f64, v: f64| [x + w * time.share(seconds), y + h * (1.0 - axis.share(v))];
    drawing.title(panel.title, [x, y - 12.0], 12.0, Anchor::Start, INK);
    for (tick, label) in time.ticks() {
        let at = x + w * time.share(tick);
        drawing.line(&[[at, y], [at, y + h]], 1.0, GRID);
        if let Some(label) = label {
            drawing.line(&[[at, y + h], [at, y + h + 5.0]], 1.2, FRAME);
            drawing.text(&label, [at, y + h + 20.0], 10.5, Anchor::Middle, INK);
        }
    }
    for (tick, label) in axis.ticks() {
        let at = y + h * (1.0 - axis.share(tick));
        drawing.line(&[[x, at], [x + w, at]], 1.0, GRID);
        if let Some(label) = label {
            drawing.line(&[[x - 5.0, at], [x, at]], 1.2, FRAME);
            drawing.text(&label, [x - 10.0, at + 5.0], 10.5, Anchor::End, INK);
        }
    }
    drawing.text("solve time (s)", [x + 0.5 * w, y + h + 42.0], 10.5, Anchor::Middle, INK);
    if let Some(goal) = methods.first().and_then(|m| m.trace.last()).and_then(value) {
        drawing.dashes(&[place(time.low, goal), place(time.high, goal)], 1.2, FRAME);
    }
    for (at, method) in methods.iter().enumerate() {
        let colour = COLOURS[at % COLOURS.len()];
        let points: Vec<_> =
            method.trace.iter().filter_map(|e| value(e).map(|v| place(e.seconds, v))).collect();
        drawing.line(&points, 2.2, colour);
        if let Some(end) = points.last() {
            drawing.disc(*end, 5.0, colour);
        }
    }
    drawing.line(&[[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]], 1.2, FRAME);
}

/// A range of values with marks at plain numbers.
struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    /// Holds all `values`, with a little room around them; of a logarithmic axis those above zero.
    fn new(values: impl Iterator<Item = f64>, logarithmic: bool) -> Axis {
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
    fn share(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value.max(1e-300) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.clamp(0.0, 1.0)
    }

    /// Marks, some with a label.
    fn ticks(&self) -> Vec<(f64, Option<String>)> {
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
fn rounded(v: f64) -> f64 {
    if v == 0.0 || !v.is_finite() {
        return v;
    }
    let unit = 10f64.powf(v.abs().log10().floor() - 2.0);
    (v / unit).round() * unit
}

/// A number as short as it goes.
fn plain(v: f64) -> String {
    if v != 0.0 && !(1e-4..1e5).contains(&v.abs()) {
        return format!("{v:.0e}");
    }
    let text = format!("{v:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most - 3).collect::<String>() + "..."
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
