//! One self-contained page: the numbers, and the script that draws them. Opens from a disk, needs
//! no network.

mod design;
pub mod embed;
mod histories;
mod report;

pub(crate) use design::page_of as design_page;
pub(crate) use report::told;

use std::rc::Rc;

use serde_json::{Value, json};

use super::axis::{LEAST_TICKS, SLACK, Scale, Step, Tick, log_sets};
use super::chart::{Chart, ChartPanel, DOT, Series, Style, stroke, x_scale, y_scale};
use super::colour::{BOTH, FAILED, LEVELS, SHADE};
use super::contour::MOST_POINTS;
use super::cuts::Cuts;
use super::error::Result;
use super::frame::{Sign, failed_hatch};
use super::gather::{Counts, Map};
use super::grid::GridAxis;
use super::layer::{self, Layer, Level, Shown};
use super::model::{Computing, Figures};
use super::read::Source;
use super::scene::{Colour, Hatch, INK, PAPER};
use super::swept::SweptAxis;
use super::table::{Column, Table};
use super::{Options, figures, label};
use crate::escape;
use sweep_parameter::Worse;

const PAGE: &str = include_str!("html/page.html");
const PARTS: &str = include_str!("html/parts.html");
const SHEET: &str = include_str!("html/sheet.html");
const STYLE: &str = include_str!("html/style.css");
const CORE: &str = include_str!("html/core.js");
const CHART: &str = include_str!("html/chart.js");
const BAR: &str = include_str!("html/bar.js");
const CELLS: &str = include_str!("html/cells.js");
const MAP: &str = include_str!("html/map.js");
const DESIGN: &str = include_str!("html/design.js");
const REPORT: &str = include_str!("html/report.js");
const START: &str = include_str!("html/start.js");

/// Bytes of a page that the values of a map's cells may take.
const CELL_BYTES: usize = 7_000_000;

/// Columns of a map file that a page carries: all results but the counts of steps.
pub(crate) fn carried(source: &Source, axes: &[SweptAxis]) -> Vec<String> {
    let names = source.columns.iter().map(|column| column.name.as_str());
    names
        .filter(|name| !name.starts_with("steps_") && !name.starts_with("rejected_"))
        .filter(|name| axes.iter().all(|axis| axis.name != *name))
        .map(str::to_owned)
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
/// [`crate::PlotError::Unfit`] for options that the file does not have, and any that reading the
/// traces brings.
pub(crate) fn map_page(
    map: &Map,
    cuts: &Cuts,
    options: &Options,
    model: &dyn Figures,
) -> Result<String> {
    let source = &map.table.source;
    let first = layer::chosen(source, options)?;
    let all = layer::all(source);
    let room = MOST_POINTS / all.len();
    let layers = all.iter().map(|shown| Ok(layer_json(map, shown, shown.layer(map)?, room)));
    let layers = layers.collect::<Result<Vec<Value>>>()?;
    let traces = match &options.traces {
        Some(folder) => histories::read(folder, map, model)?,
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
            "kinds": figures::map::kinds(map),
            "failed": FAILED.css(),
        },
        "legend": legend_json(&figures::map::legend(map, None)),
        "traces": traces,
    });
    if map.grid.merged() {
        data["counts"] = counts_json(map);
    }
    let axes = map.grid.axes.iter().map(|axis| (axis.swept.name.as_str(), axis.swept.log));
    let axes: Vec<(&str, bool)> = axes.collect();
    let told = report::told(source, model) + &report::caveats(map, model);
    let scripts = [&[CORE, CHART, BAR, CELLS, MAP][..], &[REPORT, START]];
    Ok(page(title, data, scripts, model.computing(&axes), source, &told))
}

/// The file's own word about itself, without what would fill the page: a list of a million values,
/// say.
fn provenance(source: &Source) -> String {
    let entry = |(key, value): &(String, Value)| {
        let text = value.as_str().map_or_else(|| format!("{value:#}"), str::to_owned);
        let mut lines: Vec<String> = text.lines().map(escape).collect();
        if text.len() > MOST_PROVENANCE {
            let head: String = text.chars().take(MOST_PROVENANCE / 8).collect();
            let length = text.len();
            lines = vec![format!(
                "{} ... ({length} characters in all; the file has them)",
                escape(&head)
            )];
        }
        format!("<dt>{}</dt><dd><pre tabindex=\"0\">{}</pre></dd>\n", escape(key), lines.join("\n"))
    };
    if source.provenance.is_empty() {
        return "The file says nothing about its origin.\n".to_owned();
    }
    let list: String = source.provenance.iter().map(entry).collect();
    format!("<details><summary>digests, versions, the plan</summary><dl>\n{list}</dl></details>\n")
}

