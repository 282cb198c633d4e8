//! A design's points over every pair of parameters, and the quantity over each of them.

use crate::axis::{Scale, extremes};
use crate::chart::level_stroke;
use crate::colour::{CALM, HARSH};
use crate::frame::{HEADING_HEIGHT, LABEL_SIZE, Panel, Sign, heading, legend, legend_height};
use crate::label::Label;
use crate::layer::Level;
use crate::raster::text_width;
use crate::scatter::{Scatter, Side};
use crate::scene::{Colour, INK, MUTED, Outline, Scene, Stroke};

/// Most parameters that are shown: beyond, panels are too small to read.
pub(crate) const MOST_PARAMETERS: usize = 5;
/// About as many points are drawn at most.
pub(crate) const MOST_POINTS: usize = 4000;

const WIDTH: f64 = 880.0;
/// Left of the panels: numbers and label of the y axes.
const LEFT: f64 = 100.0;
const RIGHT: f64 = 24.0;
/// Below the panels: numbers and label of the x axes.
const BELOW: f64 = 64.0;
const GAP: f64 = 20.0;
/// Greatest height of a panel, px.
const TALLEST: f64 = 330.0;

/// A value along one direction of the matrix.
pub(crate) struct Direction<'a> {
    /// As in grid files; empty of the quantity.
    pub(crate) name: &'a str,
    pub(crate) label: &'a Label,
    pub(crate) values: &'a [f64],
    pub(crate) scale: Scale,
}

/// The parameters that are shown: all, or the most influential, in file order.
pub(crate) fn shown(scatter: &Scatter) -> Vec<usize> {
    let mut places = scatter.by_influence();
    places.truncate(MOST_PARAMETERS);
    places.sort_unstable();
    places
}

/// What the subtitle says of parameters and points that are left out.
pub(crate) fn notes(scatter: &Scatter) -> Vec<String> {
    let (all, shown) = (scatter.parameters.len(), shown(scatter).len());
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

/// Places of the points that are drawn.
pub(crate) fn drawn(scatter: &Scatter) -> Vec<usize> {
    let stride = scatter.points.len().div_ceil(MOST_POINTS).max(1);
    scatter.picked(stride)
}

/// The scale that holds some values, with room for the dots at its ends.
pub(crate) fn scale(values: &[f64], log: bool) -> Scale {
    if !log {
        return Scale::around(values.iter().copied());
    }
    let positive = values.iter().copied().filter(|value| *value > 0.0);
    let (low, high) = extremes(positive).unwrap_or((1.0, 10.0));
    let room = (high / low).powf(0.05).max(1.02);
    Scale::log(low / room, high * room)
}

/// What the panels are over: the parameters, and last the quantity.
pub(crate) fn directions(scatter: &Scatter) -> Vec<Direction<'_>> {
    let parameters = shown(scatter).into_iter().map(|k| &scatter.parameters[k]);
    let parameters = parameters.map(|one| (&one.name[..], &one.label, &one.values[..], one.log));
    let all = parameters.chain([("", &scatter.short, &scatter.quantity[..], scatter.log)]);
    let direction = |(name, label, values, log)| {
        let scale = scale(values, log);
        Direction { name, label, values, scale }
    };
    all.map(direction).collect()
}

/// A panel each: the directions along it and up it, by their numbers, and its place: left, top,
/// width and height.
pub(crate) type Places = Vec<(usize, usize, f64, f64, f64, f64)>;

