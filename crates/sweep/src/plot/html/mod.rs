//! One self-contained page: the numbers, and the script that draws them. Opens from a disk, needs no network.

mod embed;
mod histories;

use serde_json::{Map, Value, json};

use super::chart::{Chart, ChartPanel, Series, Style};
use super::colour::{ColourScale, DISTINCT, FAILED, LEVELS};
use super::contour::zero_lines;
use super::error::PlotError;
use super::figures;
use super::grid::{Grid, GridAxis};
use super::label;
use super::layer::{Layer, Level, channels, layer};
use super::read::{Table, Values};
use super::scene::{Colour, INK};
use super::svg::escape;
use super::{PlotOptions, Quantity};

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const CORE: &str = include_str!("core.js");
const CHART: &str = include_str!("chart.js");
const MAP: &str = include_str!("map.js");
const START: &str = include_str!("start.js");

/// The page of a map of two or more axes: every quantity and channel, and with `--traces` the time histories.
///
/// # Errors
/// [`PlotError::NotThere`] for options that the file does not have, and any that reading the traces brings.
pub(crate) fn map_page(table: &Table, grid: &Grid, options: &PlotOptions) -> Result<String, PlotError> {
    let mut layers = Vec::new();
    let mut add = |group: &str, channel: Option<&str>, quantity: Quantity| -> Result<(), PlotError> {
        let channels = channel.map(str::to_owned).into_iter().collect();
        let layer = layer(table, &PlotOptions { quantity, channels, ..PlotOptions::default() })?;
        layers.push(layer_json(grid, group, channel.unwrap_or_default(), &layer));
        Ok(())
    };
    add("ratio", None, Quantity::Ratio)?;
    for (name, _) in channels(table, "ratio_") {
        add("ratio", Some(name), Quantity::Ratio)?;
    }
    for (prefix, group, quantity) in
        [("nonlinear_", "nonlinear", Quantity::Nonlinear), ("linear_", "linear", Quantity::Linear)]
    {
        for (name, _) in channels(table, prefix) {
            add(group, Some(name), quantity)?;
        }
    }
    for (column, group, quantity) in [
        ("min_gap_nonlinear_m", "gap-nonlinear", Quantity::GapNonlinear),
        ("min_gap_linear_m", "gap-linear", Quantity::GapLinear),
    ] {
        if table.column(column).is_some() {
            add(group, None, quantity)?;
        }
    }
    let first = first_view(table, grid, options)?;
    let palette =
        |scale: &ColourScale| -> Vec<String> { (0..LEVELS).map(|k| scale.colour(k).css()).collect() };
    let traces = match &options.traces {
        Some(folder) => histories::read(folder, table, grid)?,
        None => Value::Null,
    };
    let title = "Where the linear model can be trusted";
    let data = json!({
        "kind": "map",
        "title": title,
        "subtitle": figures::map::counts(table),
        "limit": table.ratio_limit(),
        "axes": grid.axes.iter().map(axis_json).collect::<Vec<_>>(),
        "columns": columns_json(table, grid),
        "codes": codes_json(table, grid),
        "layers": layers,
        "first": first,
        "palettes": {
            "diverging": palette(&ColourScale::ratio(std::iter::empty(), 2.0)),
            "sequential": palette(&ColourScale::amplitude(std::iter::empty())),
            "kinds": DISTINCT.map(Colour::css),
            "failed": FAILED.css(),
        },
        "traces": traces,
        "provenance": table.provenance,
    });
    Ok(page(title, &data, &[CORE, CHART, MAP, START]))
}

/// The page of a chart: every panel, those that a picture shows at first.
pub(crate) fn chart_page(table: &Table, chart: &Chart) -> String {
    let data = json!({
        "kind": "chart",
        "title": chart.title,
        "subtitle": chart.subtitle,
        "chart": chart_json(chart),
        "provenance": table.provenance,
    });
    page(&chart.title, &data, &[CORE, CHART, START])
}

