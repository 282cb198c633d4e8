//! PNG output of a scene. The typeface is part of the program, so that the picture is the same on
//! every machine.

use std::sync::LazyLock;

use tiny_skia::{
    FillRule, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform,
};
use ttf_parser::{Face, OutlineBuilder};

use super::error::{PlotError, Result};
use super::scene::{Anchor, Colour, Outline, PathSegment, Scene, SceneItem, Stroke, Text};
use super::svg::halo_width;

/// The typeface of plain text.
pub(crate) const REGULAR_FONT: &[u8] = include_bytes!("fonts/NotoSans-Regular.subset.ttf");
/// The typeface of bold text.
pub(crate) const BOLD_FONT: &[u8] = include_bytes!("fonts/NotoSans-Bold.subset.ttf");

/// Returns the typeface of bold or plain text.
pub(crate) fn typeface(is_bold: bool) -> &'static Face<'static> {
    /// The parsed typefaces, plain and bold.
    static FACES: LazyLock<[Face<'static>; 2]> = LazyLock::new(|| {
        [REGULAR_FONT, BOLD_FONT]
            .map(|font| Face::parse(font, 0).expect("the built-in font is valid"))
    });
    &FACES[usize::from(is_bold)]
}

/// Returns the width of `text` in type `size` px high, px.
pub(crate) fn text_width(text: &str, size: f64, is_bold: bool) -> f64 {
    let face = typeface(is_bold);
    let advance_sum: u32 = text.chars().map(|letter| u32::from(glyph_advance(face, letter))).sum();
    f64::from(advance_sum) * size / f64::from(face.units_per_em())
}

pub(crate) fn glyph_advance(face: &Face<'_>, letter: char) -> u16 {
    let glyph = face.glyph_index(letter).unwrap_or_default();
    face.glyph_hor_advance(glyph).unwrap_or_default()
}

/// Encodes a scene as a PNG file with `scale` image pixels per scene pixel.
///
/// # Errors
/// [`PlotError::Drawing`] if the image would be too large to hold.
pub(crate) fn write_png(scene: &Scene, scale: f64) -> Result<Vec<u8>> {
    let size_px = [(scene.width * scale).ceil() as u32, (scene.height * scale).ceil() as u32];
    let size_error = || {
        PlotError::Drawing(format!(
            "no room for an image of {} by {} pixels",
            size_px[0], size_px[1]
        ))
    };
    let mut canvas = Canvas {
        pixmap: Pixmap::new(size_px[0], size_px[1]).ok_or_else(size_error)?,
        transform: Transform::from_scale(scale as f32, scale as f32),
        clip_masks: Vec::new(),
    };
    for item in &scene.items {
        match item {
            SceneItem::Fill { outline, colour, is_crisp } => {
                canvas.fill_outline(outline, *colour, !is_crisp)
            }
            SceneItem::Line { outline, stroke } => canvas.draw_line(outline, stroke),
            SceneItem::Text(text) => canvas.draw_text(text),
            SceneItem::Clip(outline) => {
                let mask = canvas.intersect_clip(outline).ok_or_else(size_error)?;
                canvas.clip_masks.push(mask);
            }
            SceneItem::Unclip => {
                canvas.clip_masks.pop();
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
    clip_masks: Vec<Mask>,
}

impl Canvas {
    fn fill_outline(&mut self, outline: &Outline, colour: Colour, anti_alias: bool) {
        if let Some(path) = skia_path(outline) {
            let paint = skia_paint(colour, anti_alias);
            let clip_mask = self.clip_masks.last();
            self.pixmap.fill_path(&path, &paint, FillRule::Winding, self.transform, clip_mask);
        }
    }

    fn draw_line(&mut self, outline: &Outline, stroke: &Stroke) {
        if let Some(path) = skia_path(outline) {
            let dash = stroke.dash.iter().map(|&length| length as f32).collect();
            let skia_stroke = tiny_skia::Stroke {
                dash: StrokeDash::new(dash, 0.0),
                ..solid_stroke(stroke.width)
            };
            let paint = skia_paint(stroke.colour, true);
            self.pixmap.stroke_path(
                &path,
                &paint,
                &skia_stroke,
                self.transform,
                self.clip_masks.last(),
            );
        }
    }

    fn intersect_clip(&self, outline: &Outline) -> Option<Mask> {
        let mut mask = match self.clip_masks.last() {
            Some(outer) => outer.clone(),
            None => {
                let mut full_mask = Mask::new(self.pixmap.width(), self.pixmap.height())?;
                full_mask.data_mut().fill(255);
                full_mask
            }
        };
        match skia_path(outline) {
            Some(path) => mask.intersect_path(&path, FillRule::Winding, true, self.transform),
            None => mask.data_mut().fill(0),
        }
        Some(mask)
    }

    fn draw_text(&mut self, text: &Text) {
        let face = typeface(text.is_bold);
        let scale = (text.size / f64::from(face.units_per_em())) as f32;
        let width = text_width(&text.text, text.size, text.is_bold) as f32;
        let mut pen = GlyphPen { builder: PathBuilder::new(), x: 0.0, scale };
        pen.x = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        for letter in text.text.chars() {
            face.outline_glyph(face.glyph_index(letter).unwrap_or_default(), &mut pen);
            pen.x += f32::from(glyph_advance(face, letter)) * scale;
        }
        let Some(path) = pen.builder.finish() else { return };
        let translation =
            Transform::from_translate(text.position[0] as f32, text.position[1] as f32);
        let rotation = if text.is_rotated {
            Transform::from_row(0.0, -1.0, 1.0, 0.0, 0.0, 0.0)
        } else {
            Transform::identity()
        };
        let transform = self.transform.pre_concat(translation).pre_concat(rotation);
        let clip_mask = self.clip_masks.last();
        if let Some(halo) = text.halo {
            let style = solid_stroke(halo_width(text.size));
            self.pixmap.stroke_path(&path, &skia_paint(halo, true), &style, transform, clip_mask);
        }
        self.pixmap.fill_path(
            &path,
            &skia_paint(text.colour, true),
            FillRule::Winding,
            transform,
            clip_mask,
        );
    }
}

/// Returns a solid line of this width, px.
fn solid_stroke(width: f64) -> tiny_skia::Stroke {
    let width = width as f32;
    let line_join = LineJoin::Round;
    tiny_skia::Stroke { width, line_join, ..tiny_skia::Stroke::default() }
}

fn skia_paint(colour: Colour, anti_alias: bool) -> Paint<'static> {
    let mut paint = Paint { anti_alias, ..Paint::default() };
    let [r, g, b] = colour.rgb;
    paint.set_color_rgba8(r, g, b, colour.alpha);
    paint
}

fn skia_path(outline: &Outline) -> Option<Path> {
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
struct GlyphPen {
    builder: PathBuilder,
    x: f32,
    scale: f32,
}

impl GlyphPen {
    fn to_pixels(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, -y * self.scale)
    }
}

impl OutlineBuilder for GlyphPen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.to_pixels(x, y);
        self.builder.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.to_pixels(x, y);
        self.builder.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.to_pixels(x1, y1), self.to_pixels(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) =
            (self.to_pixels(x1, y1), self.to_pixels(x2, y2), self.to_pixels(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}
