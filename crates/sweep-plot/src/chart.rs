//! Charts: curves over a common x axis, in panels one above the other. All figures but maps and
//! designs are charts.

use std::rc::Rc;

use super::axis::{AxisScale, extremes, has_logarithm};
use super::colour::{BOTH as BOTH_SIDES, ColourScale, UNSTABLE_SHADE};
use super::decimate::envelope;
use super::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LegendSymbol, Panel, TICK_SIZE, heading, legend,
    legend_height,
};
use super::label::Label;
use super::raster::text_width;
use super::scene::{Colour, INK, MUTED, Outline, PAPER, Scene, Stroke, Text};

/// A figure of curves in panels over a common x axis.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Chart {
    pub title: String,
    pub subtitle: String,
    pub x_label: Label,
    /// Whether the x axis is logarithmic.
    pub x_log: bool,
    /// The panels, from top to bottom.
    pub panels: Vec<ChartPanel>,
    /// Vertical lines through all panels.
    pub marks: Vec<Mark>,
    /// The legend entry of the marks.
    pub mark_meaning: String,
    /// Ranges of x that are shaded in all panels.
    pub shades: Vec<[f64; 2]>,
    /// The legend entry of the shades.
    pub shade_meaning: String,
}

/// A panel of a chart: curves over the common x axis with a y axis of their own.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ChartPanel {
    /// The short name by which options and pages choose the panel.
    pub name: String,
    /// The label of the y axis.
    #[serde(flatten)]
    pub label: Label,
    /// Whether the panel is drawn in a picture, and shown when a page opens.
    pub shown: bool,
    /// Whether the y axis is logarithmic.
    pub log: bool,
    /// The range of the y axis; by default the range of the series and levels.
    pub range: Option<(f64, f64)>,
    /// The height in a picture, px.
    pub height: f64,
    /// The curves in drawing order.
    #[serde(skip)]
    pub series: Vec<Series>,
    /// Horizontal lines: value and legend entry.
    pub levels: Vec<(f64, String)>,
    /// Starred points: x, y and label.
    #[serde(skip)]
    pub stars: Vec<(f64, f64, String)>,
    /// Ranges of x whose cells hold points on both sides of the limit.
    pub mixed: Vec<[f64; 2]>,
}

impl ChartPanel {
    /// Returns a panel of these curves that is shown, linear, and 420 px high.
    pub fn new(name: &str, label: Label, series: Vec<Series>) -> Self {
        let name = name.to_owned();
        Self { name, label, series, shown: true, height: 420.0, ..Self::default() }
    }
}

/// The style in which a series is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Style {
    /// A solid line of this width, px.
    Solid(f64),
    Dashed,
    /// A dot at each point, and no line.
    Dots,
    /// The line, and a shaded area between these lower and upper values.
    Band(Vec<f64>, Vec<f64>),
}

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The legend entry; empty for a curve without one.
    pub name: String,
    pub colour: Colour,
    /// Rising values of x; series of one file mostly share them.
    pub x: Rc<Vec<f64>>,
    /// The value at each x; NaN interrupts the line.
    pub y: Vec<f64>,
    pub style: Style,
}

impl Series {
    pub fn new(
        name: impl Into<String>,
        colour: Colour,
        x: impl Into<Rc<Vec<f64>>>,
        y: Vec<f64>,
        style: Style,
    ) -> Self {
        Self { name: name.into(), colour, x: x.into(), y, style }
    }
}

/// A vertical line with a label.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    pub x: f64,
    pub label: String,
}

/// Left margin for the numbers and the label of the y axis, px.
const LEFT_MARGIN: f64 = 92.0;
/// Right margin, px.
const RIGHT_MARGIN: f64 = 26.0;
/// Gap between two panels, px.
const PANEL_GAP: f64 = 14.0;

/// Radius of a dot that stands for an isolated point of a line, px.
const ISOLATED_RADIUS: f64 = 3.0;
/// The legend entry of stars.
const STAR_MEANING: &str = "resonance speed";

/// The legend entry of the colour that two translucent curves make together.
const OVERLAP_MEANING: &str = "both, one over the other";

