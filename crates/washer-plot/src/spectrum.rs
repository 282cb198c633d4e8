//! The chart of a fit's spectra: the measured motion and the residual over frequency.

use serde_json::Value;

use crate::profiles::read_numbers;
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::table::FigureTable;
use sweep_plot::{INK, MUTED_COLOUR, PlotError};

/// Draws the spectra of a fit's curves.
///
/// # Errors
/// [`PlotError::Undrawable`] for a file without spectra.
pub(crate) fn spectrum_chart(table: &FigureTable) -> Result<Chart, PlotError> {
    let spectra = table.source.find_metadata("spectra").ok_or_else(|| {
        table
            .source
            .nothing_to_draw_error("it has no spectra: they are in the curves of `sweep fit`")
    })?;
    let read_panel = |column: &Value| {
        let read_text = |key: &str| column[key].as_str().unwrap_or_default();
        let (unit, factor) = label::display_unit(read_text("unit"));
        let read_curve = |key: &str, colour| {
            let values = read_numbers(&column[key]);
            let y = values.iter().map(|value| value * factor).collect();
            Series::new(key, colour, read_numbers(&spectra["hz"]), y, SeriesStyle::Solid(1.3))
        };
        let series = vec![read_curve("measured", MUTED_COLOUR), read_curve("residual", INK)];
        let label =
            Label::new(&label::name_in_words(read_text("name")), &format!("{unit} per root Hz"));
        ChartPanel {
            height: 165.0,
            is_log: true,
            ..ChartPanel::new(read_text("name"), label, series)
        }
    };
    Ok(Chart {
        title: "What the fitted model leaves over, by frequency".to_owned(),
        subtitle: table.source.subtitle("noise is even; a motion stands out"),
        x_label: Label::new("Frequency", "Hz"),
        panels: spectra["columns"].as_array().into_iter().flatten().map(read_panel).collect(),
        ..Chart::default()
    })
}
