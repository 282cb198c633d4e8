//! The scatter matrix of a design: its points over every pair of parameters, and the quantity over
//! each parameter.

use crate::axis::{AxisScale, extremes};
use crate::chart::level_stroke;
use crate::colour::{BAD_SIDE, GOOD_SIDE};
use crate::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, heading, legend,
    legend_height,
};
use crate::label::Label;
use crate::layer::DividingLimit;
use crate::raster::text_width;
use crate::scatter::{Scatter, Side};
use crate::scene::{Colour, INK, MUTED, Outline, Scene, Stroke};

/// Maximum number of parameters shown. Basis: with more, panels are too small to read.
pub(crate) const MAX_PARAMETERS: usize = 5;
/// Approximate maximum number of points that are drawn. Basis: more points overlap. Doubling it
/// doubles the size of the figure.
pub(crate) const MAX_POINTS: usize = 4000;

/// Left margin for the numbers and labels of the y axes, px.
const LEFT_MARGIN: f64 = 100.0;
/// Right margin, px.
const RIGHT_MARGIN: f64 = 24.0;
/// Gap between two panels, px.
const PANEL_GAP: f64 = 20.0;
/// Maximum height of a panel, px.
const MAX_PANEL_HEIGHT: f64 = 330.0;

/// An axis of the scatter matrix: a parameter or the quantity.
pub(crate) struct MatrixAxis<'a> {
    /// The parameter's name in grid files; empty for the quantity.
    pub(crate) name: &'a str,
    pub(crate) label: &'a Label,
    pub(crate) values: &'a [f64],
    pub(crate) scale: AxisScale,
}

/// Returns the indices of the parameters shown in file order: all, or the most influential.
pub(crate) fn shown(scatter: &Scatter) -> Vec<usize> {
    let mut places = scatter.by_influence();
    places.truncate(MAX_PARAMETERS);
    places.sort_unstable();
    places
}

/// Returns the notes on parameters and points that are left out.
pub(crate) fn notes(scatter: &Scatter) -> Vec<String> {
    let all = scatter.parameters.len();
    let shown = shown(scatter).len();
    let mut notes = Vec::new();
    if shown < all {
        notes.push(format!("the {shown} most influential of {all} parameters"));
    }
    let drawn = drawn(scatter).len();
    if drawn < scatter.points.len() {
        notes.push(format!("{drawn} drawn"));
    }
    notes
}

/// Returns the indices of the points drawn.
pub(crate) fn drawn(scatter: &Scatter) -> Vec<usize> {
    let stride = scatter.points.len().div_ceil(MAX_POINTS).max(1);
    scatter.picked(stride)
}

/// Returns the scale of some values, with a margin for the dots at its ends.
pub(crate) fn scale(values: &[f64], log: bool) -> AxisScale {
    if !log {
        return AxisScale::around(values.iter().copied());
    }
    let positive = values.iter().copied().filter(|value| *value > 0.0);
    let (low, high) = extremes(positive).unwrap_or((1.0, 10.0));
    let room = (high / low).powf(0.05).max(1.02);
    AxisScale::log(low / room, high * room)
}

/// Returns the axes of the matrix: the parameters, and last the quantity.
pub(crate) fn directions(scatter: &Scatter) -> Vec<MatrixAxis<'_>> {
    let parameters = shown(scatter).into_iter().map(|k| &scatter.parameters[k]);
    let parameters = parameters.map(|one| (&one.name[..], &one.label, &one.values[..], one.log));
    let all = parameters.chain([("", &scatter.short, &scatter.quantity[..], scatter.log)]);
    let direction = |(name, label, values, log)| {
        let scale = scale(values, log);
        MatrixAxis { name, label, values, scale }
    };
    all.map(direction).collect()
}

/// The panels of the matrix, each by the indices of its x and y axis, and its left and top edge,
/// width and height, px.
pub(crate) type PanelPlaces = Vec<(usize, usize, f64, f64, f64, f64)>;

/// Draws the matrix: every pair of parameters below its diagonal, and the quantity in its last row.
pub(crate) fn draw(scatter: &Scatter) -> (Scene, PanelPlaces) {
    let directions = directions(scatter);
    let parameters = &directions[..directions.len() - 1];
    let count = parameters.len();
    let width =
        (FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN - PANEL_GAP * (count - 1) as f64) / count as f64;
    let height = (0.8 * width).clamp(130.0, MAX_PANEL_HEIGHT);
    let entries = entries(scatter);
    let room = FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN;
    let legend_height = legend_height(&entries, room);
    let lines = parameters.iter().map(|one| x_lines(one.label, width).len()).max();
    let below = BOTTOM_MARGIN + 1.2 * LABEL_SIZE * lines.unwrap_or(1).saturating_sub(1) as f64;
    let panels_height = count as f64 * (height + PANEL_GAP) - PANEL_GAP;
    let total = HEADING_HEIGHT + panels_height + below + legend_height + 8.0;
    let title = &scatter.title;
    let subtitle = scatter.subtitle(&notes(scatter));
    let mut scene = Scene::new(FIGURE_WIDTH, total, format!("{title}. {subtitle}"));
    heading(&mut scene, title, &subtitle);
    let dots = Dots::new(scatter, width);
    let mut places = PanelPlaces::new();
    for row in 0..count {
        let last = row + 1 == count;
        let y = &directions[row + 1];
        for (column, x) in parameters.iter().enumerate().take(if last { count } else { row + 1 }) {
            let panel = Panel {
                x: LEFT_MARGIN + column as f64 * (width + PANEL_GAP),
                y: HEADING_HEIGHT + row as f64 * (height + PANEL_GAP),
                width,
                height,
                xs: x.scale,
                ys: y.scale,
            };
            places.push((column, row + 1, panel.x, panel.y, width, height));
            panel.draw_grid_lines(&mut scene);
            scene.clipped(panel.outline(), |scene| {
                if let (true, Some(level)) = (last, &scatter.level) {
                    let at = panel.at_y(level.value);
                    let line = Outline::line(&[[panel.x, at], [panel.x + width, at]]);
                    scene.line(line, level_stroke());
                }
                dots.draw(scene, &panel, x.values, y.values);
            });
            panel.draw_frame_beside(&mut scene, last, column == 0);
            if last {
                x_label(&mut scene, &panel, x.label);
            }
            if column == 0 {
                panel.y_label(&mut scene, &y.label.to_string(), 66.0);
            }
        }
    }
    let y = HEADING_HEIGHT + panels_height + below;
    legend(&mut scene, &entries, LEFT_MARGIN, y, room);
    (scene, places)
}

