//! Quantities that are compared, and what their changes add up to. Knows no files and no programs, so that it can be tested.

/// What counts as a change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Margin {
    /// A difference larger than this.
    Absolute(f64),
    /// A difference larger than this share of the first value.
    Relative(f64),
}

/// A measured quantity. A missing value is NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Key in the JSON.
    pub key: &'static str,
    /// Heading of the column, with the unit.
    pub name: &'static str,
    pub larger_is_better: bool,
    /// `None`: shown, but not judged.
    pub margin: Option<Margin>,
    /// Whether a value that only one build has is a change, too.
    pub is_required: bool,
    /// Whether other programs on the machine change it.
    pub is_clock: bool,
    pub digits: usize,
}

const fn quantity(key: &'static str, name: &'static str, margin: Option<Margin>, digits: usize) -> Quantity {
    Quantity { key, name, larger_is_better: false, margin, is_required: false, is_clock: false, digits }
}

const fn overlap(key: &'static str, name: &'static str) -> Quantity {
    Quantity { larger_is_better: true, is_required: true, ..quantity(key, name, IOU, 3) }
}

const fn error(key: &'static str, name: &'static str, digits: usize) -> Quantity {
    Quantity { is_required: true, ..quantity(key, name, ERROR, digits) }
}

const fn clock(key: &'static str, name: &'static str, margin: Option<Margin>) -> Quantity {
    Quantity { is_clock: true, ..quantity(key, name, margin, 2) }
}

const IOU: Option<Margin> = Some(Margin::Absolute(0.01));
const ERROR: Option<Margin> = Some(Margin::Relative(0.05));
const COST: Option<Margin> = Some(Margin::Relative(0.1));

/// Number of [`QUANTITIES`].
pub const COUNT: usize = 17;

/// All quantities. The constants below are their places.
pub const QUANTITIES: [Quantity; COUNT] = [
    overlap("own_iou", "own IoU"),
    overlap("best_iou", "best IoU"),
    quantity("depth_mm", "depth MAE, mm", None, 2),
    error("depth_percent", "depth MAE, % of the wall", 3),
    error("depth_rmse_mm", "depth RMSE, mm", 2),
    error("normals_deg", "normals, °", 1),
    quantity("paper_depth_m", "paper's measure: depth MAE, m", ERROR, 4),
    quantity("paper_normals", "paper's measure: normals MAE", ERROR, 4),
    quantity("within_depth_error", "errors within depth_error", None, 2),
    overlap("agreement", "agreement"),
    quantity("beside", "light beside", IOU, 3),
    quantity("cpu_s", "CPU s", COST, 2),
    quantity("memory_mb", "memory, MB", COST, 0),
    clock("wall_s", "wall s", COST),
    clock("estimates_s", "estimates s", COST),
    clock("solve_s", "solve s", COST),
    clock("files_s", "load and export s", None),
];

pub const OWN: usize = 0;
pub const BEST: usize = 1;
pub const DEPTH_MM: usize = 2;
pub const DEPTH: usize = 3;
pub const RMSE: usize = 4;
pub const NORMALS: usize = 5;
pub const PAPER_DEPTH: usize = 6;
pub const PAPER_NORMALS: usize = 7;
pub const WITHIN: usize = 8;
pub const AGREEMENT: usize = 9;
pub const BESIDE: usize = 10;
pub const CPU: usize = 11;
pub const MEMORY: usize = 12;
pub const WALL: usize = 13;
pub const ESTIMATES: usize = 14;
pub const SOLVE: usize = 15;
pub const FILES: usize = 16;

/// Values of a run, by the places of [`QUANTITIES`].
pub type Values = [f64; COUNT];

/// What a build made of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Side {
    pub values: Values,
    /// The model of reflectance that was used; `None` if the report has none.
    pub model: Option<String>,
    /// First line of the error of a run that failed.
    pub error: Option<String>,
    /// The run was kept from an earlier comparison.
    pub reused: bool,
}

impl Side {
    /// A run that failed: it found nothing, and its seconds do not count.
    pub fn failed(error: impl Into<String>, columns: &[usize]) -> Side {
        let mut values = [f64::NAN; COUNT];
        for column in [OWN, BEST, AGREEMENT].into_iter().filter(|c| columns.contains(c)) {
            values[column] = 0.0;
        }
        Side { values, model: None, error: Some(error.into()), reused: false }
    }
}

