//! Maps for print, on white: a figure of all maps with axes and colour bars, and the maps alone. As seen from the wall: +x to
//! the left, y up.

use std::path::Path;

use super::axis::{Axis, plain};
use super::depth_difference::{millimetres, shade};
use super::figure::{BODY, Colour, FRAME, Figure, INK, TITLE};
use super::picture::{Picture, colour, enlargement, normal_colour};
use super::{depth_error, png, probability};
use crate::error::Result;
use crate::maps::Maps;

/// Where there is no surface.
const WHITE: Colour = [255; 3];
/// Width of a map in the figure; space left of it, right of it, above and below, in pixels.
const WIDTH: f64 = 280.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 104.0;
const TOP: f64 = 36.0;
const BOTTOM: f64 = 54.0;
/// Width of a colour bar, and space between the maps of [`write_plain`].
const BAR_WIDTH: f64 = 14.0;
const GAP: usize = 16;

/// Colours of a bar, and its labels by their shares from the bottom.
type Bar = (fn(f64) -> Colour, Vec<(f64, String)>);

/// A map: its title, its colours, and its colour bar.
struct PrintedMap<'m> {
    title: &'static str,
    colour: Box<dyn Fn(usize) -> Option<Colour> + 'm>,
    bar: Option<Bar>,
}

/// Writes [`figure`] as SVG, text as text.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    Ok(figure(maps, usize::MAX)?.svg().into_bytes())
}

/// Writes the maps side by side without axes as PNG.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write_plain(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, plain_bytes)
}

/// The file of [`write_plain`].
pub(super) fn plain_bytes(maps: &Maps) -> Result<Vec<u8>> {
    let all: Vec<Picture> = views(maps).iter().map(|view| picture(maps, view, enlargement(maps))).collect();
    let (wide, high) = (all[0].width + GAP, all[0].height);
    let mut row = Picture::new(wide * all.len() - GAP, high);
    row.fill(0, 0, row.width, high, WHITE);
    all.iter().enumerate().for_each(|(at, map)| row.paste(map, at * wide, 0));
    png::packed(&row)
}

/// All maps with axes in metres and colour bars. Maps have at most `most` pixels along a side.
///
/// # Errors
/// `Kind::Output` if the maps are too large for a picture.
pub fn figure(maps: &Maps, most: usize) -> Result<Figure> {
    let [x0, x1, y0, y1] = maps.extent;
    let (all, height) = (views(maps), (WIDTH * (y1 - y0) / (x1 - x0)).round());
    let each = LEFT + WIDTH + RIGHT;
    let mut figure = Figure::new([each * all.len() as f64, TOP + height + BOTTOM]);
    let longer = maps.nx.max(maps.ny);
    for (number, view) in all.iter().enumerate() {
        let (left, right) = (each * number as f64 + LEFT, each * number as f64 + LEFT + WIDTH);
        let mut shown = picture(maps, view, enlargement(maps).min(most / longer).max(1));
        if longer > most {
            shown = shown.shrunk(longer.div_ceil(most));
        }
        let packed = png::packed(&shown)?;
        figure.image(shown, &packed, [left, TOP, WIDTH, height]);
        let bottom = TOP + height;
        frame(&mut figure, [left, TOP, right, bottom]);
        figure.label(view.title, TITLE, INK, [left + 0.5 * WIDTH, 0.5 * TOP], 0.5);
        let ticks = |low: f64, high: f64| Axis::new([low, high].into_iter(), false).over([low, high]).even();
        for x in ticks(x0, x1) {
            let at = right - WIDTH * (x - x0) / (x1 - x0);
            figure.line(&[[at, bottom], [at, bottom + 5.0]], 1.0, FRAME);
            figure.label(&minus(x), BODY, INK, [at, bottom + 16.0], 0.5);
        }
        for y in ticks(y0, y1) {
            let at = bottom - height * (y - y0) / (y1 - y0);
            figure.line(&[[left - 5.0, at], [left, at]], 1.0, FRAME);
            figure.label(&minus(y), BODY, INK, [left - 9.0, at], 1.0);
        }
        figure.label("x, m", BODY, INK, [left + 0.5 * WIDTH, bottom + 38.0], 0.5);
        figure.label("y, m", BODY, INK, [left - 9.0, 0.5 * TOP], 1.0);
        if let Some(bar) = &view.bar {
            colour_bar(&mut figure, [right + 12.0, TOP, height], bar)?;
        }
    }
    Ok(figure)
}

