//! A map file of one axis: ratios, amplitudes and gaps as curves over it.

use crate::plot::chart::{Chart, ChartPanel, Mark, Series, Style, spans_decades};
use crate::plot::colour::{DISTINCT, LINEAR, NONLINEAR};
use crate::plot::error::PlotError;
use crate::plot::gather::Map;
use crate::plot::label;
use crate::plot::layer::channels;
use crate::plot::scene::INK;
use crate::plot::table::Column;
use crate::plot::{PlotOptions, Quantity};

/// Most failed points that are marked: as many lines as a figure has room for.
const MOST_MARKS: usize = 400;

/// The chart of a map file of one axis.
///
/// # Errors
/// [`PlotError::NotThere`] for an unknown channel, [`PlotError::Unfit`] for a quantity that is no curve.
pub(crate) fn chart(map: &Map, options: &PlotOptions) -> Result<Chart, PlotError> {
    if options.quantity == Quantity::Status {
        return Err(PlotError::Unfit(
            "status is drawn on maps of two or more axes; over one axis, failed points are marked".to_owned(),
        ));
    }
    let (axis, table) = (&map.grid.axes[0], &map.table);
    let cells: Vec<usize> = (0..map.counts.len()).filter(|&cell| map.filled(cell)).collect();
    let values = |column: &Column, factor: f64| -> Vec<f64> {
        let values = column.numbers().unwrap_or_default();
        cells.iter().map(|&cell| values[cell] * factor).collect()
    };
    let names: Vec<&str> = channels(&table.source, "nonlinear_").into_iter().map(|(name, _)| name).collect();
    for asked in &options.channels {
        if !names.contains(&asked.as_str()) {
            return Err(PlotError::NotThere {
                option: "--channel",
                given: asked.clone(),
                path: table.source.path.clone(),
                what: "channel",
                known: names.join(", "),
            });
        }
    }
    let wanted =
        |name: &str| options.channels.is_empty() || options.channels.iter().any(|asked| asked == name);

    let mut panels = vec![ratios(map, options.quantity == Quantity::Ratio, &values, &wanted)];
    let amplitudes = matches!(options.quantity, Quantity::Nonlinear | Quantity::Linear);
    for (name, facts) in channels(&table.source, "nonlinear_") {
        let (unit, factor) = label::shown(&facts.unit);
        let models =
            [("nonlinear", NONLINEAR), ("linear", LINEAR)].into_iter().filter_map(|(model, colour)| {
                let column = table.column(&format!("{model}_{name}"))?;
                Some(line(&format!("{model} model"), colour, values(column, factor)))
            });
        let series = models.collect();
        panels.push(ChartPanel {
            label: label::with_unit(&label::channel(name), unit),
            shown: amplitudes && wanted(name),
            height: 190.0,
            ..panel(name, series)
        });
    }
    let gaps = [("nonlinear", NONLINEAR), ("linear", LINEAR)].into_iter().filter_map(|(model, colour)| {
        let column = table.column(&format!("min_gap_{model}_m"))?;
        Some(line(&format!("{model} model"), colour, values(column, 1e3)))
    });
    let gaps = ChartPanel {
        label: "Least gap between drum and tub (mm)".to_owned(),
        shown: matches!(options.quantity, Quantity::GapNonlinear | Quantity::GapLinear),
        levels: vec![(0.0, "gap closed".to_owned())],
        ..panel("gap", gaps.collect())
    };
    panels.push(gaps);
    panels.retain(|panel| !panel.series.is_empty());

    let failed: Vec<usize> = cells.iter().copied().filter(|&cell| map.counts[cell].failed > 0).collect();
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
        title: match options.quantity {
            Quantity::Ratio => "Where the linear model can be trusted",
            Quantity::Nonlinear | Quantity::Linear => "Amplitudes of both models",
            _ => "Least gap between drum and tub",
        }
        .to_owned(),
        subtitle: super::map::subtitle(map, &[]),
        x_label: axis.label(),
        x_log: axis.log,
        marks: failed.iter().step_by(each).map(mark).collect(),
        mark_meaning,
        grids: vec![cells.iter().map(|&cell| axis.values[cell]).collect()],
        panels,
    })
}

fn ratios(
    map: &Map,
    shown: bool,
    values: &impl Fn(&Column, f64) -> Vec<f64>,
    wanted: &impl Fn(&str) -> bool,
) -> ChartPanel {
    let limit = map.table.source.ratio_limit();
    let mut series: Vec<Series> = channels(&map.table.source, "ratio_")
        .into_iter()
        .enumerate()
        .filter(|(_, (name, _))| wanted(name))
        .filter_map(|(k, (name, facts))| {
            let column = map.table.column(&facts.name)?;
            Some(line(&label::channel(name), DISTINCT[k % DISTINCT.len()], values(column, 1.0)))
        })
        .collect();
    if let Some(column) = map.table.column("ratio_max") {
        let largest = Series { style: Style::Dashed, ..line("largest", INK, values(column, 1.0)) };
        series.push(largest);
    }
    ChartPanel {
        label: format!("Ratio of {}, nonlinear / linear", map.table.source.compared()),
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
