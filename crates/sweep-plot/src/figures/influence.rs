//! The influence of each of a design's parameters on a quantity, as bars.

use crate::axis::AxisScale;
use crate::colour::{FAILED_COLOUR, GOOD_SIDE_COLOUR};
use crate::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, TICK_SIZE,
    draw_heading, draw_legend, measure_legend_height,
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
const MAX_BARS: usize = 24;

/// The legend entry of a bar's outline.
const OUTLINE_MEANING: &str = "rising and falling alike (root of the correlation ratio)";

/// The text in a panel without bars.
const NO_INFLUENCE_TEXT: &str = "no two points have values that differ";

/// The colour of correlations that may be chance.
const CHANCE_COLOUR: Colour = FAILED_COLOUR.with_alpha(110);

/// Draws a bar for each parameter, the most influential on top.
pub(crate) fn draw_influence(scatter: &Scatter) -> Scene {
    let mut indices = scatter.indices_by_influence();
    indices.truncate(MAX_BARS);
    let parameter_name = |k: usize| scatter.parameters[k].label.words.clone();
    let name_widths = indices.iter().map(|&k| text_width(&parameter_name(k), LABEL_SIZE, false));
    let left_margin = name_widths.fold(80.0, f64::max).min(320.0) + 40.0;
    let legend_entries = [
        (LegendSymbol::Area(GOOD_SIDE_COLOUR), "rank correlation".to_owned()),
        (LegendSymbol::Line(Stroke::new_solid(INK, 1.6)), OUTLINE_MEANING.to_owned()),
        (LegendSymbol::Area(CHANCE_COLOUR), "may be chance (95 %)".to_owned()),
    ];
    let panel_width = FIGURE_WIDTH - left_margin - RIGHT_MARGIN;
    let legend_height = measure_legend_height(&legend_entries, FIGURE_WIDTH - 60.0);
    let height = ROW_HEIGHT * indices.len() as f64 + 12.0;
    let total_height = HEADING_HEIGHT + height + BOTTOM_MARGIN + legend_height + 8.0;
    let channel = match scatter.channel.as_str() {
        "" => String::new(),
        channel => format!(": {channel}"),
    };
    let title = format!("What it depends on: {}{channel}", scatter.label.words.to_lowercase());
    let value_count = scatter.count_with_value();
    let parameter_count = scatter.parameters.len();
    let mut notes = Vec::new();
    if value_count < scatter.point_rows.len() {
        notes.push(format!("{value_count} with a value"));
    }
    if parameter_count > MAX_BARS {
        notes.push(format!("the {MAX_BARS} most influential of {parameter_count} parameters"));
    }
    let subtitle = scatter.subtitle(&notes);
    let mut scene = Scene::new(FIGURE_WIDTH, total_height, format!("{title}. {subtitle}"));
    draw_heading(&mut scene, &title, &subtitle);
    let panel = Panel {
        x: left_margin,
        y: HEADING_HEIGHT,
        width: panel_width,
        height,
        x_scale: AxisScale::linear(-1.0, 1.0),
        // Bars have names instead of numbers.
        y_scale: AxisScale::linear(0.0, 0.0),
    };
    panel.draw_grid_lines(&mut scene);
    let fill_range =
        |scene: &mut Scene, from: f64, to: f64, y: f64, height: f64, colour: Colour| {
            let [from, to] = [from.min(to), from.max(to)].map(|x| panel.x_pixel(x));
            scene.fill_outline(Outline::rectangle(from, y, to - from, height), colour);
        };
    let chance_limit = chance_correlation(value_count);
    fill_range(&mut scene, -chance_limit, chance_limit, panel.y, height, CHANCE_COLOUR);
    let zero_x = panel.x_pixel(0.0);
    let zero_line = Outline::line(&[[zero_x, panel.y], [zero_x, panel.y + height]]);
    scene.draw_line(zero_line, Stroke::new_solid(INK, 1.2));
    for (row, &k) in indices.iter().enumerate() {
        let row_centre_y = panel.y + 6.0 + ROW_HEIGHT * (row as f64 + 0.5);
        let text = Text::new(
            parameter_name(k),
            [left_margin - 12.0, row_centre_y + 0.35 * LABEL_SIZE],
            LABEL_SIZE,
        );
        scene.draw_text(text.with_anchor(Anchor::End));
        let Some(influence) = scatter.parameters[k].influence else { continue };
        fill_range(
            &mut scene,
            0.0,
            influence.rank_correlation,
            row_centre_y - BAR_HEIGHT / 2.0,
            BAR_HEIGHT,
            GOOD_SIDE_COLOUR,
        );
        if let Some(ratio) = influence
            .root_correlation_ratio
            .filter(|ratio| *ratio > influence.rank_correlation.abs())
        {
            let end_x = panel.x_pixel(ratio.copysign(influence.rank_correlation));
            let left_x = zero_x.min(end_x);
            let right_x = zero_x.max(end_x);
            let outline = Outline::rectangle(
                left_x,
                row_centre_y - BAR_HEIGHT / 2.0,
                right_x - left_x,
                BAR_HEIGHT,
            );
            scene.draw_line(outline, Stroke::new_solid(INK, 1.6));
        }
        let correlation_text = format_signed(influence.rank_correlation);
        let position = [panel.x + panel_width + 10.0, row_centre_y + 0.35 * TICK_SIZE];
        scene.draw_text(Text::new(correlation_text, position, TICK_SIZE));
    }
    if indices.iter().all(|&k| scatter.parameters[k].influence.is_none()) {
        panel.write_centred(&mut scene, NO_INFLUENCE_TEXT);
    }
    panel.draw_frame(&mut scene, true, false);
    panel.draw_x_label(&mut scene, "Rank correlation (Spearman)");
    let y = panel.y + height + BOTTOM_MARGIN;
    draw_legend(&mut scene, &legend_entries, 40.0, y, FIGURE_WIDTH - 60.0);
    scene
}

/// Returns a correlation with its sign.
fn format_signed(rank_correlation: f64) -> String {
    let sign = if rank_correlation < 0.0 { "-" } else { "+" };
    format!("{sign}{}", label::format_significant(rank_correlation.abs(), 2))
}
