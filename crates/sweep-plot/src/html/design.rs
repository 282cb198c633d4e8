//! The page of a design: its scatter matrix, its histogram and the influence of its parameters.

use serde_json::{Value, json};

use super::{
    CHART_SCRIPT, CORE_SCRIPT, DESIGN_SCRIPT, START_SCRIPT, chart_json, embed, encode_curve,
    live_part_and_summary, write_page,
};
use crate::figures::{histogram, influence, matrix};
use crate::frame::HEADING_HEIGHT;
use crate::model::Figures;
use crate::scatter::{Scatter, Side};
use crate::{DesignView, PlotOptions, svg};

/// Writes the page, which opens with the figure that the options name.
pub(crate) fn design_page(scatter: &Scatter, options: &PlotOptions, model: &dyn Figures) -> String {
    let title = &scatter.title;
    let drawn_points = matrix::drawn_point_indices(scatter);
    let chart = histogram::histogram_chart(scatter);
    let encode_drawn_points =
        |values: &[f64]| embed::encode_floats(drawn_points.iter().map(|&k| values[k]));
    let axis_json = |axis: &matrix::MatrixAxis<'_>| {
        json!({
            "name": axis.name,
            "words": axis.label.words,
            "unit": axis.label.unit,
            "values": encode_drawn_points(axis.values),
            "log": axis.scale.is_log,
            "range": [axis.scale.from, axis.scale.to],
        })
    };
    let (picture, panels) = matrix::draw_matrix(scatter);
    let [top, width, height] = [HEADING_HEIGHT, picture.width, picture.height - HEADING_HEIGHT];
    let side_meanings = Side::ALL.map(|side| scatter.side_meaning(side));
    let data = json!({
        "kind": "design",
        "title": title,
        "subtitle": scatter.subtitle(&[]),
        "first": match options.view {
            Some(DesignView::Histogram) => "histogram",
            Some(DesignView::Influence) => "influence",
            _ => "scatter",
        },
        "scatter": {
            "picture": svg::write_svg(&picture),
            "view": [0.0, top, width, height],
            "panels": panels,
            "directions": matrix::matrix_axes(scatter).iter().map(axis_json).collect::<Value>(),
            "points": drawn_points.iter().map(|&k| scatter.point_rows[k]).collect::<Value>(),
            "of": drawn_points.iter().map(|&k| scatter.sides[k] as usize).collect::<Value>(),
            "sides": side_meanings,
            "note": matrix::matrix_notes(scatter).join("; "),
        },
        "histogram": {
            "title": chart.title,
            "subtitle": chart.subtitle,
            "chart": chart_json(&chart, encode_curve),
        },
        "influence": svg::write_svg(&influence::draw_influence(scatter)),
    });
    let axes: Vec<(&str, bool)> = scatter
        .parameters
        .iter()
        .map(|parameter| (parameter.name.as_str(), parameter.is_log))
        .collect();
    let (live_part, summary) = live_part_and_summary(&scatter.source, &axes, model);
    write_page(
        title,
        data,
        [&[CORE_SCRIPT, CHART_SCRIPT, DESIGN_SCRIPT], &[START_SCRIPT]],
        live_part,
        &scatter.source,
        &summary,
    )
}
