//! One self-contained page: the numbers, and the script that draws them. Opens from a disk, needs
//! no network.

mod design;
mod embed;
mod histories;
mod live;
mod report;

pub(crate) use design::page_of as design_page;
pub(crate) use report::about;

use serde_json::{Map as Object, Value, json};

use super::axis::{LEAST_TICKS, SLACK, Scale, Step, Tick, log_sets};
use super::chart::{Chart, ChartPanel, Series, Style, x_scale, y_scale};
use super::colour::{BOTH, ColourScale, DISTINCT, FAILED, LEVELS, SHADE};
use super::contour::{MOST_POINTS, leave_out_shortest, zero_lines};
use super::cuts::Cuts;
use super::error::PlotError;
use super::figures;
use super::gather::{Counts, Map};
use super::grid::GridAxis;
use super::label;
use super::layer::{self, Group, Layer, Level, Shown};
use super::read::Source;
use super::scene::{Colour, INK};
use super::svg::escape;
use super::swept::SweptAxis;
use super::table::{Column, Table};
use super::{Live, PlotOptions};
use sweep_parameter::Worse;

const PAGE: &str = include_str!("html/page.html");
const SHEET: &str = include_str!("html/sheet.html");
const STYLE: &str = include_str!("html/style.css");
const CORE: &str = include_str!("html/core.js");
const CHART: &str = include_str!("html/chart.js");
const BAR: &str = include_str!("html/bar.js");
const HISTORIES: &str = include_str!("html/histories.js");
const CELLS: &str = include_str!("html/cells.js");
const MAP: &str = include_str!("html/map.js");
const DESIGN: &str = include_str!("html/design.js");
const SPECTRUM: &str = include_str!("html/spectrum.js");
const POOL: &str = include_str!("html/pool.js");
const CURVES: &str = include_str!("html/curves.js");
const GROWTH: &str = include_str!("html/growth.js");
const LIVE: &str = include_str!("html/live.js");
const REPORT: &str = include_str!("html/report.js");
const START: &str = include_str!("html/start.js");

/// Bytes of a page that the values of a map's cells may take.
const CELL_BYTES: usize = 7_000_000;

/// Columns of a map file that a page carries: all results but the counts of steps.
pub(crate) fn carried<'a>(source: &'a Source, axes: &[SweptAxis]) -> Vec<&'a str> {
    let names = source.columns.iter().map(|column| column.name.as_str());
    names
        .filter(|name| !name.starts_with("steps_") && !name.starts_with("rejected_"))
        .filter(|name| axes.iter().all(|axis| axis.name != *name))
        .collect()
}

/// How many cells of a map a page has room for.
pub(crate) fn most_cells(columns: usize) -> usize {
    // A number takes four bytes, which base64 makes 5.3; besides the columns there are the counts
    // of each cell.
    CELL_BYTES / (6 * (columns + 5))
}

/// The page of a map of two or more axes: every quantity and channel, and with `--traces` the time
/// histories.
///
/// # Errors
/// [`PlotError::NotThere`] for options that the file does not have, and any that reading the traces
/// brings.
pub(crate) fn map_page(map: &Map, cuts: &Cuts, options: &PlotOptions) -> Result<String, PlotError> {
    let source = &map.table.source;
    let first = layer::chosen(source, options)?;
    let all = layer::all(source);
    let room = MOST_POINTS / all.len();
    let layers = all.iter().map(|shown| Ok(layer_json(map, shown, &shown.layer(map)?, room)));
    let layers = layers.collect::<Result<Vec<Value>, PlotError>>()?;
    let palette = |scale: &ColourScale| -> Vec<String> {
        (0..LEVELS).map(|k| scale.colour(k).css()).collect()
    };
    let traces = match &options.traces {
        Some(folder) => histories::read(folder, map)?,
        None => Value::Null,
    };
    let title = "Where the linear model can be trusted";
    let mut data = json!({
        "kind": "map",
        "title": title,
        "subtitle": figures::map::subtitle(map, &cuts.notes),
        "limit": source.ratio_limit(),
        "axes": map.grid.axes.iter().map(axis_json).collect::<Vec<_>>(),
        "columns": columns_json(&map.table),
        "codes": codes_json(&map.table),
        "rows": rows_json(source),
        "layers": layers,
        "first": {
            "column": first.as_ref().map_or(layer::STATUS, Shown::column),
            "rest": cuts.cuts.first().map_or(&[][..], |cut| &cut.rest),
        },
        "palettes": {
            "diverging": palette(&ColourScale::ratio(std::iter::empty(), 2.0, false)),
            "sequential": palette(&ColourScale::amplitude(std::iter::empty())),
            "kinds": DISTINCT.map(Colour::css),
            "failed": FAILED.css(),
        },
        "statuses": map.statuses,
        "traces": traces,
        "about": json!(about(source)),
        "provenance": provenance(source),
    });
    if map.grid.merged() {
        data["counts"] = counts_json(map);
    }
    let axes = map.grid.axes.iter().map(|axis| (axis.name.as_str(), axis.log)).collect::<Vec<_>>();
    let computing = computing(&mut data, options.live.as_ref(), source, &axes);
    let scripts = [&[CORE, CHART, BAR, HISTORIES, CELLS, MAP][..], computing, &[REPORT, START]];
    Ok(page(title, data, &scripts.concat()))
}

