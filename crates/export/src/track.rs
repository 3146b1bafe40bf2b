//! Positions with their errors as a table, a figure and a page: three views with the ellipses of one and two standard deviations, and
//! coordinates over time.

use super::axis::{Axis, Panel, plain, rounded};
use super::figure::{BODY, COLOURS, Colour, FRAME, Figure, HEADING, INK};
use super::text::{escaped, quoted};

/// A position in a frame. Lengths are metres.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackRow {
    /// The capture's name.
    pub frame: String,
    /// Seconds from the first frame.
    pub time: f64,
    /// Number of the object.
    pub track: usize,
    /// x, y, z.
    pub at: [f64; 3],
    /// Covariances xx, yy, zz, xy, xz, yz, squared metres.
    pub covariance: [f64; 6],
    /// Filtered x, y, z, and their standard deviations.
    pub filtered: [[f64; 3]; 2],
    /// Speed along x, y, z, metres a second.
    pub velocity: [f64; 3],
    /// Distance from the middle of the wall points and its standard deviation.
    pub distance: [f64; 2],
    /// Counts of a pair at a distance of one unit of length, and the standard deviation of the logarithm.
    pub light: [f64; 2],
    /// Radius, and the standard deviation of the logarithm.
    pub extent: [f64; 2],
    /// Share of the drop of χ².
    pub share: f64,
    /// The direction that is not measured.
    pub unmeasured: Option<[f64; 3]>,
}

impl TrackRow {
    /// Standard deviations of x, y, z.
    pub fn deviations(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.covariance[k].max(0.0).sqrt())
    }

    /// The covariance of two coordinates.
    fn of(&self, a: usize, b: usize) -> f64 {
        match (a.min(b), a.max(b)) {
            (0, 1) => self.covariance[3],
            (0, 2) => self.covariance[4],
            (1, 2) => self.covariance[5],
            (k, _) => self.covariance[k],
        }
    }
}

/// Names of the columns of the table.
const COLUMNS: &str = "frame,time_s,track,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,cov_xx_m2,cov_yy_m2,cov_zz_m2,cov_xy_m2,cov_xz_m2,\
cov_yz_m2,filtered_x_m,filtered_y_m,filtered_z_m,filtered_sigma_x_m,filtered_sigma_y_m,filtered_sigma_z_m,velocity_x_m_s,velocity_y_m_s,\
velocity_z_m_s,distance_m,sigma_distance_m,light,sigma_log_light,extent_m,sigma_log_extent,share,unmeasured_x,unmeasured_y,unmeasured_z";

/// The table, a row per position. A direction that is measured is empty.
pub fn csv(rows: &[TrackRow]) -> String {
    let mut out = format!("{COLUMNS}\n");
    for row in rows {
        let numbers = row
            .at
            .iter()
            .chain(&row.deviations())
            .chain(&row.covariance)
            .chain(row.filtered.iter().flatten())
            .chain(&row.velocity)
            .chain(&row.distance)
            .chain(&row.light)
            .chain(&row.extent)
            .chain([&row.share])
            .map(|v| format!("{v:.6e}"))
            .collect::<Vec<_>>();
        let direction = row.unmeasured.map_or(",,".into(), |d| d.map(|v| format!("{v:.4}")).join(","));
        out += &format!(
            "{},{:.6},{},{},{direction}\n",
            quoted(&row.frame),
            row.time,
            row.track,
            numbers.join(",")
        );
    }
    out
}

/// Panels: side, left and upper edge of the first, and step.
const SIDE: f64 = 330.0;
const EDGE: [f64; 2] = [90.0, 90.0];
const STEP: f64 = 420.0;
/// Height of a panel over time.
const LOW: f64 = 150.0;
/// Points of an ellipse.
const ROUND: usize = 60;
/// Coordinates of the views, along and up, with titles and labels.
const VIEWS: [([usize; 2], &str, &str); 3] =
    [([0, 1], "y over x (m)", "x (m)"), ([0, 2], "z over x (m)", "x (m)"), ([2, 1], "y over z (m)", "z (m)")];

