//! The plot of error against run time: four panels over one logarithmic time axis.

use super::axis::{Axis, Panel, legend, plain, rounded};
use super::comparison::{Comparison, MethodReport};
use super::figure::{BODY, COLOURS, FRAME, Figure, HEADING, INK};
use super::report::TraceEntry;

const WIDTH: f64 = 1200.0;
const PANEL: [f64; 2] = [495.0, 300.0];
const LEFT: f64 = 90.0;
const TOP: f64 = 108.0;
/// Offset between the corners of adjacent panels.
const STEP: [f64; 2] = [585.0, 388.0];
const LEGEND_LINE: f64 = 28.0;

/// Content of a panel.
struct Graph {
    title: &'static str,
    logarithmic: bool,
    /// The value at a point of the trace, in the unit of the title.
    value: fn(&TraceEntry) -> Option<f64>,
}

const GRAPHS: [Graph; 4] = [
    Graph { title: "relative residual", logarithmic: true, value: |e| e.residual },
    Graph {
        title: "depth error (mm), MAE at the best IoU",
        logarithmic: true,
        value: |e| e.metrics.as_ref().and_then(|m| m.at_best?.depth_mae).map(|v| 1000.0 * v),
    },
    Graph {
        title: "IoU of the surface, best over mask fractions",
        logarithmic: false,
        value: |e| e.metrics.as_ref().and_then(|m| m.best_iou),
    },
    Graph {
        title: "normal error (degrees), mean at the best IoU",
        logarithmic: false,
        value: |e| e.metrics.as_ref().and_then(|m| m.at_best?.normal_error_deg),
    },
];

/// Residual, depth error, best IoU and normal error of every method against solve time. A disc marks each end, a
/// dashed line the first method's final value.
pub fn error_vs_time(comparison: &Comparison) -> Figure {
    let Comparison { capture_file, capture, device, methods, .. } = comparison;
    let below = TOP + STEP[1] + PANEL[1] + 70.0;
    let mut figure = Figure::new([WIDTH, below + LEGEND_LINE * (methods.len() + 1) as f64]);
    let name = capture_file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
    let about = format!("{name}, {} pairs, {}", capture.pairs, device.name.trim());
    figure.text("Error against run time", HEADING, INK, [LEFT, 30.0]);
    figure.text(&shortened(&about, 130), BODY, FRAME, [LEFT, 57.0]);
    let time = Axis::new(methods.iter().flat_map(|m| &m.trace).map(|e| e.seconds), true);
    for (at, graph) in GRAPHS.iter().enumerate() {
        let corner = [LEFT + STEP[0] * (at % 2) as f64, TOP + STEP[1] * (at / 2) as f64];
        draw(&mut figure, corner, graph, time.clone(), methods);
    }
    let mut at = [LEFT, below + 2.0];
    for (method, colour) in methods.iter().zip(COLOURS.into_iter().cycle()) {
        let (name, seconds) = (shortened(&method.name_and_model(), 90), plain(rounded(method.seconds)));
        let text = match method.iterations {
            0 | 1 => format!("{name}: {seconds} s"),
            many => format!("{name}: {many} iterations in {seconds} s"),
        };
        legend(&mut figure, &text, Some(colour), at);
        at[1] += LEGEND_LINE;
    }
    if let Some(first) = methods.first() {
        legend(&mut figure, &format!("dashed: final value of {}", shortened(&first.name, 90)), None, at);
    }
    figure
}

fn draw(figure: &mut Figure, [x, y]: [f64; 2], graph: &Graph, time: Axis, methods: &[MethodReport]) {
    let value = |e: &TraceEntry| (graph.value)(e).filter(|v| v.is_finite());
    let axis = Axis::new(methods.iter().flat_map(|m| &m.trace).filter_map(value), graph.logarithmic);
    let [w, h] = PANEL;
    let mut panel = Panel::new(figure, [x, y, w, h], [graph.title, "solve time (s)"], [time, axis]);
    if let Some(goal) = methods.first().and_then(|m| m.trace.last()).and_then(value) {
        panel.dashes(goal);
    }
    for (method, colour) in methods.iter().zip(COLOURS.into_iter().cycle()) {
        let points: Vec<_> = method.trace.iter().filter_map(|e| value(e).map(|v| [e.seconds, v])).collect();
        panel.curve(&points, colour);
        points.last().into_iter().for_each(|end| panel.disc(*end, 5.0, colour));
    }
}

fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most - 3).collect::<String>() + "..."
}
