//! Quantities that are compared, their margins, and changes from one side to the other.

use std::collections::BTreeMap;

use super::{CaseResults, Table};

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
    /// Whether a larger value is better.
    pub larger_is_better: bool,
    /// `None`: shown, but not judged.
    pub margin: Option<Margin>,
    /// Whether a value that only one side has is a change, too.
    pub is_required: bool,
    /// Whether other programs on the machine change it.
    pub is_clock: bool,
    /// Digits behind the point.
    pub digits: usize,
}

const fn quantity(key: &'static str, name: &'static str, margin: Option<Margin>, digits: usize) -> Quantity {
    Quantity { key, name, larger_is_better: false, margin, is_required: false, is_clock: false, digits }
}

const fn overlap(key: &'static str, name: &'static str, margin: Option<Margin>) -> Quantity {
    Quantity { larger_is_better: true, is_required: margin.is_some(), ..quantity(key, name, margin, 3) }
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

/// Declares the quantities and their places.
macro_rules! quantities {
    ($($place:ident: $what:expr;)*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, clippy::enum_variant_names)]
        enum QuantityPlace { $($place,)* COUNT }
        $(
            #[allow(missing_docs)] // its quantity has its name
            pub const $place: usize = QuantityPlace::$place as usize;
        )*
        /// Number of [`QUANTITIES`].
        pub const COUNT: usize = QuantityPlace::COUNT as usize;
        /// All quantities, by their places.
        pub const QUANTITIES: [Quantity; COUNT] = [$($what),*];
    };
}

quantities! {
    SOLVE: clock("solve_s", "solve s", COST);
    OWN: overlap("own_iou", "own IoU", IOU);
    BEST: overlap("best_iou", "best IoU", IOU);
    DEPTH: error("depth_percent", "depth MAE, % of the wall", 3);
    DEPTH_MM: quantity("depth_mm", "depth MAE, mm", None, 2);
    RMSE: error("depth_rmse_mm", "depth RMSE, mm", 2);
    NORMALS: error("normals_deg", "normals, °", 1);
    COMPLETE: overlap("completeness", "completeness", None);
    WITHIN: quantity("within_depth_error", "errors within depth_error", None, 2);
    PAPER_DEPTH: quantity("paper_depth_m", "paper's measure: depth MAE, m", ERROR, 4);
    PAPER_DEPTH_RMSE: quantity("paper_depth_rmse_m", "paper's measure: depth RMSE, m", None, 4);
    PAPER_NORMALS: quantity("paper_normals", "paper's measure: normals MAE", ERROR, 4);
    PAPER_NORMALS_RMSE: quantity("paper_normals_rmse", "paper's measure: normals RMSE", None, 4);
    CPU: quantity("cpu_s", "CPU s", COST, 2);
    MEMORY: quantity("memory_mb", "memory, MB", COST, 0);
    WALL: clock("wall_s", "wall s", COST);
    ESTIMATES: clock("estimates_s", "estimates s", COST);
    FILES: clock("files_s", "load and export s", None);
}

/// Values of a side, by the places of [`QUANTITIES`]; NaN where missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values([f64; COUNT]);

impl Default for Values {
    fn default() -> Values {
        Values([f64::NAN; COUNT])
    }
}

impl std::ops::Index<usize> for Values {
    type Output = f64;
    fn index(&self, place: usize) -> &f64 {
        &self.0[place]
    }
}

impl std::ops::IndexMut<usize> for Values {
    fn index_mut(&mut self, place: usize) -> &mut f64 {
        &mut self.0[place]
    }
}

/// Values as an object of those that there are, by their keys.
pub(super) mod by_key {
    use super::{BTreeMap, COUNT, QUANTITIES, Values};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(values: &Values, to: S) -> Result<S::Ok, S::Error> {
        let there = (0..COUNT).filter(|place| values[*place].is_finite());
        there.map(|place| (QUANTITIES[place].key, values[place])).collect::<BTreeMap<_, _>>().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Values, D::Error> {
        let all = BTreeMap::<String, f64>::deserialize(from)?;
        Ok(Values(QUANTITIES.map(|quantity| all.get(quantity.key).copied().unwrap_or(f64::NAN))))
    }
}

/// Change of a quantity from one side to the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// By more than the margin.
    Better,
    /// By more than the margin.
    Worse,
    /// Within the margin.
    Same,
}

