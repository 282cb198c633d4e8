//! The variation of natural frequencies over a turn of the drum (the paper's Fig. 7b).

use crate::campbell::{interpolate, read_modes};
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::Label;
use sweep_plot::table::FigureTable;
use sweep_plot::{DISTINCT_COLOURS, PlotError};

/// Draws the variation in a modes file: for each mode with a resonance, half the difference between
/// its greatest and least frequency over a turn, as a share of the mean.
///
/// # Errors
/// [`PlotError::Undrawable`] without a column, or if no mode has a resonance.
pub(crate) fn variation_chart(table: &FigureTable) -> Result<Chart, PlotError> {
    table.numbers("frequency_min_rpm")?;
    table.numbers("frequency_max_rpm")?;
    let mut series = Vec::new();
    let mut stars = Vec::new();
    for (k, mode) in read_modes(table)?.into_iter().enumerate() {
        let resonances_rpm = &mode.resonances_rpm;
        let Some((least, greatest)) = mode.band.filter(|_| !resonances_rpm.is_empty()) else {
            continue;
        };
        let variation_percent =
            |k: usize| 50.0 * (greatest[k] - least[k]) / mode.frequencies_rpm[k];
        let variations_percent: Vec<f64> =
            (0..mode.frequencies_rpm.len()).map(variation_percent).collect();
        for &speed in resonances_rpm {
            stars.push((
                speed,
                interpolate(&mode.speeds_rpm, &variations_percent, speed),
                format!("{speed:.1} rpm"),
            ));
        }
        let colour = DISTINCT_COLOURS[k % DISTINCT_COLOURS.len()];
        series.push(Series::new(
            mode.name,
            colour,
            mode.speeds_rpm,
            variations_percent,
            SeriesStyle::Solid(2.2),
        ));
    }
    if series.is_empty() {
        return Err(table.source.nothing_to_draw_error("no mode's frequency meets the spin speed"));
    }
    let label = Label::new("Variation over a turn", "± % of the mean");
    Ok(Chart {
        title: "Natural frequencies over a turn of the drum".to_owned(),
        subtitle: table.source.subtitle("half the distance from least to greatest"),
        x_label: Label::new("Spin speed", "rpm"),
        panels: vec![ChartPanel { stars, ..ChartPanel::new("variation", label, series) }],
        ..Chart::default()
    })
}
