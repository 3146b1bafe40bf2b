//! The plot of error against run time: four panels over one logarithmic time axis.

use super::axis::{self, Axis, FRAME, INK, Labels, plain, rounded};
use super::comparison::{Comparison, MethodReport};
use super::drawing::{Anchor, Drawing};
use super::report::TraceEntry;

/// Colours that people of all kinds of colour vision tell apart (Okabe and Ito).
pub(super) const COLOURS: [[u8; 3]; 7] = [
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
    let labels = Labels { size: 10.5, below: 20.0, beside: 10.0, stroke: 5.0 };
    axis::grid(drawing, [x, y, w, h], [time, &axis], &labels);
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
    axis::frame(drawing, [x, y, w, h]);
}

fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most - 3).collect::<String>() + "..."
}
