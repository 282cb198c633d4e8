//! PNG output of a scene. The typeface is part of the program, so that the picture is the same on
//! every machine.

use std::sync::LazyLock;

use tiny_skia::{
    FillRule, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform,
};
use ttf_parser::{Face, OutlineBuilder};

use super::error::{PlotError, Result};
use super::scene::{Anchor, Colour, Item, Outline, PathSegment, Scene, Stroke, Text};
use super::svg::halo_width;

/// The typeface of plain text.
const REGULAR: &[u8] = include_bytes!("fonts/NotoSans-Regular.subset.ttf");
/// The typeface of bold text.
const BOLD: &[u8] = include_bytes!("fonts/NotoSans-Bold.subset.ttf");

/// Returns the typeface of bold or plain text.
fn face(bold: bool) -> &'static Face<'static> {
    /// The parsed typefaces, plain and bold.
    static FACES: LazyLock<[Face<'static>; 2]> = LazyLock::new(|| {
        [REGULAR, BOLD].map(|font| Face::parse(font, 0).expect("the built-in font is valid"))
    });
    &FACES[usize::from(bold)]
}

/// Returns the width of `text` in type `size` px high, px.
pub(crate) fn text_width(text: &str, size: f64, bold: bool) -> f64 {
    let face = face(bold);
    let advances: u32 = text.chars().map(|letter| u32::from(advance(face, letter))).sum();
    f64::from(advances) * size / f64::from(face.units_per_em())
}

fn advance(face: &Face<'_>, letter: char) -> u16 {
    let glyph = face.glyph_index(letter).unwrap_or_default();
    face.glyph_hor_advance(glyph).unwrap_or_default()
}

/// Encodes a scene as a PNG file with `scale` image pixels per scene pixel.
///
/// # Errors
/// [`PlotError::Drawing`] if the image would be too large to hold.
pub(crate) fn write(scene: &Scene, scale: f64) -> Result<Vec<u8>> {
    let size = [(scene.width * scale).ceil() as u32, (scene.height * scale).ceil() as u32];
    let too_large =
        || PlotError::Drawing(format!("no room for an image of {} by {} pixels", size[0], size[1]));
    let mut canvas = Canvas {
        pixmap: Pixmap::new(size[0], size[1]).ok_or_else(too_large)?,
        transform: Transform::from_scale(scale as f32, scale as f32),
        clips: Vec::new(),
    };
    for item in &scene.items {
        match item {
            Item::Fill { outline, colour, crisp } => canvas.fill(outline, *colour, !crisp),
            Item::Line { outline, stroke } => canvas.line(outline, stroke),
            Item::Text(text) => canvas.text(text),
            Item::Clip(outline) => {
                let mask = canvas.clip(outline).ok_or_else(too_large)?;
                canvas.clips.push(mask);
            }
            Item::Unclip => {
                canvas.clips.pop();
            }
        }
    }
    canvas
        .pixmap
        .encode_png()
        .map_err(|error| PlotError::Drawing(format!("encoding the PNG: {error}")))
}

struct Canvas {
    pixmap: Pixmap,
    transform: Transform,
    clips: Vec<Mask>,
}

impl Canvas {
    fn fill(&mut self, outline: &Outline, colour: Colour, anti_alias: bool) {
        if let Some(path) = path(outline) {
            let paint = paint(colour, anti_alias);
            let clip = self.clips.last();
            self.pixmap.fill_path(&path, &paint, FillRule::Winding, self.transform, clip);
        }
    }

    fn line(&mut self, outline: &Outline, stroke: &Stroke) {
        if let Some(path) = path(outline) {
            let dash = stroke.dash.iter().map(|&length| length as f32).collect();
            let style =
                tiny_skia::Stroke { dash: StrokeDash::new(dash, 0.0), ..line(stroke.width) };
            let paint = paint(stroke.colour, true);
            self.pixmap.stroke_path(&path, &paint, &style, self.transform, self.clips.last());
        }
    }

    fn clip(&self, outline: &Outline) -> Option<Mask> {
        let mut mask = match self.clips.last() {
            Some(outer) => outer.clone(),
            None => {
                let mut all = Mask::new(self.pixmap.width(), self.pixmap.height())?;
                all.data_mut().fill(255);
                all
            }
        };
        match path(outline) {
            Some(path) => mask.intersect_path(&path, FillRule::Winding, true, self.transform),
            None => mask.data_mut().fill(0),
        }
        Some(mask)
    }

    fn text(&mut self, text: &Text) {
        let face = face(text.bold);
        let scale = (text.size / f64::from(face.units_per_em())) as f32;
        let width = text_width(&text.text, text.size, text.bold) as f32;
        let mut pen = Pen { builder: PathBuilder::new(), x: 0.0, scale };
        pen.x = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        for letter in text.text.chars() {
            face.outline_glyph(face.glyph_index(letter).unwrap_or_default(), &mut pen);
            pen.x += f32::from(advance(face, letter)) * scale;
        }
        let Some(path) = pen.builder.finish() else { return };
        let place = Transform::from_translate(text.at[0] as f32, text.at[1] as f32);
        let turn = if text.upright {
            Transform::from_row(0.0, -1.0, 1.0, 0.0, 0.0, 0.0)
        } else {
            Transform::identity()
        };
        let transform = self.transform.pre_concat(place).pre_concat(turn);
        let clip = self.clips.last();
        if let Some(halo) = text.halo {
            let style = line(halo_width(text.size));
            self.pixmap.stroke_path(&path, &paint(halo, true), &style, transform, clip);
        }
        self.pixmap.fill_path(&path, &paint(text.colour, true), FillRule::Winding, transform, clip);
    }
}

/// Returns a solid line of this width, px.
fn line(width: f64) -> tiny_skia::Stroke {
    let width = width as f32;
    let line_join = LineJoin::Round;
    tiny_skia::Stroke { width, line_join, ..tiny_skia::Stroke::default() }
}

fn paint(colour: Colour, anti_alias: bool) -> Paint<'static> {
    let mut paint = Paint { anti_alias, ..Paint::default() };
    let [r, g, b] = colour.rgb;
    paint.set_color_rgba8(r, g, b, colour.alpha);
    paint
}

fn path(outline: &Outline) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for segment in &outline.0 {
        match *segment {
            PathSegment::Move([x, y]) => builder.move_to(x as f32, y as f32),
            PathSegment::Line([x, y]) => builder.line_to(x as f32, y as f32),
            PathSegment::Close => builder.close(),
        }
    }
    builder.finish()
}

/// The collector of a glyph's outline, which comes in font units with y up.
struct Pen {
    builder: PathBuilder,
    x: f32,
    scale: f32,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, -y * self.scale)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}
