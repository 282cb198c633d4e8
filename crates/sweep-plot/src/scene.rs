//! A scene: the shapes and texts of a figure in pixels from the top left corner, drawn once and
//! written as SVG, PDF or PNG.

use super::axis::extremes;

/// An opaque or translucent colour, sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colour {
    /// The red, green and blue components.
    pub rgb: [u8; 3],
    /// The opacity; 255 is opaque.
    pub alpha: u8,
}

impl Colour {
    /// Returns an opaque colour written as in CSS, `0xrrggbb`.
    pub const fn hex(rrggbb: u32) -> Self {
        Self { rgb: [(rrggbb >> 16) as u8, (rrggbb >> 8) as u8, rrggbb as u8], alpha: 255 }
    }

    /// Returns the colour with this opacity; 255 is opaque.
    pub const fn with_alpha(self, alpha: u8) -> Self {
        Self { alpha, ..self }
    }

    /// Returns the colour that results from drawing this colour over an opaque one.
    pub fn over(self, under: Self) -> Self {
        let opacity = f64::from(self.alpha) / 255.0;
        let [r, g, b] = [0, 1, 2].map(|k| {
            (opacity * f64::from(self.rgb[k]) + (1.0 - opacity) * f64::from(under.rgb[k])).round()
                as u8
        });
        Self { rgb: [r, g, b], alpha: 255 }
    }

    /// Returns the colour as in CSS, `#rrggbb`.
    pub fn css(self) -> String {
        let [r, g, b] = self.rgb;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// A segment of an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PathSegment {
    /// Starts a new part of the outline.
    Move([f64; 2]),
    Line([f64; 2]),
    /// Closes the part with a line to its start.
    Close,
}

/// An outline of any number of parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Outline(pub(crate) Vec<PathSegment>);

impl Outline {
    pub(crate) fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Self {
        let mut outline = Self::default();
        outline.add_rectangle(x, y, width, height);
        outline
    }

    /// Adds a rectangle as a closed part.
    pub(crate) fn add_rectangle(&mut self, x: f64, y: f64, width: f64, height: f64) {
        self.add_polygon(&[[x, y], [x + width, y], [x + width, y + height], [x, y + height]]);
    }

    /// Adds a closed part through the points.
    pub(crate) fn add_polygon(&mut self, points: &[[f64; 2]]) {
        self.add_line(points);
        self.0.push(PathSegment::Close);
    }

    /// Adds an open part through the points.
    pub(crate) fn add_line(&mut self, points: &[[f64; 2]]) {
        let mut points = points.iter().copied();
        self.0.extend(points.next().map(PathSegment::Move));
        self.0.extend(points.map(PathSegment::Line));
    }

    /// Returns an open line through the points.
    pub(crate) fn line(points: &[[f64; 2]]) -> Self {
        let mut outline = Self::default();
        outline.add_line(points);
        outline
    }

    /// Adds a line through each run of known points. Returns the isolated points, which no line
    /// shows.
    pub(crate) fn add_runs(&mut self, points: &[Option<[f64; 2]>]) -> Vec<[f64; 2]> {
        let mut isolated_points = Vec::new();
        for run in points.split(Option::is_none) {
            let run: Vec<[f64; 2]> = run.iter().copied().flatten().collect();
            match run[..] {
                [point] => isolated_points.push(point),
                _ => self.add_line(&run),
            }
        }
        isolated_points
    }

    /// Returns the outline, shifted.
    pub(crate) fn with_offset(&self, [dx, dy]: [f64; 2]) -> Self {
        let translate = |[x, y]: [f64; 2]| [x + dx, y + dy];
        let segments = self.0.iter().map(|segment| match *segment {
            PathSegment::Move(point) => PathSegment::Move(translate(point)),
            PathSegment::Line(point) => PathSegment::Line(translate(point)),
            PathSegment::Close => PathSegment::Close,
        });
        Self(segments.collect())
    }

    /// Returns a disc around `centre`.
    pub(crate) fn circle(centre: [f64; 2], radius: f64) -> Self {
        Self::polygon_around(centre, [radius; 16])
    }

