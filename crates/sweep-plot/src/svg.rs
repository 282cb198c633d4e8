//! SVG output of a scene.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::scene::{Anchor, Colour, Outline, PathSegment, Scene, SceneItem, Stroke, Text};

/// The font families in order of preference; PNG output has the first, which is built in.
const FONT_FAMILIES: &str = "'Noto Sans', 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";

/// Writes a scene as an SVG document. The same scene gives the same bytes.
pub(crate) fn write_svg(scene: &Scene) -> String {
    let mut svg = String::new();
    let width = format_pixels(scene.width);
    let height = format_pixels(scene.height);
    let size_attributes =
        format!(r#"width="{width}" height="{height}" viewBox="0 0 {width} {height}""#);
    let role_attributes = format!(r#"role="img" font-family="{FONT_FAMILIES}""#);
    // Writing to a string cannot fail, so that the results below are ignored.
    let _ = writeln!(
        svg,
        r#"<svg xmlns="http://www.w3.org/2000/svg" {size_attributes} {role_attributes}>"#
    );
    let _ = writeln!(svg, "<title>{}</title>", escape(&scene.description));
    let clip_ids = write_clips(&mut svg, scene);
    for item in &scene.items {
        match item {
            SceneItem::Fill { outline, colour, is_crisp } => {
                let rendering_attribute =
                    if *is_crisp { r#" shape-rendering="crispEdges""# } else { "" };
                let segment_data = path_data(outline);
                let fill_attributes = paint_attributes("fill", *colour);
                let _ = writeln!(
                    svg,
                    r#"<path d="{segment_data}"{fill_attributes}{rendering_attribute}/>"#
                );
            }
            SceneItem::Line { outline, stroke } => {
                let segment_data = path_data(outline);
                let style = stroke_style(stroke);
                let _ = writeln!(svg, r#"<path d="{segment_data}" fill="none"{style}/>"#);
            }
            SceneItem::Text(text) => write_text(&mut svg, text),
            SceneItem::Clip(outline) => {
                let _ =
                    writeln!(svg, r##"<g clip-path="url(#c{})">"##, clip_ids[&path_data(outline)]);
            }
            SceneItem::Unclip => svg.push_str("</g>\n"),
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// Writes the definition of each clip outline once. Returns their numbers by outline.
fn write_clips(svg: &mut String, scene: &Scene) -> BTreeMap<String, usize> {
    let mut clip_ids = BTreeMap::new();
    for item in &scene.items {
        let SceneItem::Clip(outline) = item else { continue };
        let segment_data = path_data(outline);
        if !clip_ids.contains_key(&segment_data) {
            let clip_id = clip_ids.len();
            let _ =
                writeln!(svg, r#"<clipPath id="c{clip_id}"><path d="{segment_data}"/></clipPath>"#);
            clip_ids.insert(segment_data, clip_id);
        }
    }
    clip_ids
}

fn write_text(svg: &mut String, text: &Text) {
    let x = format_pixels(text.position[0]);
    let y = format_pixels(text.position[1]);
    let position_attributes = if text.is_rotated {
        format!(r#"transform="translate({x} {y}) rotate(-90)""#)
    } else {
        format!(r#"x="{x}" y="{y}""#)
    };
    let anchor_attribute = match text.anchor {
        Anchor::Start => "",
        Anchor::Middle => r#" text-anchor="middle""#,
        Anchor::End => r#" text-anchor="end""#,
    };
    let weight_attribute = if text.is_bold { r#" font-weight="bold""# } else { "" };
    let font_size = format_pixels(text.size);
    let halo = text.halo.map_or(String::new(), |colour| {
        let stroke = paint_attributes("stroke", colour);
        let width = format_pixels(halo_width(text.size));
        format!(r#"{stroke} stroke-width="{width}" stroke-linejoin="round" paint-order="stroke""#)
    });
    let fill = paint_attributes("fill", text.colour);
    let escaped_text = escape(&text.text);
    let text_attributes =
        format!(r#"font-size="{font_size}"{weight_attribute}{anchor_attribute}{fill}{halo}"#);
    let _ = writeln!(svg, "<text {position_attributes} {text_attributes}>{escaped_text}</text>");
}

/// Greatest coordinate that is written, px; positions beyond are moved there. Basis: far outside of
/// any picture, and differences of two fit an integer.
const MAX_COORDINATE: f64 = 1e7;

/// Returns the width of the outline behind letters of this size, px.
pub(crate) fn halo_width(size: f64) -> f64 {
    0.3 * size
}

fn paint_attributes(attribute: &str, colour: Colour) -> String {
    let mut attributes = format!(r#" {attribute}="{}""#, colour.css());
    if colour.alpha < 255 {
        let opacity = format_pixels(f64::from(colour.alpha) / 255.0);
        let _ = write!(attributes, r#" {attribute}-opacity="{opacity}""#);
    }
    attributes
}

fn stroke_style(stroke: &Stroke) -> String {
    let paint = paint_attributes("stroke", stroke.colour);
    let width = format_pixels(stroke.width);
    let mut style = format!(r#"{paint} stroke-width="{width}" stroke-linejoin="round""#);
    if !stroke.dash.is_empty() {
        let dash: Vec<String> = stroke.dash.iter().map(|&length| format_pixels(length)).collect();
        let _ = write!(style, r#" stroke-dasharray="{}""#, dash.join(" "));
    }
    style
}

/// Returns path data with relative steps, which are shorter: a transient has thousands of them.
fn path_data(outline: &Outline) -> String {
    let mut data = String::new();
    // Positions are rounded to hundredths of a pixel before differences are taken, so that rounding
    // does not add up.
    let mut current_point = [0_i64; 2];
    let mut start_point = [0_i64; 2];
    for segment in &outline.0 {
        match *segment {
            PathSegment::Move(point) => {
                current_point = to_hundredths(point);
                start_point = current_point;
                let _ = write!(
                    data,
                    "M{} {}",
                    format_hundredths(current_point[0]),
                    format_hundredths(current_point[1])
                );
            }
            PathSegment::Line(point) => {
                let next_point = to_hundredths(point);
                let [dx, dy] = [next_point[0] - current_point[0], next_point[1] - current_point[1]];
                data += &match (format_hundredths(dx), format_hundredths(dy)) {
                    (dx, _) if dy == 0 => format!("h{dx}"),
                    (_, dy) if dx == 0 => format!("v{dy}"),
                    (dx, dy) if dy.starts_with('-') => format!("l{dx}{dy}"),
                    (dx, dy) => format!("l{dx} {dy}"),
                };
                current_point = next_point;
            }
            PathSegment::Close => {
                data.push('z');
                current_point = start_point;
            }
        }
    }
    data
}

pub(crate) fn to_hundredths(point: [f64; 2]) -> [i64; 2] {
    // A file's values may lie anywhere; their differences must fit an integer.
    point.map(|value| (value.clamp(-MAX_COORDINATE, MAX_COORDINATE) * 100.0).round() as i64)
}

/// Writes hundredths as a decimal number without needless characters.
fn format_hundredths(hundredths: i64) -> String {
    let sign = if hundredths < 0 { "-" } else { "" };
    let integer_part = hundredths.unsigned_abs() / 100;
    let fraction = hundredths.unsigned_abs() % 100;
    let integer_part =
        if integer_part == 0 && fraction > 0 { String::new() } else { integer_part.to_string() };
    let fraction = format!(".{fraction:02}");
    format!("{sign}{integer_part}{}", fraction.trim_end_matches(['0', '.']))
}

/// Writes a number of pixels to a hundredth.
pub(crate) fn format_pixels(value: f64) -> String {
    format_hundredths((value * 100.0).round() as i64)
}

/// Escapes text for XML character data.
pub fn escape(text: &str) -> String {
    let mut escaped_text = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped_text.push_str("&amp;"),
            '<' => escaped_text.push_str("&lt;"),
            '>' => escaped_text.push_str("&gt;"),
            '"' => escaped_text.push_str("&quot;"),
            // XML 1.0 allows no control characters, not even escaped ones.
            letter if letter.is_control() => escaped_text.push(' '),
            letter => escaped_text.push(letter),
        }
    }
    escaped_text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_a_hundredth() {
        for (value, text) in [
            (0.0, "0"),
            (12.0, "12"),
            (0.5, ".5"),
            (-0.25, "-.25"),
            (3.104, "3.1"),
            (-7.006, "-7.01"),
            (0.05, ".05"),
        ] {
            assert_eq!(format_pixels(value), text);
        }
    }

    #[test]
    fn rounding_does_not_accumulate_along_a_path() {
        let points: Vec<[f64; 2]> = (0..1000).map(|k| [f64::from(k) * 0.333_33, 1.0]).collect();
        let data = path_data(&Outline::line(&points));
        let step_sum: f64 = data[data.find('h').unwrap() + 1..]
            .split('h')
            .map(|step| step.parse::<f64>().unwrap())
            .sum();
        assert!((step_sum - 999.0 * 0.333_33).abs() < 0.011, "{step_sum}");
    }

    #[test]
    fn positions_far_outside_are_clamped() {
        let line = Outline::line(&[[f64::MIN, 0.5], [f64::MAX, 1.0], [f64::MIN, f64::MAX]]);
        assert_eq!(path_data(&line), "M-10000000 .5l20000000 .5l-20000000 9999999");
    }

    #[test]
    fn text_is_escaped() {
        assert_eq!(escape("a<b & \"c\"\u{1}"), "a&lt;b &amp; &quot;c&quot; ");
    }
}