impl Quantity {
    /// The better one of two values.
    pub fn better(&self, a: f64, b: f64) -> f64 {
        if self.larger_is_better { a.max(b) } else { a.min(b) }
    }

    /// The change from `a` to `b`. `None` if it is not judged: there is no margin, neither has a value, or one lacks a value
    /// that is not required.
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

    /// A value; a dash for none.
    pub fn text(&self, value: f64) -> String {
        if value.is_nan() { "–".into() } else { format!("{value:.*}", self.digits) }
    }

    /// Size of a change, and its text: a difference or a percentage, like the margin.
    fn difference(&self, a: f64, b: f64) -> (f64, String) {
        match self.margin {
            _ if a.is_nan() || b.is_nan() => (f64::INFINITY, String::new()),
            Some(Margin::Relative(_)) if a != 0.0 => {
                ((b / a - 1.0).abs(), format!("{:+.1} %", 100.0 * (b / a - 1.0)))
            }
            _ => ((b - a).abs(), format!("{:+.*}", self.digits, b - a)),
        }
    }
}

/// Sums over cases of one quantity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Total {
    /// Cases with a value of both sides; the means are theirs.
    pub both: usize,
    /// Means of both sides; NaN without cases.
    pub means: [f64; 2],
    /// Means over the worst tenth of the cases, at least two.
    pub worst: [f64; 2],
    /// Geometric mean of b over a, over the cases whose values are both above 0; NaN without any.
    pub ratio: f64,
    /// Cases that were judged, including those with one value.
    pub judged: usize,
    /// Cases that are better.
    pub better: usize,
    /// Cases that are worse.
    pub worse: usize,
}

/// The first two sides of a case.
fn pair(case: &CaseResults, place: usize) -> Option<[f64; 2]> {
    let [a, b] = &case.sides[..] else { return None };
    Some([a.values[place], b.values[place]])
}

/// The totals of a quantity. Cases without exactly two sides do not count.
pub fn total(cases: &[&CaseResults], place: usize) -> Total {
    let pairs: Vec<[f64; 2]> = cases.iter().filter_map(|case| pair(case, place)).collect();
    let both: Vec<[f64; 2]> = pairs.iter().copied().filter(|p| p.iter().all(|v| !v.is_nan())).collect();
    let changes: Vec<Change> = pairs.iter().filter_map(|[a, b]| QUANTITIES[place].change(*a, *b)).collect();
    let count = |change: Change| changes.iter().filter(|c| **c == change).count();
    let side = |k: usize| both.iter().map(move |p| p[k]);
    let logs = both.iter().filter(|p| p.iter().all(|v| *v > 0.0)).map(|[a, b]| (b / a).ln());
    Total {
        both: both.len(),
        means: [mean(side(0)), mean(side(1))],
        worst: [worst_tenth(place, side(0)), worst_tenth(place, side(1))],
        ratio: mean(logs).exp(),
        judged: changes.len(),
        better: count(Change::Better),
        worse: count(Change::Worse),
    }
}

/// Mean over the values that there are; NaN without any.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|v| !v.is_nan()).fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { f64::NAN }
}

/// Mean over the worst tenth of the values of a quantity, at least two.
fn worst_tenth(place: usize, values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(|a, b| if QUANTITIES[place].larger_is_better { a.total_cmp(b) } else { b.total_cmp(a) });
    all.truncate(all.len().div_ceil(10).max(2));
    mean(all.into_iter())
}

/// Whether the model of a side is the true one; `None` if that is unknown.
fn is_right(case: &CaseResults, side: usize) -> Option<bool> {
    let (side, known) = (case.sides.get(side)?, case.model.as_deref());
    if side.error.is_some() { known.map(|_| false) } else { Some(side.model.as_deref()? == known?) }
}

