//! What a figure is made of, in pixels from the top left corner: drawn once, written as SVG or as
//! PNG.

use super::axis::extremes;

/// An opaque or translucent colour, sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colour {
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// 255 is opaque.
    pub alpha: u8,
}

impl Colour {
    /// An opaque colour written as in CSS, `0xrrggbb`.
    pub const fn hex(rrggbb: u32) -> Self {
        Self { rgb: [(rrggbb >> 16) as u8, (rrggbb >> 8) as u8, rrggbb as u8], alpha: 255 }
    }

    /// The same colour, `alpha` of 255 opaque.
    pub const fn with_alpha(self, alpha: u8) -> Self {
        Self { alpha, ..self }
    }

    /// What this colour makes over an opaque one.
    pub fn over(self, under: Self) -> Self {
        let part = f64::from(self.alpha) / 255.0;
        let [r, g, b] = [0, 1, 2].map(|k| {
            (part * f64::from(self.rgb[k]) + (1.0 - part) * f64::from(under.rgb[k])).round() as u8
        });
        Self { rgb: [r, g, b], alpha: 255 }
    }

    /// `#rrggbb`.
    pub fn css(self) -> String {
        let [r, g, b] = self.rgb;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// One step of an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Segment {
    /// Starts a new part.
    Move([f64; 2]),
    /// Straight to.
    Line([f64; 2]),
    /// Back to the start of the part.
    Close,
}

/// An outline of any number of parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Outline(pub(crate) Vec<Segment>);

impl Outline {
    /// A rectangle.
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
        self.0.push(Segment::Close);
    }

    /// Adds an open part through the points.
    pub(crate) fn add_line(&mut self, points: &[[f64; 2]]) {
        let mut points = points.iter().copied();
        self.0.extend(points.next().map(Segment::Move));
        self.0.extend(points.map(Segment::Line));
    }

    /// One open line through the points.
    pub(crate) fn line(points: &[[f64; 2]]) -> Self {
        let mut outline = Self::default();
        outline.add_line(points);
        outline
    }

    /// Adds a line through each run of places that are known; gives those that stand alone, which
    /// no line shows.
    pub(crate) fn add_runs(&mut self, places: &[Option<[f64; 2]>]) -> Vec<[f64; 2]> {
        let mut alone = Vec::new();
        for run in places.split(Option::is_none) {
            let run: Vec<[f64; 2]> = run.iter().copied().flatten().collect();
            match run[..] {
                [place] => alone.push(place),
                _ => self.add_line(&run),
            }
        }
        alone
    }

    /// The same, elsewhere.
    pub(crate) fn moved(&self, [dx, dy]: [f64; 2]) -> Self {
        let moved = |[x, y]: [f64; 2]| [x + dx, y + dy];
        let segments = self.0.iter().map(|segment| match *segment {
            Segment::Move(point) => Segment::Move(moved(point)),
            Segment::Line(point) => Segment::Line(moved(point)),
            Segment::Close => Segment::Close,
        });
        Self(segments.collect())
    }

    /// A disc around `centre`.
    pub(crate) fn circle(centre: [f64; 2], radius: f64) -> Self {
        Self::around(centre, [radius; 16])
    }

    /// A five-pointed star around `centre`, `radius` from centre to tip.
    pub(crate) fn star(centre: [f64; 2], radius: f64) -> Self {
        let [tip, notch] = [radius, 0.42 * radius];
        Self::around(centre, [tip, notch, tip, notch, tip, notch, tip, notch, tip, notch])
    }

    /// Corners evenly around `centre`, these distances from it, clockwise from the top.
    fn around<const N: usize>([x, y]: [f64; 2], reaches: [f64; N]) -> Self {
        let mut outline = Self::default();
        let half = (N / 2) as f64;
        let corners: [[f64; 2]; N] = std::array::from_fn(|k| {
            let (sin, cos) = (std::f64::consts::PI * k as f64 / half).sin_cos();
            [x + reaches[k] * sin, y - reaches[k] * cos]
        });
        outline.add_polygon(&corners);
        outline
    }
}

/// How a line is drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stroke {
    /// Its colour.
    pub(crate) colour: Colour,
    /// Its width, px.
    pub(crate) width: f64,
    /// Lengths of dash and gap, px; empty for a solid line.
    pub(crate) dash: Vec<f64>,
}

impl Stroke {
    /// A solid line.
    pub(crate) fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Vec::new() }
    }

    /// A dashed line.
    pub(crate) fn dashed(colour: Colour, width: f64, dash: &[f64]) -> Self {
        Self { colour, width, dash: dash.to_vec() }
    }
}

/// Slanted lines over an area.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hatch {
    /// Drawn one over the other.
    pub(crate) strokes: Vec<Stroke>,
    /// From one line to the next along x, px.
    pub(crate) spacing: f64,
    /// Lines fall to the right, in place of rising.
    pub(crate) falling: bool,
}

impl Hatch {
    /// The same, drawn smaller where areas of `width` by `height` px are so small that they could
    /// lie between its lines.
    pub(crate) fn within(mut self, [width, height]: [f64; 2]) -> Self {
        // An area is crossed by a line at least where the spacing is no more than both its sides.
        let spacing = ((width + height) / 1.5).clamp(FINEST_HATCH, self.spacing);
        for stroke in &mut self.strokes {
            stroke.width *= spacing / self.spacing;
        }
        self.spacing = spacing;
        self
    }
}