/// The matrix: below its diagonal every pair of parameters, and in its last row the quantity.
pub(crate) fn draw(scatter: &Scatter) -> (Scene, Places) {
    let directions = directions(scatter);
    let parameters = &directions[..directions.len() - 1];
    let count = parameters.len();
    let width = (WIDTH - LEFT - RIGHT - GAP * (count - 1) as f64) / count as f64;
    let height = (0.8 * width).clamp(130.0, TALLEST);
    let entries = entries(scatter);
    let room = WIDTH - LEFT - RIGHT;
    let of_legend = legend_height(&entries, room);
    let lines = parameters.iter().map(|one| x_lines(one.label, width).len()).max();
    let below = BELOW + 1.2 * LABEL_SIZE * lines.unwrap_or(1).saturating_sub(1) as f64;
    let panels_height = count as f64 * (height + GAP) - GAP;
    let total = HEADING_HEIGHT + panels_height + below + of_legend + 8.0;
    let title = &scatter.title;
    let subtitle = scatter.subtitle(&notes(scatter));
    let mut scene = Scene::new(WIDTH, total, format!("{title}. {subtitle}"));
    heading(&mut scene, title, &subtitle);
    let dots = Dots::new(scatter, width);
    let mut places = Places::new();
    for row in 0..count {
        let last = row + 1 == count;
        let y = &directions[row + 1];
        for (column, x) in parameters.iter().enumerate().take(if last { count } else { row + 1 }) {
            let panel = Panel {
                x: LEFT + column as f64 * (width + GAP),
                y: HEADING_HEIGHT + row as f64 * (height + GAP),
                width,
                height,
                xs: x.scale,
                ys: y.scale,
            };
            places.push((column, row + 1, panel.x, panel.y, width, height));
            panel.rules(&mut scene);
            scene.clipped(panel.outline(), |scene| {
                if let (true, Some(level)) = (last, &scatter.level) {
                    let at = panel.at_y(level.value);
                    let line = Outline::line(&[[panel.x, at], [panel.x + width, at]]);
                    scene.line(line, level_stroke());
                }
                dots.draw(scene, &panel, x.values, y.values);
            });
            panel.frame_beside(&mut scene, last, column == 0);
            if last {
                x_label(&mut scene, &panel, x.label);
            }
            if column == 0 {
                panel.y_label(&mut scene, &y.label.to_string(), 66.0);
            }
        }
    }
    let y = HEADING_HEIGHT + panels_height + below;
    legend(&mut scene, &entries, LEFT, y, room);
    (scene, places)
}

/// A label in lines that fit below a panel; its unit stays whole.
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

/// The colour of a side.
pub(crate) const fn colour(side: Side) -> Colour {
    match side {
        Side::Good => CALM,
        Side::Bad => HARSH,
        Side::Undefined => MUTED,
        Side::Failed => INK,
    }
}

/// What each kind of point is drawn as: shapes differ as well as colours.
struct Dots {
    /// Places of the points that are drawn, by side.
    places: Vec<(Side, Vec<usize>)>,
    /// Half the size of a dot, px.
    radius: f64,
}

impl Dots {
    fn new(scatter: &Scatter, width: f64) -> Self {
        let all = drawn(scatter);
        let of = |side: Side| all.iter().copied().filter(|&k| scatter.sides[k] == side).collect();
        let places = Side::ALL.into_iter().map(|side| (side, of(side))).collect();
        // A quarter of the panel's area under dots at most.
        let radius = (0.25 * width / (all.len().max(1) as f64).sqrt()).clamp(1.1, 3.4);
        Self { places, radius }
    }

    /// Points without one of the two values are drawn at the panel's lower edge, where what failed
    /// is seen over its parameter.
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

/// A round dot, a diamond, a ring or a cross.
fn add(outline: &mut Outline, side: Side, [x, y]: [f64; 2], radius: f64) {
    match side {
        Side::Good | Side::Undefined => {
            let (n, f) = (0.414 * radius, radius);
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

fn entries(scatter: &Scatter) -> Vec<(Sign, String)> {
    let mut entries = Vec::new();
    for (side, count) in Side::ALL.into_iter().zip(scatter.counts) {
        if count > 0 {
            let words = format!("{} ({count})", scatter.words(side));
            entries.push((sign(side), words));
        }
    }
    let quantity = scale(&scatter.quantity, scatter.log);
    let is_drawn = |level: &&Level| (0.0..=1.0).contains(&quantity.position(level.value));
    if let Some(level) = scatter.level.as_ref().filter(is_drawn) {
        entries.push((Sign::Line(level_stroke()), level.line.clone()));
    }
    entries
}

/// A dot of a side as a legend draws it.
fn sign(side: Side) -> Sign {
    let mut outline = Outline::default();
    add(&mut outline, side, [0.0, 0.0], 5.0);
    Sign::Shape(outline, matches!(side, Side::Good | Side::Bad), colour(side))
}
