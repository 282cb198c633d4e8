//! The traced curve on which the ratio is at its limit, with the bracket it is known to lie in.

use crate::plot::axis::evenly_by_log;
use crate::plot::chart::{Chart, ChartPanel, Series, Style};
use crate::plot::colour::NONLINEAR;
use crate::plot::error::PlotError;
use crate::plot::label;
use crate::plot::read::{Column, Table, bracket};

/// The chart of a boundary file: its first column across, its second up, the bracket shaded.
///
/// # Errors
/// [`PlotError::Empty`] with fewer than two points.
pub(crate) fn chart(table: &Table) -> Result<Chart, PlotError> {
    let columns: Vec<&Column> = table.columns.iter().filter(|column| column.numbers().is_some()).collect();
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let empty = || PlotError::Empty { path: table.path.clone(), reason: "a curve needs at least two points" };
    let (low, high) = bracket(&names).ok_or_else(empty)?;
    let (x, y) = (columns[0], columns[1]);
    let mut rows: Vec<usize> = (0..table.rows).collect();
    let values = table.numbers(&x.name)?;
    rows.retain(|&row| values[row].is_finite());
    rows.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    if rows.len() < 2 {
        return Err(empty());
    }
    let pick = |name: &str| -> Result<Vec<f64>, PlotError> {
        let values = table.numbers(name)?;
        Ok(rows.iter().map(|&row| values[row]).collect())
    };
    let xs = pick(&x.name)?;
    let limit = label::significant(table.ratio_limit(), 4);
    let series = Series {
        name: format!("boundary: ratio {limit}, bracket shaded"),
        colour: NONLINEAR,
        grid: 0,
        y: pick(&y.name)?,
        style: Style::Band(pick(low)?, pick(high)?),
    };
    let run = table.run_name().map_or(String::new(), |name| format!("{name} · "));
    Ok(Chart {
        title: "Boundary of the linear model's reliability".to_owned(),
        subtitle: format!("{run}{} points", rows.len()),
        x_label: label::with_unit(&label::words(&x.name), &x.unit),
        x_log: evenly_by_log(&xs),
        grids: vec![xs],
        panels: vec![ChartPanel {
            name: "boundary".to_owned(),
            label: label::with_unit(&label::words(&y.name), &y.unit),
            shown: true,
            log: false,
            range: None,
            height: 440.0,
            series: vec![series],
            levels: Vec::new(),
            stars: Vec::new(),
        }],
        marks: Vec::new(),
        mark_meaning: String::new(),
    })
}
