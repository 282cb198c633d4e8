//! A scene as PDF 1.7, with the typeface embedded and its text selectable.
//!
//! A figure needs nine kinds of PDF objects, which is so little that using a crate for PDF would
//! save less than half of this module.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use ttf_parser::GlyphId;

use super::raster::{BOLD_FONT, REGULAR_FONT, glyph_advance, text_width, typeface};
use super::scene::{Anchor, Colour, Outline, PathSegment, Scene, SceneItem, Stroke, Text};
use super::svg::{format_pixels, halo_width, to_hundredths};
use sweep_files::PDF_START;

/// Points (1/72 in) to a pixel of the scene (1/96 in), as in CSS.
const POINTS_PER_PIXEL: f64 = 0.75;

/// The width of the line around neighbouring areas of a map, px. Basis: viewers smooth edges, which
/// leaves a seam between areas that only touch. Doubling it blurs the edges of cells.
const SEAM_WIDTH: f64 = 0.25;

/// Returns the scene as the bytes of a PDF document of one page. The same scene gives the same
/// bytes.
pub(crate) fn write_pdf(scene: &Scene) -> Vec<u8> {
    let mut page = Page::default();
    let width = format_pixels(scene.width * POINTS_PER_PIXEL);
    let height = format_pixels(scene.height * POINTS_PER_PIXEL);
    // Scenes have y downwards.
    let scale = POINTS_PER_PIXEL;
    page.add_operators(&format!("{scale} 0 0 -{scale} 0 {height} cm 1 j"));
    scene.items.iter().for_each(|item| page.add_item(item));
    let mut objects = Objects::default();
    let catalogue_object = objects.reserve();
    let pages_object = objects.reserve();
    let page_object = objects.reserve();
    let content_object = objects.add_stream("", page.operators.as_bytes());
    let font_entries: Vec<String> = page
        .glyphs
        .iter()
        .map(|(is_bold, glyphs)| {
            format!("/{} {} 0 R", font_name(*is_bold), objects.add_font(*is_bold, glyphs))
        })
        .collect();
    let graphics_states = page.alphas.iter().map(|alpha| {
        let opacity = format_pixels(f64::from(*alpha) / 255.0);
        format!("/A{alpha} << /ca {opacity} /CA {opacity} >>")
    });
    let graphics_states: Vec<String> = graphics_states.collect();
    objects
        .set_object(catalogue_object, &format!("<< /Type /Catalog /Pages {pages_object} 0 R >>"));
    objects.set_object(
        pages_object,
        &format!("<< /Type /Pages /Kids [{page_object} 0 R] /Count 1 >>"),
    );
    objects.set_object(
        page_object,
        &format!(
            "<< /Type /Page /Parent {pages_object} 0 R /MediaBox [0 0 {width} {height}] /Contents \
             {content_object} 0 R /Resources << /Font << {} >> /ExtGState << {} >> >> >>",
            font_entries.join(" "),
            graphics_states.join(" ")
        ),
    );
    let title = hexadecimal_utf_16(&scene.description);
    let information_object =
        objects.add_object(&format!("<< /Title <FEFF{title}> /Producer (sweep plot) >>"));
    objects.finish(catalogue_object, information_object)
}

/// Returns the name of the plain or the bold font in the page's resources.
const fn font_name(is_bold: bool) -> &'static str {
    if is_bold { "F1" } else { "F0" }
}

/// The content of a page, and the resources that it refers to.
#[derive(Default)]
struct Page {
    operators: String,
    /// The glyphs that are used of the plain and of the bold font, with their letters.
    glyphs: BTreeMap<bool, BTreeMap<u16, char>>,
    alphas: BTreeSet<u8>,
}

impl Page {
    /// Adds a line of operators.
    fn add_operators(&mut self, operators: &str) {
        self.operators.push_str(operators);
        self.operators.push('\n');
    }

    fn add_item(&mut self, item: &SceneItem) {
        match item {
            SceneItem::Fill { outline, colour, is_crisp } => {
                self.set_colour(*colour);
                let mut fill_operator = "f";
                if *is_crisp && colour.alpha == 255 {
                    self.add_operators(&format!("[] 0 d {} w", format_pixels(SEAM_WIDTH)));
                    fill_operator = "B";
                }
                self.add_path(outline, fill_operator);
            }
            SceneItem::Line { outline, stroke } => {
                let Stroke { colour, width, dash } = stroke;
                self.set_colour(*colour);
                let dash: Vec<String> = dash.iter().map(|length| format_pixels(*length)).collect();
                self.add_operators(&format!(
                    "[{}] 0 d {} w",
                    dash.join(" "),
                    format_pixels(*width)
                ));
                self.add_path(outline, "S");
            }
            SceneItem::Text(text) => self.add_text(text),
            SceneItem::Clip(outline) => {
                self.add_operators("q");
                if outline.0.is_empty() {
                    self.add_operators("0 0 0 0 re");
                }
                self.add_path(outline, "W n");
            }
            SceneItem::Unclip => self.add_operators("Q"),
        }
    }

