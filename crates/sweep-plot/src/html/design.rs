//! The page of a design: its scatter matrix, its histogram and what the quantity depends on.

use serde_json::{Value, json};

use super::{CHART, CORE, DESIGN, START, chart_json, embed, log_ticks_json, page, provenance};
use crate::View;
use crate::axis::Scale;
use crate::figures::{histogram, influence, matrix};
use crate::influence::chance;
use crate::label::Label;
use crate::scatter::{Scatter, Side};

/// The page, which opens with `first`.
pub(crate) fn page_of(scatter: &Scatter, first: Option<View>) -> String {
    let title = &scatter.title;
    let drawn = matrix::drawn(scatter);
    let chart = histogram::chart(scatter);
    let pick = |values: &[f64]| embed::floats(drawn.iter().map(|&k| values[k]));
    let direction = |label: &Label, values: &[f64], scale: Scale| {
        json!({
            "words": label.words,
            "unit": label.unit,
            "values": pick(values),
            "log": scale.log,
            "range": [scale.from, scale.to],
            "ticks": log_ticks_json(scale),
        })
    };
    let parameters = matrix::shown(scatter).into_iter().map(|k| &scatter.parameters[k]);
    let parameters = parameters
        .map(|one| direction(&one.label, &one.values, matrix::scale(&one.values, one.log)));
    let sides = Side::ALL.into_iter().zip(scatter.counts).map(|(side, count)| {
        let colour = matrix::colour(side);
        json!({ "words": scatter.words(side), "colour": colour.css(), "count": count })
    });
    let influences = scatter.by_influence().into_iter().map(|k| {
        let one = &scatter.parameters[k];
        let found = one.influence;
        json!([one.label.words, found.map(|found| found.rank), found.and_then(|found| found.any)])
    });
    let data = json!({
        "kind": "design",
        "title": title,
        "subtitle": scatter.subtitle(&[]),
        "first": match first {
            Some(View::Histogram) => "histogram",
            Some(View::Influence) => "influence",
            _ => "scatter",
        },
        "scatter": {
            "parameters": parameters.collect::<Value>(),
            "quantity": direction(
                &scatter.short,
                &scatter.quantity,
                matrix::scale(&scatter.quantity, scatter.log),
            ),
            "level": scatter.level.as_ref().map(|level| json!([level.value, level.line])),
            "points": drawn.iter().map(|&k| scatter.points[k]).collect::<Value>(),
            "of": drawn.iter().map(|&k| scatter.sides[k] as usize).collect::<Value>(),
            "sides": sides.collect::<Value>(),
            "note": matrix::notes(scatter).join("; "),
        },
        "histogram": {
            "title": chart.title, "subtitle": chart.subtitle, "chart": chart_json(&chart),
        },
        "influence": {
            "title": influence::title(scatter),
            "subtitle": influence::subtitle(scatter),
            "chance": chance(scatter.valued()),
            "rows": influences.collect::<Value>(),
        },
        "provenance": provenance(&scatter.source),
    });
    page(title, data, &[CORE, CHART, DESIGN, START])
}
