//! The page of a design: its scatter matrix, its histogram and the influence of its parameters.

use serde_json::{Value, json};

use super::{CHART, CORE, DESIGN, START, chart_json, computed, curve, embed, page};
use crate::figures::{histogram, influence, matrix};
use crate::frame::HEADING_HEIGHT;
use crate::model::Figures;
use crate::scatter::{Scatter, Side};
use crate::{DesignView, PlotOptions, svg};

/// Writes the page, which opens with the figure that the options name.
pub(crate) fn design_page(scatter: &Scatter, options: &PlotOptions, model: &dyn Figures) -> String {
    let title = &scatter.title;
    let drawn = matrix::drawn(scatter);
    let chart = histogram::chart(scatter);
    let pick = |values: &[f64]| embed::floats(drawn.iter().map(|&k| values[k]));
    let direction = |one: &matrix::MatrixAxis<'_>| {
        json!({
            "name": one.name,
            "words": one.label.words,
            "unit": one.label.unit,
            "values": pick(one.values),
            "log": one.scale.log,
            "range": [one.scale.from, one.scale.to],
        })
    };
    let (picture, panels) = matrix::draw(scatter);
    let [top, width, height] = [HEADING_HEIGHT, picture.width, picture.height - HEADING_HEIGHT];
    let sides = Side::ALL.map(|side| scatter.words(side));
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
            "picture": svg::write(&picture),
            "view": [0.0, top, width, height],
            "panels": panels,
            "directions": matrix::directions(scatter).iter().map(direction).collect::<Value>(),
            "points": drawn.iter().map(|&k| scatter.points[k]).collect::<Value>(),
            "of": drawn.iter().map(|&k| scatter.sides[k] as usize).collect::<Value>(),
            "sides": sides,
            "note": matrix::notes(scatter).join("; "),
        },
        "histogram": {
            "title": chart.title, "subtitle": chart.subtitle, "chart": chart_json(&chart, curve),
        },
        "influence": svg::write(&influence::draw(scatter)),
    });
    let axes: Vec<(&str, bool)> =
        scatter.parameters.iter().map(|one| (one.name.as_str(), one.log)).collect();
    let (live_part, summary) = computed(&scatter.source, &axes, model);
    page(title, data, [&[CORE, CHART, DESIGN], &[START]], live_part, &scatter.source, &summary)
}