    /// Returns a five-pointed star around `centre`, `radius` from centre to tip.
    pub(crate) fn star(centre: [f64; 2], radius: f64) -> Self {
        let [tip, notch] = [radius, 0.42 * radius];
        Self::polygon_around(centre, [tip, notch, tip, notch, tip, notch, tip, notch, tip, notch])
    }

    /// Returns a polygon around the centre: corners at equal angles and these distances, clockwise
    /// from the top.
    fn polygon_around<const N: usize>([centre_x, centre_y]: [f64; 2], distances: [f64; N]) -> Self {
        let mut outline = Self::default();
        let half_count = (N / 2) as f64;
        let corners: [[f64; 2]; N] = std::array::from_fn(|k| {
            let (sin, cos) = (std::f64::consts::PI * k as f64 / half_count).sin_cos();
            [centre_x + distances[k] * sin, centre_y - distances[k] * cos]
        });
        outline.add_polygon(&corners);
        outline
    }
}

/// The stroke of a line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stroke {
    pub(crate) colour: Colour,
    /// The width, px.
    pub(crate) width: f64,
    /// The lengths of dash and gap, px; empty for a solid line.
    pub(crate) dash: Vec<f64>,
}

impl Stroke {
    pub(crate) fn new_solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Vec::new() }
    }

    pub(crate) fn new_dashed(colour: Colour, width: f64, dash: &[f64]) -> Self {
        Self { colour, width, dash: dash.to_vec() }
    }
}

/// Slanted lines over an area.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hatch {
    /// The strokes of each line, drawn one over the other.
    pub(crate) strokes: Vec<Stroke>,
    /// The distance between two lines along x, px.
    pub(crate) spacing: f64,
    /// Whether lines fall to the right; otherwise they rise.
    pub(crate) is_falling: bool,
}

impl Hatch {
    /// Returns the hatch, drawn finer if areas of `width` by `height` px could lie between its
    /// lines.
    pub(crate) fn with_spacing_for(mut self, [width, height]: [f64; 2]) -> Self {
        // A line crosses an area at least once if the spacing is no larger than both sides.
        let finer_spacing = ((width + height) / 1.5).clamp(MIN_HATCH_SPACING, self.spacing);
        for stroke in &mut self.strokes {
            stroke.width *= finer_spacing / self.spacing;
        }
        self.spacing = finer_spacing;
        self
    }
}

/// Minimum spacing of a hatch, px. Basis: finer lines merge. Doubling it hides hatches of small
/// cells.
const MIN_HATCH_SPACING: f64 = 2.0;

/// The point of a text that is placed at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Text {
    pub(crate) text: String,
    /// The position of the anchor on the baseline, px.
    pub(crate) position: [f64; 2],
    /// The type size, px.
    pub(crate) size: f64,
    pub(crate) is_bold: bool,
    pub(crate) colour: Colour,
    pub(crate) anchor: Anchor,
    /// Whether the text reads upwards.
    pub(crate) is_rotated: bool,
    /// The colour of an outline that sets the text off from what is behind it.
    pub(crate) halo: Option<Colour>,
}

impl Text {
    /// Returns plain text in the ink colour.
    pub(crate) fn new(text: impl Into<String>, position: [f64; 2], size: f64) -> Self {
        Self {
            text: text.into(),
            position,
            size,
            is_bold: false,
            colour: INK,
            anchor: Anchor::Start,
            is_rotated: false,
            halo: None,
        }
    }

    /// Returns the text in bold type.
    pub(crate) fn with_bold_face(mut self) -> Self {
        self.is_bold = true;
        self
    }

    /// Returns the text with another anchor.
    pub(crate) fn with_anchor(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// Returns the text reading upwards.
    pub(crate) fn with_rotation(mut self) -> Self {
        self.is_rotated = true;
        self
    }
}

/// An item of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SceneItem {
    /// An outline filled by the non-zero rule.
    Fill {
        outline: Outline,
        colour: Colour,
        /// Whether edges lie on whole pixels, so that neighbours leave no seam.
        is_crisp: bool,
    },
    /// A drawn outline.
    Line {
        outline: Outline,
        stroke: Stroke,
    },
    Text(Text),
    /// Starts a clip: items until the matching `Unclip` are drawn within the outline alone.
    Clip(Outline),
    /// Ends the last clip.
    Unclip,
}

