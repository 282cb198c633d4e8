//! How the cost of a fit rises on both sides of each fitted number, the others fitted again.

use serde_json::Value;

use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::table::Table;
use sweep_plot::{DISTINCT, MUTED, PlotError};

/// The cost at either end of a 95 % interval, above the least.
const AT_95: f64 = 3.84;

/// The chart of a fit's curves.
///
/// # Errors
/// [`PlotError::Undrawable`] for a file that has no profiles.
pub(crate) fn chart(table: &Table) -> Result<Chart, PlotError> {
    let empty = || {
        table.source.empty(
            "it has no profiles: they are in the curves of `sweep fit`, if the model follows",
        )
    };
    let profiles = table.source.find("profiles").and_then(Value::as_array).ok_or_else(empty)?;
    let grid = profiles.first().map(|profile| numbers(&profile["deviations"]));
    let grid = grid.filter(|grid| grid.len() > 1).ok_or_else(empty)?;
    let series = profiles.iter().enumerate().map(|(k, profile)| {
        let name = label::words(profile["name"].as_str().unwrap_or_default());
        let y = numbers(&profile["cost_above"]);
        Series::new(name, DISTINCT[k % 6], grid.clone(), y, Style::Solid(1.8))
    });
    let parabola = grid.iter().map(|deviation| deviation * deviation).collect();
    let parabola =
        Series::new("by the standard errors", MUTED, grid.clone(), parabola, Style::Dashed);
    let series = series.chain([parabola]).collect();
    let panel = ChartPanel {
        levels: vec![(AT_95, "95 %".to_owned())],
        ..ChartPanel::new("cost", Label::new("Cost above the least", ""), series)
    };
    Ok(Chart {
        title: "How well the fitted numbers are known".to_owned(),
        subtitle: table.source.subtitle("each moved, the others fitted again"),
        x_label: Label::new("Distance from the fitted number in standard errors", ""),
        panels: vec![panel],
        ..Chart::default()
    })
}

/// A list's numbers.
pub(crate) fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}
