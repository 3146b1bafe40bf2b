//! Results of a benchmark: cases × sides, where a side is a method or a build of the program. `benchmark.json`, tables, curves of
//! error against run time, and `benchmark.html`.

mod curve;
mod html;
mod quantities;

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use thirdbounce::advice::Advice;
use thirdbounce::export::text::escaped;
use thirdbounce::files::atomic;
use thirdbounce::measure::Metrics;
use thirdbounce::{Error, Result};

use crate::pinned::Pinned;

pub use curve::{Curve, CurvePoint, METRICS, Metric, WORST, Wins, curves, figure, hull, wins};
pub use quantities::*;

/// The complete benchmark.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Page {
    /// Version of thirdbounce.
    pub version: String,
    /// Model of the host's processor, and its number of cores.
    pub host: (String, usize),
    /// Seconds of all cases, with those of earlier invocations.
    pub seconds: f64,
    /// Cases, in order.
    pub cases: Vec<CaseResults>,
    /// Stiff and extreme cases; empty unless they were run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stability: Vec<Stability>,
    /// The pinned solve of the build that made the stored tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pinned: Option<Pinned>,
}

/// One capture, and the results of all sides.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseResults {
    /// Group of cases; empty for a capture of the caller.
    pub group: String,
    /// Unique name, which is that of its folder.
    pub name: String,
    /// Description in a few words.
    pub words: String,
    /// True reflectance model, if known.
    pub model: Option<String>,
    /// Whether closed-form methods stand in for the truth.
    pub agreed: bool,
    /// Whether the truth chose all masks.
    #[serde(default)]
    pub oracle: bool,
    /// Reason for missing results, and whether it is a failure.
    pub why: Option<(String, bool)>,
    /// Hint for fixing it.
    #[serde(skip)]
    pub hint: Option<Advice>,
    /// Whether it was computed by an earlier invocation.
    #[serde(skip)]
    pub was_there: bool,
    /// Seconds that it took.
    pub seconds: f64,
    /// Device and driver.
    pub device: String,
    /// Results in the given order; changes are relative to the first.
    pub sides: Vec<SideResults>,
    /// Methods not applicable to this capture: name and violated assumption.
    pub left_out: Vec<(String, String)>,
}

/// Results of a method or a build. Times are medians over the repeats, results those of the first run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SideResults {
    /// Short name, unique in its case.
    pub name: String,
    /// Specification of the method; location of the maps or the build.
    pub spec: String,
    /// Whether another program made the maps. Its times are user-supplied.
    pub foreign: bool,
    /// Device, or threads of the host.
    pub runs_on: String,
    /// Reflectance model in use, where it was estimated or is compared.
    pub model: Option<String>,
    /// Folder of its maps, beside the case's file; empty without one.
    pub folder: String,
    /// Reason of a failed run.
    pub error: Option<String>,
    /// Number of iterations; 0 or 1 for a closed form.
    pub iterations: usize,
    /// Whether the run ended at its time limit.
    pub limited: bool,
    /// Solve seconds of each repeat.
    pub repeats_s: Vec<f64>,
    /// Measured quantities, by the places of [`QUANTITIES`].
    #[serde(with = "by_key")]
    pub values: Values,
    /// Whether the first point is that of the preview, whose time is part of all others.
    pub preview: bool,
    /// Errors against run time.
    pub points: Vec<CurvePoint>,
}

/// A stiff or extreme case, relative to its twin scene or to the float64 reference.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// Description.
    pub name: String,
    /// Against the twin scene: IoU of both masks, 99th percentile of depth differences as a share of the wall.
    pub twin: Option<[f64; 2]>,
    /// Against the float64 reference: relative errors of the rendering and of the gradient.
    pub reference: Option<[f64; 2]>,
    /// Largest rise of the objective between points of the trace with the same pixels and pairs, relative.
    pub rise: Option<f64>,
    /// Reason of a failed run.
    pub error: Option<String>,
}

impl SideResults {
    /// Name, with the reflectance model, or the origin of foreign maps, in brackets.
    pub fn title(&self) -> String {
        let limit = if self.limited { ", stopped" } else { "" };
        match &self.model {
            _ if self.foreign => format!("{} (foreign)", self.name),
            Some(model) => format!("{} ({model}{limit})", self.name),
            None if self.limited => format!("{} (stopped)", self.name),
            None => self.name.clone(),
        }
    }

