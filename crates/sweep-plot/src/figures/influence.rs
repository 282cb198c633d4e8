//! How much a quantity depends on each of a design's parameters.

use crate::axis::Scale;
use crate::colour::{CALM, FAILED};
use crate::frame::{
    HEADING_HEIGHT, LABEL_SIZE, Panel, Sign, TICK_SIZE, heading, legend, legend_height,
};
use crate::influence::chance;
use crate::label;
use crate::raster::text_width;
use crate::scatter::Scatter;
use crate::scene::{Anchor, Colour, INK, Outline, Scene, Stroke, Text};

const WIDTH: f64 = 880.0;
const RIGHT: f64 = 70.0;
const ROW: f64 = 40.0;
/// Height of a bar, px.
const BAR: f64 = 20.0;
const BELOW: f64 = 64.0;

/// Most parameters that are shown, the most influential ones.
const MOST_PARAMETERS: usize = 24;

/// What the outline of a bar means.
const ANY: &str = "rising and falling alike (root of the correlation ratio)";

/// Stands in a panel without bars.
const NO_INFLUENCE: &str = "no two points have values that differ";

/// The colour of what lies in the grey.
const GREY: Colour = FAILED.with_alpha(110);

/// Draws a bar for each parameter, the most influential on top.
pub(crate) fn draw(scatter: &Scatter) -> Scene {
    let mut places = scatter.by_influence();
    places.truncate(MOST_PARAMETERS);
    let words = |k: usize| scatter.parameters[k].label.words.clone();
    let widest = places.iter().map(|&k| text_width(&words(k), LABEL_SIZE, false));
    let left = widest.fold(80.0, f64::max).min(320.0) + 40.0;
    let entries = [
        (Sign::Area(CALM), "rank correlation".to_owned()),
        (Sign::Line(Stroke::solid(INK, 1.6)), ANY.to_owned()),
        (Sign::Area(GREY), "may be chance (95 %)".to_owned()),
    ];
    let room = WIDTH - left - RIGHT;
    let of_legend = legend_height(&entries, WIDTH - 60.0);
    let height = ROW * places.len() as f64 + 12.0;
    let total = HEADING_HEIGHT + height + BELOW + of_legend + 8.0;
    let channel = match scatter.channel.as_str() {
        "" => String::new(),
        channel => format!(": {channel}"),
    };
    let title = format!("What it depends on: {}{channel}", scatter.label.words.to_lowercase());
    let (valued, all) = (scatter.valued(), scatter.parameters.len());
    let mut notes = Vec::new();
    if valued < scatter.points.len() {
        notes.push(format!("{valued} with a value"));
    }
    if all > MOST_PARAMETERS {
        notes.push(format!("the {MOST_PARAMETERS} most influential of {all} parameters"));
    }
    let subtitle = scatter.subtitle(&notes);
    let mut scene = Scene::new(WIDTH, total, format!("{title}. {subtitle}"));
    heading(&mut scene, &title, &subtitle);
    let panel = Panel {
        x: left,
        y: HEADING_HEIGHT,
        width: room,
        height,
        xs: Scale::linear(-1.0, 1.0),
        // Bars are named, so that this axis has no numbers.
        ys: Scale::linear(0.0, 0.0),
    };
    panel.rules(&mut scene);
    let span = |scene: &mut Scene, from: f64, to: f64, y: f64, height: f64, colour: Colour| {
        let [from, to] = [from.min(to), from.max(to)].map(|x| panel.at_x(x));
        scene.fill(Outline::rectangle(from, y, to - from, height), colour);
    };
    let noise = chance(valued);
    span(&mut scene, -noise, noise, panel.y, height, GREY);
    let middle = panel.at_x(0.0);
    let axis = Outline::line(&[[middle, panel.y], [middle, panel.y + height]]);
    scene.line(axis, Stroke::solid(INK, 1.2));
    for (row, &k) in places.iter().enumerate() {
        let centre = panel.y + 6.0 + ROW * (row as f64 + 0.5);
        let text = Text::new(words(k), [left - 12.0, centre + 0.35 * LABEL_SIZE], LABEL_SIZE);
        scene.text(text.anchor(Anchor::End));
        let Some(found) = scatter.parameters[k].influence else { continue };
        span(&mut scene, 0.0, found.rank, centre - BAR / 2.0, BAR, CALM);
        if let Some(any) = found.any.filter(|any| *any > found.rank.abs()) {
            let end = panel.at_x(any.copysign(found.rank));
            let (from, to) = (middle.min(end), middle.max(end));
            let outline = Outline::rectangle(from, centre - BAR / 2.0, to - from, BAR);
            scene.line(outline, Stroke::solid(INK, 1.6));
        }
        let said = signed(found.rank);
        let at = [panel.x + room + 10.0, centre + 0.35 * TICK_SIZE];
        scene.text(Text::new(said, at, TICK_SIZE));
    }
    if places.iter().all(|&k| scatter.parameters[k].influence.is_none()) {
        panel.say(&mut scene, NO_INFLUENCE);
    }
    panel.frame(&mut scene, true, false);
    panel.x_label(&mut scene, "Rank correlation (Spearman)");
    let y = panel.y + height + BELOW;
    legend(&mut scene, &entries, 40.0, y, WIDTH - 60.0);
    scene
}

/// A correlation with its sign.
fn signed(rank: f64) -> String {
    let sign = if rank < 0.0 { "-" } else { "+" };
    format!("{sign}{}", label::significant(rank.abs(), 2))
}