fn page(title: &str, data: &Value, scripts: &[&str]) -> String {
    // Within a script element only `<` could end it, or start a comment.
    let data = data.to_string().replace('<', "\\u003c");
    PAGE.replace("{{title}}", &escape(title))
        .replace("{{style}}", STYLE)
        .replace("{{script}}", &scripts.concat())
        .replace("{{data}}", &data)
}

/// The layer and the cut that the page opens with.
fn first_view(table: &Table, grid: &Grid, options: &PlotOptions) -> Result<Value, PlotError> {
    let group = match options.quantity {
        Quantity::Ratio => "ratio",
        Quantity::Nonlinear => "nonlinear",
        Quantity::Linear => "linear",
        Quantity::GapNonlinear => "gap-nonlinear",
        Quantity::GapLinear => "gap-linear",
        Quantity::Status => "status",
    };
    let free_choice = options.channels.is_empty()
        && matches!(options.quantity, Quantity::Status | Quantity::Nonlinear | Quantity::Linear);
    if !free_choice {
        layer(table, options)?;
    }
    let cuts = figures::map::Slices::of(table, grid, options)?;
    Ok(json!({
        "group": group,
        "channel": options.channels.first().map_or("", String::as_str),
        "rest": cuts.first(),
    }))
}

fn axis_json(axis: &GridAxis) -> Value {
    json!({
        "name": axis.name,
        "words": axis.words,
        "unit": axis.unit,
        "log": axis.log,
        "values": axis.values,
        "borders": axis.borders(),
    })
}

/// Every column of results as 32 bit floats in grid order, NaN where the file has no value.
fn columns_json(table: &Table, grid: &Grid) -> Value {
    let mut columns = Map::new();
    let axes: Vec<&str> = grid.axes.iter().map(|axis| axis.name.as_str()).collect();
    for column in &table.columns {
        let Some(numbers) = column.numbers() else { continue };
        let counter = column.name.starts_with("steps_") || column.name.starts_with("rejected_");
        if counter || axes.contains(&column.name.as_str()) {
            continue;
        }
        let values = grid.rows().iter().map(|row| row.map_or(f64::NAN, |row| numbers[row]));
        let (unit, factor) = label::shown(&column.unit);
        columns.insert(
            column.name.clone(),
            json!({
                "unit": unit,
                "factor": factor,
                "description": column.description,
                "data": embed::floats(values),
            }),
        );
    }
    Value::Object(columns)
}

/// Columns of few distinct words, as their numbers in grid order; 255 where the file has none.
fn codes_json(table: &Table, grid: &Grid) -> Value {
    let mut coded = Map::new();
    for column in &table.columns {
        let word = |row: usize| match &column.values {
            Values::Text(texts) => texts[row].clone(),
            Values::Flag(flags) => flags[row].map(|flag| flag.to_string()),
            Values::Number(_) => None,
        };
        if column.numbers().is_some() {
            continue;
        }
        let mut words: Vec<String> = (0..table.rows).filter_map(word).collect();
        words.sort();
        words.dedup();
        // Names that are not among the first 255 could only come from a file that is not ours.
        words.truncate(255);
        let code = |row: &Option<usize>| {
            let word = row.and_then(word)?;
            words.binary_search(&word).ok().and_then(|code| u8::try_from(code).ok())
        };
        let codes = grid.rows().iter().map(|row| code(row).unwrap_or(u8::MAX));
        coded.insert(column.name.clone(), json!({ "data": embed::bytes(codes), "words": words }));
    }
    Value::Object(coded)
}