/// Every regression from the first to the second side as a sentence, by quantity, the largest change first: those of results, CPU
/// seconds and memory, and those of wall-clock seconds. Failed runs and models that are no longer right come first.
pub fn regressions(cases: &[&CaseResults]) -> [Vec<String>; 2] {
    let name = |case: &CaseResults| format!("{} {}", case.group, case.name);
    let (mut all, mut clock) = (vec![], vec![]);
    for case in cases {
        if let [a, b] = &case.sides[..]
            && let (None, Some(error)) = (&a.error, &b.error)
        {
            all.push(format!("{}: fails: {error}", name(case)));
        }
    }
    for case in cases.iter().filter(|case| case.sides.iter().all(|side| side.error.is_none())) {
        if let (Some(true), Some(false)) = (is_right(case, 0), is_right(case, 1)) {
            let [known, found] = [&case.model, &case.sides[1].model].map(|m| m.as_deref().unwrap_or("none"));
            all.push(format!("{}: model {known} → {found}", name(case)));
        }
    }
    for (place, quantity) in QUANTITIES.iter().enumerate() {
        let worse = |case: &&CaseResults| {
            let [a, b] = pair(case, place)?;
            if case.sides[1].error.is_some() || quantity.change(a, b) != Some(Change::Worse) {
                return None;
            }
            let (size, change) = quantity.difference(a, b);
            let change = if change.is_empty() { change } else { format!(" ({change})") };
            let [a, b] = [a, b].map(|v| quantity.text(v));
            Some((size, format!("{}: {} {a} → {b}{change}", name(case), quantity.name)))
        };
        let mut found: Vec<(f64, String)> = cases.iter().filter_map(worse).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let list = if quantity.is_clock { &mut clock } else { &mut all };
        list.extend(found.into_iter().map(|f| f.1));
    }
    [all, clock]
}

/// Changes from the first to the second side: a row for each judged quantity, then models and failures.
pub fn changes(cases: &[&CaseResults]) -> Table {
    let head = [
        "quantity",
        "cases",
        "mean a",
        "mean b",
        "change",
        "worst tenth a",
        "worst tenth b",
        "b / a",
        "margin",
        "better",
        "worse",
    ];
    let mut rows: Vec<Vec<String>> = vec![];
    for (place, quantity) in QUANTITIES.iter().enumerate() {
        let total = total(cases, place);
        let Some(margin) = quantity.margin.filter(|_| total.judged > 0) else { continue };
        let count = match total.judged == total.both {
            true => total.both.to_string(),
            false => format!("{} ({} with both)", total.judged, total.both),
        };
        let (ratio, margin) = match margin {
            Margin::Relative(share) if !total.ratio.is_nan() => {
                (format!("{:.3}", total.ratio), format!("{:.0} %", 100.0 * share))
            }
            Margin::Relative(share) => ("–".into(), format!("{:.0} %", 100.0 * share)),
            Margin::Absolute(least) => ("–".into(), least.to_string()),
        };
        let [[a, b], [c, d]] = [total.means, total.worst].map(|pair| pair.map(|v| quantity.text(v)));
        let change = quantity.difference(total.means[0], total.means[1]).1;
        let [better, worse] = [total.better, total.worse].map(|n| n.to_string());
        rows.push(vec![quantity.name.into(), count, a, b, change, c, d, ratio, margin, better, worse]);
    }
    let mut count = |name: &str, judged: Vec<[bool; 2]>, larger_is_better: bool| {
        let side = |k: usize| judged.iter().filter(|j| j[k]).count();
        let from = |a: bool, b: bool| judged.iter().filter(|j| **j == [a, b]).count().to_string();
        let (better, worse) = match larger_is_better {
            true => (from(false, true), from(true, false)),
            false => (from(true, false), from(false, true)),
        };
        let change = format!("{:+}", side(1) as i64 - side(0) as i64);
        let none = || "–".to_string();
        let [all, a, b] = [judged.len(), side(0), side(1)].map(|n| n.to_string());
        rows.push(vec![name.into(), all, a, b, change, none(), none(), none(), none(), better, worse]);
    };
    let models = cases.iter().filter_map(|case| Some([is_right(case, 0)?, is_right(case, 1)?]));
    let models: Vec<_> = models.collect();
    if !models.is_empty() {
        count("models right", models, true);
    }
    let failed = cases.iter().filter(|case| case.sides.len() == 2);
    let failed: Vec<_> = failed.map(|case| [0, 1].map(|k| case.sides[k].error.is_some())).collect();
    if failed.iter().flatten().any(|f| *f) {
        count("failed runs", failed, false);
    }
    Table { head: head.map(String::from).into(), rows }
}
