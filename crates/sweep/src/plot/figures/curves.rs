//! A map file of one axis: ratios, amplitudes and gaps as curves over it.

use crate::plot::chart::{Chart, ChartPanel, Mark, Series, Style, spans_decades};
use crate::plot::colour::{DISTINCT, LINEAR, NONLINEAR};
use crate::plot::error::PlotError;
use crate::plot::grid::Grid;
use crate::plot::label;
use crate::plot::layer::channels;
use crate::plot::read::{Column, Table};
use crate::plot::scene::INK;
use crate::plot::{PlotOptions, Quantity};

/// The chart of a map file of one axis.
///
/// # Errors
/// [`PlotError::NotThere`] for an unknown channel, [`PlotError::Unfit`] for a quantity that is no curve.
pub(crate) fn chart(table: &Table, grid: &Grid, options: &PlotOptions) -> Result<Chart, PlotError> {
    if options.quantity == Quantity::Status {
        return Err(PlotError::Unfit(
            "status is drawn on maps of two or more axes; over one axis, failed points are marked".to_owned(),
        ));
    }
    let axis = &grid.axes[0];
    let order: Vec<usize> = grid.rows().iter().copied().flatten().collect();
    let at_grid = |column: &Column, factor: f64| -> Vec<f64> {
        let values = column.numbers().unwrap_or_default();
        order.iter().map(|&row| values[row] * factor).collect()
    };
    let names: Vec<&str> = channels(table, "nonlinear_").into_iter().map(|(name, _)| name).collect();
    for asked in &options.channels {
        if !names.contains(&asked.as_str()) {
            return Err(PlotError::NotThere {
                option: "--channel",
                given: asked.clone(),
                path: table.path.clone(),
                what: "channel",
                known: names.join(", "),
            });
        }
    }
    let wanted =
        |name: &str| options.channels.is_empty() || options.channels.iter().any(|asked| asked == name);

    let mut panels = vec![ratios(table, options.quantity == Quantity::Ratio, &at_grid, &wanted)];
    let amplitudes = matches!(options.quantity, Quantity::Nonlinear | Quantity::Linear);
    for (name, column) in channels(table, "nonlinear_") {
        let (unit, factor) = label::shown(&column.unit);
        let mut series = vec![line("nonlinear model", NONLINEAR, at_grid(column, factor))];
        if let Some(column) = table.column(&format!("linear_{name}")) {
            series.push(line("linear model", LINEAR, at_grid(column, factor)));
        }
        panels.push(ChartPanel {
            label: label::with_unit(&label::channel(name), unit),
            shown: amplitudes && wanted(name),
            height: 190.0,
            ..panel(name, series)
        });
    }
    let gaps = [("nonlinear", NONLINEAR), ("linear", LINEAR)].into_iter().filter_map(|(model, colour)| {
        let column = table.column(&format!("min_gap_{model}_m"))?;
        Some(line(&format!("{model} model"), colour, at_grid(column, 1e3)))
    });
    let gaps = ChartPanel {
        label: "Least gap between drum and tub (mm)".to_owned(),
        shown: matches!(options.quantity, Quantity::GapNonlinear | Quantity::GapLinear),
        levels: vec![(0.0, "gap closed".to_owned())],
        ..panel("gap", gaps.collect())
    };
    panels.push(gaps);
    panels.retain(|panel| !panel.series.is_empty());

    let status: Vec<&str> = table.statuses().collect();
    let failures = order.iter().zip(&axis.values).filter_map(|(&row, &x)| {
        let status = *status.get(row)?;
        (status != "ok").then(|| Mark { x, label: status.replace('_', " ") })
    });
    Ok(Chart {
        title: match options.quantity {
            Quantity::Ratio => "Where the linear model can be trusted",
            Quantity::Nonlinear | Quantity::Linear => "Amplitudes of both models",
            _ => "Least gap between drum and tub",
        }
        .to_owned(),
        subtitle: super::map::counts(table),
        x_label: axis.label(),
        x_log: axis.log,
        marks: failures.collect(),
        mark_meaning: "failed: no result".to_owned(),
        grids: vec![order_values(grid)],
        panels,
    })
}

/// Axis values that have a row, in grid order.
fn order_values(grid: &Grid) -> Vec<f64> {
    let values = &grid.axes[0].values;
    grid.rows().iter().zip(values).filter(|(row, _)| row.is_some()).map(|(_, value)| *value).collect()
}

fn ratios(
    table: &Table,
    shown: bool,
    at_grid: &impl Fn(&Column, f64) -> Vec<f64>,
    wanted: &impl Fn(&str) -> bool,
) -> ChartPanel {
    let limit = table.ratio_limit();
    let mut series: Vec<Series> = channels(table, "ratio_")
        .into_iter()
        .enumerate()
        .filter(|(_, (name, _))| wanted(name))
        .map(|(k, (name, column))| {
            line(&label::channel(name), DISTINCT[k % DISTINCT.len()], at_grid(column, 1.0))
        })
        .collect();
    if let Some(column) = table.column("ratio_max") {
        let largest = Series { style: Style::Dashed, ..line("largest", INK, at_grid(column, 1.0)) };
        series.push(largest);
    }
    ChartPanel {
        label: format!("Ratio of {}, nonlinear / linear", table.compared()),
        shown,
        log: spans_decades(series.iter().flat_map(|series| series.y.iter().copied())),
        levels: vec![(limit, format!("unreliable from ratio {} on", label::significant(limit, 4)))],
        ..panel("ratio", series)
    }
}

fn line(name: &str, colour: crate::plot::scene::Colour, y: Vec<f64>) -> Series {
    Series { name: name.to_owned(), colour, grid: 0, y, style: Style::Solid(2.2) }
}

fn panel(name: &str, series: Vec<Series>) -> ChartPanel {
    ChartPanel {
        name: name.to_owned(),
        label: String::new(),
        shown: true,
        log: false,
        range: None,
        height: 420.0,
        series,
        levels: Vec::new(),
        stars: Vec::new(),
    }
}