/// Adds what a page computes with, if it does, and the run in words. The scripts that it takes;
/// `axes` by name, and whether they are logarithmic.
fn computing(
    data: &mut Value,
    live: Option<&Live>,
    source: &Source,
    axes: &[(&str, bool)],
) -> &'static [&'static str] {
    let Some(live) = live else { return &[] };
    data["about"] = json!(report::about(source));
    data["live"] = live::json(live, axes);
    data["resonances"] = json!(live.resonances);
    &[SPECTRUM, POOL, CURVES, GROWTH, LIVE]
}

/// The file's own word about itself, without what would fill the page: a list of a million values,
/// say.
fn provenance(source: &Source) -> Value {
    let entry = |(key, value): &(String, Value)| {
        let text = value.to_string();
        if text.len() <= MOST_PROVENANCE {
            return json!([key, value]);
        }
        let head: String = text.chars().take(MOST_PROVENANCE / 8).collect();
        json!([key, format!("{head} ... ({} characters in all; the file has them)", text.len())])
    };
    source.provenance.iter().map(entry).collect()
}

/// Longest entry of a file's metadata that a page carries whole, characters.
const MOST_PROVENANCE: usize = 100_000;

/// The page of a chart: every panel, those that a picture shows at first. It may compute, along
/// an axis of this name.
pub(crate) fn chart_page(source: &Source, chart: &Chart, live: Option<(&Live, &str)>) -> String {
    let mut data = json!({
        "kind": "chart",
        "title": chart.title,
        "subtitle": chart.subtitle,
        "chart": chart_json(chart),
        "provenance": provenance(source),
    });
    let axis = live.map_or("", |(_, axis)| axis);
    let live = live.map(|(live, _)| live);
    let computing = computing(&mut data, live, source, &[(axis, chart.x_log)]);
    page(&chart.title, data, &[&[CORE, CHART][..], computing, &[START]].concat())
}

/// A page with the picture that it shows where scripts are switched off.
pub(crate) fn with_still(page: &[u8], picture: &[u8]) -> Vec<u8> {
    let picture = embed::bytes(picture.iter().copied());
    // It stands before the data, which might hold anything.
    String::from_utf8_lossy(page).replacen("{{still}}", &picture, 1).into_bytes()
}

/// A page of this body, which is HTML, without scripts: to be read and printed.
#[must_use]
pub fn sheet(title: &str, body: &str) -> String {
    SHEET.replace("{{title}}", &escape(title)).replace("{{style}}", STYLE).replace("{{body}}", body)
}

/// An SVG picture as an element: names within it are its own.
pub(crate) fn picture(svg: &[u8]) -> String {
    let data = embed::bytes(svg.iter().copied());
    format!("<img alt=\"figure\" src=\"data:image/svg+xml;base64,{data}\">")
}

fn page(title: &str, mut data: Value, scripts: &[&str]) -> String {
    data["ticks"] = ticks_json();
    data["both"] = json!(BOTH.css());
    data["shade"] = json!(format!("{}{:02x}", SHADE.css(), SHADE.alpha));
    let worker = if data.get("live").is_some() { live::WORKER } else { "" };
    // Within a script element only `<` could end it, or start a comment.
    let data = data.to_string().replace('<', "\\u003c");
    PAGE.replace("{{title}}", &escape(title))
        .replace("{{style}}", STYLE)
        .replace("{{worker}}", worker)
        .replace("{{script}}", &scripts.concat())
        .replace("{{data}}", &data)
}