/// The figure. `volume`: lowest and highest corner of the box, `wall`: wall points.
pub fn figure(title: &str, rows: &[TrackRow], volume: [[f64; 3]; 2], wall: &[[f64; 3]]) -> Figure {
    let has_times = rows.iter().any(|row| row.time > 0.0);
    let views = EDGE[1] + SIDE + 70.0;
    let height = if has_times { views + 3.0 * (LOW + 80.0) } else { views };
    let mut figure = Figure::new([EDGE[0] + 3.0 * STEP, height]);
    figure.text(title, HEADING, INK, [EDGE[0], 28.0]);
    figure.text("ellipses: one and two standard deviations; dots: wall points", BODY, FRAME, [EDGE[0], 52.0]);
    let colour = |row: &TrackRow| COLOURS[row.track % COLOURS.len()];
    let axis = |k: usize| {
        let far = |row: &TrackRow| {
            let reach = 2.0 * row.deviations()[k];
            [row.at[k] - reach, row.at[k] + reach]
        };
        let ends = rows.iter().flat_map(far).map(|v| v.clamp(volume[0][k], volume[1][k]));
        Axis::new(ends.chain(wall.iter().map(|p| p[k])), false)
    };
    for (i, ([a, b], name, label)) in VIEWS.into_iter().enumerate() {
        let place = [EDGE[0] + i as f64 * STEP, EDGE[1], SIDE, SIDE];
        let mut panel = Panel::new(&mut figure, place, [name, label], [axis(a), axis(b)]);
        wall.iter().for_each(|p| panel.disc([p[a], p[b]], 1.5, FRAME));
        for row in rows {
            for scale in [1.0, 2.0] {
                panel.steps(&ellipse(row, [a, b], scale), Some(colour(row)));
            }
            panel.disc([row.at[a], row.at[b]], 3.0, colour(row));
        }
        for (track, colour) in tracks(rows) {
            let points: Vec<_> = track.iter().map(|row| [row.filtered[0][a], row.filtered[0][b]]).collect();
            panel.curve(&points, colour);
        }
    }
    for k in (0..3).filter(|_| has_times) {
        let place = [EDGE[0], views + 20.0 + k as f64 * (LOW + 80.0), 2.0 * STEP + SIDE, LOW];
        over_time(&mut figure, rows, k, place);
    }
    figure
}

/// Rows of each object, and its colour.
fn tracks(rows: &[TrackRow]) -> Vec<(Vec<&TrackRow>, Colour)> {
    let last = rows.iter().map(|row| row.track + 1).max().unwrap_or(0);
    let of = |track: usize| {
        (rows.iter().filter(|row| row.track == track).collect::<Vec<_>>(), COLOURS[track % COLOURS.len()])
    };
    (0..last).map(of).filter(|(rows, _)| !rows.is_empty()).collect()
}

/// A coordinate over time: filtered, with one standard deviation, and the positions of the frames.
fn over_time(figure: &mut Figure, rows: &[TrackRow], k: usize, place: [f64; 4]) {
    let ends = |row: &TrackRow| {
        let [at, deviation] = [row.filtered[0][k], row.filtered[1][k]];
        [at - deviation, at + deviation, row.at[k]]
    };
    let axes =
        [Axis::new(rows.iter().map(|row| row.time), false), Axis::new(rows.iter().flat_map(ends), false)];
    let title = format!("{} (m), filtered, with one standard deviation", ["x", "y", "z"][k]);
    let mut panel = Panel::new(figure, place, [&title, "time (s)"], axes);
    for (track, colour) in tracks(rows) {
        for sign in [-1.0, 0.0, 1.0] {
            let at = |row: &&TrackRow| [row.time, row.filtered[0][k] + sign * row.filtered[1][k]];
            let points: Vec<_> = track.iter().map(at).collect();
            if sign == 0.0 { panel.curve(&points, colour) } else { panel.steps(&points, None) }
        }
        track.iter().for_each(|row| panel.disc([row.time, row.at[k]], 2.0, colour));
    }
}

/// Points of the ellipse of `scale` standard deviations in the plane of two coordinates.
fn ellipse(row: &TrackRow, [a, b]: [usize; 2], scale: f64) -> Vec<[f64; 2]> {
    // The root of the covariance by Cholesky's method.
    let first = row.of(a, a).max(0.0).sqrt();
    let across = if first > 0.0 { row.of(a, b) / first } else { 0.0 };
    let second = (row.of(b, b) - across * across).max(0.0).sqrt();
    let at = |i: usize| {
        let (sine, cosine) = (i as f64 * std::f64::consts::TAU / ROUND as f64).sin_cos();
        [row.at[a] + scale * first * cosine, row.at[b] + scale * (across * cosine + second * sine)]
    };
    (0..=ROUND).map(at).collect()
}

