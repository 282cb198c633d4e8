//! Charts: curves over a common x axis, in panels one above the other. All figures but maps and
//! designs are charts.

use std::rc::Rc;

use super::axis::{AxisScale, extremes, has_logarithm};
use super::colour::{BOTH_SIDES_COLOUR, ColourScale, UNSTABLE_SHADE};
use super::decimate::envelope_indices;
use super::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LegendSymbol, Panel, TICK_SIZE, draw_heading,
    draw_legend, measure_legend_height,
};
use super::label::Label;
use super::raster::text_width;
use super::scene::{Colour, INK, MUTED_COLOUR, Outline, PAPER, Scene, Stroke, Text};

/// A figure of curves in panels over a common x axis.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Chart {
    pub title: String,
    pub subtitle: String,
    pub x_label: Label,
    /// Whether the x axis is logarithmic.
    pub is_x_log: bool,
    /// The panels, from top to bottom.
    pub panels: Vec<ChartPanel>,
    /// Vertical lines through all panels.
    pub marks: Vec<Mark>,
    /// The legend entry of the marks.
    pub mark_meaning: String,
    /// Ranges of x that are shaded in all panels.
    pub shaded_ranges: Vec<[f64; 2]>,
    /// The legend entry of the shades.
    pub shade_meaning: String,
}

/// A panel of a chart: curves over the common x axis, with the panel's own y axis.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ChartPanel {
    /// The short name by which options and pages choose the panel.
    pub name: String,
    /// The label of the y axis.
    #[serde(flatten)]
    pub label: Label,
    /// Whether the panel is drawn in a picture, and shown when a page opens.
    #[serde(rename = "shown")]
    pub is_shown: bool,
    /// Whether the y axis is logarithmic.
    #[serde(rename = "log")]
    pub is_log: bool,
    /// The range of the y axis; by default the range of the series and levels.
    #[serde(rename = "range")]
    pub y_range: Option<(f64, f64)>,
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
    #[serde(rename = "mixed")]
    pub mixed_ranges: Vec<[f64; 2]>,
}

impl ChartPanel {
    /// Returns a panel of these curves that is shown, linear, and 420 px high.
    pub fn new(name: &str, label: Label, series: Vec<Series>) -> Self {
        let name = name.to_owned();
        Self { name, label, series, is_shown: true, height: 420.0, ..Self::default() }
    }
}

/// The style in which a series is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum SeriesStyle {
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
    pub style: SeriesStyle,
}

