//! Self-contained HTML pages, which have the data and the scripts that draw them. A page needs no
//! server and no network.

mod design;
pub mod embed;
mod histories;
mod report;

pub(crate) use design::design_page;
pub(crate) use report::run_summary;

use std::rc::Rc;

use serde_json::{Value, json};

use super::axis::{AxisScale, MIN_TICKS, STEP_TOLERANCE, Tick, TickStep, log_tick_sets};
use super::chart::{
    Chart, ChartPanel, DOT_RADIUS, Series, SeriesStyle, chart_x_scale, panel_y_scale, series_stroke,
};
use super::colour::{BOTH_SIDES_COLOUR, COLOUR_STEPS, FAILED_COLOUR, UNSTABLE_SHADE};
use super::contour::MAX_LINE_POINTS;
use super::cuts::Cuts;
use super::error::Result;
use super::frame::{LegendSymbol, failed_hatch};
use super::gather::{CellMap, PointCounts};
use super::grid::GridAxis;
use super::layer::{self, DividingLimit, Layer, ShownColumn};
use super::model::{Figures, LivePart};
use super::read::FigureFile;
use super::scene::{Colour, Hatch, INK, PAPER};
use super::swept::SweptAxis;
use super::table::{FigureColumn, FigureTable};
use super::{PlotOptions, figures, label};
use crate::escape;
use sweep_parameter::Worse;

/// The template of a page: placeholders in double braces.
const PAGE_TEMPLATE: &str = include_str!("html/page.html");
/// The templates of elements that scripts copy.
const ELEMENT_TEMPLATES: &str = include_str!("html/parts.html");
/// The template of a page without scripts.
const PRINTABLE_PAGE_TEMPLATE: &str = include_str!("html/sheet.html");
/// The style sheet of all pages.
const STYLE_SHEET: &str = include_str!("html/style.css");
/// The script of parts that all figures share.
const CORE_SCRIPT: &str = include_str!("html/core.js");
/// The script of charts.
const CHART_SCRIPT: &str = include_str!("html/chart.js");
/// The script of a map's colour bar.
const COLOUR_BAR_SCRIPT: &str = include_str!("html/bar.js");
/// The script that draws the cells of a map.
const CELLS_SCRIPT: &str = include_str!("html/cells.js");
/// The script of maps.
const MAP_SCRIPT: &str = include_str!("html/map.js");
/// The script of designs.
const DESIGN_SCRIPT: &str = include_str!("html/design.js");
/// The script of the table of a map's point.
const REPORT_SCRIPT: &str = include_str!("html/report.js");
/// The script that starts the page.
const START_SCRIPT: &str = include_str!("html/start.js");

/// Maximum size of the cell values of a page, bytes. Basis: a page of at most 10 MB. Doubling it
/// doubles the cells of large maps and the size of their pages.
const CELL_BYTES: usize = 7_000_000;

/// Returns the columns of a map file that a page carries: all results but the counts of steps.
pub(crate) fn page_columns(source: &FigureFile, axes: &[SweptAxis]) -> Vec<String> {
    let column_names = source.columns.iter().map(|column| column.name.as_str());
    column_names
        .filter(|name| !name.starts_with("steps_") && !name.starts_with("rejected_"))
        .filter(|name| axes.iter().all(|axis| axis.name != *name))
        .map(str::to_owned)
        .collect()
}

/// Returns the maximum number of cells of a map's page with this number of columns.
pub(crate) fn max_cells(columns: usize) -> usize {
    // A number takes four bytes, 5.3 in base64; each cell has its counts besides the columns.
    CELL_BYTES / (6 * (columns + 5))
}