/// Rows of the table on the page, at most.
const MOST_ROWS: usize = 500;

/// The page: figure, notes, and a table of the positions.
pub fn page(title: &str, figure: &Figure, rows: &[TrackRow], notes: &[String]) -> String {
    let millimetres = |v: f64| plain(rounded(1e3 * v));
    let cell = |at: f64, deviation: f64| format!("<td>{at:.4} ± {}</td>", millimetres(deviation));
    let line = |row: &TrackRow| {
        let sigma = row.deviations();
        let along = row
            .unmeasured
            .map_or("all".into(), |d| format!("not along ({})", d.map(|v| format!("{v:.2}")).join(", ")));
        let coordinates: String = (0..3).map(|k| cell(row.at[k], sigma[k])).collect();
        format!(
            "<tr><td>{}</td><td>{:.3}</td><td>{}</td>{coordinates}{}<td>{}</td><td>{:.0} %</td><td>{along}</td></tr>\n",
            escaped(&row.frame),
            row.time,
            row.track,
            cell(row.distance[0], row.distance[1]),
            millimetres(row.extent[0]),
            100.0 * row.share,
        )
    };
    let table: String = rows.iter().take(MOST_ROWS).map(line).collect();
    let more = match rows.len().saturating_sub(MOST_ROWS) {
        0 => String::new(),
        more => format!("<p>{more} more in track.csv</p>"),
    };
    let notes: String = notes.iter().map(|note| format!("<li>{}</li>\n", escaped(note))).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>thirdbounce: {title}</title>\n\
         <style>body{{font-family:sans-serif;margin:2em;max-width:1400px}}svg{{max-width:100%;height:auto}}\
         table{{border-collapse:collapse}}td,th{{padding:.2em .8em;text-align:left;border-bottom:1px solid #ccc}}</style>\n\
         <h1>{title}</h1>\n{}\n<ul>\n{notes}</ul>\n<table><tr><th>frame</th><th>time, s</th><th>object</th><th>x, m ± mm</th>\
         <th>y, m ± mm</th><th>z, m ± mm</th><th>distance, m ± mm</th><th>radius, mm</th><th>share</th><th>measured</th></tr>\n\
         {table}</table>\n{more}\n</html>\n",
        figure.svg(),
        title = escaped(title),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(frame: &str, time: f64) -> TrackRow {
        TrackRow {
            frame: frame.into(),
            time,
            track: 0,
            at: [0.1, -0.2, 0.8],
            covariance: [1e-4, 4e-4, 9e-4, 1e-4, 0.0, -3e-4],
            filtered: [[0.1, -0.2, 0.8], [0.01; 3]],
            velocity: [0.0; 3],
            distance: [0.83, 0.02],
            light: [50.0, 0.1],
            extent: [0.08, 0.2],
            share: 1.0,
            unmeasured: None,
        }
    }

    #[test]
    fn the_ellipse_is_that_of_the_covariance() {
        let row = row("a", 0.0);
        // Every point of it is two standard deviations away by the inverse of the covariance.
        let [xx, yy, xy] = [1e-4, 4e-4, 1e-4];
        for [x, y] in ellipse(&row, [0, 1], 2.0) {
            let (x, y) = (x - 0.1, y + 0.2);
            let square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy);
            assert!((square - 4.0).abs() < 1e-9, "{square}");
        }
    }

    #[test]
    fn names_stay_in_their_cell() {
        let rows = [row("a,\"b\" <c>", 0.0), row("d", 0.1)];
        let text = csv(&rows);
        assert!(text.contains("\n\"a,\"\"b\"\" <c>\",0.000000,0,"), "{text}");
        let columns = COLUMNS.split(',').count();
        assert_eq!(text.lines().nth(2).unwrap().split(',').count(), columns);
        let drawn = figure("<t>", &rows, [[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]], &[[0.0; 3]]);
        let page = page("<t>", &drawn, &rows, &["x < y".into()]);
        assert!(page.contains("<td>a,&quot;b&quot; &lt;c&gt;</td>") && page.contains("x &lt; y"), "{page}");
        assert!(!page.contains("<t>"));
    }
}