/// Draws the panels of a chart that are shown.
pub(crate) fn draw(chart: &Chart) -> Scene {
    let panels: Vec<&ChartPanel> = chart.panels.iter().filter(|panel| panel.shown).collect();
    let entries = entries(chart, &panels);
    let width = FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN;
    let legend_height = legend_height(&entries, width);
    let heights: f64 = panels.iter().map(|panel| panel.height + PANEL_GAP).sum();
    let labels = chart.marks.iter().map(|mark| text_width(&mark.label, TICK_SIZE, false) + 22.0);
    let strip = labels.fold(0.0, f64::max);
    let total = HEADING_HEIGHT + strip + heights + BOTTOM_MARGIN + legend_height + 4.0;
    let mut scene = Scene::new(FIGURE_WIDTH, total, format!("{}. {}", chart.title, chart.subtitle));
    heading(&mut scene, &chart.title, &chart.subtitle);
    let xs = x_scale(chart);
    let mut y = HEADING_HEIGHT + strip;
    for (index, &content) in panels.iter().enumerate() {
        let panel =
            Panel { x: LEFT_MARGIN, y, width, height: content.height, xs, ys: y_scale(content) };
        panel.draw_grid_lines(&mut scene);
        let mut dots = Vec::new();
        scene.clipped(panel.outline(), |scene| {
            dots = draw_panel(scene, chart, content, &panel);
        });
        if !has_values(content) {
            panel.write_centred(&mut scene, NO_VALUES_TEXT);
        }
        draw_marks(&mut scene, chart, &panel, index == 0);
        draw_stars(&mut scene, content, &panel);
        let last = index + 1 == panels.len();
        panel.draw_frame(&mut scene, last, true);
        // Dots are drawn after the frame and without clipping, so that they are whole at the edge
        // too.
        let within = |y: f64| (panel.y..=panel.y + panel.height).contains(&y);
        for (place, radius, colour) in dots.into_iter().filter(|([_, y], ..)| within(*y)) {
            scene.fill(Outline::circle(place, radius), colour);
        }
        panel.y_label(&mut scene, &content.label.to_string(), 62.0);
        if last {
            panel.x_label(&mut scene, &chart.x_label.to_string());
        }
        y += content.height + PANEL_GAP;
    }
    legend(&mut scene, &entries, LEFT_MARGIN, y - PANEL_GAP + BOTTOM_MARGIN, width);
    scene
}

/// Returns the scale of the x axis: the range of all series, with a margin if all are dots.
pub(crate) fn x_scale(chart: &Chart) -> AxisScale {
    let all = || chart.panels.iter().flat_map(|panel| &panel.series);
    let xs = all().flat_map(|series| series.x.iter().copied());
    if !chart.x_log && all().all(|series| series.style == Style::Dots) {
        return AxisScale::around(xs);
    }
    if chart.x_log {
        let positive = xs.filter(|x| has_logarithm(*x));
        let (low, high) = extremes(positive).unwrap_or((1.0, 10.0));
        return AxisScale::log(low, if high > low { high } else { 10.0 * low });
    }
    let (low, high) = extremes(xs).unwrap_or((0.0, 1.0));
    // If all series have only one x, it is in the middle, so that its dots are whole.
    if high <= low {
        let half = 0.5_f64.max(1e-6 * low.abs());
        return AxisScale::linear(low - half, low + half);
    }
    AxisScale::linear(low, high)
}