/// Writes the page of a map of two axes or more: every quantity and channel, and with `--traces`
/// the time histories.
///
/// # Errors
/// [`crate::PlotError::Unfit`] for options that do not fit the file, and the errors of reading the
/// traces.
pub(crate) fn map_page(
    map: &CellMap,
    cuts: &Cuts,
    options: &PlotOptions,
    model: &dyn Figures,
) -> Result<String> {
    let source = &map.table.source;
    let first_column = layer::requested_column(source, options)?;
    let columns = layer::all_columns(source);
    let max_points = MAX_LINE_POINTS / columns.len();
    let layers = columns
        .iter()
        .map(|column| Ok(layer_json(map, column, column.create_layer(map)?, max_points)));
    let layers = layers.collect::<Result<Vec<Value>>>()?;
    let traces = match &options.traces {
        Some(folder) => histories::read_histories(folder, map, model)?,
        None => Value::Null,
    };
    let title = "Where the linear model can be trusted";
    let mut data = json!({
        "kind": "map",
        "title": title,
        "subtitle": figures::map::map_subtitle(map, &cuts.notes),
        "limit": source.ratio_limit(),
        "axes": map.grid.axes.iter().map(axis_json).collect::<Vec<_>>(),
        "columns": columns_json(&map.table),
        "codes": codes_json(&map.table),
        "rows": rows_json(source),
        "layers": layers,
        "first": {
            "column": first_column.as_ref().map_or(layer::STATUS_COLUMN, ShownColumn::name),
            "rest": cuts.cuts.first().map_or(&[][..], |cut| &cut.pick_positions),
        },
        "palettes": {
            "kinds": figures::map::status_colours(map),
            "failed": FAILED_COLOUR.css(),
        },
        "legend": legend_json(&figures::map::map_legend_entries(map, None)),
        "traces": traces,
    });
    if map.grid.merges_points() {
        data["counts"] = counts_json(map);
    }
    let axes =
        map.grid.axes.iter().map(|axis| (axis.swept_axis.name.as_str(), axis.swept_axis.is_log));
    let axes: Vec<(&str, bool)> = axes.collect();
    let summary = report::run_summary(source, model) + &report::cautions(map, model);
    let scripts = [
        &[CORE_SCRIPT, CHART_SCRIPT, COLOUR_BAR_SCRIPT, CELLS_SCRIPT, MAP_SCRIPT][..],
        &[REPORT_SCRIPT, START_SCRIPT],
    ];
    Ok(write_page(title, data, scripts, model.live_part(&axes), source, &summary))
}

/// Writes the metadata of the file, without entries that would fill the page, such as a list of a
/// million values.
fn provenance(source: &FigureFile) -> String {
    let table_entry = |(key, value): &(String, Value)| {
        let text = value.as_str().map_or_else(|| format!("{value:#}"), str::to_owned);
        let mut lines: Vec<String> = text.lines().map(escape).collect();
        if text.len() > MAX_ENTRY_CHARACTERS {
            let first_characters: String = text.chars().take(MAX_ENTRY_CHARACTERS / 8).collect();
            let text_length = text.len();
            lines = vec![format!(
                "{} ... ({text_length} characters in all; the file has them)",
                escape(&first_characters)
            )];
        }
        format!("<dt>{}</dt><dd><pre tabindex=\"0\">{}</pre></dd>\n", escape(key), lines.join("\n"))
    };
    if source.provenance.is_empty() {
        return "The file says nothing about its origin.\n".to_owned();
    }
    let entry_list: String = source.provenance.iter().map(table_entry).collect();
    format!(
        "<details><summary>digests, versions, the plan</summary><dl>\n{entry_list}</dl></details>\n"
    )
}

/// Maximum length of a metadata entry that a page carries whole, characters. Basis: a plan with
/// long lists is shorter. Doubling it adds as much to a page for each longer entry.
const MAX_ENTRY_CHARACTERS: usize = 100_000;

/// Returns the live part of a page over these axes, and the summary of the run that it needs, in
/// HTML.
fn live_part_and_summary(
    source: &FigureFile,
    axes: &[(&str, bool)],
    model: &dyn Figures,
) -> (Option<LivePart>, String) {
    let live_part = model.live_part(axes);
    let summary =
        live_part.as_ref().map_or_else(String::new, |_| report::run_summary(source, model));
    (live_part, summary)
}

/// Writes the page of a chart with all panels, of which those of a picture are shown first. A live
/// page computes along the axis of this name.
pub(crate) fn chart_page(
    source: &FigureFile,
    chart: &Chart,
    axis: &str,
    model: &dyn Figures,
) -> String {
    let data = json!({
        "kind": "chart",
        "title": chart.title,
        "subtitle": chart.subtitle,
        "chart": chart_json(chart, encode_curve),
    });
    let (live_part, summary) = live_part_and_summary(source, &[(axis, chart.is_x_log)], model);
    write_page(
        &chart.title,
        data,
        [&[CORE_SCRIPT, CHART_SCRIPT], &[START_SCRIPT]],
        live_part,
        source,
        &summary,
    )
}

/// Adds the picture that a page shows where scripts are switched off.
pub(crate) fn add_still_picture(page: &[u8], picture: &[u8]) -> Vec<u8> {
    let encoded_picture = embed::encode_bytes(picture.iter().copied());
    // The placeholder precedes the data, which might hold the same text.
    String::from_utf8_lossy(page).replacen("{{still}}", &encoded_picture, 1).into_bytes()
}

