//! `index.html` and `index.csv`: the results of a batch as one table. Pictures and reports are linked by relative paths, so that
//! the folder can be moved and read without a network.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use super::text::{escaped, quoted};
use crate::error::Result;
use crate::files::atomic;

const PAGE: &str = include_str!("index.html");

/// A capture of a batch.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexRow {
    /// Name of its folder, beside the index.
    pub name: String,
    /// Path of the capture, if known.
    pub capture: String,
    /// `done`, `failed`, or `open` without a result.
    pub status: &'static str,
    /// Key figures; null without a result.
    pub figures: Value,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
    /// What failed, and how to fix it.
    pub error: Option<[String; 2]>,
}

/// A column with a figure: heading, key, factor, and unit.
struct IndexColumn(&'static str, &'static str, f64, &'static str);

const COLUMNS: [IndexColumn; 9] = [
    IndexColumn("Residual", "residual", 1.0, ""),
    IndexColumn("Surface", "surface", 100.0, "%"),
    IndexColumn("Depth, median", "depth", 1.0, "m"),
    IndexColumn("Expected depth error", "depth_error", 1e3, "mm"),
    IndexColumn("IoU", "iou", 1.0, ""),
    IndexColumn("Depth error", "depth_mae", 1e3, "mm"),
    IndexColumn("Normal error", "normal_error_deg", 1.0, "°"),
    IndexColumn("Iterations", "iterations", 1.0, ""),
    IndexColumn("Time", "solve_s", 1.0, "s"),
];

/// Figures of the CSV file, in SI units.
const KEYS: [&str; 13] = [
    "verdict",
    "reasons",
    "solver",
    "model",
    "iterations",
    "residual",
    "surface",
    "depth",
    "depth_error",
    "solve_s",
    "iou",
    "depth_mae",
    "normal_error_deg",
];

/// Writes `index.html` and `index.csv` into the folder that contains the results. `settings`: a line on how they were made.
///
/// # Errors
/// `Kind::Output` if a file cannot be written.
pub fn write(folder: &Path, rows: &[IndexRow], settings: &str) -> Result<()> {
    atomic::write(&folder.join("index.csv"), csv(rows).as_bytes())?;
    atomic::write(&folder.join("index.html"), html(rows, settings).as_bytes())
}

fn html(rows: &[IndexRow], settings: &str) -> String {
    // Truth, where there is any.
    let columns: Vec<&IndexColumn> =
        COLUMNS.iter().filter(|c| rows.iter().any(|row| row.figures[c.1].is_number())).collect();
    let count = |status: &str| rows.iter().filter(|row| row.status == status).count();
    let warned = rows.iter().filter(|row| !row.warnings.is_empty()).count();
    let parts = [
        (rows.len(), "captures"),
        (count("done"), "done"),
        (count("failed"), "failed"),
        (count("open"), "without a result"),
        (warned, "with warnings"),
    ];
    let parts =
        parts.iter().filter(|(n, what)| *n > 0 || *what == "failed").map(|(n, what)| format!("{n} {what}"));
    let summary = format!("{}. {}", parts.collect::<Vec<_>>().join(", "), escaped(settings));
    let mut heads = String::new();
    let titles = columns.iter().map(|c| headed(c.0, c.3));
    let words = ["Capture", "Status", "Verdict"].map(String::from).into_iter();
    for (at, title) in words.chain(titles).chain(["Warnings and errors".into()]).enumerate() {
        let kind = if (3..3 + columns.len()).contains(&at) { "number" } else { "text" };
        let _ = write!(heads, "<th scope=\"col\" data-kind=\"{kind}\"><button>{title}</button>");
    }
    let rows: String = rows.iter().map(|row| line(row, &columns)).collect();
    // No inserted text is searched for a placeholder.
    let (before, rest) = PAGE.split_once("SUMMARY").unwrap_or((PAGE, ""));
    let (middle, rest) = rest.split_once("HEADS").unwrap_or((rest, ""));
    let (last, after) = rest.split_once("ROWS").unwrap_or((rest, ""));
    [before, &summary, middle, &heads, last, &rows, after].concat()
}

/// Decimals of three significant digits.
fn decimals(value: f64) -> usize {
    (2.0 - value.abs().max(1e-6).log10().floor()).clamp(0.0, 8.0) as usize
}

/// A heading with its unit.
fn headed(title: &str, unit: &str) -> String {
    if unit.is_empty() { title.into() } else { format!("{title}, {unit}") }
}

/// The row of a capture.
fn line(row: &IndexRow, columns: &[&IndexColumn]) -> String {
    let (name, is_done) = (escaped(&row.name), row.status == "done");
    let pictures: String = ["albedo", "depth", "normal"]
        .map(|map| format!("<a href=\"{name}/{map}.png\"><img loading=\"lazy\" alt=\"{map}\" src=\"{name}/{map}.png\"></a>"))
        .concat();
    let title = match is_done {
        true => format!(
            "<a href=\"{name}/report.html\">{name}</a><small>{}</small><div class=\"pictures\">{pictures}</div>",
            escaped(&row.capture)
        ),
        false => format!("{name}<small>{}</small>", escaped(&row.capture)),
    };
    let mut out = format!(
        "<tr><td class=\"name\" data-value=\"{name}\">{title}<td class=\"{0}\" data-label=\"Status\" data-value=\"{0}\">{0}",
        row.status
    );
    let text = |key: &str| escaped(row.figures[key].as_str().unwrap_or_default());
    let (grade, reasons) = (text("verdict"), text("reasons"));
    out += &format!("<td data-label=\"Verdict\" data-value=\"{grade}\">{grade}<small>{reasons}</small>");
    for IndexColumn(title, key, factor, unit) in columns {
        let _ = match row.figures[*key].as_f64() {
            Some(value) => {
                let value = factor * value;
                let label = headed(title, unit);
                let digits = if *key == "iterations" { 0 } else { decimals(value) };
                write!(out, "<td data-label=\"{label}\" data-value=\"{value}\">{value:.digits$}")
            }
            None => write!(out, "<td>"),
        };
    }
    let items = |all: &[String]| all.iter().map(|text| format!("<li>{}", escaped(text))).collect::<String>();
    let warned = match row.warnings.len() {
        0 => String::new(),
        n => format!(
            "<details><summary class=\"warning\">{n} {}</summary><ul>{}</ul></details>",
            if n == 1 { "warning" } else { "warnings" },
            items(&row.warnings)
        ),
    };
    let failed = row.error.as_ref().map_or_else(String::new, |[what, hint]| {
        format!("<span class=\"failed\">{}</span><small>{}</small>", escaped(what), escaped(hint))
    });
    let order = match (&row.error, row.warnings.len()) {
        (None, 0) => String::new(),
        (Some(_), _) => "failed".into(),
        (None, n) => format!("{n} warnings"),
    };
    out + &format!("<td class=\"words\" data-value=\"{order}\">{failed}{warned}\n")
}

fn csv(rows: &[IndexRow]) -> String {
    let mut out = format!("name,capture,status,{},warnings,error\n", KEYS.join(","));
    for row in rows {
        let figure = |key: &&str| match &row.figures[*key] {
            Value::String(text) => text.clone(),
            Value::Null => String::new(),
            value => value.to_string(),
        };
        let mut cells = vec![row.name.clone(), row.capture.clone(), row.status.into()];
        cells.extend(KEYS.iter().map(figure));
        cells.push(row.warnings.join(" | "));
        cells.push(row.error.as_ref().map_or_else(String::new, |[what, _]| what.clone()));
        let cells: Vec<_> = cells.iter().map(|cell| quoted(cell)).collect();
        out += &(cells.join(",") + "\n");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_captures_are_no_markup_and_no_cells() {
        let row = IndexRow {
            name: "a".into(),
            capture: "x/<b>\"ROWS,1\".npz".into(),
            status: "failed",
            figures: Value::Null,
            warnings: vec![],
            error: Some(["<script>, SUMMARY".into(), "fix \"it\"".into()]),
        };
        let done = IndexRow {
            status: "done",
            figures: serde_json::json!({"verdict": "fair", "reasons": "a <b>", "depth": 0.61234, "iou": null}),
            error: None,
            ..row.clone()
        };
        let rows = [row, done];
        let page = html(&rows, "settings HEADS");
        assert_eq!(page.matches("<script>").count(), 1);
        assert!(page.contains("2 captures, 1 done, 1 failed. settings HEADS"), "{page}");
        assert!(page.contains("x/&lt;b&gt;&quot;ROWS,1&quot;.npz") && page.contains(">0.612"), "{page}");
        assert!(page.contains(">fair<small>a &lt;b&gt;</small>"), "{page}");
        assert!(page.contains("Depth, median, m") && !page.contains("IoU"), "no truth, no column");
        assert!(!page.contains("://"), "nothing is fetched");
        let text = csv(&rows);
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[1].starts_with("a,\"x/<b>\"\"ROWS,1\"\".npz\",failed,,")
                && lines[2].contains(",done,fair,a <b>,")
                && lines[2].contains(",0.61234,"),
            "{text}"
        );
        assert!(lines[1].ends_with(",\"<script>, SUMMARY\""), "{text}");
    }
}