    /// A run that failed: an empty map, without costs.
    pub fn failed(name: &str, error: impl Into<String>) -> SideResults {
        let mut side = SideResults { name: name.into(), error: Some(error.into()), ..SideResults::default() };
        (side.values[OWN], side.values[BEST]) = (0.0, 0.0);
        side
    }
}

impl CaseResults {
    /// A case without results.
    pub fn without(self, why: &Error, failed: bool) -> CaseResults {
        CaseResults { why: Some((why.what.clone(), failed)), hint: Some(why.hint.clone()), ..self }
    }

    /// Name, or that it is judged by agreement.
    pub fn title(&self) -> String {
        format!("{}{}", self.name, if self.agreed { " (agreement)" } else { "" })
    }

    /// The side of this name.
    pub fn side(&self, name: &str) -> Option<&SideResults> {
        self.sides.iter().find(|side| side.name == name)
    }
}

/// The metrics of a result, by the places of [`QUANTITIES`]. `wall`: its width in metres; NaN if unknown.
pub fn values_of(metrics: &Metrics, wall: f64) -> Values {
    let (mut values, m) = (Values::default(), metrics);
    let all = [
        (OWN, m.iou, 1.0),
        (BEST, m.best_iou, 1.0),
        (DEPTH_MM, m.depth_mae, 1e3),
        (DEPTH, m.depth_mae, 100.0 / wall),
        (RMSE, m.depth_rmse, 1e3),
        (NORMALS, m.normal_error_deg, 1.0),
        (COMPLETE, m.completeness, 1.0),
        (WITHIN, m.within_depth_error, 1.0),
        (PAPER_DEPTH, m.paper.depth_mae, 1.0),
        (PAPER_DEPTH_RMSE, m.paper.depth_rmse, 1.0),
        (PAPER_NORMALS, m.paper.normal_mae, 1.0),
        (PAPER_NORMALS_RMSE, m.paper.normal_rmse, 1.0),
    ];
    all.into_iter().for_each(|(place, value, unit)| values[place] = value.map_or(f64::NAN, |v| unit * v));
    values
}

/// A table as text. The best figures of a case are between stars.
pub struct Table {
    /// Column heads.
    pub head: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Markdown, first column left-aligned, others right-aligned.
    pub fn markdown(&self) -> String {
        let cell = |text: &String| text.replace('|', "\\|").replace('\n', " ");
        let row =
            |cells: &[String]| format!("| {} |\n", cells.iter().map(cell).collect::<Vec<_>>().join(" | "));
        let line = format!("|---|{}\n", "--:|".repeat(self.head.len().saturating_sub(1)));
        row(&self.head) + &line + &self.rows.iter().map(|cells| row(cells)).collect::<String>()
    }

    /// HTML.
    pub fn html(&self) -> String {
        let cell = |tag: &str, text: &String| match text.strip_prefix("**").and_then(|t| t.strip_suffix("**"))
        {
            Some(best) => format!("<{tag}><b>{}</b></{tag}>", escaped(best)),
            None => format!("<{tag}>{}</{tag}>", escaped(text)),
        };
        let row = |tag: &str, cells: &[String]| {
            format!("<tr>{}</tr>\n", cells.iter().map(|text| cell(tag, text)).collect::<String>())
        };
        let rows: String = self.rows.iter().map(|cells| row("td", cells)).collect();
        format!("<table>\n{}{rows}</table>\n", row("th", &self.head))
    }
}

impl Page {
    /// Cases with results.
    pub fn compared(&self) -> Vec<&CaseResults> {
        self.cases.iter().filter(|case| !case.sides.is_empty()).collect()
    }