fn minus(value: f64) -> String {
    plain(value).replace('-', "−")
}

fn frame(figure: &mut Figure, [left, top, right, bottom]: [f64; 4]) {
    figure.line(&[[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], 1.0, FRAME);
}

fn colour_bar(figure: &mut Figure, [left, top, height]: [f64; 3], (shade, labels): &Bar) -> Result<()> {
    const STEPS: usize = 128;
    let mut bar = Picture::new(1, STEPS);
    (0..STEPS).for_each(|row| bar.fill(0, row, 1, 1, shade(1.0 - (row as f64 + 0.5) / STEPS as f64)));
    let packed = png::packed(&bar)?;
    figure.image(bar, &packed, [left, top, BAR_WIDTH, height]);
    let right = left + BAR_WIDTH;
    frame(figure, [left, top, right, top + height]);
    for (share, label) in labels {
        let at = top + height * (1.0 - share);
        figure.line(&[[right, at], [right + 4.0, at]], 1.0, FRAME);
        figure.text(label, BODY, INK, [right + 8.0, at]);
    }
    Ok(())
}

fn picture(maps: &Maps, view: &PrintedMap<'_>, factor: usize) -> Picture {
    Picture::of_maps(maps, factor, |p| (view.colour)(p).unwrap_or(WHITE))
}

/// Albedo, depth, normals and, if they are known, the expected depth error and the probability of surface.
fn views(maps: &Maps) -> Vec<PrintedMap<'_>> {
    let grey = |share: f64| [(255.0 * share.clamp(0.0, 1.0)).round() as u8; 3];
    let white = f64::from(Maps::white(&maps.albedo)).max(f64::MIN_POSITIVE);
    let range = png::shown_range(maps).unwrap_or_default();
    let [near, far] = range;
    let along = move |depth: f64| if far > near { (depth - near) / (far - near) } else { 0.0 };
    let depths = Axis::new(range.into_iter(), false).over(range).even();
    let mut all = vec![
        PrintedMap {
            title: "Albedo",
            colour: Box::new(move |p| Some(grey(f64::from(maps.albedo[p]) / white))),
            bar: None,
        },
        PrintedMap {
            title: "Depth",
            colour: Box::new(move |p| png::shows(maps, p).then(|| colour(along(f64::from(maps.depth[p]))))),
            // Near, as in depth.png, at the bottom.
            bar: (far > near).then(|| {
                (colour as _, depths.iter().map(|z| (along(*z), format!("{} m", plain(*z)))).collect())
            }),
        },
        PrintedMap {
            title: "Normals",
            colour: Box::new(|p| normal_colour(maps.normal[p]).filter(|_| maps.mask[p])),
            bar: None,
        },
    ];
    if let Some((least, most)) = depth_error::range(maps) {
        let share =
            move |error: f64| if most > least { (error / least).ln() / (most / least).ln() } else { 0.0 };
        let labels =
            [least, (least * most).sqrt(), most].map(|m| (share(m), format!("{} mm", millimetres(m))));
        all.push(PrintedMap {
            title: "Expected depth error",
            colour: Box::new(move |p| depth_error::of(maps, p).map(|error| shade(share(f64::from(error))))),
            bar: (most > least).then(|| (shade as _, labels.into())),
        });
    }
    if maps.probability.is_some() {
        let labels = [0.0, 0.5, 1.0].map(|p| (p, plain(p)));
        all.push(PrintedMap {
            title: "Probability",
            colour: Box::new(|p| probability::of(maps, p).map(shade)),
            bar: Some((shade as _, labels.into())),
        });
    }
    all
}
