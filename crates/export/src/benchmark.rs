//! Captures × methods × photon counts: `benchmark.json` with error against run time, and `benchmark.html`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::axis::{Axis, Panel, legend};
use super::comparison::{Comparison, MethodReport, Table};
use super::curves::error_vs_time;
use super::figure::{BODY, COLOURS, FRAME, Figure, HEADING, INK};
use super::page::escaped;
use crate::advice::Advice;
use crate::error::{Error, Result};
use crate::files::atomic;

/// The complete benchmark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// Version of thirdbounce.
    pub version: String,
    /// Seconds of this invocation.
    pub seconds: f64,
    /// Cases, in order.
    pub cases: Vec<Case>,
}

/// One capture, and the comparison of methods on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Case {
    /// The scene's name.
    pub scene: String,
    /// Mean photon count of the strongest bin, if drawn; `None`: the capture unchanged.
    pub photons: Option<f64>,
    /// Folder of the case, relative to the page.
    pub folder: String,
    /// Whether it was computed by an earlier invocation.
    #[serde(skip)]
    pub was_there: bool,
    /// Whether it failed.
    pub failed: bool,
    /// Whether it has no truth: metrics are then agreement with the closed-form methods.
    pub agreed: bool,
    /// Reason for a missing comparison.
    pub why: Option<String>,
    /// Hint for fixing it.
    #[serde(skip)]
    pub hint: Option<Advice>,
    /// Seconds of this invocation.
    pub seconds: f64,
    /// The comparison.
    pub comparison: Option<Comparison>,
}

impl Case {
    /// A case without a comparison.
    pub fn left_out(scene: &str, photons: Option<f64>, folder: &str, failed: bool, why: &Error) -> Case {
        Case {
            scene: scene.into(),
            photons,
            folder: folder.into(),
            was_there: false,
            failed,
            agreed: false,
            why: Some(why.what.clone()),
            hint: Some(why.hint.clone()),
            seconds: 0.0,
            comparison: None,
        }
    }

    fn title(&self) -> String {
        match self.photons {
            Some(p) => format!("{}, {p} photons", self.scene),
            None if self.agreed => format!("{} (agreement)", self.scene),
            None => self.scene.clone(),
        }
    }

    fn of(&self, method: &str) -> Option<&MethodReport> {
        self.comparison.as_ref()?.methods.iter().find(|m| m.name == method)
    }
}

/// A metric in the tables.
struct Figured {
    title: &'static str,
    digits: usize,
    more_is_better: bool,
    value: fn(&MethodReport) -> Option<f64>,
}

const FIGURES: [Figured; 7] = [
    Figured {
        title: "Best IoU over shares of the brightest albedo",
        digits: 3,
        more_is_better: true,
        value: |m| m.metrics.best_iou,
    },
    Figured { title: "IoU of the maps' own mask", digits: 3, more_is_better: true, value: |m| m.metrics.iou },
    Figured {
        title: "Depth MAE at the best IoU (mm)",
        digits: 2,
        more_is_better: false,
        value: |m| Some(1000.0 * m.metrics.at_best?.depth_mae?),
    },
    Figured {
        title: "Normal error at the best IoU (°)",
        digits: 1,
        more_is_better: false,
        value: |m| m.metrics.at_best?.normal_error_deg,
    },
    Figured { title: "Solve time (s)", digits: 2, more_is_better: false, value: |m| Some(m.seconds) },
    Figured {
        title: "Depth MAE by the measure of Shim et al. (m)",
        digits: 4,
        more_is_better: false,
        value: |m| m.metrics.paper.depth_mae,
    },
    Figured {
        title: "Normals MAE by the measure of Shim et al.",
        digits: 4,
        more_is_better: false,
        value: |m| m.metrics.paper.normal_mae,
    },
];