/// Where ticks can be: the steps of even axes, each with the decimals of its numbers, and how one
/// is chosen.
fn ticks_json() -> Value {
    let steps: Vec<Value> =
        Step::all().map(|step| json!([step.length(), step.decimals()])).collect();
    json!({ "steps": steps, "slack": SLACK, "least": LEAST_TICKS })
}

/// The ticks of a logarithmic axis in ever denser sets, null for an even one.
fn log_ticks_json(scale: Scale) -> Value {
    if !scale.log {
        return Value::Null;
    }
    let tick = |tick: Tick| json!([embed::short(tick.value), tick.label]);
    let sets = log_sets(scale.from.min(scale.to), scale.from.max(scale.to));
    json!(sets.map(|set| set.into_iter().map(tick).collect::<Vec<_>>()))
}

/// The rows of a point's table: name, words, unit, and the columns that hold the values of both
/// models and their ratio.
fn rows_json(source: &Source) -> Value {
    let row = |name: &str, words: &str, columns: [Option<String>; 3]| {
        let unit = columns[0].as_ref().and_then(|name| source.column(name));
        let unit = unit.map_or("", |column| label::shown(&column.unit).0);
        json!({ "name": name, "words": words, "unit": unit, "columns": columns })
    };
    let channels = layer::channels(source, Group::Nonlinear).into_iter().map(|(name, _)| {
        let columns = ["nonlinear", "linear", "ratio"].map(|kind| Some(format!("{kind}_{name}")));
        row(name, &label::channel(name), columns)
    });
    let families = layer::families(source).into_iter().map(|family| {
        let mut columns = family.columns.iter().map(|(_, facts)| Some(facts.name.clone()));
        let [nonlinear, linear] = [0, 1].map(|_| columns.next().flatten());
        row(&family.name, &family.words, [nonlinear, linear, None])
    });
    channels.chain(families).collect()
}

fn axis_json(axis: &GridAxis) -> Value {
    let mut data = json!({
        "name": axis.name,
        "words": axis.words,
        "unit": axis.unit,
        "log": axis.log,
        "ticks": log_ticks_json(axis.scale()),
        "values": axis.values,
        "borders": axis.borders,
    });
    if let Some(spans) = &axis.spans {
        data["spans"] = json!(spans);
    }
    data
}

/// Every column of results as 32 bit floats in grid order, NaN where the file has no value.
fn columns_json(table: &Table) -> Value {
    let numbers = |column: &Column| {
        let (unit, factor) = label::shown(&column.unit);
        let data = json!({
            "unit": unit,
            "factor": factor,
            "description": column.description,
            "data": embed::floats(column.numbers()?.iter().copied()),
        });
        Some((column.name.clone(), data))
    };
    Value::Object(table.columns.iter().filter_map(numbers).collect::<Object<_, _>>())
}

/// Columns of few distinct words, as their numbers in grid order; 255 where the file has none, 254
/// where a cell has several.
fn codes_json(table: &Table) -> Value {
    let words = |column: &Column| {
        let words = column.words()?;
        let data =
            json!({ "data": embed::bytes(words.codes.iter().copied()), "words": words.names });
        Some((column.name.clone(), data))
    };
    Value::Object(table.columns.iter().filter_map(words).collect::<Object<_, _>>())
}

/// How many of each cell's points are what.
fn counts_json(map: &Map) -> Value {
    let of = |count: fn(&Counts) -> u32| {
        embed::floats(map.counts.iter().map(|cell| f64::from(count(cell))))
    };
    json!({
        "points": of(|cell| cell.points),
        "reliable": of(|cell| cell.reliable),
        "unreliable": of(|cell| cell.unreliable),
        "failed": of(|cell| cell.failed),
        "sensitive": of(|cell| cell.sensitive),
    })
}

fn layer_json(map: &Map, shown: &Shown, layer: &Layer, room: usize) -> Value {
    let scale = match layer.scale {
        ColourScale::Diverging { log, low, centre, high, reversed, .. } => {
            json!({ "log": log, "low": low, "centre": centre, "high": high, "reversed": reversed })
        }
        ColourScale::Sequential(scale) => {
            json!({ "log": scale.log, "low": scale.from, "high": scale.to })
        }
    };
    let ticks: Vec<Value> = layer
        .scale
        .ticks()
        .iter()
        .map(|tick| json!([embed::short(tick.value), tick.label]))
        .collect();
    let mut data = json!({
        "group": shown.group.name(),
        "groupWords": shown.group.words(),
        "channel": shown.channel,
        "words": shown.short(),
        "worse": shown.worse().map(Worse::name),
        "title": layer.title,
        "label": layer.label,
        "column": shown.column(),
        "scale": scale,
        "ticks": ticks,
        "nonlinear": layer.nonlinear,
        "level": layer.level.as_ref().map(|level| level_json(map, layer, level, room)),
    });
    if let Some([both, undefined]) = layer.mixed() {
        data["both"] = json!(embed::bits(both));
        data["undefined"] = json!(embed::bits(undefined));
    }
    data
}