fn layer_json(grid: &Grid, group: &str, channel: &str, layer: &Layer) -> Value {
    let column = match (group, channel) {
        ("ratio", "") => "ratio_max".to_owned(),
        ("gap-nonlinear", _) => "min_gap_nonlinear_m".to_owned(),
        ("gap-linear", _) => "min_gap_linear_m".to_owned(),
        (group, channel) => format!("{group}_{channel}"),
    };
    let scale = match layer.scale {
        ColourScale::Diverging { log, low, centre, high, reversed } => {
            json!({ "log": log, "low": low, "centre": centre, "high": high, "reversed": reversed })
        }
        ColourScale::Sequential(scale) => json!({ "log": scale.log, "low": scale.from, "high": scale.to }),
    };
    let ticks: Vec<Value> =
        layer.scale.ticks().iter().map(|tick| json!([embed::short(tick.value), tick.label])).collect();
    json!({
        "group": group,
        "channel": channel,
        "channelWords": label::channel(channel),
        "title": layer.title,
        "label": layer.label,
        "column": column,
        "scale": scale,
        "ticks": ticks,
        "level": layer.level.as_ref().map(|level| level_json(grid, layer, level)),
    })
}

/// The level, and its lines in data coordinates for each cut through the axes after the second, in grid order.
fn level_json(grid: &Grid, layer: &Layer, level: &Level) -> Value {
    let [x_axis, y_axis] = [&grid.axes[0], &grid.axes[1]];
    let cuts: usize = grid.axes[2..].iter().map(|axis| axis.values.len()).product();
    let (xs, ys) = (x_axis.even(), y_axis.even());
    let back = |axis: &GridAxis, even: f64| embed::short(if axis.log { even.exp() } else { even });
    let lines: Vec<Value> = (0..cuts)
        .map(|cut| {
            let value = |x: usize, y: usize| {
                let row = grid.rows()[(x * ys.len() + y) * cuts + cut];
                level.offset(row.map_or(f64::NAN, |row| layer.values[row]))
            };
            let lines = zero_lines(&xs, &ys, value);
            let flat = |line: Vec<[f64; 2]>| -> Vec<f64> {
                line.into_iter().flat_map(|[x, y]| [back(x_axis, x), back(y_axis, y)]).collect()
            };
            json!(lines.into_iter().map(flat).collect::<Vec<_>>())
        })
        .collect();
    json!({ "value": level.value, "line": level.line, "above": level.above[1], "below": level.below[1], "lines": lines })
}

fn chart_json(chart: &Chart) -> Value {
    json!({
        "xLabel": chart.x_label,
        "xLog": chart.x_log,
        "grids": chart.grids.iter().map(|grid| embed::floats(grid.iter().copied())).collect::<Vec<_>>(),
        "panels": chart.panels.iter().map(panel_json).collect::<Vec<_>>(),
        "marks": chart.marks.iter().map(|mark| json!([embed::short(mark.x), mark.label])).collect::<Vec<_>>(),
        "markMeaning": chart.mark_meaning,
    })
}

fn panel_json(panel: &ChartPanel) -> Value {
    let stars = panel.stars.iter().map(|(x, y, label)| json!([embed::short(*x), embed::short(*y), label]));
    json!({
        "name": panel.name,
        "label": panel.label,
        "shown": panel.shown,
        "log": panel.log,
        "range": panel.range.map(|(low, high)| [low, high]),
        "height": panel.height,
        "series": panel.series.iter().map(series_json).collect::<Vec<_>>(),
        "levels": panel.levels,
        "stars": stars.collect::<Vec<_>>(),
    })
}

fn series_json(series: &Series) -> Value {
    let data = |values: &[f64]| embed::floats(values.iter().copied());
    let (width, dashed, low, high) = match &series.style {
        Style::Solid(width) => (*width, false, None, None),
        Style::Dashed => (1.8, true, None, None),
        Style::Band(low, high) => (2.2, false, Some(data(low)), Some(data(high))),
    };
    json!({
        "name": series.name,
        "colour": if series.colour == INK { "ink".to_owned() } else { series.colour.css() },
        "grid": series.grid,
        "alpha": embed::short(f64::from(series.colour.alpha) / 255.0),
        "width": width,
        "dashed": dashed,
        "y": data(&series.y),
        "low": low,
        "high": high,
    })
}