impl Page {
    /// Names of all methods, in order of first occurrence.
    fn methods(&self) -> Vec<&str> {
        let all = self.cases.iter().filter_map(|c| c.comparison.as_ref()).flat_map(|c| &c.methods);
        let mut names: Vec<&str> = vec![];
        for method in all.filter(|m| !m.name.is_empty()) {
            if !names.contains(&method.name.as_str()) {
                names.push(&method.name);
            }
        }
        names
    }

    /// A metric of every method (columns) in every case (rows), the best of a row between stars.
    fn table(&self, figure: &Figured) -> Table {
        let names = self.methods();
        let row = |case: &Case| {
            let value = |name: &&str| case.of(name).and_then(figure.value).filter(|v| v.is_finite());
            let values: Vec<Option<f64>> = names.iter().map(value).collect();
            let text = |v: &Option<f64>| v.map_or("–".into(), |v| format!("{v:.*}", figure.digits));
            let better = |a: f64, b: f64| if figure.more_is_better { a.max(b) } else { a.min(b) };
            let best = text(&values.iter().copied().flatten().reduce(better));
            let cells = values.iter().map(|v| match text(v) {
                found if v.is_some() && found == best => format!("**{found}**"),
                found => found,
            });
            std::iter::once(case.title()).chain(cells).collect()
        };
        Table {
            head: std::iter::once("case").chain(names.iter().copied()).map(String::from).collect(),
            rows: self.cases.iter().filter(|c| c.comparison.is_some()).map(row).collect(),
        }
    }

    /// Cases where the first method is not the best: a sentence per metric.
    fn lost(&self) -> Vec<String> {
        let names = self.methods();
        let Some(first) = names.first() else { return vec![] };
        let of = |figure: &Figured| -> Option<String> {
            let text = |v: f64| format!("{v:.*}", figure.digits);
            let (mut all, mut lost) = (0, vec![]);
            for case in &self.cases {
                let value = |name: &str| case.of(name).and_then(figure.value).filter(|v| v.is_finite());
                let Some(own) = value(first) else { continue };
                let better = |a: f64, b: f64| if figure.more_is_better { a > b } else { a < b };
                let valued = names.iter().filter_map(|name| Some((*name, value(name)?)));
                let best = valued.reduce(|a, b| if better(b.1, a.1) { b } else { a });
                all += 1;
                if let Some((name, best)) = best.filter(|best| text(best.1) != text(own)) {
                    lost.push(format!("{} ({name} {}, {first} {})", case.title(), text(best), text(own)));
                }
            }
            let cases = if lost.is_empty() { "none".into() } else { lost.join("; ") };
            (all > 0).then(|| format!("{}, {} of {all} cases: {cases}.", figure.title, lost.len()))
        };
        FIGURES.iter().filter_map(of).collect()
    }

