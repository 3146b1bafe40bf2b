//! `benchmark.html`: curves, table, then curves and pictures of every case.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::curve::coloured;
use super::{CaseResults, METRICS, Page, Table, changes, curves, figure, regressions, wins};
use thirdbounce::export::text::escaped;
use thirdbounce::{Error, Result};

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:1.5em auto;max-width:1280px;padding:0 1em;color:#282828;\
                     background:#fff}table{border-collapse:collapse}th,td{padding:.25em .7em;border-bottom:1px solid #e2e2e6;\
                     text-align:right;white-space:nowrap}th{white-space:normal;vertical-align:bottom}td:nth-child(-n+2),\
                     th:nth-child(-n+2){text-align:left}.scroll{overflow:auto;max-height:36em;margin:.5em 0 1.5em;border:1px \
                     solid #e2e2e6}.scroll th{position:sticky;top:0;background:#fff}.curves{display:grid;gap:.5em;\
                     grid-template-columns:repeat(auto-fit,minmax(min(100%,480px),1fr))}svg{width:100%;height:auto}.legend\
                     {display:flex;flex-wrap:wrap;gap:.2em 1.4em;margin:.5em 0 1.5em}.legend i{display:inline-block;width:1.6em;\
                     height:.25em;vertical-align:middle;margin-right:.5em}.pictures{overflow-x:auto;margin:.5em 0 2em}";

impl Page {
    /// HTML page with embedded curves and pictures; `root` contains the cases' folders.
    ///
    /// # Errors
    /// A picture of a case cannot be read.
    pub fn html(&self, root: &Path) -> Result<String> {
        let cases = self.compared();
        let mut out = format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
             <title>Benchmark</title>\n<style>{STYLE}</style>\n<h1>Error against run time</h1>\n<p>thirdbounce {}; {}.</p>\n",
            escaped(&self.version),
            escaped(&self.machine())
        );
        let add = |out: &mut String, text: &str| {
            let _ = writeln!(out, "<p>{}</p>", escaped(text));
        };
        if !cases.is_empty() {
            if cases.len() > 1 {
                add(&mut out, &format!("Means over {} cases.{}", cases.len(), self.standing()));
            }
            out += &graphs(&cases);
            out += "<h2>Table</h2>\n";
            out += &scrolling(&self.table());
            self.notes().iter().for_each(|note| add(&mut out, note));
        }
        if cases.iter().all(|case| case.sides.len() == 2) && cases.len() > 1 {
            let _ = write!(out, "<h2>Changes from a to b</h2>\n{}", scrolling(&changes(&cases)));
            regressions(&cases).iter().flatten().for_each(|line| add(&mut out, line));
        }
        if !self.stability.is_empty() {
            let _ = write!(out, "<h2>Stability</h2>\n{}", scrolling(&self.stability_table()));
        }
        for case in &cases {
            let _ = writeln!(out, "<h2>{}</h2>", escaped(&case.title()));
            let missing = case.left_out.iter().map(|(name, why)| format!("{name} is left out: {why}."));
            let words = (!case.words.is_empty()).then(|| format!("{}.", case.words));
            words.into_iter().chain(missing).for_each(|text| add(&mut out, &text));
            if cases.len() > 1 {
                out += &graphs(&[case]);
            }
            out += &pictures(root, case)?;
        }
        let failed = self.cases.iter().filter_map(|case| Some((case.title(), case.why.as_ref()?)));
        let failed: Vec<String> = failed
            .map(|(name, (why, failed))| {
                format!("{name} {}: {why}.", if *failed { "failed" } else { "is left out" })
            })
            .collect();
        if !failed.is_empty() {
            out += "<h2>Left out</h2>\n";
            failed.iter().for_each(|text| add(&mut out, text));
        }
        Ok(out + "</html>\n")
    }

    /// Where the first side stands against the closed forms, as a sentence; empty without closed forms.
    pub fn standing(&self) -> String {
        let cases = self.compared();
        let (Some(wins), Some(first)) = (wins(&cases), super::names(&cases).first().copied()) else {
            return String::new();
        };
        let than = "the best closed form in the IoU of its own mask";
        let from = match wins.from {
            Some(from) => format!("From {from:.2} s on, {first} exceeds {than}"),
            None => format!("At the end, {first} is below {than}"),
        };
        format!(" {from}; the difference at the end is {:+.3}.", wins.at_end)
    }

    /// Sentences on the table.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec![
            "Times are solve times without load, set-up and measurement: medians over the repeats. Depth and normal errors are over \
             pixels that are surface in both the result's own mask and the truth; the best IoU is over shares of the brightest \
             albedo, which requires the truth. In curves and means an empty map has IoU 0, a depth error of the width of the wall \
             and normals 90° off; so has a method in a case that it does not take. – : not available. The best of a case is bold. \
             The paper's measure is over all pixels, where pixels without surface have depth 0 and normal (0, 0, 0) (Shim et al.)."
                .to_string(),
        ];
        if self.cases.iter().any(|case| case.agreed) {
            notes.push(
                "Agreement: without truth, the IoU is that with the mean of lct, fk, phasor and fbp above Otsu's threshold, and the \
                 depth error the distance to their median. Both favour these four."
                    .into(),
            );
        }
        let sides = || self.cases.iter().flat_map(|case| &case.sides);
        if sides().any(|side| side.limited) {
            notes.push("Stopped: the run ended at its time limit; its last sample is the result.".into());
        }
        if self.cases.iter().any(|case| case.oracle) {
            notes.push("Oracle masks: selected with the truth, which is not available in practice.".into());
        }
        if sides().any(|side| side.foreign) {
            notes.push("Times of foreign methods, and figures without maps, are user-supplied.".into());
        }
        for side in sides().filter(|s| !s.foreign && s.spec != s.name && !s.spec.is_empty()) {
            let note = format!("{} is {}.", side.name, side.spec);
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }
}

/// A table in a box that scrolls.
fn scrolling(table: &Table) -> String {
    format!("<div class=\"scroll\">{}</div>\n", table.html())
}

/// The curves of cases, one drawing for each metric, and their legend.
fn graphs(cases: &[&CaseResults]) -> String {
    let all: String = (0..METRICS.len()).map(|k| figure(cases, "", &[k], false).svg()).collect();
    let curves = curves(cases);
    let named = coloured(&curves).map(|(curve, [r, g, b])| {
        format!("<span><i style=\"background:#{r:02x}{g:02x}{b:02x}\"></i>{}</span>", escaped(&curve.name))
    });
    format!(
        "<div class=\"curves\">{all}</div>\n<p class=\"legend\">{}<span>dashed: best of all at each time</span><span>ring: preview\
         </span></p>\n",
        named.collect::<String>()
    )
}

/// The pictures of a case.
fn pictures(root: &Path, case: &CaseResults) -> Result<String> {
    let file = root.join(&case.name).join("pictures.png");
    if !file.exists() && case.sides.iter().all(|side| side.error.is_some()) {
        return Ok(String::new());
    }
    let sheet = std::fs::read(&file).map_err(|e| {
        Error::input(
            format!("{}: cannot be read: {e}", file.display()),
            "remove the folder of this case and start the benchmark again",
        )
    })?;
    Ok(format!(
        "<div class=\"pictures\"><img alt=\"Albedo, normals and depth of all methods\" src=\"data:image/png;base64,{}\"></div>\n",
        STANDARD.encode(sheet)
    ))
}