    /// Sets the colour of areas and lines.
    fn set_colour(&mut self, colour: Colour) {
        self.alphas.insert(colour.alpha);
        let format_component = |value: u8| format!("{:.4}", f64::from(value) / 255.0);
        let [r, g, b] = colour.rgb.map(format_component);
        self.add_operators(&format!("/A{} gs {r} {g} {b} rg {r} {g} {b} RG", colour.alpha));
    }

    /// Adds an outline and the operator that paints it.
    fn add_path(&mut self, outline: &Outline, operator: &str) {
        let mut start_point = [0; 2];
        let mut current_point = start_point;
        for segment in &outline.0 {
            match *segment {
                PathSegment::Move(point) => {
                    current_point = to_hundredths(point);
                    start_point = current_point;
                    let _ = write!(self.operators, "{} m ", format_point(current_point));
                }
                PathSegment::Line(point) => {
                    // Most points of a long history have the same position as the one before.
                    let next_point = to_hundredths(point);
                    if next_point != current_point {
                        let _ = write!(self.operators, "{} l ", format_point(next_point));
                    }
                    current_point = next_point;
                }
                PathSegment::Close => {
                    self.operators.push_str("h ");
                    current_point = start_point;
                }
            }
        }
        self.add_operators(operator);
    }

    fn add_text(&mut self, text: &Text) {
        let font_face = typeface(text.is_bold);
        let glyphs = self.glyphs.entry(text.is_bold).or_default();
        let mut glyph_codes = String::new();
        for letter in text.text.chars() {
            let GlyphId(glyph) = font_face.glyph_index(letter).unwrap_or_default();
            glyphs.insert(glyph, letter);
            let _ = write!(glyph_codes, "{glyph:04X}");
        }
        let width = text_width(&text.text, text.size, text.is_bold);
        let anchor_offset = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        };
        let [x, y] = text.position;
        let text_matrix = if text.is_rotated {
            format!("0 -1 -1 0 {} {}", format_pixels(x), format_pixels(y + anchor_offset))
        } else {
            format!("1 0 0 -1 {} {}", format_pixels(x - anchor_offset), format_pixels(y))
        };
        let size = format_pixels(text.size);
        let font = font_name(text.is_bold);
        let text_operators = format!("/{font} {size} Tf {text_matrix} Tm <{glyph_codes}> Tj ET");
        if let Some(halo) = text.halo {
            self.set_colour(halo);
            self.add_operators(&format!(
                "[] 0 d {} w BT 1 Tr {text_operators}",
                format_pixels(halo_width(text.size))
            ));
        }
        self.set_colour(text.colour);
        self.add_operators(&format!("BT 0 Tr {text_operators}"));
    }
}

/// Returns a position in hundredths of a pixel as two numbers of pixels.
fn format_point(hundredths: [i64; 2]) -> String {
    let [x, y] = hundredths.map(|value| format_pixels(value as f64 / 100.0));
    format!("{x} {y}")
}

/// The objects of a document, numbered from 1.
#[derive(Default)]
struct Objects(Vec<Vec<u8>>);

impl Objects {
    /// Returns the number of an object whose content follows later.
    fn reserve(&mut self) -> usize {
        self.0.push(Vec::new());
        self.0.len()
    }

    fn set_object(&mut self, number: usize, content: &str) {
        self.0[number - 1] = content.as_bytes().to_vec();
    }

    /// Adds an object and returns its number.
    fn add_object(&mut self, content: &str) -> usize {
        self.0.push(content.as_bytes().to_vec());
        self.0.len()
    }

    /// Adds a compressed stream with further entries and returns its number.
    fn add_stream(&mut self, entries: &str, bytes: &[u8]) -> usize {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        // Writing to memory cannot fail.
        let _ = encoder.write_all(bytes);
        let compressed_bytes = encoder.finish().unwrap_or_default();
        let compressed_length = compressed_bytes.len();
        let mut object =
            format!("<< /Filter /FlateDecode {entries}/Length {compressed_length} >>\nstream\n")
                .into_bytes();
        object.extend(compressed_bytes);
        object.extend(b"\nendstream");
        self.0.push(object);
        self.0.len()
    }

