//! Curves over a common x axis, in panels one above the other. All figures but the map are charts.

use std::rc::Rc;

use super::axis::{Scale, extremes, has_logarithm};
use super::colour::{BOTH as BOTH_SIDES, ColourScale, SHADE};
use super::decimate::envelope;
use super::frame::{HEADING_HEIGHT, Panel, Sign, TICK_SIZE, heading, legend, legend_height};
use super::label::Label;
use super::raster::text_width;
use super::scene::{Colour, INK, MUTED, Outline, PAPER, Scene, Stroke, Text};

/// A figure of curves.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Chart {
    /// What is shown.
    pub title: String,
    /// Name of the run and conditions.
    pub subtitle: String,
    /// What the x axis shows.
    pub x_label: Label,
    /// The x axis is better read by its logarithm.
    pub x_log: bool,
    /// From top to bottom.
    pub panels: Vec<ChartPanel>,
    /// Upright lines through all panels.
    pub marks: Vec<Mark>,
    /// What the marks mean, in the legend.
    pub mark_meaning: String,
    /// Ranges of x that are shaded in all panels.
    pub shades: Vec<[f64; 2]>,
    /// What the shades mean, in the legend.
    pub shade_meaning: String,
}

/// One panel of a chart.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ChartPanel {
    /// Short name, by which it is picked.
    pub name: String,
    /// What the y axis shows.
    #[serde(flatten)]
    pub label: Label,
    /// Shown in a picture, and at first in a page.
    pub shown: bool,
    /// Whether the axis is logarithmic.
    pub log: bool,
    /// y values between which the panel extends; by default what its series need.
    pub range: Option<(f64, f64)>,
    /// Height in a picture, px.
    pub height: f64,
    /// In drawing order.
    #[serde(skip)]
    pub series: Vec<Series>,
    /// Level lines: value and meaning.
    pub levels: Vec<(f64, String)>,
    /// Starred points: x, y and a label.
    #[serde(skip)]
    pub stars: Vec<(f64, f64, String)>,
    /// Ranges of x whose cells hold points on both sides of the level.
    pub mixed: Vec<[f64; 2]>,
}

impl ChartPanel {
    /// A panel of these curves that is shown, even, as high as its series need, and 420 px tall.
    pub fn new(name: &str, label: Label, series: Vec<Series>) -> Self {
        let name = name.to_owned();
        Self { name, label, series, shown: true, height: 420.0, ..Self::default() }
    }
}

/// How a series is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Style {
    /// A solid line of this width, px.
    Solid(f64),
    /// A dashed line.
    Dashed,
    /// A dot at each point, and no line.
    Dots,
    /// The line, and the area between these two values at each point.
    Band(Vec<f64>, Vec<f64>),
}

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Its colour.
    pub colour: Colour,
    /// Rising; series mostly share theirs.
    pub x: Rc<Vec<f64>>,
    /// One per x; NaN breaks the line.
    pub y: Vec<f64>,
    /// How it is drawn.
    pub style: Style,
}

impl Series {
    /// A series.
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

/// An upright line.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where.
    pub x: f64,
    /// Words and unit beside it.
    pub label: String,
}

const WIDTH: f64 = 880.0;
const LEFT: f64 = 92.0;
const RIGHT: f64 = 26.0;
const BELOW: f64 = 64.0;
const GAP: f64 = 14.0;
/// Radius of the dot of a place that no line runs to, px.
const ALONE: f64 = 3.0;
/// What a star means, in the legend.
const STARS: &str = "resonance speed";

/// What the colour of one translucent curve over another means, in the legend.
const BOTH: &str = "both, one over the other";

/// Draws the panels that are shown.
pub(crate) fn draw(chart: &Chart) -> Scene {
    let panels: Vec<&ChartPanel> = chart.panels.iter().filter(|panel| panel.shown).collect();
    let entries = entries(chart, &panels);
    let width = WIDTH - LEFT - RIGHT;
    let of_legend = legend_height(&entries, width);
    let heights: f64 = panels.iter().map(|panel| panel.height + GAP).sum();
    let labels = chart.marks.iter().map(|mark| text_width(&mark.label, TICK_SIZE, false) + 22.0);
    let strip = labels.fold(0.0, f64::max);
    let total = HEADING_HEIGHT + strip + heights + BELOW + of_legend + 4.0;
    let mut scene = Scene::new(WIDTH, total, format!("{}. {}", chart.title, chart.subtitle));
    heading(&mut scene, &chart.title, &chart.subtitle);
    let xs = x_scale(chart);
    let mut y = HEADING_HEIGHT + strip;
    for (index, &content) in panels.iter().enumerate() {
        let panel = Panel { x: LEFT, y, width, height: content.height, xs, ys: y_scale(content) };
        panel.rules(&mut scene);
        let mut dots = Vec::new();
        scene.clipped(panel.outline(), |scene| {
            dots = draw_panel(scene, chart, content, &panel);
        });
        if !has_values(content) {
            panel.say(&mut scene, NO_VALUES);
        }
        draw_marks(&mut scene, chart, &panel, index == 0);
        draw_stars(&mut scene, content, &panel);
        let last = index + 1 == panels.len();
        panel.frame(&mut scene, last, true);
        // Whole at the panel's edge too.
        let within = |y: f64| (panel.y..=panel.y + panel.height).contains(&y);
        for (place, radius, colour) in dots.into_iter().filter(|([_, y], ..)| within(*y)) {
            scene.fill(Outline::circle(place, radius), colour);
        }
        panel.y_label(&mut scene, &content.label.to_string(), 62.0);
        if last {
            panel.x_label(&mut scene, &chart.x_label.to_string());
        }
        y += content.height + GAP;
    }
    legend(&mut scene, &entries, LEFT, y - GAP + BELOW, width);
    scene
}

