//! The influence of each of a design's parameters on a quantity, as bars.

use crate::axis::AxisScale;
use crate::colour::{FAILED, GOOD_SIDE};
use crate::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, TICK_SIZE,
    heading, legend, legend_height,
};
use crate::influence::chance_correlation;
use crate::label;
use crate::raster::text_width;
use crate::scatter::Scatter;
use crate::scene::{Anchor, Colour, INK, Outline, Scene, Stroke, Text};

/// Right margin for the numbers beside the bars, px.
const RIGHT_MARGIN: f64 = 70.0;
/// Distance between two bars, px.
const ROW_HEIGHT: f64 = 40.0;

/// Height of a bar, px.
const BAR_HEIGHT: f64 = 20.0;

/// Maximum number of parameters shown, the most influential ones. Basis: a figure of one page.
const MAX_PARAMETERS: usize = 24;

/// The legend entry of a bar's outline.
const OUTLINE_MEANING: &str = "rising and falling alike (root of the correlation ratio)";

/// The text in a panel without bars.
const NO_INFLUENCE: &str = "no two points have values that differ";

/// The colour of correlations that may be chance.
const CHANCE_COLOUR: Colour = FAILED.with_alpha(110);

/// Draws a bar for each parameter, the most influential on top.
pub(crate) fn draw(scatter: &Scatter) -> Scene {
    let mut places = scatter.by_influence();
    places.truncate(MAX_PARAMETERS);
    let words = |k: usize| scatter.parameters[k].label.words.clone();
    let widest = places.iter().map(|&k| text_width(&words(k), LABEL_SIZE, false));
    let left = widest.fold(80.0, f64::max).min(320.0) + 40.0;
    let entries = [
        (LegendSymbol::Area(GOOD_SIDE), "rank correlation".to_owned()),
        (LegendSymbol::Line(Stroke::solid(INK, 1.6)), OUTLINE_MEANING.to_owned()),
        (LegendSymbol::Area(CHANCE_COLOUR), "may be chance (95 %)".to_owned()),
    ];
    let room = FIGURE_WIDTH - left - RIGHT_MARGIN;
    let legend_height = legend_height(&entries, FIGURE_WIDTH - 60.0);
    let height = ROW_HEIGHT * places.len() as f64 + 12.0;
    let total = HEADING_HEIGHT + height + BOTTOM_MARGIN + legend_height + 8.0;
    let channel = match scatter.channel.as_str() {
        "" => String::new(),
        channel => format!(": {channel}"),
    };
    let title = format!("What it depends on: {}{channel}", scatter.label.words.to_lowercase());
    let with_value = scatter.count_with_value();
    let all = scatter.parameters.len();
    let mut notes = Vec::new();
    if with_value < scatter.points.len() {
        notes.push(format!("{with_value} with a value"));
    }
    if all > MAX_PARAMETERS {
        notes.push(format!("the {MAX_PARAMETERS} most influential of {all} parameters"));
    }
    let subtitle = scatter.subtitle(&notes);
    let mut scene = Scene::new(FIGURE_WIDTH, total, format!("{title}. {subtitle}"));
    heading(&mut scene, &title, &subtitle);
    let panel = Panel {
        x: left,
        y: HEADING_HEIGHT,
        width: room,
        height,
        xs: AxisScale::linear(-1.0, 1.0),
        // Bars have names instead of numbers.
        ys: AxisScale::linear(0.0, 0.0),
    };
    panel.draw_grid_lines(&mut scene);
    let span = |scene: &mut Scene, from: f64, to: f64, y: f64, height: f64, colour: Colour| {
        let [from, to] = [from.min(to), from.max(to)].map(|x| panel.at_x(x));
        scene.fill(Outline::rectangle(from, y, to - from, height), colour);
    };
    let noise = chance_correlation(with_value);
    span(&mut scene, -noise, noise, panel.y, height, CHANCE_COLOUR);
    let middle = panel.at_x(0.0);
    let axis = Outline::line(&[[middle, panel.y], [middle, panel.y + height]]);
    scene.line(axis, Stroke::solid(INK, 1.2));
    for (row, &k) in places.iter().enumerate() {
        let centre = panel.y + 6.0 + ROW_HEIGHT * (row as f64 + 0.5);
        let text = Text::new(words(k), [left - 12.0, centre + 0.35 * LABEL_SIZE], LABEL_SIZE);
        scene.text(text.anchor(Anchor::End));
        let Some(found) = scatter.parameters[k].influence else { continue };
        span(&mut scene, 0.0, found.rank, centre - BAR_HEIGHT / 2.0, BAR_HEIGHT, GOOD_SIDE);
        if let Some(any) = found.any.filter(|any| *any > found.rank.abs()) {
            let end = panel.at_x(any.copysign(found.rank));
            let from = middle.min(end);
            let to = middle.max(end);
            let outline =
                Outline::rectangle(from, centre - BAR_HEIGHT / 2.0, to - from, BAR_HEIGHT);
            scene.line(outline, Stroke::solid(INK, 1.6));
        }
        let phrase = signed(found.rank);
        let at = [panel.x + room + 10.0, centre + 0.35 * TICK_SIZE];
        scene.text(Text::new(phrase, at, TICK_SIZE));
    }
    if places.iter().all(|&k| scatter.parameters[k].influence.is_none()) {
        panel.write_centred(&mut scene, NO_INFLUENCE);
    }
    panel.draw_frame(&mut scene, true, false);
    panel.x_label(&mut scene, "Rank correlation (Spearman)");
    let y = panel.y + height + BOTTOM_MARGIN;
    legend(&mut scene, &entries, 40.0, y, FIGURE_WIDTH - 60.0);
    scene
}

/// Returns a correlation with its sign.
fn signed(rank: f64) -> String {
    let sign = if rank < 0.0 { "-" } else { "+" };
    format!("{sign}{}", label::significant(rank.abs(), 2))
}
