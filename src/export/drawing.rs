//! Drawings of lines, discs and text: a list of shapes, written as SVG or rastered into a [`Picture`].

use std::fmt::Write;

use super::picture::Picture;
use super::strokes;

/// Where a text is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// Lengths in pixels, x to the right, y downwards from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    Line {
        points: Vec<[f64; 2]>,
        width: f64,
        colour: [u8; 3],
        dashed: bool,
    },
    Disc {
        centre: [f64; 2],
        radius: f64,
        colour: [u8; 3],
    },
    /// `at` lies on the base line, `size` is the height of a capital.
    Text {
        text: String,
        at: [f64; 2],
        size: f64,
        anchor: Anchor,
        colour: [u8; 3],
        bold: bool,
    },
}

/// Shapes on a white ground, the later over the earlier.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    pub width: usize,
    pub height: usize,
    pub shapes: Vec<Shape>,
}

/// Length of a dash and of the gap after it.
const DASH: f64 = 7.0;

impl Drawing {
    pub fn new(width: usize, height: usize) -> Drawing {
        Drawing { width, height, shapes: vec![] }
    }

    pub fn line(&mut self, points: &[[f64; 2]], width: f64, colour: [u8; 3]) {
        self.shapes.push(Shape::Line { points: points.to_vec(), width, colour, dashed: false });
    }

    pub fn dashes(&mut self, points: &[[f64; 2]], width: f64, colour: [u8; 3]) {
        self.shapes.push(Shape::Line { points: points.to_vec(), width, colour, dashed: true });
    }

    pub fn disc(&mut self, centre: [f64; 2], radius: f64, colour: [u8; 3]) {
        self.shapes.push(Shape::Disc { centre, radius, colour });
    }

    pub fn text(&mut self, text: &str, at: [f64; 2], size: f64, anchor: Anchor, colour: [u8; 3]) {
        self.shapes.push(Shape::Text { text: text.into(), at, size, anchor, colour, bold: false });
    }

    pub fn title(&mut self, text: &str, at: [f64; 2], size: f64, anchor: Anchor, colour: [u8; 3]) {
        self.shapes.push(Shape::Text { text: text.into(), at, size, anchor, colour, bold: true });
    }

    /// The drawing as SVG, text as text.
    pub fn svg(&self) -> String {
        let (w, h) = (self.width, self.height);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"Helvetica, Arial, sans-serif\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n"
        );
        for shape in &self.shapes {
            let _ = match shape {
                Shape::Line { points, width, colour, dashed } => {
                    let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
                    let dash =
                        if *dashed { format!(" stroke-dasharray=\"{DASH} {DASH}\"") } else { String::new() };
                    writeln!(
                        out,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" \
                         stroke-linejoin=\"round\" stroke-linecap=\"round\"{dash}/>",
                        points.join(" "),
                        hex(*colour)
                    )
                }
                Shape::Disc { centre: [x, y], radius, colour } => writeln!(
                    out,
                    "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{}\"/>",
                    hex(*colour)
                ),
                Shape::Text { text, at: [x, y], size, anchor, colour, bold } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let weight = if *bold { " font-weight=\"bold\"" } else { "" };
                    // A capital is about 0.72 of a font's size high.
                    writeln!(
                        out,
                        "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{:.1}\" text-anchor=\"{anchor}\"{weight} \
                         fill=\"{}\">{}</text>",
                        size / 0.72,
                        hex(*colour),
                        escaped(text)
                    )
                }
            };
        }
        out + "</svg>\n"
    }

    /// The drawing as pixels, with smooth edges and the font of `strokes`.
    pub fn picture(&self) -> Picture {
        let mut picture =
            Picture { width: self.width, height: self.height, rgb: vec![255; 3 * self.width * self.height] };
        for shape in &self.shapes {
            draw(&mut picture, shape);
        }
        picture
    }
}

/// Draws a shape over what is there; what lies outside is left out.
pub fn draw(picture: &mut Picture, shape: &Shape) {
    match shape {
        Shape::Line { points, width, colour, dashed: false } => polyline(picture, points, *width, *colour),
        Shape::Line { points, width, colour, dashed: true } => {
            dashes_of(points).iter().for_each(|dash| polyline(picture, dash, *width, *colour));
        }
        Shape::Disc { centre, radius, colour } => {
            segment(picture, *centre, *centre, 2.0 * radius, *colour);
        }
        Shape::Text { text, at, size, anchor, colour, bold } => {
            let length = strokes::width(text, *size);
            let left = at[0]
                - match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5 * length,
                    Anchor::End => length,
                };
            let width = size * if *bold { 0.17 } else { 0.125 };
            for stroke in strokes::strokes(text, *size) {
                let points: Vec<_> = stroke.iter().map(|p| [left + p[0], at[1] + p[1]]).collect();
                polyline(picture, &points, width, *colour);
            }
        }
    }
}

fn polyline(picture: &mut Picture, points: &[[f64; 2]], width: f64, colour: [u8; 3]) {
    points.windows(2).for_each(|pair| segment(picture, pair[0], pair[1], width, colour));
}

/// A segment with round ends: a pixel is covered by how far its centre lies within.
fn segment(picture: &mut Picture, a: [f64; 2], b: [f64; 2], width: f64, colour: [u8; 3]) {
    let reach = 0.5 * width + 0.5;
    let range = |a: f64, b: f64, end: usize| {
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        (low.max(0.0) as usize)..((high.max(0.0) as usize).saturating_add(1)).min(end)
    };
    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    let square = (dx * dx + dy * dy).max(1e-12);
    for row in range(a[1], b[1], picture.height) {
        for column in range(a[0], b[0], picture.width) {
            let [px, py] = [column as f64 + 0.5 - a[0], row as f64 + 0.5 - a[1]];
            let along = ((px * dx + py * dy) / square).clamp(0.0, 1.0);
            let distance = (px - along * dx).hypot(py - along * dy);
            let cover = (reach - distance).clamp(0.0, 1.0);
            let at = 3 * (row * picture.width + column);
            for (channel, ink) in picture.rgb[at..at + 3].iter_mut().zip(colour) {
                let mixed = f64::from(*channel) * (1.0 - cover) + f64::from(ink) * cover;
                *channel = mixed.round() as u8;
            }
        }
    }
}

/// The dashes of a line.
fn dashes_of(points: &[[f64; 2]]) -> Vec<[[f64; 2]; 2]> {
    let mut dashes = Vec::new();
    for pair in points.windows(2) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let at = |s: f64| [0, 1].map(|c| pair[0][c] + (pair[1][c] - pair[0][c]) * s / length);
        let count = if length.is_finite() { (length / (2.0 * DASH)) as usize } else { 0 };
        dashes.extend((0..count).map(|i| [at(2.0 * DASH * i as f64), at(2.0 * DASH * i as f64 + DASH)]));
    }
    dashes
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
