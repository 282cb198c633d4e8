//! A map file of one axis: ratios, amplitudes and gaps as curves over it.

use crate::Options;
use crate::chart::{Chart, ChartPanel, Mark, Series, Style, spans_decades};
use crate::colour::{DISTINCT, LINEAR, NONLINEAR};
use crate::error::{PlotError, Result};
use crate::gather::Map;
use crate::label::{self, Label};
use crate::layer::{self, Group, Shown};
use crate::read::{ColumnFacts, Source};
use crate::scene::{Colour, INK};
use crate::table::Column;

/// Most failed points that are marked: as many lines as a figure has room for.
const MOST_MARKS: usize = 400;

/// The title over what is asked for first; with its channel, where no other is asked for too.
fn title(source: &Source, asked: &[Shown]) -> String {
    let Some(first) = asked.first() else { return TRUSTED.to_owned() };
    let is_alone = asked.iter().all(|shown| shown.channel == first.channel);
    match (first.group, first.channel.as_ref().filter(|_| is_alone)) {
        (Group::Nonlinear | Group::Linear, Some(channel)) => {
            format!("{BOTH}: {}", label::channel(channel))
        }
        (Group::Nonlinear | Group::Linear, None) => BOTH.to_owned(),
        (Group::Other, _) => label::quantity(first.column()),
        (Group::Ratio, Some(_)) => first.words(source).0,
        (Group::Ratio, None) => TRUSTED.to_owned(),
    }
}

/// Titles of charts of amplitudes, and of ratios.
const BOTH: &str = "Amplitudes of both models";
const TRUSTED: &str = "Where the linear model can be trusted";

/// The chart of a map file of one axis.
///
/// # Errors
/// [`PlotError::Unfit`] for a column that the file does not have, or that is not a curve.
pub(crate) fn chart(map: &Map, options: &Options) -> Result<Chart> {
    let (axis, table) = (&map.grid.axes[0], &map.table);
    let source = &table.source;
    let asked: Option<Vec<Shown>> = layer::asked(source, options)?.into_iter().collect();
    let Some(asked) = asked else {
        return Err(PlotError::Unfit(
            "status is drawn on maps of two or more axes; over one axis, failed points are marked"
                .to_owned(),
        ));
    };
    let cells: Vec<usize> = (0..map.counts.len()).filter(|&cell| map.filled(cell)).collect();
    let xs: Vec<f64> = cells.iter().map(|&cell| axis.values[cell]).collect();
    let line = |name: &str, colour: Colour, column: &Column, factor: f64| {
        let values = column.numbers().unwrap_or_default();
        let y = cells.iter().map(|&cell| values[cell] * factor).collect();
        Series::new(name, colour, xs.clone(), y, Style::Solid(2.2))
    };
    let ratios_asked: Vec<&Shown> =
        asked.iter().filter(|shown| shown.group == Group::Ratio).collect();
    let wanted = |name: &str| {
        let mut channels = ratios_asked.iter().map(|shown| shown.channel.as_deref());
        ratios_asked.is_empty() || channels.any(|channel| channel.is_none_or(|of| of == name))
    };
    let mut panels = vec![ratios(map, !ratios_asked.is_empty(), &line, &wanted)];
    // A panel of both models' columns.
    let panel = |family: layer::Family<'_>| {
        let columns = &family.columns;
        let (unit, factor) = label::shown(&columns[0].1.unit);
        let lines = columns.iter().filter_map(|(model, facts)| {
            let said = if model.is_empty() { String::new() } else { format!("{model} model") };
            let colour = if *model == "linear" { LINEAR } else { NONLINEAR };
            Some(line(&said, colour, table.column(&facts.name)?, factor))
        });
        let limit = columns[0].1.limit.map(|limit| limit * factor);
        let is_asked = |name: &String| asked.iter().any(|shown| shown.column() == name);
        let label = Label::new(&label::capitalised(&family.words), unit);
        let panel = ChartPanel::new(&family.name, label, lines.collect());
        ChartPanel {
            shown: columns.iter().any(|(_, facts)| is_asked(&facts.name)),
            levels: limit.map(|limit| (limit, "limit".to_owned())).into_iter().collect(),
            height: if family.is_channel { 190.0 } else { panel.height },
            ..panel
        }
    };
    panels.extend(layer::families(source).into_iter().map(panel));
    panels.retain(|panel| !panel.series.is_empty());

    let failed: Vec<usize> =
        cells.iter().copied().filter(|&cell| map.counts[cell].failed > 0).collect();
    let each = failed.len().div_ceil(MOST_MARKS).max(1);
    let mark = |&cell: &usize| Mark {
        x: axis.values[cell],
        label: map.status(cell).unwrap_or("some failed").replace('_', " "),
    };
    let mark_meaning = if each == 1 {
        "failed: no result".to_owned()
    } else {
        format!("failed: no result; one of {each} places is marked")
    };
    Ok(Chart {
        title: title(source, &asked),
        subtitle: super::map::subtitle(map, &[]),
        x_label: Label::new(&axis.swept.words, &axis.swept.unit),
        x_log: axis.swept.log,
        marks: failed.iter().step_by(each).map(mark).collect(),
        mark_meaning,
        panels,
        ..Chart::default()
    })
}

fn ratios(
    map: &Map,
    shown: bool,
    line: &impl Fn(&str, Colour, &Column, f64) -> Series,
    wanted: &impl Fn(&str) -> bool,
) -> ChartPanel {
    let limit = map.table.source.ratio_limit();
    let mut channels = map.table.source.with_prefix("ratio_");
    channels.retain(|(name, _)| !["max", "min", "change"].contains(name));
    let ratio = |(k, (name, facts)): (usize, (&str, &ColumnFacts))| {
        let column = map.table.column(&facts.name).filter(|_| wanted(name))?;
        Some(line(&label::channel(name), DISTINCT[k % DISTINCT.len()], column, 1.0))
    };
    let mut series: Vec<Series> = channels.into_iter().enumerate().filter_map(ratio).collect();
    if let Some(column) = map.table.column("ratio_max") {
        series.push(Series { style: Style::Dashed, ..line("largest", INK, column, 1.0) });
    }
    let words = format!("Ratio of {}, nonlinear / linear", map.table.source.compared());
    ChartPanel {
        shown,
        log: spans_decades(series.iter().flat_map(|series| series.y.iter().copied())),
        levels: vec![(limit, format!("unreliable from ratio {} on", label::significant(limit, 4)))],
        mixed: mixed(map),
        ..ChartPanel::new("ratio", Label::new(&words, ""), series)
    }
}

/// Where a cell holds reliable and unreliable points, as ranges of the axis. Those too near to each
/// other to be seen apart are one.
fn mixed(map: &Map) -> Vec<[f64; 2]> {
    let axis = &map.grid.axes[0];
    let scale = axis.scale();
    let mut ranges: Vec<[f64; 2]> = Vec::new();
    for (counts, pair) in map.counts.iter().zip(axis.borders.windows(2)) {
        if counts.reliable == 0 || counts.unreliable == 0 {
            continue;
        }
        match ranges.last_mut() {
            Some(last) if scale.position(pair[0]) - scale.position(last[1]) < LEAST_APART => {
                last[1] = pair[1];
            }
            _ => ranges.push([pair[0], pair[1]]),
        }
    }
    ranges
}

/// Half a pixel of a picture, as a share of the axis.
const LEAST_APART: f64 = 5e-4;