    /// Every side of every case, then the means over the cases.
    pub fn table(&self) -> Table {
        let cases = self.compared();
        let sides = || cases.iter().flat_map(|case| &case.sides);
        let shown: Vec<usize> =
            (0..COUNT).filter(|place| sides().any(|side| !side.values[*place].is_nan())).collect();
        let head =
            ["case", "method", "iterations"].into_iter().chain(shown.iter().map(|p| QUANTITIES[*p].name));
        let mut rows: Vec<Vec<String>> = vec![];
        for case in &cases {
            for side in &case.sides {
                let cell = |place: &usize| {
                    let text = QUANTITIES[*place].text(side.values[*place]);
                    let all = case.sides.iter().map(|s| s.values[*place]).filter(|v| !v.is_nan());
                    let best = all.reduce(|a, b| QUANTITIES[*place].better(a, b)).unwrap_or(f64::NAN);
                    let is_judged = case.sides.len() > 1 && QUANTITIES[*place].margin.is_some();
                    let is_best = is_judged && !best.is_nan() && text == QUANTITIES[*place].text(best);
                    if is_best { format!("**{text}**") } else { text }
                };
                let method = match &side.error {
                    Some(error) => format!("{} failed: {error}", side.title()),
                    None => side.title(),
                };
                let first = [case.title(), method, side.iterations.to_string()];
                rows.push(first.into_iter().chain(shown.iter().map(cell)).collect());
            }
        }
        if cases.len() > 1 {
            for name in names(&cases) {
                let mean = |place: &usize| QUANTITIES[*place].text(mean_of(&cases, name, *place));
                let first = ["mean".into(), with_count(&cases, name), String::new()];
                rows.push(first.into_iter().chain(shown.iter().map(mean)).collect());
            }
        }
        Table { head: head.map(String::from).collect(), rows }
    }

    /// The most important figures as text of at most 80 columns: method, seconds, IoU, depth and normals, case by case.
    pub fn brief(&self) -> String {
        const NAME: usize = 36;
        let shown = [SOLVE, OWN, DEPTH_MM, NORMALS];
        let head = ["solve s", "own IoU", "depth, mm", "normals, °"];
        let row = |name: &str, cells: &mut dyn Iterator<Item = String>| {
            let name = match name.chars().count() > NAME {
                true => name.chars().take(NAME - 1).chain(['…']).collect(),
                false => name.to_string(),
            };
            let cells: String = cells.map(|cell| format!("{cell:>11}")).collect();
            format!("{name:<NAME$}{cells}\n")
        };
        let cases = self.compared();
        let mut text = String::new();
        for case in &cases {
            text += &row(&case.title(), &mut head.iter().map(ToString::to_string));
            for side in &case.sides {
                text +=
                    &row(&side.title(), &mut shown.map(|p| QUANTITIES[p].text(side.values[p])).into_iter());
            }
            text.push('\n');
        }
        if cases.len() > 1 {
            text +=
                &row(&format!("mean of {} cases", cases.len()), &mut head.iter().map(ToString::to_string));
            for name in names(&cases) {
                let mean = |p: usize| QUANTITIES[p].text(mean_of(&cases, name, p));
                text += &row(&with_count(&cases, name), &mut shown.map(mean).into_iter());
            }
            text.push('\n');
        }
        if cases.iter().any(|case| case.agreed) {
            text += "Without truth, methods are judged by what closed forms agree on. That favours\n\
                     closed forms: a method that shows more than they do counts as wrong there.\n\n";
        }
        text + "The page has all figures, curves and pictures.\n"
    }

    /// The means over the cases: a row for each side.
    pub fn means(&self) -> Table {
        let cases = self.compared();
        let shown = [SOLVE, OWN, BEST, DEPTH, NORMALS];
        let row = |name: &str| -> Vec<String> {
            let mean = |place: usize| QUANTITIES[place].text(mean_of(&cases, name, place));
            [format!("`{name}`"), cases.iter().filter(|c| c.side(name).is_some()).count().to_string()]
                .into_iter()
                .chain(shown.map(mean))
                .collect()
        };
        let head = ["method", "cases"].into_iter().chain(shown.map(|place| QUANTITIES[place].name));
        Table { head: head.map(String::from).collect(), rows: names(&cases).into_iter().map(row).collect() }
    }