/// Longest entry of a file's metadata that a page carries whole, characters.
const MOST_PROVENANCE: usize = 100_000;

/// What a page over these axes computes with, and what it then tells of the run, in HTML.
fn computed(
    source: &Source,
    axes: &[(&str, bool)],
    model: &dyn Figures,
) -> (Option<Computing>, String) {
    let computing = model.computing(axes);
    let told = computing.as_ref().map_or_else(String::new, |_| report::told(source, model));
    (computing, told)
}

/// The page of a chart: every panel, those that a picture shows at first. It may compute, along
/// the axis of this name.
pub(crate) fn chart_page(
    source: &Source,
    chart: &Chart,
    axis: &str,
    model: &dyn Figures,
) -> String {
    let data = json!({
        "kind": "chart",
        "title": chart.title,
        "subtitle": chart.subtitle,
        "chart": chart_json(chart, curve),
    });
    let (computing, told) = computed(source, &[(axis, chart.x_log)], model);
    page(&chart.title, data, [&[CORE, CHART], &[START]], computing, source, &told)
}

/// A page with the picture that it shows where scripts are switched off.
pub(crate) fn with_still(page: &[u8], picture: &[u8]) -> Vec<u8> {
    let picture = embed::bytes(picture.iter().copied());
    // It stands before the data, which might hold anything.
    String::from_utf8_lossy(page).replacen("{{still}}", &picture, 1).into_bytes()
}

/// A page of this body, which is HTML, without scripts: to be read and printed.
pub fn sheet(title: &str, body: &str) -> String {
    SHEET.replace("{{title}}", &escape(title)).replace("{{style}}", STYLE).replace("{{body}}", body)
}

/// A table under a heading; nothing without rows.
pub fn table(title: &str, heads: &[&str], rows: &[Vec<String>]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    fn row<T: AsRef<str>>(cells: &[T], cell: &str) -> String {
        let cells = cells.iter().map(|text| format!("<{cell}>{}</{cell}>", escape(text.as_ref())));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    }
    let all: String = rows.iter().map(|cells| row(cells, "td")).collect();
    let head = if heads.iter().all(|head| head.is_empty()) { "" } else { &row(heads, "th") };
    format!(
        "<h2>{}</h2>\n<table><thead>{head}</thead><tbody>\n{all}</tbody></table>\n",
        escape(title)
    )
}

/// An SVG picture as an element: names within it are its own.
pub(crate) fn picture(svg: &[u8]) -> String {
    let data = embed::bytes(svg.iter().copied());
    format!("<img alt=\"figure\" src=\"data:image/svg+xml;base64,{data}\">")
}

/// A page of these data, and of what is `told` of the run in HTML. What it computes with has its
/// scripts between these.
fn page(
    title: &str,
    mut data: Value,
    [first, last]: [&[&str]; 2],
    computing: Option<Computing>,
    source: &Source,
    told: &str,
) -> String {
    let (scripts, parts) = computing.map_or((&[][..], ""), |computing| {
        data["live"] = computing.data;
        (computing.scripts, computing.parts)
    });
    let scripts = [first, scripts, last].concat();
    // Where ticks of even axes can be, with the decimals of their numbers, and how one is chosen.
    let steps: Value = Step::all().map(|step| json!([step.length(), step.decimals()])).collect();
    data["ticks"] = json!({ "steps": steps, "slack": SLACK, "least": LEAST_TICKS });
    data["both"] = json!(BOTH.css());
    data["shade"] = json!(format!("{}{:02x}", SHADE.css(), SHADE.alpha));
    // What a file says is no place for what follows it.
    let told = [told, &provenance(source)].map(|text| text.replace('{', "&#123;"));
    // Within a script element only `<` could end it, or start a comment.
    let data = data.to_string().replace('<', "\\u003c");
    PAGE.replace("{{title}}", &escape(title))
        .replace("{{style}}", STYLE)
        .replace("{{about}}", &told[0])
        .replace("{{provenance}}", &told[1])
        .replace("{{parts}}", &[PARTS, parts].concat())
        .replace("{{script}}", &scripts.concat())
        .replace("{{data}}", &data)
}