/// Breaks a label into lines that fit below a panel; its unit stays on one line.
fn x_lines(label: &Label, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let unit = (!label.unit.is_empty()).then(|| format!("({})", label.unit));
    for word in label.words.split(' ').chain(unit.as_deref()) {
        let longer = lines.last().map(|line| format!("{line} {word}"));
        match longer {
            Some(longer) if text_width(&longer, LABEL_SIZE, false) <= width => {
                lines.pop();
                lines.push(longer);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn x_label(scene: &mut Scene, panel: &Panel, label: &Label) {
    for (k, line) in x_lines(label, panel.width).iter().enumerate() {
        let below = Panel { y: panel.y + 1.2 * LABEL_SIZE * k as f64, ..panel.clone() };
        below.x_label(scene, line);
    }
}

/// Returns the colour of a side.
pub(crate) const fn colour(side: Side) -> Colour {
    match side {
        Side::Good => GOOD_SIDE,
        Side::Bad => BAD_SIDE,
        Side::Undefined => MUTED,
        Side::Failed => INK,
    }
}

/// The dots of a design's points: shapes differ as well as colours.
struct Dots {
    /// The indices of the points drawn, by side.
    places: Vec<(Side, Vec<usize>)>,
    /// Half the size of a dot, px.
    radius: f64,
}

impl Dots {
    fn new(scatter: &Scatter, width: f64) -> Self {
        let all = drawn(scatter);
        let points_on =
            |side: Side| all.iter().copied().filter(|&k| scatter.sides[k] == side).collect();
        let places = Side::ALL.into_iter().map(|side| (side, points_on(side))).collect();
        // Dots cover a quarter of the panel's area at most.
        let radius = (0.25 * width / (all.len().max(1) as f64).sqrt()).clamp(1.1, 3.4);
        Self { places, radius }
    }

    /// Draws the dots of a panel. Points without a value lie at its lower edge, so that failures
    /// are visible over their parameter.
    fn draw(&self, scene: &mut Scene, panel: &Panel, xs: &[f64], ys: &[f64]) {
        for (side, places) in &self.places {
            let mut outline = Outline::default();
            let failed = matches!(side, Side::Failed | Side::Undefined);
            for &k in places {
                let y = if ys[k].is_finite() {
                    panel.at_y(ys[k])
                } else {
                    panel.y + panel.height - 5.0
                };
                if xs[k].is_finite() && (failed || ys[k].is_finite()) {
                    add(&mut outline, *side, [panel.at_x(xs[k]), y], self.radius);
                }
            }
            if outline.0.is_empty() {
                continue;
            }
            match side {
                Side::Good | Side::Bad => scene.fill(outline, colour(*side).with_alpha(210)),
                Side::Undefined | Side::Failed => {
                    scene.line(outline, Stroke::solid(colour(*side), 1.2));
                }
            }
        }
    }
}

/// Adds a dot of a side: a round dot, a diamond, a ring or a cross.
fn add(outline: &mut Outline, side: Side, [x, y]: [f64; 2], radius: f64) {
    match side {
        Side::Good | Side::Undefined => {
            let n = 0.414 * radius;
            let f = radius;
            let corners = [[n, f], [f, n], [f, -n], [n, -f], [-n, -f], [-f, -n], [-f, n], [-n, f]];
            outline.add_polygon(&corners.map(|[dx, dy]| [x + dx, y + dy]));
        }
        Side::Bad => {
            let reach = 1.25 * radius;
            outline.add_polygon(&[[x + reach, y], [x, y + reach], [x - reach, y], [x, y - reach]]);
        }
        Side::Failed => {
            let reach = radius.max(2.5);
            outline.add_line(&[[x - reach, y - reach], [x + reach, y + reach]]);
            outline.add_line(&[[x - reach, y + reach], [x + reach, y - reach]]);
        }
    }
}

fn entries(scatter: &Scatter) -> Vec<(LegendSymbol, String)> {
    let mut entries = Vec::new();
    for (side, count) in Side::ALL.into_iter().zip(scatter.counts) {
        if count > 0 {
            let words = format!("{} ({count})", scatter.words(side));
            entries.push((sign(side), words));
        }
    }
    let quantity = scale(&scatter.quantity, scatter.log);
    let is_drawn = |level: &&DividingLimit| (0.0..=1.0).contains(&quantity.position(level.value));
    if let Some(level) = scatter.level.as_ref().filter(is_drawn) {
        entries.push((LegendSymbol::Line(level_stroke()), level.line.clone()));
    }
    entries
}

/// Returns the legend symbol of a side.
fn sign(side: Side) -> LegendSymbol {
    let mut outline = Outline::default();
    add(&mut outline, side, [0.0, 0.0], 5.0);
    LegendSymbol::Shape(outline, matches!(side, Side::Good | Side::Bad), colour(side))
}
