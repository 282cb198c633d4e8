//! The figure of a map file over one axis: ratios, amplitudes and gaps as curves.

use crate::PlotOptions;
use crate::chart::{Chart, ChartPanel, Mark, Series, SeriesStyle, spans_decades};
use crate::colour::{DISTINCT_COLOURS, LINEAR_COLOUR, NONLINEAR_COLOUR};
use crate::error::{PlotError, Result};
use crate::gather::CellMap;
use crate::label::{self, Label};
use crate::layer::{self, ColumnGroup, ShownColumn};
use crate::read::{ColumnFacts, FigureFile};
use crate::scene::{Colour, INK};
use crate::table::FigureColumn;

/// Maximum number of failed points that are marked. Basis: more lines than that fill a figure.
const MAX_MARKS: usize = 400;

/// Returns the title for the requested columns, with the channel if it is the only one.
fn curves_title(source: &FigureFile, requested: &[ShownColumn]) -> String {
    let Some(first) = requested.first() else { return RATIOS_TITLE.to_owned() };
    let is_single_channel = requested.iter().all(|shown| shown.channel == first.channel);
    match (first.column_group, first.channel.as_ref().filter(|_| is_single_channel)) {
        (ColumnGroup::Nonlinear | ColumnGroup::Linear, Some(channel)) => {
            format!("{AMPLITUDES_TITLE}: {}", label::channel_in_words(channel))
        }
        (ColumnGroup::Nonlinear | ColumnGroup::Linear, None) => AMPLITUDES_TITLE.to_owned(),
        (ColumnGroup::Other, _) => label::quantity_in_words(first.name()),
        (ColumnGroup::Ratio, Some(_)) => first.title_and_label(source).0,
        (ColumnGroup::Ratio, None) => RATIOS_TITLE.to_owned(),
    }
}

/// The title of charts of amplitudes.
const AMPLITUDES_TITLE: &str = "Amplitudes of both models";
/// The title of charts of ratios.
const RATIOS_TITLE: &str = "Where the linear model can be trusted";

/// Draws the chart of a map file over one axis.
///
/// # Errors
/// [`PlotError::Unfit`] for a column that the file does not have, or that is not a curve.
pub(crate) fn curves_chart(map: &CellMap, options: &PlotOptions) -> Result<Chart> {
    let axis = &map.grid.axes[0];
    let table = &map.table;
    let source = &table.source;
    let requested: Option<Vec<ShownColumn>> =
        layer::requested_columns(source, options)?.into_iter().collect();
    let Some(requested) = requested else {
        return Err(PlotError::Unfit(
            "status is drawn on maps of two or more axes; over one axis, failed points are marked"
                .to_owned(),
        ));
    };
    let filled_cells: Vec<usize> =
        (0..map.point_counts.len()).filter(|&cell| map.has_points(cell)).collect();
    let xs: Vec<f64> = filled_cells.iter().map(|&cell| axis.values[cell]).collect();
    let column_series = |name: &str, colour: Colour, column: &FigureColumn, factor: f64| {
        let column_values = column.numbers().unwrap_or_default();
        let y = filled_cells.iter().map(|&cell| column_values[cell] * factor).collect();
        Series::new(name, colour, xs.clone(), y, SeriesStyle::Solid(2.2))
    };
    let requested_ratios: Vec<&ShownColumn> =
        requested.iter().filter(|shown| shown.column_group == ColumnGroup::Ratio).collect();
    let is_channel_requested = |name: &str| {
        let mut channels = requested_ratios.iter().map(|shown| shown.channel.as_deref());
        requested_ratios.is_empty()
            || channels.any(|channel| channel.is_none_or(|channel| channel == name))
    };
    let mut panels =
        vec![ratio_panel(map, !requested_ratios.is_empty(), &column_series, &is_channel_requested)];
    // Each quantity has a panel with the columns of both models.
    let quantity_panel = |quantity: layer::QuantityColumns<'_>| {
        let columns = &quantity.columns;
        let (unit, factor) = label::display_unit(columns[0].1.unit());
        let series = columns.iter().filter_map(|(model, facts)| {
            let name = if model.is_empty() { String::new() } else { format!("{model} model") };
            let colour = if *model == "linear" { LINEAR_COLOUR } else { NONLINEAR_COLOUR };
            Some(column_series(&name, colour, table.column(&facts.name)?, factor))
        });
        let limit = columns[0].1.metadata.limit.map(|limit| limit * factor);
        let is_requested = |name: &String| requested.iter().any(|shown| shown.name() == name);
        let label = Label::new(&label::capitalise(&quantity.words), unit);
        let panel = ChartPanel::new(&quantity.name, label, series.collect());
        ChartPanel {
            is_shown: columns.iter().any(|(_, facts)| is_requested(&facts.name)),
            levels: limit.map(|limit| (limit, "limit".to_owned())).into_iter().collect(),
            height: if quantity.is_channel { 190.0 } else { panel.height },
            ..panel
        }
    };
    panels.extend(layer::collect_quantities(source).into_iter().map(quantity_panel));
    panels.retain(|panel| !panel.series.is_empty());

    let failed_cells: Vec<usize> = filled_cells
        .iter()
        .copied()
        .filter(|&cell| map.point_counts[cell].failed_points > 0)
        .collect();
    let mark_stride = failed_cells.len().div_ceil(MAX_MARKS).max(1);
    let to_mark = |&cell: &usize| Mark {
        x: axis.values[cell],
        label: map.common_status(cell).unwrap_or("some failed").replace('_', " "),
    };
    let mark_meaning = if mark_stride == 1 {
        "failed: no result".to_owned()
    } else {
        format!("failed: no result; one of {mark_stride} places is marked")
    };
    Ok(Chart {
        title: curves_title(source, &requested),
        subtitle: super::map::map_subtitle(map, &[]),
        x_label: Label::new(&axis.swept_axis.words, &axis.swept_axis.unit),
        is_x_log: axis.swept_axis.is_log,
        marks: failed_cells.iter().step_by(mark_stride).map(to_mark).collect(),
        mark_meaning,
        panels,
        ..Chart::default()
    })
}