/// The ticks of a logarithmic axis in ever denser sets, null for an even one.
fn log_ticks_json(scale: Scale) -> Value {
    if !scale.log {
        return Value::Null;
    }
    let sets = log_sets(scale.from.min(scale.to), scale.from.max(scale.to));
    json!(sets.map(|set| set.into_iter().map(tick_json).collect::<Vec<_>>()))
}

fn tick_json(tick: Tick) -> Value {
    json!([embed::short(tick.value), tick.label])
}

/// The rows of a point's table: name, words, unit, and the columns that hold the values of both
/// models and their ratio.
fn rows_json(source: &Source) -> Value {
    let row = |family: layer::Family<'_>| {
        let column = |k: usize| family.columns.get(k).map(|(_, facts)| &facts.name);
        let ratio = family.is_channel.then(|| format!("ratio_{}", family.name));
        json!({
            "name": family.name,
            "words": family.words,
            "unit": label::shown(&family.columns[0].1.unit).0,
            "columns": [column(0), column(1), ratio.as_ref()],
        })
    };
    layer::families(source).into_iter().map(row).collect()
}

fn axis_json(axis: &GridAxis) -> Value {
    let mut data = json!(axis);
    data["ticks"] = log_ticks_json(axis.scale());
    data
}

/// Every column of results as 32 bit floats in grid order, NaN where the file has no value.
fn columns_json(table: &Table) -> Value {
    let numbers = |column: &Column| {
        let (unit, factor) = label::shown(&column.facts.unit);
        let data = json!({
            "unit": unit,
            "factor": factor,
            "description": column.facts.description,
            "data": embed::floats(column.numbers()?.iter().copied()),
        });
        Some((column.facts.name.clone(), data))
    };
    table.columns.iter().filter_map(numbers).collect()
}