impl Series {
    pub fn new(
        name: impl Into<String>,
        colour: Colour,
        x: impl Into<Rc<Vec<f64>>>,
        y: Vec<f64>,
        style: SeriesStyle,
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
pub(crate) fn draw_chart(chart: &Chart) -> Scene {
    let panels: Vec<&ChartPanel> = chart.panels.iter().filter(|panel| panel.is_shown).collect();
    let legend_entries = collect_legend_entries(chart, &panels);
    let width = FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN;
    let legend_height = measure_legend_height(&legend_entries, width);
    let panels_height: f64 = panels.iter().map(|panel| panel.height + PANEL_GAP).sum();
    let label_heights =
        chart.marks.iter().map(|mark| text_width(&mark.label, TICK_SIZE, false) + 22.0);
    let label_height = label_heights.fold(0.0, f64::max);
    let total_height =
        HEADING_HEIGHT + label_height + panels_height + BOTTOM_MARGIN + legend_height + 4.0;
    let mut scene =
        Scene::new(FIGURE_WIDTH, total_height, format!("{}. {}", chart.title, chart.subtitle));
    draw_heading(&mut scene, &chart.title, &chart.subtitle);
    let x_scale = chart_x_scale(chart);
    let mut y = HEADING_HEIGHT + label_height;
    for (index, &chart_panel) in panels.iter().enumerate() {
        let panel = Panel {
            x: LEFT_MARGIN,
            y,
            width,
            height: chart_panel.height,
            x_scale,
            y_scale: panel_y_scale(chart_panel),
        };
        panel.draw_grid_lines(&mut scene);
        let mut dots = Vec::new();
        scene.draw_clipped(panel.outline(), |scene| {
            dots = draw_panel(scene, chart, chart_panel, &panel);
        });
        if !has_visible_points(chart_panel) {
            panel.write_centred(&mut scene, NO_VALUES_TEXT);
        }
        draw_marks(&mut scene, chart, &panel, index == 0);
        draw_stars(&mut scene, chart_panel, &panel);
        let is_last_panel = index + 1 == panels.len();
        panel.draw_frame(&mut scene, is_last_panel, true);
        // Dots are drawn after the frame and without clipping, so that they are whole at the edge
        // too.
        let is_in_panel = |y: f64| (panel.y..=panel.y + panel.height).contains(&y);
        for (position, radius, colour) in dots.into_iter().filter(|([_, y], ..)| is_in_panel(*y)) {
            scene.fill_outline(Outline::circle(position, radius), colour);
        }
        panel.draw_y_label(&mut scene, &chart_panel.label.to_string(), 62.0);
        if is_last_panel {
            panel.draw_x_label(&mut scene, &chart.x_label.to_string());
        }
        y += chart_panel.height + PANEL_GAP;
    }
    draw_legend(&mut scene, &legend_entries, LEFT_MARGIN, y - PANEL_GAP + BOTTOM_MARGIN, width);
    scene
}

/// Returns the scale of the x axis: the range of all series, with a margin if all are dots.
pub(crate) fn chart_x_scale(chart: &Chart) -> AxisScale {
    let all_series = || chart.panels.iter().flat_map(|panel| &panel.series);
    let xs = all_series().flat_map(|series| series.x.iter().copied());
    if !chart.is_x_log && all_series().all(|series| series.style == SeriesStyle::Dots) {
        return AxisScale::around_values(xs);
    }
    if chart.is_x_log {
        let positive_xs = xs.filter(|x| has_logarithm(*x));
        let (low, high) = extremes(positive_xs).unwrap_or((1.0, 10.0));
        return AxisScale::logarithmic(low, if high > low { high } else { 10.0 * low });
    }
    let (low, high) = extremes(xs).unwrap_or((0.0, 1.0));
    // If all series have only one x, it is in the middle, so that its dots are whole.
    if high <= low {
        let half_width = 0.5_f64.max(1e-6 * low.abs());
        return AxisScale::linear(low - half_width, low + half_width);
    }
    AxisScale::linear(low, high)
}

/// Returns the scale of a panel's y axis: its given range, or the range of its series and levels.
pub(crate) fn panel_y_scale(panel: &ChartPanel) -> AxisScale {
    if let Some((low, high)) = panel.y_range {
        return if panel.is_log {
            AxisScale::logarithmic(low, high)
        } else {
            AxisScale::linear(low, high)
        };
    }
    let value_lists = panel.series.iter().flat_map(|series| match &series.style {
        SeriesStyle::Band(low, high) => [&low[..], &high[..]],
        _ => [&series.y[..], &[]],
    });
    let shown_values =
        value_lists.flatten().copied().chain(panel.levels.iter().map(|(value, _)| *value));
    if panel.is_log {
        let (low, high) =
            extremes(shown_values.filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        AxisScale::logarithmic(low / 1.15, high * 1.15)
    } else {
        AxisScale::around_values(shown_values)
    }
}

/// The text in a panel without curves, dots and stars.
const NO_VALUES_TEXT: &str = "no values to show";

/// Returns whether a panel has a point of a line, a dot or a star to draw.
fn has_visible_points(panel: &ChartPanel) -> bool {
    let is_shown = |y: &f64| y.is_finite() && (!panel.is_log || *y > 0.0);
    let has_points = |series: &Series| {
        let has_any = |ys: &[f64]| ys.iter().any(is_shown);
        match &series.style {
            SeriesStyle::Band(low, high) => has_any(&series.y) || has_any(low) || has_any(high),
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
    chart_panel: &ChartPanel,
    panel: &Panel,
) -> Vec<([f64; 2], f64, Colour)> {
    let mut dots = Vec::new();
    for (ranges, colour) in
        [(&chart.shaded_ranges, UNSTABLE_SHADE), (&chart_panel.mixed_ranges, BOTH_SIDES_COLOUR)]
    {
        if ranges.is_empty() {
            continue;
        }
        let mut shaded_areas = Outline::default();
        for range in ranges {
            let [from, to] = range.map(|x| panel.x_pixel(x));
            // A shade narrower than 1 px would not be visible.
            shaded_areas.add_rectangle(from, panel.y, (to - from).max(1.0), panel.height);
        }
        scene.fill_outline(shaded_areas, colour);
    }
    for series in &chart_panel.series {
        let xs = &series.x;
        let sample_pixel = |ys: &[f64], k: usize| {
            (xs[k].is_finite() && ys[k].is_finite()).then(|| panel.pixel(xs[k], ys[k]))
        };
        if let SeriesStyle::Band(low, high) = &series.style {
            let band_edges: Vec<_> =
                (0..xs.len()).map(|k| sample_pixel(low, k).zip(sample_pixel(high, k))).collect();
            let mut outline = Outline::default();
            for run in band_edges.split(Option::is_none).filter(|run| !run.is_empty()) {
                let (mut low_points, mut high_points): (Vec<[f64; 2]>, Vec<[f64; 2]>) =
                    run.iter().flatten().copied().unzip();
                // The band at an isolated point is as wide as its dot.
                for side in [&mut low_points, &mut high_points] {
                    if let [[x, y]] = side[..] {
                        *side = vec![[x - ISOLATED_RADIUS, y], [x + ISOLATED_RADIUS, y]];
                    }
                }
                low_points.extend(high_points.into_iter().rev());
                outline.add_polygon(&low_points);
            }
            scene.fill_outline(outline, series.colour.with_alpha(90));
        }
        if series.style == SeriesStyle::Dots {
            let pixels = (0..xs.len()).filter_map(|k| sample_pixel(&series.y, k));
            dots.extend(pixels.map(|point| (point, DOT_RADIUS, series.colour)));
            continue;
        }
        let indices = envelope_indices(
            xs,
            &series.y,
            panel.x_scale.from,
            panel.x_scale.to,
            panel.width as usize,
        );
        let pixels: Vec<_> = indices.into_iter().map(|k| sample_pixel(&series.y, k)).collect();
        let mut outline = Outline::default();
        let isolated_points = outline.add_runs(&pixels);
        scene.draw_line(outline, series_stroke(series));
        dots.extend(
            isolated_points.into_iter().map(|point| (point, ISOLATED_RADIUS, series.colour)),
        );
    }
    for (value, _) in &chart_panel.levels {
        let y = panel.y_pixel(*value);
        scene.draw_line(Outline::line(&[[panel.x, y], [panel.x + panel.width, y]]), level_stroke());
    }
    dots
}

/// Returns the stroke of a series' line.
pub(crate) fn series_stroke(series: &Series) -> Stroke {
    match series.style {
        SeriesStyle::Solid(width) => Stroke::new_solid(series.colour, width),
        SeriesStyle::Dashed => Stroke::new_dashed(series.colour, 1.8, &[8.0, 5.0]),
        SeriesStyle::Band(..) | SeriesStyle::Dots => Stroke::new_solid(series.colour, 2.2),
    }
}

/// Returns the stroke of a level's line.
pub(crate) fn level_stroke() -> Stroke {
    Stroke::new_dashed(INK, 1.6, &[3.0, 3.0])
}

fn mark_stroke() -> Stroke {
    Stroke::new_dashed(MUTED_COLOUR, 1.2, &[6.0, 4.0])
}

/// Radius of a dot, px. Doubling it quadruples the ink of dense series.
pub(crate) const DOT_RADIUS: f64 = 2.8;

/// Radius of a star from centre to tip, px.
const STAR_RADIUS: f64 = 10.0;

/// A rectangle: left, top, right and bottom, px.
type Rectangle = [f64; 4];

/// Draws all stars, then their labels. A label is placed where it covers no star and no earlier
/// label; among such positions, that with the fewest curves across it is chosen.
fn draw_stars(scene: &mut Scene, chart_panel: &ChartPanel, panel: &Panel) {
    let mut occupied_areas: Vec<Rectangle> = Vec::new();
    for (x, y, _) in &chart_panel.stars {
        let [x, y] = panel.pixel(*x, *y);
        scene.fill_outline(Outline::star([x, y], STAR_RADIUS), INK);
        occupied_areas.push([x - STAR_RADIUS, y - STAR_RADIUS, x + STAR_RADIUS, y + STAR_RADIUS]);
    }
    for (x, y, label) in &chart_panel.stars {
        let [x, y] = panel.pixel(*x, *y);
        let width = text_width(label, TICK_SIZE, true);
        // The candidates lie on both sides of the star, from close to it to farther above and
        // below.
        let x_candidates = [x - STAR_RADIUS - 2.0 - width, x + STAR_RADIUS + 2.0];
        let y_offsets = [-6.0, 18.0, -24.0, 36.0, -42.0, 54.0];
        let candidates = y_offsets.iter().flat_map(|dy| x_candidates.map(|left| [left, y + dy]));
        let text_extent =
            |[left, base]: [f64; 2]| [left, base - TICK_SIZE, left + width, base + 4.0];
        let is_unobstructed = |position: &[f64; 2]| {
            let [left, top, right, bottom] = text_extent(*position);
            left > panel.x
                && right < panel.x + panel.width
                && top > panel.y
                && bottom < panel.y + panel.height
                && occupied_areas.iter().all(|rectangle| {
                    right < rectangle[0]
                        || left > rectangle[2]
                        || bottom < rectangle[1]
                        || top > rectangle[3]
                })
        };
        let label_position = candidates.filter(is_unobstructed).min_by_key(|label_position| {
            count_curves_through(chart_panel, panel, text_extent(*label_position))
        });
        let label_position = label_position.unwrap_or([x_candidates[1], y + 18.0]);
        occupied_areas.push(text_extent(label_position));
        let text = Text::new(label.clone(), label_position, TICK_SIZE).with_bold_face();
        scene.draw_text(Text { halo: Some(PAPER), ..text });
    }
}

/// Returns the number of curves of a panel that pass through a rectangle.
fn count_curves_through(chart_panel: &ChartPanel, panel: &Panel, extent: Rectangle) -> usize {
    let passes_through = |series: &&Series| {
        let pixels = series.x.iter().zip(&series.y).map(|(&x, &y)| panel.pixel(x, y));
        let pixels: Vec<[f64; 2]> = pixels.collect();
        pixels.windows(2).any(|pair| segment_intersects([pair[0], pair[1]], extent))
    };
    chart_panel.series.iter().filter(passes_through).count()
}

/// Returns whether a part of a line segment lies within a rectangle (Liang-Barsky clipping).
fn segment_intersects([from, to]: [[f64; 2]; 2], [left, top, right, bottom]: Rectangle) -> bool {
    let mut entry_fraction = 0.0_f64;
    let mut exit_fraction = 1.0_f64;
    for (k, (low, high)) in [(left, right), (top, bottom)].into_iter().enumerate() {
        let step = to[k] - from[k];
        if step == 0.0 {
            if !(low..=high).contains(&from[k]) {
                return false;
            }
            continue;
        }
        let [at_low, at_high] = [(low - from[k]) / step, (high - from[k]) / step];
        entry_fraction = entry_fraction.max(at_low.min(at_high));
        exit_fraction = exit_fraction.min(at_low.max(at_high));
    }
    // A segment with a NaN end belongs to a gap of the curve.
    from.iter().chain(&to).all(|coordinate| coordinate.is_finite())
        && entry_fraction <= exit_fraction
}

/// Draws the marks through a panel, and their labels above it if `is_labelled`. A label that would
/// cover the one before it is moved to the right.
fn draw_marks(scene: &mut Scene, chart: &Chart, panel: &Panel, is_labelled: bool) {
    let mut next_free_x = f64::NEG_INFINITY;
    for mark in &chart.marks {
        let x = panel.x_pixel(mark.x);
        scene.draw_line(Outline::line(&[[x, panel.y], [x, panel.y + panel.height]]), mark_stroke());
        let label_x = x.max(next_free_x);
        if is_labelled && label_x <= panel.x + panel.width + 8.0 {
            next_free_x = label_x + TICK_SIZE + 2.0;
            let leader_line = Outline::line(&[[x, panel.y], [label_x, panel.y - 12.0]]);
            scene.draw_line(leader_line, Stroke::new_solid(MUTED_COLOUR, 1.2));
            scene.draw_text(
                Text::new(mark.label.clone(), [label_x + 5.0, panel.y - 16.0], TICK_SIZE)
                    .with_rotation(),
            );
        }
    }
}

fn collect_legend_entries(chart: &Chart, panels: &[&ChartPanel]) -> Vec<(LegendSymbol, String)> {
    let mut entries: Vec<(LegendSymbol, String)> = Vec::new();
    let mut add_entry = |symbol: LegendSymbol, name: &str| {
        if !name.is_empty() && !entries.iter().any(|(_, known_name)| known_name == name) {
            entries.push((symbol, name.to_owned()));
        }
    };
    for panel in panels {
        for series in &panel.series {
            if series.style == SeriesStyle::Dots {
                let dot = Outline::circle([0.0, 0.0], 1.4 * DOT_RADIUS);
                add_entry(LegendSymbol::Shape(dot, true, series.colour), &series.name);
                continue;
            }
            let mut stroke = series_stroke(series);
            stroke.width = stroke.width.max(2.2);
            add_entry(LegendSymbol::Line(stroke), &series.name);
        }
        if let [.., under, over] = &panel.series[..]
            && over.colour.alpha < 255
        {
            let overlap_stroke = Stroke::new_solid(over.colour.over(under.colour), 2.2);
            add_entry(LegendSymbol::Line(overlap_stroke), OVERLAP_MEANING);
        }
        for (_, meaning) in &panel.levels {
            add_entry(LegendSymbol::Line(level_stroke()), meaning);
        }
        if !panel.mixed_ranges.is_empty() {
            add_entry(LegendSymbol::Area(BOTH_SIDES_COLOUR), MIXED_MEANING);
        }
        if !panel.stars.is_empty() {
            add_entry(LegendSymbol::Shape(Outline::star([0.0, 0.0], 9.0), true, INK), STAR_MEANING);
        }
    }
    if !chart.marks.is_empty() {
        add_entry(LegendSymbol::Line(mark_stroke()), &chart.mark_meaning);
    }
    if !chart.shaded_ranges.is_empty() {
        add_entry(LegendSymbol::Area(UNSTABLE_SHADE), &chart.shade_meaning);
    }
    entries
}

/// The legend entry of [`ChartPanel::mixed_ranges`].
pub const MIXED_MEANING: &str = "both: reliable and unreliable points";

/// Returns whether positive values span more than a factor of ten, which calls for a logarithmic
/// axis.
pub fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    ColourScale::without_limit(values).axis_scale.is_log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_stars_avoid_the_curves() {
        let speeds: Vec<f64> = (0..=30).map(|k| 10.0 * f64::from(k)).collect();
        let horizontal_series =
            |y: f64| Series::new("", INK, speeds.clone(), vec![y; 31], SeriesStyle::Solid(2.0));
        // The second curve lies at the place that the first star's label prefers.
        let mut series =
            vec![horizontal_series(147.8), horizontal_series(154.0), horizontal_series(162.1)];
        series.push(Series { y: speeds.clone(), ..horizontal_series(0.0) });
        let stars = [147.8, 162.1].map(|at| (at, at, format!("{at} Hz"))).to_vec();
        let panel = ChartPanel {
            stars,
            y_range: Some((0.0, 300.0)),
            ..ChartPanel::new("frequency", Label::new("Frequency", ""), series)
        };
        let chart = Chart {
            title: String::new(),
            subtitle: String::new(),
            x_label: Label::new("Speed", "Hz"),
            is_x_log: false,
            panels: vec![panel],
            marks: Vec::new(),
            mark_meaning: String::new(),
            shaded_ranges: Vec::new(),
            shade_meaning: String::new(),
        };
        let scene = draw_chart(&chart);
        let star_labels = scene.items.iter().filter_map(|item| match item {
            crate::scene::SceneItem::Text(text) if text.halo.is_some() => Some(text),
            _ => None,
        });
        let chart_panel = &chart.panels[0];
        let x = LEFT_MARGIN;
        let y = HEADING_HEIGHT;
        let xs = chart_x_scale(&chart);
        let ys = panel_y_scale(chart_panel);
        let panel = Panel {
            x,
            y,
            width: FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN,
            height: chart_panel.height,
            x_scale: xs,
            y_scale: ys,
        };
        let mut count = 0;
        for text in star_labels {
            let [left, base] = text.position;
            let width = text_width(&text.text, TICK_SIZE, true);
            let text_extent = [left, base - TICK_SIZE, left + width, base + 4.0];
            assert_eq!(count_curves_through(chart_panel, &panel, text_extent), 0, "{}", text.text);
            count += 1;
        }
        assert_eq!(count, 2);
    }
}
