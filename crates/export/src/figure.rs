//! Plots as SVG and as pictures: `plotters` draws both from the same description.

use std::convert::Infallible;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::prelude::{FontStyle, SVGBackend, WHITE};
use plotters::style::{Color, RGBColor, TextStyle, register_font, text_anchor};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};

use super::picture::Picture;
use super::text;
use crate::error::{Error, Result};

/// Units of a drawing per pixel. `plotters` has whole coordinates: with one unit per pixel, curves would have steps,
/// and pictures would have ragged edges.
pub(super) const FINE: u32 = 3;

/// Colours that all plots share.
pub(super) const INK: RGBColor = RGBColor(40, 40, 46);
pub(super) const GRID: RGBColor = RGBColor(226, 226, 230);
pub(super) const FRAME: RGBColor = RGBColor(120, 120, 128);
/// Colours of curves. People with any kind of colour vision can tell the first seven apart (Okabe and Ito).
pub(super) const COLOURS: [RGBColor; 11] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(70, 70, 70),
    RGBColor(140, 90, 50),
    RGBColor(120, 60, 180),
    RGBColor(120, 180, 40),
    RGBColor(190, 20, 60),
];

/// Sizes of text, in pixels per em.
pub(super) const HEADING: u32 = 21;
pub(super) const TITLE: u32 = 16;
pub(super) const BODY: u32 = 14;

/// The names of the compiled-in font, and of fonts that replace it where an SVG is shown without it.
const FAMILY: &str = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif";
/// A font's size in `plotters`, over its em.
const EM: f64 = 1.24;

pub(super) type Area<B> = DrawingArea<B, Shift>;
pub(super) type Drawn<B> = std::result::Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// A target that `plotters` draws on.
pub trait Canvas: DrawingBackend<ErrorType: 'static> {}

impl<B: DrawingBackend<ErrorType: 'static>> Canvas for B {}

/// Something that can be drawn.
pub trait Figure {
    /// Width and height in pixels.
    fn size(&self) -> [u32; 2];

    /// Draws it on a white area of three times [`Figure::size`], because coordinates are whole numbers.
    fn draw<B: Canvas>(&self, area: &Area<B>) -> Drawn<B>;
}

/// The figure as SVG, text as text.
///
/// # Errors
/// `Kind::Output` if the figure cannot be drawn.
pub fn svg(figure: &impl Figure) -> Result<String> {
    let [w, h] = figure.size();
    let mut svg = String::new();
    let backend = SVGBackend::with_string(&mut svg, (FINE * w, FINE * h));
    draw(figure, backend)?;
    let fine = format!("width=\"{}\" height=\"{}\"", FINE * w, FINE * h);
    Ok(svg.replacen(&fine, &format!("width=\"{w}\" height=\"{h}\""), 1))
}

/// The figure as pixels, with smooth edges.
///
/// # Errors
/// `Kind::Output` if the figure cannot be drawn.
pub fn picture(figure: &impl Figure) -> Result<Picture> {
    let [w, h] = figure.size().map(|n| n as usize);
    let fine = FINE as usize;
    let mut large = Picture::new(fine * w, fine * h);
    draw(figure, Raster(&mut large))?;
    Ok(large.shrunk(fine))
}

fn draw<B: Canvas>(figure: &impl Figure, backend: B) -> Result<()> {
    static REGISTERED: Once = Once::new();
    REGISTERED.call_once(|| {
        // A font that cannot be used shows as an error of the first text.
        let _ = register_font(FAMILY, FontStyle::Normal, text::FONT);
    });
    let area = backend.into_drawing_area();
    let drawn = area.fill(&WHITE).and_then(|()| figure.draw(&area)).and_then(|()| area.present());
    drawn.map_err(|e| Error::output(format!("a plot cannot be drawn: {e}"), "report this as a bug"))
}

/// Pixels in the units of a drawing.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(FINE)).round() as i32
}

/// Text of `em` pixels per em.
pub(super) fn font(em: u32, colour: RGBColor) -> TextStyle<'static> {
    TextStyle { color: colour.to_backend_color(), ..(FAMILY, f64::from(em * FINE) * EM).into() }
}

/// Writes a line of text. It begins at `x`, and its middle is at `y`, in pixels.
pub(super) fn line_of_text<B: Canvas>(
    area: &Area<B>,
    words: &str,
    style: &TextStyle<'_>,
    [x, y]: [f64; 2],
) -> Drawn<B> {
    let left = text_anchor::Pos::new(text_anchor::HPos::Left, text_anchor::VPos::Center);
    area.draw_text(words, &style.pos(left), (px(x), px(y)))
}

/// A picture that `plotters` draws on.
struct Raster<'a>(&'a mut Picture);

type Done = std::result::Result<(), DrawingErrorKind<Infallible>>;

impl DrawingBackend for Raster<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width as u32, self.0.height as u32)
    }

    fn ensure_prepared(&mut self) -> Done {
        Ok(())
    }

    fn present(&mut self) -> Done {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Done {
        let (r, g, b) = colour.rgb;
        self.0.blend([x, y], [r, g, b], colour.alpha);
        Ok(())
    }

    /// Draws segment by segment with round joints. The outline of a whole path would have holes where it crosses
    /// itself.
    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Done {
        let mut last = None;
        for point in path {
            if let Some(last) = last {
                self.draw_line(last, point, style)?;
            }
            if style.stroke_width() > FINE {
                self.draw_circle(point, style.stroke_width() / 2, &style.color(), true)?;
            }
            last = Some(point);
        }
        Ok(())
    }

    /// Places text as the SVG backend does. The own text of `plotters` leaves out the blank at the left of each glyph,
    /// and it is a fifth of its size too high.
    fn draw_text<S: BackendTextStyle>(&mut self, words: &str, style: &S, (x, y): BackendCoord) -> Done {
        let em = (style.size() / EM) as f32;
        let left = match style.anchor().h_pos {
            text_anchor::HPos::Left => 0.0,
            text_anchor::HPos::Center => 0.5,
            text_anchor::HPos::Right => 1.0,
        } * text::width(words, em);
        let down = match style.anchor().v_pos {
            text_anchor::VPos::Top => 0.76,
            text_anchor::VPos::Center => 0.27,
            text_anchor::VPos::Bottom => -0.27,
        } * em;
        let (r, g, b) = style.color().rgb;
        self.0.write(words, [x as f32 - left, y as f32 + down], em, [r, g, b]);
        Ok(())
    }
}