/// Columns of few distinct words, as their numbers in grid order; 255 where the file has none, 254
/// where a cell has several.
fn codes_json(table: &Table) -> Value {
    let words = |column: &Column| {
        let words = column.words()?;
        let data =
            json!({ "data": embed::bytes(words.codes.iter().copied()), "words": words.names });
        Some((column.facts.name.clone(), data))
    };
    table.columns.iter().filter_map(words).collect()
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

/// Entries of a legend, each the style of its sign and its words.
fn legend_json(entries: &[(Sign, String)]) -> Value {
    let hatched = |hatch: &Hatch| {
        let [ink, paper] = [INK, PAPER].map(Colour::css);
        let lines = match hatch.strokes.len() {
            1 => format!("135deg,{ink} 0 1px,transparent 1px 6px"),
            _ => format!("45deg,{ink} 0 1px,{paper} 1px 2px,{ink} 2px 3px,transparent 3px 7px"),
        };
        format!("background:repeating-linear-gradient({lines})")
    };
    let style = |sign: &Sign| match sign {
        // As it is drawn: dark between light, on any ground.
        Sign::Line(_) => {
            "height:6px;background:#1b1f24;border:solid #ffffff;border-width:1.5px 0".to_owned()
        }
        Sign::Area(colour) => format!("background:{}", colour.css()),
        Sign::Failed => format!("{} {}", hatched(&failed_hatch()), FAILED.css()),
        Sign::Hatched(hatch) => hatched(hatch),
        _ => "background:radial-gradient(circle,var(--muted) 2px,var(--paper) 2.5px);\
              outline:1px solid var(--faint)"
            .to_owned(),
    };
    entries.iter().map(|(sign, words)| json!([style(sign), words])).collect()
}

fn layer_json(map: &Map, shown: &Shown, layer: Layer, room: usize) -> Value {
    let (Scale { log, from, to }, limit) = (layer.scale.scale, layer.scale.centre);
    let middle = limit.unwrap_or(if log { (from * to).sqrt() } else { 0.5 * (from + to) });
    let colours = (0..LEVELS).map(|level| layer.scale.colour(level).css());
    let ticks = layer.scale.ticks().into_iter().map(tick_json);
    let mut data = json!({
        "group": shown.group.name(),
        "groupWords": shown.group.words(),
        "channel": shown.channel,
        "words": shown.short(),
        "worse": shown.worse().map(Worse::name),
        "title": layer.title,
        "label": layer.label,
        "column": shown.column(),
        "scale": { "log": log, "stops": [from, middle, to], "limit": limit },
        "colours": colours.collect::<Value>(),
        "ticks": ticks.collect::<Value>(),
        "nonlinear": layer.nonlinear,
        "lines": layer.level.as_ref().map(|level| level_json(map, &layer, level, room)),
    });
    if let Some(sides) = &layer.divided {
        data["both"] = json!(embed::bits(&sides.both));
        data["undefined"] = json!(embed::bits(&sides.undefined));
    }
    data["legend"] = legend_json(&figures::map::legend(map, Some(layer)));
    data
}

/// The level's lines in data coordinates for each cut through the axes after the second, in grid
/// order.
fn level_json(map: &Map, layer: &Layer, level: &Level, room: usize) -> Value {
    let cuts: usize = map.grid.axes[2..].iter().map(|axis| axis.values.len()).product();
    let ys = map.grid.axes[1].values.len();
    let cell = |cut: usize, x: usize, y: usize| (x * ys + y) * cuts + cut;
    let lines = figures::map::level_lines(map, (layer, level), cuts, cell, room);
    let flat = |line: &Vec<[f64; 2]>| -> Vec<f64> {
        line.iter().flatten().map(|value| embed::short(*value)).collect()
    };
    lines.iter().map(|cut| cut.iter().map(flat).collect::<Value>()).collect()
}

/// A curve's values, to seven digits.
fn curve(values: &[f64]) -> Value {
    json!(embed::floats(values.iter().copied()))
}

/// A chart, its curves by `curve`.
fn chart_json(chart: &Chart, curve: fn(&[f64]) -> Value) -> Value {
    let mut grids: Vec<&Rc<Vec<f64>>> = Vec::new();
    for series in chart.panels.iter().flat_map(|panel| &panel.series) {
        if !grids.contains(&&series.x) {
            grids.push(&series.x);
        }
    }
    let panels = chart.panels.iter().map(|panel| panel_json(panel, &grids, curve));
    let marks = chart.marks.iter().map(|mark| json!([embed::short(mark.x), mark.label]));
    let xs = x_scale(chart);
    json!({
        "xWords": chart.x_label.words,
        "xUnit": chart.x_label.unit,
        "xLog": chart.x_log,
        "xRange": [xs.from, xs.to],
        "xTicks": log_ticks_json(xs),
        "grids": grids.iter().map(|grid| embed::floats(grid.iter().copied())).collect::<Value>(),
        "panels": panels.collect::<Value>(),
        "marks": marks.collect::<Vec<_>>(),
        "markMeaning": chart.mark_meaning,
        "shades": chart.shades,
        "shadeMeaning": chart.shade_meaning,
    })
}

fn panel_json(panel: &ChartPanel, grids: &[&Rc<Vec<f64>>], curve: fn(&[f64]) -> Value) -> Value {
    let stars =
        panel.stars.iter().map(|(x, y, label)| json!([embed::short(*x), embed::short(*y), label]));
    let mut data = json!(panel);
    data["ticks"] = log_ticks_json(y_scale(panel));
    data["stars"] = stars.collect();
    let of_series = |series| series_json(series, grids, curve);
    data["series"] = panel.series.iter().map(of_series).collect();
    data
}

fn series_json(series: &Series, grids: &[&Rc<Vec<f64>>], curve: fn(&[f64]) -> Value) -> Value {
    let (stroke, dots) = (stroke(series), series.style == Style::Dots);
    let [low, high] = match &series.style {
        Style::Band(low, high) => [low, high].map(|side| curve(side)),
        _ => [Value::Null, Value::Null],
    };
    json!({
        "name": series.name,
        "colour": if series.colour == INK { "ink".to_owned() } else { series.colour.css() },
        "grid": grids.iter().position(|grid| **grid == series.x),
        "alpha": embed::short(f64::from(series.colour.alpha) / 255.0),
        "width": if dots { 2.0 * DOT } else { stroke.width },
        "dashed": !stroke.dash.is_empty(),
        "dots": dots,
        "y": curve(&series.y),
        "low": low,
        "high": high,
    })
}