/// A case, and what one or two builds made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub group: &'static str,
    pub name: String,
    /// What the case is, in a few words.
    pub words: String,
    /// The true model of reflectance, if it is known.
    pub model: Option<&'static str>,
    pub sides: Vec<Side>,
}

impl Row {
    /// Whether the model of a side is the true one; `None` if that is not known.
    pub fn is_right(&self, side: usize) -> Option<bool> {
        let side = self.sides.get(side)?;
        let chosen = side.model.as_deref();
        if side.error.is_some() { self.model.map(|_| false) } else { Some(chosen? == self.model?) }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    Better,
    Worse,
    Same,
}

impl Quantity {
    /// The change from `a` to `b`. `None` if it is not judged: there is no margin, neither has a value, or one lacks a value
    /// that it need not have.
    pub fn change(&self, a: f64, b: f64) -> Option<Change> {
        let margin = self.margin?;
        match (a.is_nan(), b.is_nan()) {
            (true, true) => return None,
            (false, false) => {}
            _ if !self.is_required => return None,
            (true, false) => return Some(Change::Better),
            (false, true) => return Some(Change::Worse),
        }
        let rise = if self.larger_is_better { b - a } else { a - b };
        let least = match margin {
            Margin::Absolute(least) => least,
            Margin::Relative(share) => share * a.abs(),
        };
        // A difference of exactly the margin, but for rounding, is within it.
        let is_beyond = rise.abs() > least * (1.0 + 1e-9) + 1e-12;
        Some(match is_beyond {
            false => Change::Same,
            true if rise > 0.0 => Change::Better,
            true => Change::Worse,
        })
    }

    /// The margin in words.
    pub fn margin_text(&self) -> String {
        match self.margin {
            Some(Margin::Absolute(least)) => format!("{least}"),
            Some(Margin::Relative(share)) => format!("{:.0} %", 100.0 * share),
            None => "–".into(),
        }
    }

    /// A value; `-` for none.
    pub fn text(&self, value: f64) -> String {
        if value.is_nan() { "-".into() } else { format!("{value:.*}", self.digits) }
    }
}

/// Sums over cases of one quantity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Total {
    /// Cases with a value of both builds; the means are theirs.
    pub both: usize,
    pub means: [f64; 2],
    /// Geometric mean of b over a, over the cases whose values are both above 0; NaN without any.
    pub ratio: f64,
    /// Cases that were judged, those with one value among them.
    pub judged: usize,
    pub better: usize,
    pub worse: usize,
}

/// The totals of a quantity. Rows with fewer than two sides do not count.
pub fn total(rows: &[&Row], place: usize) -> Total {
    let mut total = Total { means: [f64::NAN; 2], ratio: f64::NAN, ..Total::default() };
    let (mut sums, mut logs) = ([0.0; 2], vec![]);
    for row in rows {
        let [a, b] = &row.sides[..] else { continue };
        let values = [a.values[place], b.values[place]];
        match QUANTITIES[place].change(values[0], values[1]) {
            Some(Change::Better) => total.better += 1,
            Some(Change::Worse) => total.worse += 1,
            Some(Change::Same) | None => {}
        }
        total.judged += usize::from(QUANTITIES[place].change(values[0], values[1]).is_some());
        if values.iter().all(|v| !v.is_nan()) {
            total.both += 1;
            (0..2).for_each(|k| sums[k] += values[k]);
            if values.iter().all(|v| *v > 0.0) {
                logs.push((values[1] / values[0]).ln());
            }
        }
    }
    if total.both > 0 {
        total.means = sums.map(|sum| sum / total.both as f64);
    }
    if !logs.is_empty() {
        total.ratio = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    }
    total
}

/// Mean over the values that there are; NaN without any.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|v| !v.is_nan()).fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { f64::NAN }
}

/// Mean over the worst tenth of the values of a quantity, at least two.
pub fn worst_tenth(place: usize, values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.filter(|v| !v.is_nan()).collect();
    all.sort_by(|a, b| if QUANTITIES[place].larger_is_better { a.total_cmp(b) } else { b.total_cmp(a) });
    all.truncate(all.len().div_ceil(10).max(2));
    mean(all.into_iter())
}