/// Returns the scale of a panel's y axis: its given range, or the range of its series and levels.
pub(crate) fn y_scale(panel: &ChartPanel) -> AxisScale {
    if let Some((low, high)) = panel.range {
        return if panel.log { AxisScale::log(low, high) } else { AxisScale::linear(low, high) };
    }
    let bands = panel.series.iter().flat_map(|series| match &series.style {
        Style::Band(low, high) => [&low[..], &high[..]],
        _ => [&series.y[..], &[]],
    });
    let values = bands.flatten().copied().chain(panel.levels.iter().map(|(value, _)| *value));
    if panel.log {
        let (low, high) = extremes(values.filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        AxisScale::log(low / 1.15, high * 1.15)
    } else {
        AxisScale::around(values)
    }
}

/// The text in a panel without curves, dots and stars.
const NO_VALUES_TEXT: &str = "no values to show";

/// Returns whether a panel has a point of a line, a dot or a star to draw.
fn has_values(panel: &ChartPanel) -> bool {
    let is_shown = |y: &f64| y.is_finite() && (!panel.log || *y > 0.0);
    let has_points = |series: &Series| {
        let has_any = |ys: &[f64]| ys.iter().any(is_shown);
        match &series.style {
            Style::Band(low, high) => has_any(&series.y) || has_any(low) || has_any(high),
            _ => has_any(&series.y),
        }
    };
    !panel.stars.is_empty() || panel.series.iter().any(has_points)
}

/// Draws shades, curves and levels. Returns the dots, which are drawn later: those of series of
/// dots, and those of isolated points, which no line shows.
fn draw_panel(
    scene: &mut Scene,
    chart: &Chart,
    content: &ChartPanel,
    panel: &Panel,
) -> Vec<([f64; 2], f64, Colour)> {
    let mut dots = Vec::new();
    for (ranges, colour) in [(&chart.shades, UNSTABLE_SHADE), (&content.mixed, BOTH_SIDES)] {
        if ranges.is_empty() {
            continue;
        }
        let mut areas = Outline::default();
        for range in ranges {
            let [from, to] = range.map(|x| panel.at_x(x));
            // A shade narrower than 1 px would not be visible.
            areas.add_rectangle(from, panel.y, (to - from).max(1.0), panel.height);
        }
        scene.fill(areas, colour);
    }
    for series in &content.series {
        let xs = &series.x;
        let at = |ys: &[f64], k: usize| {
            (xs[k].is_finite() && ys[k].is_finite()).then(|| panel.at(xs[k], ys[k]))
        };
        if let Style::Band(low, high) = &series.style {
            let both: Vec<_> = (0..xs.len()).map(|k| at(low, k).zip(at(high, k))).collect();
            let mut outline = Outline::default();
            for run in both.split(Option::is_none).filter(|run| !run.is_empty()) {
                let (mut area, mut back): (Vec<[f64; 2]>, Vec<[f64; 2]>) =
                    run.iter().flatten().copied().unzip();
                // The band at an isolated point is as wide as its dot.
                for side in [&mut area, &mut back] {
                    if let [[x, y]] = side[..] {
                        *side = vec![[x - ISOLATED_RADIUS, y], [x + ISOLATED_RADIUS, y]];
                    }
                }
                area.extend(back.into_iter().rev());
                outline.add_polygon(&area);
            }
            scene.fill(outline, series.colour.with_alpha(90));
        }
        if series.style == Style::Dots {
            let places = (0..xs.len()).filter_map(|k| at(&series.y, k));
            dots.extend(places.map(|place| (place, DOT_RADIUS, series.colour)));
            continue;
        }
        let kept = envelope(xs, &series.y, panel.xs.from, panel.xs.to, panel.width as usize);
        let places: Vec<_> = kept.into_iter().map(|k| at(&series.y, k)).collect();
        let mut outline = Outline::default();
        let isolated = outline.add_runs(&places);
        scene.line(outline, stroke(series));
        dots.extend(isolated.into_iter().map(|place| (place, ISOLATED_RADIUS, series.colour)));
    }
    for (value, _) in &content.levels {
        let y = panel.at_y(*value);
        scene.line(Outline::line(&[[panel.x, y], [panel.x + panel.width, y]]), level_stroke());
    }
    dots
}

/// Returns the stroke of a series' line.
pub(crate) fn stroke(series: &Series) -> Stroke {
    match series.style {
        Style::Solid(width) => Stroke::solid(series.colour, width),
        Style::Dashed => Stroke::dashed(series.colour, 1.8, &[8.0, 5.0]),
        Style::Band(..) | Style::Dots => Stroke::solid(series.colour, 2.2),
    }
}

/// Returns the stroke of a level's line.
pub(crate) fn level_stroke() -> Stroke {
    Stroke::dashed(INK, 1.6, &[3.0, 3.0])
}

fn mark_stroke() -> Stroke {
    Stroke::dashed(MUTED, 1.2, &[6.0, 4.0])
}

/// Radius of a dot, px. Doubling it quadruples the ink of dense series.
pub(crate) const DOT_RADIUS: f64 = 2.8;

/// Radius of a star from centre to tip, px.
const STAR_RADIUS: f64 = 10.0;

/// A rectangle: left, top, right and bottom, px.
type Rectangle = [f64; 4];

/// Draws all stars, then their labels. A label is placed where it covers no star and no earlier
/// label; among such places the one that the fewest curves cross is taken.
fn draw_stars(scene: &mut Scene, content: &ChartPanel, panel: &Panel) {
    let mut taken: Vec<Rectangle> = Vec::new();
    for (x, y, _) in &content.stars {
        let [x, y] = panel.at(*x, *y);
        scene.fill(Outline::star([x, y], STAR_RADIUS), INK);
        taken.push([x - STAR_RADIUS, y - STAR_RADIUS, x + STAR_RADIUS, y + STAR_RADIUS]);
    }
    for (x, y, label) in &content.stars {
        let [x, y] = panel.at(*x, *y);
        let width = text_width(label, TICK_SIZE, true);
        // The candidates lie on both sides of the star, from close to it to farther above and
        // below.
        let sides = [x - STAR_RADIUS - 2.0 - width, x + STAR_RADIUS + 2.0];
        let heights = [-6.0, 18.0, -24.0, 36.0, -42.0, 54.0];
        let places = heights.iter().flat_map(|dy| sides.map(|left| [left, y + dy]));
        let extent = |[left, base]: [f64; 2]| [left, base - TICK_SIZE, left + width, base + 4.0];
        let free = |place: &[f64; 2]| {
            let [left, top, right, bottom] = extent(*place);
            left > panel.x
                && right < panel.x + panel.width
                && top > panel.y
                && bottom < panel.y + panel.height
                && taken.iter().all(|other| {
                    right < other[0] || left > other[2] || bottom < other[1] || top > other[3]
                })
        };
        let place =
            places.filter(free).min_by_key(|place| lines_through(content, panel, extent(*place)));
        let place = place.unwrap_or([sides[1], y + 18.0]);
        taken.push(extent(place));
        let text = Text::new(label.clone(), place, TICK_SIZE).bold();
        scene.text(Text { halo: Some(PAPER), ..text });
    }
}

/// Returns the number of curves of a panel that pass through a rectangle.
fn lines_through(content: &ChartPanel, panel: &Panel, extent: Rectangle) -> usize {
    let runs_through = |series: &&Series| {
        let places = series.x.iter().zip(&series.y).map(|(&x, &y)| panel.at(x, y));
        let places: Vec<[f64; 2]> = places.collect();
        places.windows(2).any(|pair| intersects([pair[0], pair[1]], extent))
    };
    content.series.iter().filter(runs_through).count()
}

/// Returns whether a part of a line segment lies within a rectangle (Liang-Barsky clipping).
fn intersects([from, to]: [[f64; 2]; 2], [left, top, right, bottom]: Rectangle) -> bool {
    let mut first = 0.0_f64;
    let mut last = 1.0_f64;
    for (k, (low, high)) in [(left, right), (top, bottom)].into_iter().enumerate() {
        let step = to[k] - from[k];
        if step == 0.0 {
            if !(low..=high).contains(&from[k]) {
                return false;
            }
            continue;
        }
        let [one, other] = [(low - from[k]) / step, (high - from[k]) / step];
        first = first.max(one.min(other));
        last = last.min(one.max(other));
    }
    // A segment with a NaN end belongs to a gap of the curve.
    from.iter().chain(&to).all(|part| part.is_finite()) && first <= last
}

/// Draws the marks through a panel, and their labels above it if `labelled`. A label that would
/// cover the one before it is moved to the right.
fn draw_marks(scene: &mut Scene, chart: &Chart, panel: &Panel, labelled: bool) {
    let mut free = f64::NEG_INFINITY;
    for mark in &chart.marks {
        let x = panel.at_x(mark.x);
        scene.line(Outline::line(&[[x, panel.y], [x, panel.y + panel.height]]), mark_stroke());
        let aside = x.max(free);
        if labelled && aside <= panel.x + panel.width + 8.0 {
            free = aside + TICK_SIZE + 2.0;
            let leader = Outline::line(&[[x, panel.y], [aside, panel.y - 12.0]]);
            scene.line(leader, Stroke::solid(MUTED, 1.2));
            scene.text(
                Text::new(mark.label.clone(), [aside + 5.0, panel.y - 16.0], TICK_SIZE).upright(),
            );
        }
    }
}

fn entries(chart: &Chart, panels: &[&ChartPanel]) -> Vec<(LegendSymbol, String)> {
    let mut entries: Vec<(LegendSymbol, String)> = Vec::new();
    let mut add = |sign: LegendSymbol, name: &str| {
        if !name.is_empty() && !entries.iter().any(|(_, known)| known == name) {
            entries.push((sign, name.to_owned()));
        }
    };
    for panel in panels {
        for series in &panel.series {
            if series.style == Style::Dots {
                let dot = Outline::circle([0.0, 0.0], 1.4 * DOT_RADIUS);
                add(LegendSymbol::Shape(dot, true, series.colour), &series.name);
                continue;
            }
            let mut stroke = stroke(series);
            stroke.width = stroke.width.max(2.2);
            add(LegendSymbol::Line(stroke), &series.name);
        }
        if let [.., under, over] = &panel.series[..]
            && over.colour.alpha < 255
        {
            let both = Stroke::solid(over.colour.over(under.colour), 2.2);
            add(LegendSymbol::Line(both), OVERLAP_MEANING);
        }
        for (_, meaning) in &panel.levels {
            add(LegendSymbol::Line(level_stroke()), meaning);
        }
        if !panel.mixed.is_empty() {
            add(LegendSymbol::Area(BOTH_SIDES), MIXED);
        }
        if !panel.stars.is_empty() {
            add(LegendSymbol::Shape(Outline::star([0.0, 0.0], 9.0), true, INK), STAR_MEANING);
        }
    }
    if !chart.marks.is_empty() {
        add(LegendSymbol::Line(mark_stroke()), &chart.mark_meaning);
    }
    if !chart.shades.is_empty() {
        add(LegendSymbol::Area(UNSTABLE_SHADE), &chart.shade_meaning);
    }
    entries
}

/// The legend entry of [`ChartPanel::mixed`].
pub const MIXED: &str = "both: reliable and unreliable points";

/// Returns whether positive values span more than a factor of ten, which calls for a logarithmic
/// axis.
pub fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    ColourScale::amplitude(values).scale.log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_stars_avoid_the_curves() {
        let speeds: Vec<f64> = (0..=30).map(|k| 10.0 * f64::from(k)).collect();
        let flat = |y: f64| Series::new("", INK, speeds.clone(), vec![y; 31], Style::Solid(2.0));
        // The second curve lies at the place that the first star's label prefers.
        let mut series = vec![flat(147.8), flat(154.0), flat(162.1)];
        series.push(Series { y: speeds.clone(), ..flat(0.0) });
        let stars = [147.8, 162.1].map(|at| (at, at, format!("{at} Hz"))).to_vec();
        let panel = ChartPanel {
            stars,
            range: Some((0.0, 300.0)),
            ..ChartPanel::new("frequency", Label::new("Frequency", ""), series)
        };
        let chart = Chart {
            title: String::new(),
            subtitle: String::new(),
            x_label: Label::new("Speed", "Hz"),
            x_log: false,
            panels: vec![panel],
            marks: Vec::new(),
            mark_meaning: String::new(),
            shades: Vec::new(),
            shade_meaning: String::new(),
        };
        let drawn = draw(&chart);
        let labels = drawn.items.iter().filter_map(|item| match item {
            crate::scene::Item::Text(text) if text.halo.is_some() => Some(text),
            _ => None,
        });
        let content = &chart.panels[0];
        let x = LEFT_MARGIN;
        let y = HEADING_HEIGHT;
        let xs = x_scale(&chart);
        let ys = y_scale(content);
        let panel = Panel {
            x,
            y,
            width: FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN,
            height: content.height,
            xs,
            ys,
        };
        let mut count = 0;
        for text in labels {
            let [left, base] = text.at;
            let width = text_width(&text.text, TICK_SIZE, true);
            let extent = [left, base - TICK_SIZE, left + width, base + 4.0];
            assert_eq!(lines_through(content, &panel, extent), 0, "{}", text.text);
            count += 1;
        }
        assert_eq!(count, 2);
    }
}