fn ratio_panel(
    map: &CellMap,
    is_shown: bool,
    column_series: &impl Fn(&str, Colour, &FigureColumn, f64) -> Series,
    is_channel_requested: &impl Fn(&str) -> bool,
) -> ChartPanel {
    let limit = map.table.source.ratio_limit();
    let mut channels = map.table.source.with_prefix("ratio_");
    channels.retain(|(name, _)| !["max", "min", "change"].contains(name));
    let channel_series = |(k, (name, facts)): (usize, (&str, &ColumnFacts))| {
        let column = map.table.column(&facts.name).filter(|_| is_channel_requested(name))?;
        Some(column_series(
            &label::channel_in_words(name),
            DISTINCT_COLOURS[k % DISTINCT_COLOURS.len()],
            column,
            1.0,
        ))
    };
    let mut series: Vec<Series> =
        channels.into_iter().enumerate().filter_map(channel_series).collect();
    if let Some(column) = map.table.column("ratio_max") {
        series.push(Series {
            style: SeriesStyle::Dashed,
            ..column_series("largest", INK, column, 1.0)
        });
    }
    let label_words =
        format!("Ratio of {}, nonlinear / linear", map.table.source.compared_quantity());
    ChartPanel {
        is_shown,
        is_log: spans_decades(series.iter().flat_map(|series| series.y.iter().copied())),
        levels: vec![(
            limit,
            format!("unreliable from ratio {} on", label::format_significant(limit, 4)),
        )],
        mixed_ranges: mixed_ranges(map),
        ..ChartPanel::new("ratio", Label::new(&label_words, ""), series)
    }
}

/// Returns the ranges of the axis whose cells hold reliable and unreliable points. Ranges that are
/// too close to be distinguished are merged.
fn mixed_ranges(map: &CellMap) -> Vec<[f64; 2]> {
    let axis = &map.grid.axes[0];
    let scale = axis.scale();
    let mut ranges: Vec<[f64; 2]> = Vec::new();
    for (counts, ends) in map.point_counts.iter().zip(axis.borders.windows(2)) {
        if counts.reliable_points == 0 || counts.unreliable_points == 0 {
            continue;
        }
        match ranges.last_mut() {
            Some(last_range)
                if scale.position(ends[0]) - scale.position(last_range[1]) < MIN_RANGE_GAP =>
            {
                last_range[1] = ends[1];
            }
            _ => ranges.push([ends[0], ends[1]]),
        }
    }
    ranges
}

/// Minimum gap between two ranges that are drawn apart, as a share of the axis. Basis: half a pixel
/// of a picture.
const MIN_RANGE_GAP: f64 = 5e-4;