/// The scale of the x axis: all that series hold, with room for dots where there are no lines.
pub(crate) fn x_scale(chart: &Chart) -> Scale {
    let all = || chart.panels.iter().flat_map(|panel| &panel.series);
    let xs = all().flat_map(|series| series.x.iter().copied());
    if !chart.x_log && all().all(|series| series.style == Style::Dots) {
        return Scale::around(xs);
    }
    if chart.x_log {
        let positive = xs.filter(|x| has_logarithm(*x));
        let (low, high) = extremes(positive).unwrap_or((1.0, 10.0));
        return Scale::log(low, if high > low { high } else { 10.0 * low });
    }
    let (low, high) = extremes(xs).unwrap_or((0.0, 1.0));
    // The one place of all series is in the middle, so that dots are whole.
    if high <= low {
        let half = 0.5_f64.max(1e-6 * low.abs());
        return Scale::linear(low - half, low + half);
    }
    Scale::linear(low, high)
}

/// The scale of a panel's y axis: its range, or all that its series and levels need.
pub(crate) fn y_scale(panel: &ChartPanel) -> Scale {
    if let Some((low, high)) = panel.range {
        return if panel.log { Scale::log(low, high) } else { Scale::linear(low, high) };
    }
    let bands = panel.series.iter().flat_map(|series| match &series.style {
        Style::Band(low, high) => [&low[..], &high[..]],
        _ => [&series.y[..], &[]],
    });
    let values = bands.flatten().copied().chain(panel.levels.iter().map(|(value, _)| *value));
    if panel.log {
        let (low, high) = extremes(values.filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        Scale::log(low / 1.15, high * 1.15)
    } else {
        Scale::around(values)
    }
}

/// Stands in a panel without curves, dots and stars.
const NO_VALUES: &str = "no values to show";

/// Returns whether a panel has a place for a line, a dot or a star.
fn has_values(panel: &ChartPanel) -> bool {
    let is_shown = |y: &f64| y.is_finite() && (!panel.log || *y > 0.0);
    let of_series = |series: &Series| {
        let has_any = |ys: &[f64]| ys.iter().any(is_shown);
        match &series.style {
            Style::Band(low, high) => has_any(&series.y) || has_any(low) || has_any(high),
            _ => has_any(&series.y),
        }
    };
    !panel.stars.is_empty() || panel.series.iter().any(of_series)
}

/// Draws shades, curves and levels; gives the dots: of series of dots, and of places that stand
/// alone, which no line shows.
fn draw_panel(
    scene: &mut Scene,
    chart: &Chart,
    content: &ChartPanel,
    panel: &Panel,
) -> Vec<([f64; 2], f64, Colour)> {
    let mut dots = Vec::new();
    for (ranges, colour) in [(&chart.shades, SHADE), (&content.mixed, BOTH_SIDES)] {
        if ranges.is_empty() {
            continue;
        }
        let mut areas = Outline::default();
        for range in ranges {
            let [from, to] = range.map(|x| panel.at_x(x));
            // Narrower ones would not be seen.
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
                // The bracket of a place that stands alone is as wide as its dot.
                for side in [&mut area, &mut back] {
                    if let [[x, y]] = side[..] {
                        *side = vec![[x - ALONE, y], [x + ALONE, y]];
                    }
                }
                area.extend(back.into_iter().rev());
                outline.add_polygon(&area);
            }
            scene.fill(outline, series.colour.with_alpha(90));
        }
        if series.style == Style::Dots {
            let places = (0..xs.len()).filter_map(|k| at(&series.y, k));
            dots.extend(places.map(|place| (place, DOT, series.colour)));
            continue;
        }
        let kept = envelope(xs, &series.y, panel.xs.from, panel.xs.to, panel.width as usize);
        let places: Vec<_> = kept.into_iter().map(|k| at(&series.y, k)).collect();
        let mut outline = Outline::default();
        let alone = outline.add_runs(&places);
        scene.line(outline, stroke(series));
        dots.extend(alone.into_iter().map(|place| (place, ALONE, series.colour)));
    }
    for (value, _) in &content.levels {
        let y = panel.at_y(*value);
        scene.line(Outline::line(&[[panel.x, y], [panel.x + panel.width, y]]), level_stroke());
    }
    dots
}

