//! A map file of one axis: ratios, amplitudes and gaps as curves over it.

use crate::chart::{Chart, ChartPanel, Mark, Series, Style, spans_decades};
use crate::colour::{DISTINCT, LINEAR, NONLINEAR};
use crate::error::PlotError;
use crate::gather::Map;
use crate::label::{self, Label};
use crate::layer::{WHOLE, channels};
use crate::scene::{Colour, INK};
use crate::table::Column;
use crate::{PlotOptions, Quantity};

/// Most failed points that are marked: as many lines as a figure has room for.
const MOST_MARKS: usize = 400;

/// The chart of a map file of one axis.
///
/// # Errors
/// [`PlotError::NotThere`] for an unknown channel or a quantity that the file does not have,
/// [`PlotError::Unfit`] for a quantity that is not a curve.
pub(crate) fn chart(map: &Map, options: &PlotOptions) -> Result<Chart, PlotError> {
    if options.quantity == Quantity::Status {
        return Err(PlotError::Unfit(
            "status is drawn on maps of two or more axes; over one axis, failed points are marked"
                .to_owned(),
        ));
    }
    let (axis, table) = (&map.grid.axes[0], &map.table);
    options.quantity.there(&table.source)?;
    let cells: Vec<usize> = (0..map.counts.len()).filter(|&cell| map.filled(cell)).collect();
    let values = |column: &Column, factor: f64| -> Vec<f64> {
        let values = column.numbers().unwrap_or_default();
        cells.iter().map(|&cell| values[cell] * factor).collect()
    };
    let mut names: Vec<&str> =
        channels(&table.source, "nonlinear_").into_iter().map(|(name, _)| name).collect();
    if let Some((whole, ..)) = options.quantity.whole() {
        names.extend(whole.parts(&table.source).into_iter().map(|of_part| of_part.part));
    }
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
    let wanted = |name: &str| {
        options.channels.is_empty() || options.channels.iter().any(|asked| asked == name)
    };

    let mut panels = vec![ratios(map, options.quantity == Quantity::Ratio, &values, &wanted)];
    let amplitudes = matches!(options.quantity, Quantity::Nonlinear | Quantity::Linear);
    for (name, facts) in channels(&table.source, "nonlinear_") {
        let (unit, factor) = label::shown(&facts.unit);
        let models = [("nonlinear", NONLINEAR), ("linear", LINEAR)].into_iter().filter_map(
            |(model, colour)| {
                let column = table.column(&format!("{model}_{name}"))?;
                Some(line(&format!("{model} model"), colour, values(column, factor)))
            },
        );
        let series = models.collect();
        panels.push(ChartPanel {
            shown: amplitudes && wanted(name),
            height: 190.0,
            ..ChartPanel::new(name, Label::new(&label::channel(name), unit), series)
        });
    }
    let model_colour = |model: &str| if model == "linear" { LINEAR } else { NONLINEAR };
    let panel = |name: &str, words: &str, columns: &[(&str, &str)]| {
        let mut unit = "";
        let lines = columns.iter().filter_map(|(model, name)| {
            let column = table.column(name)?;
            let factor;
            (unit, factor) = label::shown(&column.unit);
            let said = if model.is_empty() { String::new() } else { format!("{model} model") };
            Some(line(&said, model_colour(model), values(column, factor)))
        });
        let lines: Vec<Series> = lines.collect();
        ChartPanel::new(name, Label::new(&label::capitalised(words), unit), lines)
    };
    for whole in &WHOLE {
        let columns: Vec<_> =
            whole.columns.iter().map(|(_, model, name)| (*model, *name)).collect();
        let gap = whole.name == "gap";
        let asked = whole.columns.iter().any(|(quantity, ..)| *quantity == options.quantity);
        let parts = whole.parts(&table.source);
        let asked_part = |part: &str| asked && options.channels.iter().any(|name| name == part);
        panels.push(ChartPanel {
            shown: asked && !parts.iter().any(|of_part| asked_part(of_part.part)),
            levels: if gap { vec![(0.0, "gap closed".to_owned())] } else { Vec::new() },
            ..panel(whole.name, whole.words, &columns)
        });
        for of_part in &parts {
            panels.push(ChartPanel {
                shown: asked_part(of_part.part),
                ..panel(&of_part.name, &of_part.words, &of_part.columns)
            });
        }
    }
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
        title: match (options.quantity, options.quantity.whole()) {
            (Quantity::Ratio, _) => "Where the linear model can be trusted".to_owned(),
            (_, Some((whole, ..))) => label::capitalised(whole.words),
            _ => "Amplitudes of both models".to_owned(),
        },
        subtitle: super::map::subtitle(map, &[]),
        x_label: Label::new(&axis.words, &axis.unit),
        x_log: axis.log,
        marks: failed.iter().step_by(each).map(mark).collect(),
        mark_meaning,
        shades: Vec::new(),
        shade_meaning: String::new(),
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
    let words = format!("Ratio of {}, nonlinear / linear", map.table.source.compared());
    ChartPanel {
        shown,
        log: spans_decades(series.iter().flat_map(|series| series.y.iter().copied())),
        levels: vec![(limit, format!("unreliable from ratio {} on", label::significant(limit, 4)))],
        mixed: mixed(map),
        ..ChartPanel::new("ratio", Label::new(&words, ""), series)
    }
}

fn line(name: &str, colour: Colour, y: Vec<f64>) -> Series {
    Series { name: name.to_owned(), colour, grid: 0, y, style: Style::Solid(2.2) }
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