/// Least spacing at which lines can be seen apart, px.
const FINEST_HATCH: f64 = 2.0;

/// Which part of a text is at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    /// The first letter.
    Start,
    /// The middle.
    Middle,
    /// The last letter.
    End,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Text {
    /// What it says.
    pub(crate) text: String,
    /// Baseline position of the anchor.
    pub(crate) at: [f64; 2],
    /// Height of the type, px.
    pub(crate) size: f64,
    /// Heavier type.
    pub(crate) bold: bool,
    /// Colour of the letters.
    pub(crate) colour: Colour,
    /// Which part of it is at `at`.
    pub(crate) anchor: Anchor,
    /// Reads upwards.
    pub(crate) upright: bool,
    /// Letters stand out from what lies behind them by this outline.
    pub(crate) halo: Option<Colour>,
}

impl Text {
    /// Plain text in the ink colour.
    pub(crate) fn new(text: impl Into<String>, at: [f64; 2], size: f64) -> Self {
        Self {
            text: text.into(),
            at,
            size,
            bold: false,
            colour: INK,
            anchor: Anchor::Start,
            upright: false,
            halo: None,
        }
    }

    /// The same, heavier.
    pub(crate) fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    /// The same, placed by another part.
    pub(crate) fn anchor(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// The same, reading upwards.
    pub(crate) fn upright(mut self) -> Self {
        self.upright = true;
        self
    }
}

/// Something drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    /// A filled outline.
    Fill {
        /// What is filled, by the non-zero rule.
        outline: Outline,
        /// With what.
        colour: Colour,
        /// Edges on whole pixels, so that neighbours leave no seam.
        crisp: bool,
    },
    /// A drawn outline.
    Line {
        /// Where.
        outline: Outline,
        /// How.
        stroke: Stroke,
    },
    /// A line of text.
    Text(Text),
    /// Until the matching `Unclip`, nothing is drawn outside the outline.
    Clip(Outline),
    /// Ends the last `Clip`.
    Unclip,
}

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scene {
    /// Width, px.
    pub(crate) width: f64,
    /// Height, px.
    pub(crate) height: f64,
    /// What the picture shows, in a sentence, for those who hear it.
    pub(crate) description: String,
    /// In drawing order.
    pub(crate) items: Vec<Item>,
}

/// Letters and frames.
pub const INK: Colour = Colour::hex(0x1b1f24);
/// Secondary text.
pub const MUTED: Colour = Colour::hex(0x57606a);
/// Grid lines.
pub(crate) const FAINT: Colour = Colour::hex(0xd8dee4);
/// The sheet.
pub(crate) const PAPER: Colour = Colour::hex(0xffffff);

impl Scene {
    /// A white sheet.
    pub(crate) fn new(width: f64, height: f64, description: impl Into<String>) -> Self {
        let mut scene = Self { width, height, description: description.into(), items: Vec::new() };
        scene.fill(Outline::rectangle(0.0, 0.0, width, height), PAPER);
        scene
    }

    /// Fills an outline.
    pub(crate) fn fill(&mut self, outline: Outline, colour: Colour) {
        self.items.push(Item::Fill { outline, colour, crisp: false });
    }

    /// Fills an outline with its edges on whole pixels.
    pub(crate) fn fill_crisp(&mut self, outline: Outline, colour: Colour) {
        self.items.push(Item::Fill { outline, colour, crisp: true });
    }

    /// Draws an outline.
    pub(crate) fn line(&mut self, outline: Outline, stroke: Stroke) {
        self.items.push(Item::Line { outline, stroke });
    }

    /// Sets a line of text.
    pub(crate) fn text(&mut self, text: Text) {
        self.items.push(Item::Text(text));
    }

    /// Draws what `draw` draws, within `outline` alone.
    pub(crate) fn clipped(&mut self, outline: Outline, draw: impl FnOnce(&mut Self)) {
        self.items.push(Item::Clip(outline));
        draw(self);
        self.items.push(Item::Unclip);
    }

    /// Fills `outline` with slanted lines.
    pub(crate) fn hatch(&mut self, outline: Outline, hatch: &Hatch) {
        let spacing = hatch.spacing;
        let extent = |k: usize| {
            extremes(outline.0.iter().filter_map(|segment| match *segment {
                Segment::Move(point) | Segment::Line(point) => Some(point[k]),
                Segment::Close => None,
            }))
        };
        let Some(((left, right), (top, bottom))) = extent(0).zip(extent(1)) else { return };
        // Lines off the sheet are not seen, and there could be any number of them.
        let [left, right] = [left, right].map(|x| x.clamp(0.0, self.width));
        let [top, bottom] = [top, bottom].map(|y| y.clamp(0.0, self.height));
        if left >= right || top >= bottom {
            return;
        }
        let height = bottom - top;
        let mut lines = Outline::default();
        // Lines lie on multiples of the spacing of x + y, or of x - y, so that the hatching runs on
        // from shape to shape.
        let (from, to, sign) = if hatch.falling { (bottom, top, -1.0) } else { (top, bottom, 1.0) };
        let mut along = ((left + sign * from) / spacing).ceil() * spacing - sign * from;
        while along < right + height {
            lines.add_line(&[[along, from], [along - height, to]]);
            along += spacing;
        }
        self.clipped(outline, |scene| {
            for stroke in &hatch.strokes {
                scene.line(lines.clone(), stroke.clone());
            }
        });
    }
}