/// Writes a page of this HTML body without scripts, to be read and printed.
pub fn printable_page(title: &str, body: &str) -> String {
    PRINTABLE_PAGE_TEMPLATE
        .replace("{{title}}", &escape(title))
        .replace("{{style}}", STYLE_SHEET)
        .replace("{{body}}", body)
}

/// Writes an HTML table under a heading; nothing without rows.
pub fn html_table(title: &str, heads: &[&str], rows: &[Vec<String>]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    fn table_row<T: AsRef<str>>(cells: &[T], element: &str) -> String {
        let cells_html =
            cells.iter().map(|text| format!("<{element}>{}</{element}>", escape(text.as_ref())));
        format!("<tr>{}</tr>\n", cells_html.collect::<String>())
    }
    let table_rows: String = rows.iter().map(|cells| table_row(cells, "td")).collect();
    let heading =
        if heads.iter().all(|head| head.is_empty()) { "" } else { &table_row(heads, "th") };
    format!(
        "<h2>{}</h2>\n<table><thead>{heading}</thead><tbody>\n{table_rows}</tbody></table>\n",
        escape(title)
    )
}

/// Returns an SVG picture as an HTML image, so that names within it do not clash with those of the
/// page.
pub(crate) fn svg_image(svg: &[u8]) -> String {
    let encoded_svg = embed::encode_bytes(svg.iter().copied());
    format!("<img alt=\"figure\" src=\"data:image/svg+xml;base64,{encoded_svg}\">")
}

/// Writes a page of these data with a `summary` of the run, in HTML. Scripts of a live page come
/// between the two groups of scripts.
fn write_page(
    title: &str,
    mut data: Value,
    [scripts_before, scripts_after]: [&[&str]; 2],
    live_part: Option<LivePart>,
    source: &FigureFile,
    summary: &str,
) -> String {
    let (scripts, templates) = live_part.map_or((&[][..], ""), |live_part| {
        data["live"] = live_part.data;
        (live_part.scripts, live_part.templates)
    });
    let scripts = [scripts_before, scripts, scripts_after].concat();
    // The steps of linear ticks with the decimals of their labels, and the rule that chooses a
    // step.
    let steps: Value =
        TickStep::all_steps().map(|step| json!([step.length(), step.decimals()])).collect();
    data["ticks"] = json!({ "steps": steps, "slack": STEP_TOLERANCE, "least": MIN_TICKS });
    data["both"] = json!(BOTH_SIDES_COLOUR.css());
    data["shade"] = json!(format!("{}{:02x}", UNSTABLE_SHADE.css(), UNSTABLE_SHADE.alpha));
    // A brace in the file's text must not look like a placeholder.
    let escaped_texts = [summary, &provenance(source)].map(|text| text.replace('{', "&#123;"));
    // Within a script element only `<` could end the element or start a comment.
    let data = data.to_string().replace('<', "\\u003c");
    PAGE_TEMPLATE
        .replace("{{title}}", &escape(title))
        .replace("{{style}}", STYLE_SHEET)
        .replace("{{about}}", &escaped_texts[0])
        .replace("{{provenance}}", &escaped_texts[1])
        .replace("{{parts}}", &[ELEMENT_TEMPLATES, templates].concat())
        .replace("{{script}}", &scripts.concat())
        .replace("{{data}}", &data)
}

/// Returns the sets of ticks of a logarithmic axis, from sparse to dense; null for a linear one.
fn log_ticks_json(scale: AxisScale) -> Value {
    if !scale.is_log {
        return Value::Null;
    }
    let tick_sets = log_tick_sets(scale.from.min(scale.to), scale.from.max(scale.to));
    json!(tick_sets.map(|set| set.into_iter().map(tick_json).collect::<Vec<_>>()))
}

fn tick_json(tick: Tick) -> Value {
    json!([embed::round_to_six_digits(tick.value), tick.label])
}

/// Returns the rows of the table of a point: name, words, unit, and the columns of both models and
/// of their ratio.
fn rows_json(source: &FigureFile) -> Value {
    let row_json = |quantity: layer::QuantityColumns<'_>| {
        let column = |k: usize| quantity.columns.get(k).map(|(_, facts)| &facts.name);
        let ratio = quantity.is_channel.then(|| format!("ratio_{}", quantity.name));
        json!({
            "name": quantity.name,
            "words": quantity.words,
            "unit": label::display_unit(quantity.columns[0].1.unit()).0,
            "columns": [column(0), column(1), ratio.as_ref()],
        })
    };
    layer::collect_quantities(source).into_iter().map(row_json).collect()
}