    /// Sentences on the comparison.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec![
            "Time is solve time, excluding load, set-up, measurement and export: the median over the repeats, with the range in \
             brackets. Except for the IoU of the maps' own mask, metrics use the share of the brightest albedo with the best IoU, \
             which requires the truth. – : method not applicable, or no pixel counts. The best of a row is bold."
                .to_string(),
            "s to …: seconds until the metric reaches, and keeps, the final value of the first method; in brackets the share of \
             its total time. paper: …: errors over all pixels, where pixels without surface count as depth 0 and normal (0, 0, 0) \
             (Shim et al.). Other depth and normal errors are over pixels that are surface in both the result and the truth."
                .to_string(),
        ];
        let compared = || self.cases.iter().filter_map(|c| c.comparison.as_ref());
        let mut places: BTreeMap<&str, &str> = BTreeMap::new();
        compared().flat_map(|c| &c.methods).for_each(|m| {
            places.insert(&m.name, &m.runs_on);
        });
        let places: Vec<String> = places.iter().map(|(name, place)| format!("{name}: {place}")).collect();
        if !places.is_empty() {
            notes.push(format!("Devices: {}.", places.join("; ")));
        }
        if self.cases.iter().any(|case| case.agreed) {
            notes.push(
                "Agreement: without truth, the IoU is that with the mean of lct, fk, phasor and fbp above Otsu's threshold, and the \
                 depth error the distance to their median. Both favour these four."
                    .into(),
            );
        }
        if compared().any(|c| c.oracle) {
            notes.push("Oracle masks: selected with the truth, which is not available in practice.".into());
        }
        notes
    }

    /// Omitted methods and cases with reasons, as sentences.
    fn missing(&self) -> Vec<String> {
        let mut all: Vec<String> = vec![];
        for case in &self.cases {
            if let Some(why) = &case.why {
                let word = if case.failed { "failed" } else { "is left out" };
                all.push(format!("{} {word}: {why}.", case.title()));
            }
            let left_out = case.comparison.iter().flat_map(|c| &c.left_out);
            all.extend(left_out.map(|m| format!("{}: {} is left out: {}.", case.title(), m.name, m.why)));
        }
        all
    }

    /// Scenes with several photon counts, and their cases.
    fn with_photons(&self) -> Vec<AgainstPhotons<'_>> {
        let mut scenes: Vec<&str> = vec![];
        let counted = |case: &&Case| case.photons.is_some() && case.comparison.is_some();
        for case in self.cases.iter().filter(counted) {
            if !scenes.contains(&case.scene.as_str()) {
                scenes.push(&case.scene);
            }
        }
        let of = |scene| AgainstPhotons {
            scene,
            cases: self.cases.iter().filter(counted).filter(|c| c.scene == scene).collect(),
            methods: self.methods(),
        };
        scenes.into_iter().map(of).filter(|plot| plot.cases.len() > 1).collect()
    }

    /// Markdown: the table of the only case, else best IoU, depth errors and times.
    pub fn summary(&self) -> String {
        if let [Case { comparison: Some(only), .. }] = &self.cases[..] {
            return only.table().markdown();
        }
        let tables =
            [0, 2, 4].map(|i| format!("{}\n\n{}", FIGURES[i].title, self.table(&FIGURES[i]).markdown()));
        tables.join("\n")
    }

    /// HTML page with embedded plots and pictures; `root` contains the cases' folders.
    ///
    /// # Errors
    /// A picture of a case cannot be read.
    pub fn html(&self, root: &Path) -> Result<String> {
        let paragraphs = |all: Vec<String>| -> String {
            all.iter().map(|text| format!("<p>{}</p>\n", escaped(text))).collect()
        };
        let mut out = format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Benchmark</title>\n<style>{STYLE}\
             </style>\n<h1>Benchmark</h1>\n<p>thirdbounce {}</p>\n{}",
            escaped(&self.version),
            paragraphs(self.notes())
        );
        let compared = || self.cases.iter().filter_map(|case| Some((case, case.comparison.as_ref()?)));
        if compared().count() > 1 {
            for figure in &FIGURES {
                out += &format!("<h2>{}</h2>\n{}", escaped(figure.title), self.table(figure).html());
            }
        }
        out += &format!("<h2>Where the first method is not the best</h2>\n{}", paragraphs(self.lost()));
        for plot in self.with_photons() {
            let title = format!("{} by photon count", plot.scene);
            out += &format!("<h2>{}</h2>\n{}\n", escaped(&title), plot.figure().svg());
        }
        for (case, comparison) in compared() {
            let file = root.join(&case.folder).join("pictures.png");
            let sheet = std::fs::read(&file).map_err(|e| {
                Error::input(
                    format!("{}: cannot be read: {e}", file.display()),
                    "remove the folder of this case and start the benchmark again",
                )
            })?;
            out += &format!(
                "<h2>{}</h2>\n{}{}<img alt=\"Albedo, normals and depth\" src=\"data:image/png;base64,{}\">\n{}",
                escaped(&case.title()),
                paragraphs(comparison.notes()),
                comparison.table().html(),
                STANDARD.encode(sheet),
                error_vs_time(comparison).svg()
            );
        }
        let missing = paragraphs(self.missing());
        if !missing.is_empty() {
            out += &format!("<h2>Left out</h2>\n{missing}");
        }
        Ok(out + "</html>\n")
    }
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1280px;padding:0 1em;\
                     color:#282828;background:#fff}table{border-collapse:collapse;margin:.5em 0 1.5em}th,td{padding:\
                     .25em .7em;border-bottom:1px solid #e2e2e6;text-align:right}th:first-child,td:first-child{text-\
                     align:left}img,svg{max-width:100%;height:auto;display:block;margin:.5em 0}";