    /// Adds the plain or the bold font with the widths and letters of its glyphs; returns the
    /// number of its object.
    fn add_font(&mut self, is_bold: bool, glyphs: &BTreeMap<u16, char>) -> usize {
        let font_face = typeface(is_bold);
        let units = f64::from(font_face.units_per_em());
        let to_thousandths = |value: f64| (1000.0 * value / units).round() as i64;
        let font_bytes = if is_bold { BOLD_FONT } else { REGULAR_FONT };
        let font_file = self.add_stream(&format!("/Length1 {} ", font_bytes.len()), font_bytes);
        let name = if is_bold { "SWEEPP+NotoSans-Bold" } else { "SWEEPP+NotoSans-Regular" };
        let bounds = font_face.global_bounding_box();
        let [left, bottom, right, top] = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max]
            .map(|value| to_thousandths(f64::from(value)));
        let ascent = to_thousandths(f64::from(font_face.ascender()));
        let descent = to_thousandths(f64::from(font_face.descender()));
        let capital_height = font_face.capital_height().unwrap_or(font_face.ascender());
        let capital_height = to_thousandths(f64::from(capital_height));
        let font_descriptor = self.add_object(&format!(
            "<< /Type /FontDescriptor /FontName /{name} /Flags 4 /FontBBox [{left} {bottom} \
             {right} {top}] /ItalicAngle 0 /Ascent {ascent} /Descent {descent} /CapHeight \
             {capital_height} /StemV {} /FontFile2 {font_file} 0 R >>",
            if is_bold { 140 } else { 80 }
        ));
        let mut width_entries = String::new();
        let mut character_entries = String::new();
        for (glyph, letter) in glyphs {
            let width = to_thousandths(f64::from(glyph_advance(font_face, *letter)));
            let _ = write!(width_entries, "{glyph} [{width}] ");
            let code = hexadecimal_utf_16(&letter.to_string());
            let _ = writeln!(character_entries, "1 beginbfchar <{glyph:04X}> <{code}> endbfchar");
        }
        let descendant_font = self.add_object(&format!(
            "<< /Type /Font /Subtype /CIDFontType2 /BaseFont /{name} /CIDSystemInfo << /Registry \
             (Adobe) /Ordering (Identity) /Supplement 0 >> /FontDescriptor {font_descriptor} 0 R \
             /CIDToGIDMap /Identity /DW 0 /W [{width_entries}] >>"
        ));
        let character_map = format!(
            "/CIDInit /ProcSet findresource begin\n12 dict begin\nbegincmap\n/CIDSystemInfo << \
             /Registry (Adobe) /Ordering (UCS) /Supplement 0 >> def\n/CMapName \
             /Adobe-Identity-UCS def\n/CMapType 2 def\n1 begincodespacerange <0000> <FFFF> \
             endcodespacerange\n{character_entries}endcmap\nCMapName currentdict /CMap \
             defineresource pop\nend\nend\n"
        );
        let character_map = self.add_stream("", character_map.as_bytes());
        self.add_object(&format!(
            "<< /Type /Font /Subtype /Type0 /BaseFont /{name} /Encoding /Identity-H \
             /DescendantFonts [{descendant_font} 0 R] /ToUnicode {character_map} 0 R >>"
        ))
    }

    /// Returns the document: the objects, and the table of their positions.
    fn finish(self, catalogue_object: usize, information_object: usize) -> Vec<u8> {
        let mut bytes = PDF_START.to_vec();
        let mut offset_table = String::new();
        for (k, object) in self.0.iter().enumerate() {
            // Every entry of the table has 20 bytes.
            let _ = writeln!(offset_table, "{:010} 00000 n ", bytes.len());
            bytes.extend(format!("{} 0 obj\n", k + 1).bytes());
            bytes.extend(object);
            bytes.extend(b"\nendobj\n");
        }
        let table_offset = bytes.len();
        let object_count = self.0.len() + 1;
        let trailer = format!(
            "xref\n0 {object_count}\n0000000000 65535 f \n{offset_table}trailer\n<< \
             /Size {object_count} /Root {catalogue_object} 0 R /Info {information_object} 0 R \
             >>\nstartxref\n{table_offset}\n%%EOF\n"
        );
        bytes.extend(trailer.bytes());
        bytes
    }
}

