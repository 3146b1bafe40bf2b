//! Plots as lists of shapes, rendered as SVG or as pictures. Coordinates are pixels from the upper left corner.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use zeno::{Cap, Command, Join, Mask, PathBuilder, Stroke};

use super::picture::Picture;
use super::text;
use super::text::escaped;

/// Red, green and blue.
pub type Colour = [u8; 3];

/// Colours shared by all plots.
pub const INK: Colour = [40, 40, 46];
pub const GRID: Colour = [226, 226, 230];
pub const FRAME: Colour = [120, 120, 128];
/// Colours of curves. The first seven are distinguishable with any colour vision (Okabe and Ito).
pub const COLOURS: [Colour; 11] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [70, 70, 70],
    [140, 90, 50],
    [120, 60, 180],
    [120, 180, 40],
    [190, 20, 60],
];

/// Sizes of text, in pixels per em.
pub const HEADING: f64 = 21.0;
pub const TITLE: f64 = 16.0;
pub const BODY: f64 = 14.0;

/// Length of dashes and gaps.
const DASH: f64 = 7.0;
/// Distance of a base line below the middle of a line of text, in ems.
const DOWN: f64 = 0.27;
/// The compiled-in font, and its substitutes in SVG viewers.
const FAMILY: &str = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif";

#[derive(Debug, Clone, PartialEq)]
enum FigureShape {
    Line {
        points: Vec<[f64; 2]>,
        width: f64,
        dashed: bool,
    },
    Disc {
        at: [f64; 2],
        radius: f64,
    },
    /// Two opposite corners.
    Bar([f64; 2], [f64; 2]),
    /// Left, top, width and height of a picture, whose pixels become rectangles; and the picture as PNG in base64.
    Image {
        picture: Picture,
        place: [f64; 4],
        packed: String,
    },
    /// Share of the text to the left of x; y is its middle.
    Text {
        words: String,
        at: [f64; 2],
        em: f64,
        left: f64,
    },
}

/// A drawing on a white background.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    size: [f64; 2],
    shapes: Vec<(FigureShape, Colour)>,
}

impl Figure {
    /// A white background of this width and height.
    pub fn new(size: [f64; 2]) -> Figure {
        Figure { size: size.map(f64::ceil), shapes: vec![] }
    }

    pub fn line(&mut self, points: &[[f64; 2]], width: f64, colour: Colour) {
        self.shapes.push((FigureShape::Line { points: points.into(), width, dashed: false }, colour));
    }

    pub fn dashes(&mut self, points: &[[f64; 2]], colour: Colour) {
        self.shapes.push((FigureShape::Line { points: points.into(), width: 1.0, dashed: true }, colour));
    }

    pub fn disc(&mut self, at: [f64; 2], radius: f64, colour: Colour) {
        self.shapes.push((FigureShape::Disc { at, radius }, colour));
    }

    pub fn bar(&mut self, from: [f64; 2], to: [f64; 2], colour: Colour) {
        self.shapes.push((FigureShape::Bar(from, to), colour));
    }

    /// A picture at left, top, width and height; `packed` is its PNG.
    pub fn image(&mut self, picture: Picture, packed: &[u8], place: [f64; 4]) {
        let packed = STANDARD.encode(packed);
        self.shapes.push((FigureShape::Image { picture, place, packed }, INK));
    }

    /// A line of text of `em` pixels per em that starts at x, centred at y.
    pub fn text(&mut self, words: &str, em: f64, colour: Colour, at: [f64; 2]) {
        self.label(words, em, colour, at, 0.0);
    }

    /// A line of text with the share `left` to the left of x: 0, 0.5 or 1.
    pub fn label(&mut self, words: &str, em: f64, colour: Colour, at: [f64; 2], left: f64) {
        self.shapes.push((FigureShape::Text { words: words.into(), at, em, left }, colour));
    }

