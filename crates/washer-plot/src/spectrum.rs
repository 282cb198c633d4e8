//! What a fit leaves over by frequency, under what was measured.

use serde_json::Value;

use crate::profiles::numbers;
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::table::Table;
use sweep_plot::{INK, MUTED, PlotError};

/// The chart of a fit's curves.
///
/// # Errors
/// [`PlotError::Undrawable`] for a file that has no spectra.
pub(crate) fn chart(table: &Table) -> Result<Chart, PlotError> {
    let spectra = table.source.find("spectra").ok_or_else(|| {
        table.source.empty("it has no spectra: they are in the curves of `sweep fit`")
    })?;
    let panel = |column: &Value| {
        let text = |key: &str| column[key].as_str().unwrap_or_default();
        let (unit, factor) = label::shown(text("unit"));
        let curve = |key: &str, colour| {
            let values = numbers(&column[key]);
            let y = values.iter().map(|value| value * factor).collect();
            Series::new(key, colour, numbers(&spectra["hz"]), y, Style::Solid(1.3))
        };
        let series = vec![curve("measured", MUTED), curve("residual", INK)];
        let label = Label::new(&label::words(text("name")), &format!("{unit} per root Hz"));
        ChartPanel { height: 165.0, log: true, ..ChartPanel::new(text("name"), label, series) }
    };
    Ok(Chart {
        title: "What the fitted model leaves over, by frequency".to_owned(),
        subtitle: table.source.subtitle("noise is even; a motion stands out"),
        x_label: Label::new("Frequency", "Hz"),
        panels: spectra["columns"].as_array().into_iter().flatten().map(panel).collect(),
        ..Chart::default()
    })
}