/// Returns the UTF-16 code units of a text in hexadecimal digits.
fn hexadecimal_utf_16(text: &str) -> String {
    text.encode_utf16().map(|unit| format!("{unit:04X}")).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::ZlibDecoder;

    use super::*;
    use crate::scene::INK;

    fn test_scene() -> Scene {
        let mut scene = Scene::new(200.0, 100.0, "a test & more");
        let area = Outline::rectangle(10.0, 10.0, 50.0, 20.0);
        scene.fill_crisply(area.clone(), Colour::hex(0x336699));
        scene.draw_clipped(area, |scene| {
            let line = Outline::line(&[[0.0, 0.0], [0.001, 0.0], [60.0, 40.0]]);
            scene.draw_line(line, Stroke::new_dashed(INK.with_alpha(128), 1.5, &[4.0, 2.0]));
        });
        scene.draw_text(Text::new("Ω (x)", [20.0, 80.0], 12.0).with_bold_face());
        scene.draw_text(
            Text::new("yaw", [20.0, 80.0], 12.0).with_rotation().with_anchor(Anchor::Middle),
        );
        scene
    }

    /// Returns the unpacked streams.
    fn unpack_streams(document: &[u8]) -> Vec<Vec<u8>> {
        let find_pattern = |offset: usize, pattern: &[u8]| {
            document[offset..]
                .windows(pattern.len())
                .position(|window| window == pattern)
                .map(|start| offset + start)
        };
        let mut contents = Vec::new();
        let mut offset = 0;
        while let Some(stream_start) = find_pattern(offset, b">>\nstream\n") {
            let stream_start = stream_start + 10;
            let stream_end = find_pattern(stream_start, b"\nendstream").unwrap();
            let mut unpacked_bytes = Vec::new();
            ZlibDecoder::new(&document[stream_start..stream_end])
                .read_to_end(&mut unpacked_bytes)
                .unwrap();
            contents.push(unpacked_bytes);
            offset = stream_end;
        }
        contents
    }

    #[test]
    fn every_object_is_at_its_position_in_the_table() {
        let document = write_pdf(&test_scene());
        let text = String::from_utf8_lossy(&document);
        let table = text.rfind("xref\n0 ").unwrap();
        let entries = text[table..].lines().skip(2).filter(|line| line.ends_with(" 00000 n "));
        let mut count = 0;
        for (k, entry) in entries.enumerate() {
            let offset: usize = entry[..10].parse().unwrap();
            assert!(document[offset..].starts_with(format!("{} 0 obj\n", k + 1).as_bytes()));
            count += 1;
        }
        assert!(count > 10, "{count}");
        let start = document.windows(10).rposition(|window| window == b"startxref\n").unwrap();
        let offset: usize = String::from_utf8_lossy(&document[start + 10..])
            .lines()
            .next()
            .unwrap()
            .parse()
            .unwrap();
        assert!(document[offset..].starts_with(b"xref\n"));
        assert_eq!(document, write_pdf(&test_scene()));
    }

    #[test]
    fn shapes_and_letters_are_in_the_page() {
        let document = write_pdf(&test_scene());
        let streams = unpack_streams(&document);
        let page = String::from_utf8_lossy(&streams[0]).into_owned();
        for operators in [
            "0.75 0 0 -0.75 0 75 cm",
            "10 10 m 60 10 l 60 30 l 10 30 l h B",
            "10 10 m 60 10 l 60 30 l 10 30 l h W n",
            // A point with the same position as the one before is omitted.
            "[4 2] 0 d 1.5 w\n0 0 m 60 40 l S",
            "/A128 gs",
        ] {
            assert!(page.contains(operators), "{operators}: {page}");
        }
        let count_matches = |pattern: &str| page.matches(pattern).count();
        assert_eq!((count_matches("q\n"), count_matches("Q\n")), (1, 1));
        // Both weights of the typeface are embedded, with the letters that their glyphs show.
        assert!(streams.iter().any(|stream| stream == BOLD_FONT));
        assert!(streams.iter().any(|stream| stream == REGULAR_FONT));
        let character_maps = streams.iter().map(|stream| String::from_utf8_lossy(stream));
        let character_maps: Vec<_> =
            character_maps.filter(|map| map.contains("begincmap")).collect();
        assert_eq!(character_maps.len(), 2);
        assert!(character_maps.iter().any(|map| map.contains("<03A9>")), "{character_maps:?}");
    }
}