fn axis_json(axis: &GridAxis) -> Value {
    let mut data = json!(axis);
    data["ticks"] = log_ticks_json(axis.scale());
    data
}

/// Returns every column of numbers as 32-bit floats in grid order, NaN where the file has no value.
fn columns_json(table: &FigureTable) -> Value {
    let encode_numbers = |column: &FigureColumn| {
        let (unit, factor) = label::display_unit(column.facts.unit());
        let data = json!({
            "unit": unit,
            "factor": factor,
            "description": column.facts.metadata.description,
            "data": embed::encode_floats(column.numbers()?.iter().copied()),
        });
        Some((column.facts.name.clone(), data))
    };
    table.columns.iter().filter_map(encode_numbers).collect()
}

/// Returns the columns of words as codes in grid order: 255 for no word, 254 for several words in a
/// cell.
fn codes_json(table: &FigureTable) -> Value {
    let encode_words = |column: &FigureColumn| {
        let word_codes = column.words()?;
        let codes = embed::encode_bytes(word_codes.codes.iter().copied());
        let data = json!({ "data": codes, "words": word_codes.names });
        Some((column.facts.name.clone(), data))
    };
    table.columns.iter().filter_map(encode_words).collect()
}

/// Returns the number of points of each kind in each cell.
fn counts_json(map: &CellMap) -> Value {
    let encode_counts = |count: fn(&PointCounts) -> u32| {
        embed::encode_floats(map.point_counts.iter().map(|cell| f64::from(count(cell))))
    };
    json!({
        "points": encode_counts(|cell| cell.points),
        "reliable": encode_counts(|cell| cell.reliable_points),
        "unreliable": encode_counts(|cell| cell.unreliable_points),
        "failed": encode_counts(|cell| cell.failed_points),
        "sensitive": encode_counts(|cell| cell.sensitive_points),
    })
}

/// Returns the entries of a legend: the style of the symbol and its text.
fn legend_json(entries: &[(LegendSymbol, String)]) -> Value {
    let hatched_style = |hatch: &Hatch| {
        let [ink, paper] = [INK, PAPER].map(Colour::css);
        let lines = match hatch.strokes.len() {
            1 => format!("135deg,{ink} 0 1px,transparent 1px 6px"),
            _ => format!("45deg,{ink} 0 1px,{paper} 1px 2px,{ink} 2px 3px,transparent 3px 7px"),
        };
        format!("background:repeating-linear-gradient({lines})")
    };
    let to_style = |symbol: &LegendSymbol| match symbol {
        // The line of a boundary is dark between light edges, to show on any ground.
        LegendSymbol::Line(_) => {
            "height:6px;background:#1b1f24;border:solid #ffffff;border-width:1.5px 0".to_owned()
        }
        LegendSymbol::Area(colour) => format!("background:{}", colour.css()),
        LegendSymbol::Failed => {
            format!("{} {}", hatched_style(&failed_hatch()), FAILED_COLOUR.css())
        }
        LegendSymbol::Hatched(hatch) => hatched_style(hatch),
        _ => "background:radial-gradient(circle,var(--muted) 2px,var(--paper) 2.5px);\
              outline:1px solid var(--faint)"
            .to_owned(),
    };
    entries.iter().map(|(symbol, text)| json!([to_style(symbol), text])).collect()
}

fn layer_json(map: &CellMap, column: &ShownColumn, layer: Layer, max_points: usize) -> Value {
    let (AxisScale { is_log, from, to }, limit) = (layer.scale.axis_scale, layer.scale.centre);
    let middle = limit.unwrap_or(if is_log { (from * to).sqrt() } else { 0.5 * (from + to) });
    let colours = (0..COLOUR_STEPS).map(|step| layer.scale.colour(step).css());
    let ticks = layer.scale.ticks().into_iter().map(tick_json);
    let mut data = json!({
        "group": column.column_group.name(),
        "groupWords": column.column_group.in_words(),
        "channel": column.channel,
        "words": column.short_name(),
        "worse": column.worse().map(Worse::name),
        "title": layer.title,
        "label": layer.label,
        "column": column.name(),
        "scale": { "log": is_log, "stops": [from, middle, to], "limit": limit },
        "colours": colours.collect::<Value>(),
        "ticks": ticks.collect::<Value>(),
        "nonlinear": layer.is_nonlinear,
        "lines": layer.limit.as_ref().map(|limit| limit_lines_json(map, &layer, limit, max_points)),
    });
    if let Some(sides) = &layer.sides {
        data["both"] = json!(embed::encode_bits(&sides.is_divided));
        data["undefined"] = json!(embed::encode_bits(&sides.has_undefined));
    }
    data["legend"] = legend_json(&figures::map::map_legend_entries(map, Some(layer)));
    data
}