/// How a series is drawn where it is a line.
pub(crate) fn stroke(series: &Series) -> Stroke {
    match series.style {
        Style::Solid(width) => Stroke::solid(series.colour, width),
        Style::Dashed => Stroke::dashed(series.colour, 1.8, &[8.0, 5.0]),
        Style::Band(..) | Style::Dots => Stroke::solid(series.colour, 2.2),
    }
}

/// Lines at a level.
pub(crate) fn level_stroke() -> Stroke {
    Stroke::dashed(INK, 1.6, &[3.0, 3.0])
}

fn mark_stroke() -> Stroke {
    Stroke::dashed(MUTED, 1.2, &[6.0, 4.0])
}

/// Radius of a dot, px.
pub(crate) const DOT: f64 = 2.8;

/// Radius of a star, px.
const STAR: f64 = 10.0;

/// A rectangle: left, top, right, bottom, px.
type Extent = [f64; 4];

/// Stars first, then their labels, each where it covers neither a star nor a label before it, if
/// there is such a place; of several, the one that the fewest lines run through.
fn draw_stars(scene: &mut Scene, content: &ChartPanel, panel: &Panel) {
    let mut taken: Vec<Extent> = Vec::new();
    for (x, y, _) in &content.stars {
        let [x, y] = panel.at(*x, *y);
        scene.fill(Outline::star([x, y], STAR), INK);
        taken.push([x - STAR, y - STAR, x + STAR, y + STAR]);
    }
    for (x, y, label) in &content.stars {
        let [x, y] = panel.at(*x, *y);
        let width = text_width(label, TICK_SIZE, true);
        // On either side of the star, and from close to it to farther above and below.
        let sides = [x - STAR - 2.0 - width, x + STAR + 2.0];
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

/// How many curves of a panel run through a rectangle.
fn lines_through(content: &ChartPanel, panel: &Panel, extent: Extent) -> usize {
    let runs_through = |series: &&Series| {
        let places = series.x.iter().zip(&series.y).map(|(&x, &y)| panel.at(x, y));
        let places: Vec<[f64; 2]> = places.collect();
        places.windows(2).any(|pair| crosses([pair[0], pair[1]], extent))
    };
    content.series.iter().filter(runs_through).count()
}

/// Whether a straight line between two places has a part within a rectangle.
fn crosses([from, to]: [[f64; 2]; 2], [left, top, right, bottom]: Extent) -> bool {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
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
    // A gap has no place.
    from.iter().chain(&to).all(|part| part.is_finite()) && first <= last
}

/// Marks through a panel; above the first one their labels, moved aside where they would cover each
/// other.
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

fn entries(chart: &Chart, panels: &[&ChartPanel]) -> Vec<(Sign, String)> {
    let mut entries: Vec<(Sign, String)> = Vec::new();
    let mut add = |sign: Sign, name: &str| {
        if !name.is_empty() && !entries.iter().any(|(_, known)| known == name) {
            entries.push((sign, name.to_owned()));
        }
    };
    for panel in panels {
        for series in &panel.series {
            if series.style == Style::Dots {
                let dot = Outline::circle([0.0, 0.0], 1.4 * DOT);
                add(Sign::Shape(dot, true, series.colour), &series.name);
                continue;
            }
            let mut stroke = stroke(series);
            stroke.width = stroke.width.max(2.2);
            add(Sign::Line(stroke), &series.name);
        }
        if let [.., under, over] = &panel.series[..]
            && over.colour.alpha < 255
        {
            let both = Stroke::solid(over.colour.over(under.colour), 2.2);
            add(Sign::Line(both), BOTH);
        }
        for (_, meaning) in &panel.levels {
            add(Sign::Line(level_stroke()), meaning);
        }
        if !panel.mixed.is_empty() {
            add(Sign::Area(BOTH_SIDES), MIXED);
        }
        if !panel.stars.is_empty() {
            add(Sign::Shape(Outline::star([0.0, 0.0], 9.0), true, INK), STARS);
        }
    }
    if !chart.marks.is_empty() {
        add(Sign::Line(mark_stroke()), &chart.mark_meaning);
    }
    if !chart.shades.is_empty() {
        add(Sign::Area(SHADE), &chart.shade_meaning);
    }
    entries
}

/// What the ranges of [`ChartPanel::mixed`] are, in the legend.
pub const MIXED: &str = "both: reliable and unreliable points";

/// Whether positive values span so much that only a logarithm shows them all.
pub fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    ColourScale::amplitude(values).scale.log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_stars_stand_off_the_curves() {
        let speeds: Vec<f64> = (0..=30).map(|k| 10.0 * f64::from(k)).collect();
        let flat = |y: f64| Series::new("", INK, speeds.clone(), vec![y; 31], Style::Solid(2.0));
        // The second curve is where the first one's label would stand.
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
        let (x, y) = (LEFT, HEADING_HEIGHT);
        let (xs, ys) = (x_scale(&chart), y_scale(content));
        let panel = Panel { x, y, width: WIDTH - LEFT - RIGHT, height: content.height, xs, ys };
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