    /// The figure as SVG, text as text.
    pub fn svg(&self) -> String {
        let [w, h] = self.size;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"{FAMILY}\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
        );
        for (shape, [r, g, b]) in &self.shapes {
            let colour = format!("#{r:02x}{g:02x}{b:02x}");
            // Writing to a string cannot fail.
            let _ = match shape {
                FigureShape::Line { points, width, dashed } => {
                    let all: String = points.iter().map(|[x, y]| format!(" {x:.2},{y:.2}")).collect();
                    let dash = if *dashed { format!(" stroke-dasharray=\"{DASH}\"") } else { String::new() };
                    writeln!(
                        out,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" \
                         stroke-linejoin=\"round\"{dash}/>",
                        all.trim_start()
                    )
                }
                FigureShape::Disc { at: [x, y], radius } => {
                    writeln!(out, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{colour}\"/>")
                }
                FigureShape::Bar([x0, y0], [x1, y1]) => writeln!(
                    out,
                    "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{colour}\"/>",
                    x0.min(*x1),
                    y0.min(*y1),
                    (x1 - x0).abs(),
                    (y1 - y0).abs()
                ),
                FigureShape::Image { place: [x, y, w, h], packed, .. } => writeln!(
                    out,
                    "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" \
                     style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{packed}\"/>"
                ),
                FigureShape::Text { words, at: [x, y], em, left } => writeln!(
                    out,
                    "<text x=\"{x:.2}\" y=\"{:.2}\" font-size=\"{em}\" fill=\"{colour}\" text-anchor=\"{}\">{}</text>",
                    y + DOWN * em,
                    ["start", "middle", "end"][(2.0 * left) as usize % 3],
                    escaped(words)
                ),
            };
        }
        out + "</svg>\n"
    }

    /// The figure as pixels, antialiased.
    pub fn picture(&self) -> Picture {
        let [w, h] = self.size;
        let mut picture = Picture::new(w as usize, h as usize);
        picture.fill(0, 0, w as usize, h as usize, [255; 3]);
        for (shape, colour) in &self.shapes {
            let mut ink = |at, cover| picture.blend(at, *colour, cover);
            let point = |[x, y]: [f64; 2]| [x as f32, y as f32];
            let mut path: Vec<Command> = vec![];
            match shape {
                FigureShape::Line { points, width, dashed } => {
                    for (i, at) in points.iter().enumerate() {
                        if i == 0 {
                            path.move_to(point(*at))
                        } else {
                            path.line_to(point(*at))
                        };
                    }
                    let dash = [DASH as f32; 2];
                    let mut stroke = Stroke::new(*width as f32);
                    stroke.join(Join::Round).cap(Cap::Butt);
                    if *dashed {
                        stroke.dash(&dash, 0.0);
                    }
                    text::paint(Mask::new(&path).style(stroke), &mut ink);
                }
                FigureShape::Disc { at, radius } => {
                    path.add_circle(point(*at), *radius as f32);
                    text::paint(&Mask::new(&path), &mut ink);
                }
                FigureShape::Bar(from, to) => {
                    let low = [from[0].min(to[0]), from[1].min(to[1])];
                    path.add_rect(point(low), (to[0] - from[0]).abs() as f32, (to[1] - from[1]).abs() as f32);
                    text::paint(&Mask::new(&path), &mut ink);
                }
                FigureShape::Image { picture: image, place, .. } => {
                    picture.stretch(image, place.map(|v| v.round() as usize));
                }
                FigureShape::Text { words, at: [x, y], em, left } => {
                    let x = *x as f32 - *left as f32 * text::width(words, *em as f32);
                    text::write(words, [x, (y + DOWN * em) as f32], *em as f32, ink);
                }
            }
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn svg_and_picture_show_the_same_shapes() {
        let mut figure = Figure::new([60.0, 40.0]);
        figure.line(&[[5.0, 5.0], [55.0, 5.0]], 3.0, COLOURS[0]);
        figure.dashes(&[[0.0, 10.0], [28.0, 10.0]], COLOURS[1]);
        figure.disc([10.0, 20.0], 4.0, COLOURS[2]);
        figure.bar([20.0, 30.0], [30.0, 22.0], COLOURS[3]);
        let mut image = Picture::new(2, 1);
        image.fill(1, 0, 1, 1, COLOURS[4]);
        figure.image(image, b"PNG", [40.0, 12.0, 10.0, 6.0]);
        figure.label("<a & b>", BODY, INK, [58.0, 34.0], 1.0);
        let svg = figure.svg();
        for part in [
            "points=\"5.00,5.00 55.00,5.00\"",
            "stroke-dasharray",
            "<circle cx=\"10.00\"",
            "y=\"22.00\" width=\"10.00\" height=\"8.00\"",
            "<image x=\"40\" y=\"12\" width=\"10\" height=\"6\"",
            ">&lt;a &amp; b&gt;</text>",
        ] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        let picture = figure.picture();
        let at = |x: usize, y: usize| [0, 1, 2].map(|c| picture.rgb[3 * (y * 60 + x) + c]);
        assert_eq!(at(30, 5), COLOURS[0]);
        assert!(at(3, 9) != [255; 3] && at(10, 9) == [255; 3], "a dash and a gap");
        assert_eq!([at(10, 20), at(25, 26), at(2, 38)], [COLOURS[2], COLOURS[3], [255; 3]]);
        assert_eq!([at(44, 15), at(45, 15)], [super::super::picture::BACKGROUND, COLOURS[4]]);
        assert!((30..58).any(|x| at(x, 34) != [255; 3]), "text ends at the right");
        // An empty figure renders empty.
        let mut empty = Figure::new([3.0, 3.0]);
        empty.line(&[], 1.0, INK);
        empty.line(&[[1.0, 1.0]], 1.0, INK);
        assert!(empty.picture().rgb.len() == 27);
    }
}