/// A figure as a list of shapes and texts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scene {
    /// The width, px.
    pub(crate) width: f64,
    /// The height, px.
    pub(crate) height: f64,
    /// A sentence that describes the picture to readers who cannot see it.
    pub(crate) description: String,
    /// The items in drawing order.
    pub(crate) items: Vec<SceneItem>,
}

/// The colour of letters and frames.
pub const INK: Colour = Colour::hex(0x1b1f24);
/// The colour of secondary text.
pub const MUTED_COLOUR: Colour = Colour::hex(0x57606a);
/// The colour of grid lines.
pub(crate) const FAINT_COLOUR: Colour = Colour::hex(0xd8dee4);
/// The colour of the background.
pub(crate) const PAPER: Colour = Colour::hex(0xffffff);

impl Scene {
    /// Returns an empty scene with a white background.
    pub(crate) fn new(width: f64, height: f64, description: impl Into<String>) -> Self {
        let mut scene = Self { width, height, description: description.into(), items: Vec::new() };
        scene.fill_outline(Outline::rectangle(0.0, 0.0, width, height), PAPER);
        scene
    }

    pub(crate) fn fill_outline(&mut self, outline: Outline, colour: Colour) {
        self.items.push(SceneItem::Fill { outline, colour, is_crisp: false });
    }

    /// Fills an outline whose edges lie on whole pixels.
    pub(crate) fn fill_crisply(&mut self, outline: Outline, colour: Colour) {
        self.items.push(SceneItem::Fill { outline, colour, is_crisp: true });
    }

    /// Draws the line of an outline.
    pub(crate) fn draw_line(&mut self, outline: Outline, stroke: Stroke) {
        self.items.push(SceneItem::Line { outline, stroke });
    }

    pub(crate) fn draw_text(&mut self, text: Text) {
        self.items.push(SceneItem::Text(text));
    }

    /// Draws the items of `draw` within `outline` alone.
    pub(crate) fn draw_clipped(&mut self, outline: Outline, draw: impl FnOnce(&mut Self)) {
        self.items.push(SceneItem::Clip(outline));
        draw(self);
        self.items.push(SceneItem::Unclip);
    }

    /// Fills `outline` with slanted lines.
    pub(crate) fn fill_with_hatch(&mut self, outline: Outline, hatch: &Hatch) {
        let spacing = hatch.spacing;
        let extent = |k: usize| {
            extremes(outline.0.iter().filter_map(|segment| match *segment {
                PathSegment::Move(point) | PathSegment::Line(point) => Some(point[k]),
                PathSegment::Close => None,
            }))
        };
        let Some(((left, right), (top, bottom))) = extent(0).zip(extent(1)) else { return };
        // Lines outside the scene are left out: a file's values could ask for any number of them.
        let [left, right] = [left, right].map(|x| x.clamp(0.0, self.width));
        let [top, bottom] = [top, bottom].map(|y| y.clamp(0.0, self.height));
        if left >= right || top >= bottom {
            return;
        }
        let height = bottom - top;
        let mut lines = Outline::default();
        // Lines lie on multiples of the spacing of x + y, or of x - y, so that hatches of
        // neighbouring shapes match.
        let (start_y, end_y, slope) =
            if hatch.is_falling { (bottom, top, -1.0) } else { (top, bottom, 1.0) };
        let mut x = ((left + slope * start_y) / spacing).ceil() * spacing - slope * start_y;
        while x < right + height {
            lines.add_line(&[[x, start_y], [x - height, end_y]]);
            x += spacing;
        }
        self.draw_clipped(outline, |scene| {
            for stroke in &hatch.strokes {
                scene.draw_line(lines.clone(), stroke.clone());
            }
        });
    }
}