/// Every regression as a sentence, by quantity, the largest change first: those of results, CPU seconds and memory, and those
/// of seconds on the clock. Failed runs and models that are no longer right come first.
pub fn regressions(rows: &[&Row]) -> [Vec<String>; 2] {
    let name = |row: &Row| format!("{} {}", row.group, row.name);
    let (mut all, mut clock) = (vec![], vec![]);
    for row in rows {
        if let [a, b] = &row.sides[..]
            && let (None, Some(error)) = (&a.error, &b.error)
        {
            all.push(format!("{}: fails: {error}", name(row)));
        }
    }
    for row in rows.iter().filter(|row| row.sides.iter().all(|side| side.error.is_none())) {
        if let (Some(true), Some(false)) = (row.is_right(0), row.is_right(1)) {
            let model = row.sides[1].model.as_deref().unwrap_or("none");
            all.push(format!("{}: model {} → {model}", name(row), row.model.unwrap_or("none")));
        }
    }
    for (place, quantity) in QUANTITIES.iter().enumerate() {
        let mut found: Vec<(f64, String)> = rows
            .iter()
            .filter_map(|row| {
                let [a, b] = &row.sides[..] else { return None };
                let [x, y] = [a.values[place], b.values[place]];
                if b.error.is_some() || quantity.change(x, y) != Some(Change::Worse) {
                    return None;
                }
                let (size, change) = difference(quantity, x, y);
                let values = format!("{} → {}{change}", quantity.text(x), quantity.text(y));
                Some((size, format!("{}: {} {values}", name(row), quantity.name)))
            })
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let list = if quantity.is_clock { &mut clock } else { &mut all };
        list.extend(found.into_iter().map(|f| f.1));
    }
    [all, clock]
}

/// Size of a change, and its text in brackets: a difference or a percentage, as the margin is.
fn difference(quantity: &Quantity, a: f64, b: f64) -> (f64, String) {
    if a.is_nan() || b.is_nan() {
        return (f64::INFINITY, String::new());
    }
    match quantity.margin {
        Some(Margin::Relative(_)) if a != 0.0 => {
            let share = b / a - 1.0;
            (share.abs(), format!(" ({:+.1} %)", 100.0 * share))
        }
        _ => ((b - a).abs(), format!(" ({:+.*})", quantity.digits, b - a)),
    }
}

/// The last table: a row for each judged quantity, then the models.
pub fn table(rows: &[&Row]) -> String {
    let mut text = String::from(
        "| quantity | cases | mean a | mean b | change of the mean | geometric mean of b / a | margin | better | worse |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for (place, quantity) in QUANTITIES.iter().enumerate() {
        let total = total(rows, place);
        if quantity.margin.is_none() || total.judged == 0 {
            continue;
        }
        let [a, b] = total.means;
        let change = match quantity.margin {
            _ if total.both == 0 => "-".into(),
            Some(Margin::Relative(_)) if a != 0.0 => format!("{:+.1} %", 100.0 * (b / a - 1.0)),
            _ => format!("{:+.*}", quantity.digits, b - a),
        };
        let is_relative = matches!(quantity.margin, Some(Margin::Relative(_)));
        let ratio =
            if is_relative && !total.ratio.is_nan() { format!("{:.3}", total.ratio) } else { "-".into() };
        let cases = if total.judged == total.both {
            total.both.to_string()
        } else {
            format!("{} ({} with both)", total.judged, total.both)
        };
        text += &format!(
            "| {} | {cases} | {} | {} | {change} | {ratio} | {} | {} | {} |\n",
            quantity.name,
            quantity.text(a),
            quantity.text(b),
            quantity.margin_text(),
            total.better,
            total.worse
        );
    }
    let judged: Vec<[bool; 2]> =
        rows.iter().filter_map(|row| Some([row.is_right(0)?, row.is_right(1)?])).collect();
    if !judged.is_empty() {
        let right = |side: usize| judged.iter().filter(|right| right[side]).count();
        let count = |from: bool, to: bool| judged.iter().filter(|right| **right == [from, to]).count();
        text += &format!(
            "| models right | {} | {} | {} | {:+} | - | - | {} | {} |\n",
            judged.len(),
            right(0),
            right(1),
            right(1) as i64 - right(0) as i64,
            count(false, true),
            count(true, false)
        );
    }
    let failed = |side: usize| {
        rows.iter().filter(|row| row.sides.get(side).is_some_and(|side| side.error.is_some())).count()
    };
    if failed(0) + failed(1) > 0 {
        let both = rows.iter().filter(|row| row.sides.iter().all(|side| side.error.is_some())).count();
        text += &format!(
            "| failed runs | {} | {} | {} | {:+} | - | - | {} | {} |\n",
            rows.len(),
            failed(0),
            failed(1),
            failed(1) as i64 - failed(0) as i64,
            failed(0) - both,
            failed(1) - both
        );
    }
    text
}