/// Writes `benchmark.json` and `benchmark.html` into `folder`, which contains the cases' folders. Returns the paths.
///
/// # Errors
/// `Kind::Output` if a file cannot be written; a picture of a case that cannot be read.
pub fn write(folder: &Path, page: &Page) -> Result<Vec<PathBuf>> {
    let json = serde_json::to_string_pretty(page).map_err(|e| {
        Error::output(format!("benchmark.json: cannot be packed as JSON: {e}"), "report this as a bug")
    })?;
    let mut files = vec![];
    for (name, text) in [("benchmark.json", json + "\n"), ("benchmark.html", page.html(folder)?)] {
        let file = folder.join(name);
        atomic::write(&file, text.as_bytes())?;
        files.push(file);
    }
    Ok(files)
}

const WIDTH: f64 = 1200.0;
const PANEL: [f64; 2] = [290.0, 250.0];
const LEFT: f64 = 90.0;
const TOP: f64 = 90.0;
const STEP: f64 = 385.0;
const LINE: f64 = 26.0;

/// Metrics of every method against photon counts, for one scene.
struct AgainstPhotons<'p> {
    scene: &'p str,
    cases: Vec<&'p Case>,
    methods: Vec<&'p str>,
}

impl AgainstPhotons<'_> {
    fn points(&self, method: &str, value: fn(&MethodReport) -> Option<f64>) -> Vec<[f64; 2]> {
        let point = |case: &&Case| Some([case.photons?, case.of(method).and_then(value)?]);
        let mut points: Vec<[f64; 2]> = self.cases.iter().filter_map(point).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    }

    fn figure(&self) -> Figure {
        let mut drawn =
            Figure::new([WIDTH, TOP + PANEL[1] + 76.0 + LINE * self.methods.len().div_ceil(3) as f64]);
        drawn.text(self.scene, HEADING, INK, [LEFT, 26.0]);
        drawn.text("each method at its best IoU", BODY, FRAME, [LEFT, 48.0]);
        let photons = Axis::new(self.cases.iter().filter_map(|c| c.photons), true);
        let shown = [
            (&FIGURES[0], "best IoU", false),
            (&FIGURES[2], "depth MAE (mm)", true),
            (&FIGURES[3], "normals (°)", false),
        ];
        for (at, (figure, title, logarithmic)) in shown.into_iter().enumerate() {
            let curves: Vec<_> = self.methods.iter().map(|m| self.points(m, figure.value)).collect();
            let axis = Axis::new(curves.iter().flatten().map(|p| p[1]), logarithmic);
            let place = [LEFT + STEP * at as f64, TOP, PANEL[0], PANEL[1]];
            let names = [title, "photons in the strongest bin"];
            let mut panel = Panel::new(&mut drawn, place, names, [photons.clone(), axis]);
            for (points, colour) in curves.iter().zip(COLOURS.into_iter().cycle()) {
                panel.curve(points, colour);
                points.iter().for_each(|point| panel.disc(*point, 3.5, colour));
            }
        }
        for (i, (name, colour)) in self.methods.iter().zip(COLOURS.into_iter().cycle()).enumerate() {
            let at = [LEFT + STEP * (i % 3) as f64, TOP + PANEL[1] + 74.0 + LINE * (i / 3) as f64];
            legend(&mut drawn, name, Some(colour), at);
        }
        drawn
    }
}