    /// The table of stiff and extreme cases.
    pub fn stability_table(&self) -> Table {
        let row = |s: &Stability| -> Vec<String> {
            let number = |v: Option<f64>, f: &dyn Fn(f64) -> String| v.map_or("–".into(), f);
            let small = |v: f64| if v == 0.0 { "0".into() } else { format!("{v:.1e}") };
            let name = s.error.as_ref().map_or(s.name.clone(), |e| format!("{} failed: {e}", s.name));
            vec![
                name,
                number(s.twin.map(|t| t[0]), &|v| format!("{v:.3}")),
                number(s.twin.map(|t| 100.0 * t[1]), &|v| format!("{v:.3}")),
                number(s.reference.map(|r| r[0]), &small),
                number(s.reference.map(|r| r[1]), &small),
                number(s.rise, &|v| if v > 0.0 { format!("by {:.2} %", 100.0 * v) } else { "never".into() }),
            ]
        };
        let head = [
            "case",
            "twin: mask IoU",
            "twin: 99th percentile of depth differences, % of the wall",
            "float64: rendering",
            "float64: gradient",
            "objective rose",
        ];
        Table { head: head.map(String::from).into(), rows: self.stability.iter().map(row).collect() }
    }

    /// Processor, cores, device and driver.
    pub fn machine(&self) -> String {
        let device =
            self.cases.iter().map(|c| c.device.as_str()).find(|d| !d.is_empty()).unwrap_or("no device");
        format!("{}, {} cores; {device}", self.host.0, self.host.1)
    }

    /// Writes `benchmark.json` and `benchmark.html` into `folder`, which contains the cases' folders. Returns the paths.
    ///
    /// # Errors
    /// `Kind::Output` if a file cannot be written; a picture of a case that cannot be read.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let [json, page] = ["benchmark.json", "benchmark.html"].map(|name| folder.join(name));
        write_json(&json, self)?;
        atomic::write(&page, self.html(folder)?.as_bytes())?;
        Ok(vec![json, page])
    }
}

/// Names of all sides, in order of first occurrence.
pub fn names<'c>(cases: &[&'c CaseResults]) -> Vec<&'c str> {
    let mut names: Vec<&str> = vec![];
    for side in cases.iter().flat_map(|case| &case.sides) {
        if !names.contains(&side.name.as_str()) {
            names.push(&side.name);
        }
    }
    names
}

/// The name of a side, with its number of cases if it lacks some.
fn with_count(cases: &[&CaseResults], name: &str) -> String {
    let there = cases.iter().filter(|case| case.side(name).is_some()).count();
    if there == cases.len() { name.into() } else { format!("{name} ({there} of {} cases)", cases.len()) }
}

/// Mean of a quantity over the cases. A metric of the curves counts as that of an empty map in a case without it, unless no side has
/// it there, as normals without truth; others do not count there.
pub fn mean_of(cases: &[&CaseResults], name: &str, place: usize) -> f64 {
    let worst = METRICS.iter().position(|m| m.place == place).map(|k| WORST[k] * METRICS[k].unit);
    let value = |case: &&CaseResults| {
        let found = case.side(name).map_or(f64::NAN, |side| side.values[place]);
        let is_known = place != NORMALS || case.sides.iter().any(|side| !side.values[place].is_nan());
        if found.is_nan() && is_known { worst.unwrap_or(f64::NAN) } else { found }
    };
    mean(cases.iter().map(value))
}

/// Writes a value as indented JSON with each list of numbers on one line.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let json = serde_json::to_string_pretty(value).map_err(|e| {
        Error::output(format!("{}: cannot be packed as JSON: {e}", path.display()), "report this as a bug")
    })?;
    let mut text = String::new();
    let mut rest = json.as_str();
    while let Some((before, after)) = rest.split_once('[') {
        let inside = after.split(']').next().unwrap_or_default();
        let is_plain =
            !inside.is_empty() && inside.chars().all(|c| c.is_ascii_digit() || ".,-+e \n".contains(c));
        text.extend([before, "["]);
        if is_plain {
            text.extend(inside.split_whitespace());
        }
        rest = if is_plain { &after[inside.len()..] } else { after };
    }
    atomic::write(path, (text + rest + "\n").as_bytes())
}

/// Reads a value that [`write_json`] wrote.
///
/// # Errors
/// `Kind::Input` if the file cannot be read or has another form.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display()), "check the path"))?;
    serde_json::from_str(&json).map_err(|e| {
        Error::input(
            format!("{}: is no result of a benchmark of this version: {e}", path.display()),
            "remove the file, and run the benchmark again",
        )
    })
}