/// Returns the lines of a limit in data coordinates, for each cut in grid order.
fn limit_lines_json(
    map: &CellMap,
    layer: &Layer,
    limit: &DividingLimit,
    max_points: usize,
) -> Value {
    let cuts: usize = map.grid.axes[2..].iter().map(|axis| axis.values.len()).product();
    let row_count = map.grid.axes[1].values.len();
    let cell = |cut: usize, x: usize, y: usize| (x * row_count + y) * cuts + cut;
    let lines = figures::map::limit_lines(map, (layer, limit), cuts, cell, max_points);
    let to_flat_line = |line: &Vec<[f64; 2]>| -> Vec<f64> {
        line.iter().flatten().map(|value| embed::round_to_six_digits(*value)).collect()
    };
    lines
        .iter()
        .map(|lines_of_cut| lines_of_cut.iter().map(to_flat_line).collect::<Value>())
        .collect()
}

/// Encodes a curve's values to seven digits.
fn encode_curve(values: &[f64]) -> Value {
    json!(embed::encode_floats(values.iter().copied()))
}

/// Encodes a chart; `encode_curve` encodes the values of its curves.
fn chart_json(chart: &Chart, encode_curve: fn(&[f64]) -> Value) -> Value {
    let mut grids: Vec<&Rc<Vec<f64>>> = Vec::new();
    for series in chart.panels.iter().flat_map(|panel| &panel.series) {
        if !grids.contains(&&series.x) {
            grids.push(&series.x);
        }
    }
    let panels = chart.panels.iter().map(|panel| panel_json(panel, &grids, encode_curve));
    let marks =
        chart.marks.iter().map(|mark| json!([embed::round_to_six_digits(mark.x), mark.label]));
    let x_scale = chart_x_scale(chart);
    let grids = grids.iter().map(|grid| embed::encode_floats(grid.iter().copied()));
    json!({
        "xWords": chart.x_label.words,
        "xUnit": chart.x_label.unit,
        "xLog": chart.is_x_log,
        "xRange": [x_scale.from, x_scale.to],
        "xTicks": log_ticks_json(x_scale),
        "grids": grids.collect::<Value>(),
        "panels": panels.collect::<Value>(),
        "marks": marks.collect::<Vec<_>>(),
        "markMeaning": chart.mark_meaning,
        "shades": chart.shaded_ranges,
        "shadeMeaning": chart.shade_meaning,
    })
}

fn panel_json(
    panel: &ChartPanel,
    grids: &[&Rc<Vec<f64>>],
    encode_curve: fn(&[f64]) -> Value,
) -> Value {
    let stars = panel.stars.iter().map(|(x, y, label)| {
        json!([embed::round_to_six_digits(*x), embed::round_to_six_digits(*y), label])
    });
    let mut data = json!(panel);
    data["ticks"] = log_ticks_json(panel_y_scale(panel));
    data["stars"] = stars.collect();
    let encode_series = |series| series_json(series, grids, encode_curve);
    data["series"] = panel.series.iter().map(encode_series).collect();
    data
}

fn series_json(
    series: &Series,
    grids: &[&Rc<Vec<f64>>],
    encode_curve: fn(&[f64]) -> Value,
) -> Value {
    let stroke = series_stroke(series);
    let is_dots = series.style == SeriesStyle::Dots;
    let [low, high] = match &series.style {
        SeriesStyle::Band(low, high) => [low, high].map(|side| encode_curve(side)),
        _ => [Value::Null, Value::Null],
    };
    json!({
        "name": series.name,
        "colour": if series.colour == INK { "ink".to_owned() } else { series.colour.css() },
        "grid": grids.iter().position(|grid| **grid == series.x),
        "alpha": embed::round_to_six_digits(f64::from(series.colour.alpha) / 255.0),
        "width": if is_dots { 2.0 * DOT_RADIUS } else { stroke.width },
        "dashed": !stroke.dash.is_empty(),
        "dots": is_dots,
        "y": encode_curve(&series.y),
        "low": low,
        "high": high,
    })
}