/// The level, and its lines in data coordinates for each cut through the axes after the second, in
/// grid order. Where a ragged boundary has more than `room` points, its shortest lines are left
/// out: the cells on either side show them.
fn level_json(map: &Map, layer: &Layer, level: &Level, room: usize) -> Value {
    let [x_axis, y_axis] = [&map.grid.axes[0], &map.grid.axes[1]];
    let cuts: usize = map.grid.axes[2..].iter().map(|axis| axis.values.len()).product();
    let (xs, ys) = (x_axis.even(), y_axis.even());
    let mut lines: Vec<Vec<Vec<[f64; 2]>>> = (0..cuts)
        .map(|cut| {
            zero_lines(&xs, &ys, |x, y| {
                let cell = (x * ys.len() + y) * cuts + cut;
                level.offset(if map.filled(cell) { layer.typical(cell) } else { f64::NAN })
            })
        })
        .collect();
    leave_out_shortest(&mut lines, room);
    let back = |axis: &GridAxis, even: f64| embed::short(if axis.log { even.exp() } else { even });
    let flat = |line: &Vec<[f64; 2]>| -> Vec<f64> {
        line.iter().flat_map(|[x, y]| [back(x_axis, *x), back(y_axis, *y)]).collect()
    };
    let lines: Vec<Vec<Vec<f64>>> =
        lines.iter().map(|cut| cut.iter().map(flat).collect()).collect();
    json!({
        "value": level.value,
        "line": level.line,
        "above": level.above[1],
        "below": level.below[1],
        "both": level.both,
        "lines": lines,
    })
}

fn chart_json(chart: &Chart) -> Value {
    let grids = chart.grids.iter().map(|grid| embed::floats(grid.iter().copied()));
    let marks = chart.marks.iter().map(|mark| json!([embed::short(mark.x), mark.label]));
    json!({
        "xWords": chart.x_label.words,
        "xUnit": chart.x_label.unit,
        "xLog": chart.x_log,
        "xTicks": log_ticks_json(x_scale(chart)),
        "grids": grids.collect::<Vec<_>>(),
        "panels": chart.panels.iter().map(panel_json).collect::<Vec<_>>(),
        "marks": marks.collect::<Vec<_>>(),
        "markMeaning": chart.mark_meaning,
        "shades": chart.shades,
        "shadeMeaning": chart.shade_meaning,
    })
}

fn panel_json(panel: &ChartPanel) -> Value {
    let stars =
        panel.stars.iter().map(|(x, y, label)| json!([embed::short(*x), embed::short(*y), label]));
    json!({
        "name": panel.name,
        "words": panel.label.words,
        "unit": panel.label.unit,
        "shown": panel.shown,
        "log": panel.log,
        "ticks": log_ticks_json(y_scale(panel)),
        "range": panel.range.map(|(low, high)| [low, high]),
        "height": panel.height,
        "series": panel.series.iter().map(series_json).collect::<Vec<_>>(),
        "levels": panel.levels,
        "stars": stars.collect::<Vec<_>>(),
        "mixed": panel.mixed,
    })
}

fn series_json(series: &Series) -> Value {
    let data = |values: &[f64]| embed::floats(values.iter().copied());
    let (width, dashed, low, high) = match &series.style {
        Style::Solid(width) => (*width, false, None, None),
        Style::Dashed => (1.8, true, None, None),
        Style::Dots => (5.6, false, None, None),
        Style::Band(low, high) => (2.2, false, Some(data(low)), Some(data(high))),
    };
    json!({
        "name": series.name,
        "colour": if series.colour == INK { "ink".to_owned() } else { series.colour.css() },
        "grid": series.grid,
        "alpha": embed::short(f64::from(series.colour.alpha) / 255.0),
        "width": width,
        "dashed": dashed,
        "dots": series.style == Style::Dots,
        "y": data(&series.y),
        "low": low,
        "high": high,
    })
}
