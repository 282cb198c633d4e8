//! The chart of a fit's profiles: the cost at fixed values of each fitted number, with the other
//! numbers fitted again.

use serde_json::Value;

use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::table::FigureTable;
use sweep_plot::{DISTINCT_COLOURS, MUTED_COLOUR, PlotError};

/// The 95 % quantile of the chi-squared distribution with one degree of freedom: the cost above the
/// least at either end of a 95 % interval.
const CHI2_1_95: f64 = 3.84;

/// Draws the profiles of a fit's curves.
///
/// # Errors
/// [`PlotError::Undrawable`] for a file without profiles.
pub(crate) fn profile_chart(table: &FigureTable) -> Result<Chart, PlotError> {
    let no_profiles_error = || {
        table.source.nothing_to_draw_error(
            "it has no profiles: they are in the curves of `sweep fit`, if the model follows",
        )
    };
    let profiles = table
        .source
        .find_metadata("profiles")
        .and_then(Value::as_array)
        .ok_or_else(no_profiles_error)?;
    let deviations = profiles.first().map(|profile| read_numbers(&profile["deviations"]));
    let deviations =
        deviations.filter(|deviations| deviations.len() > 1).ok_or_else(no_profiles_error)?;
    let series = profiles.iter().enumerate().map(|(k, profile)| {
        let name = label::name_in_words(profile["name"].as_str().unwrap_or_default());
        let y = read_numbers(&profile["cost_above"]);
        Series::new(name, DISTINCT_COLOURS[k % 6], deviations.clone(), y, SeriesStyle::Solid(1.8))
    });
    let parabola_values = deviations.iter().map(|deviation| deviation * deviation).collect();
    let parabola = Series::new(
        "by the standard errors",
        MUTED_COLOUR,
        deviations.clone(),
        parabola_values,
        SeriesStyle::Dashed,
    );
    let series = series.chain([parabola]).collect();
    let panel = ChartPanel {
        levels: vec![(CHI2_1_95, "95 %".to_owned())],
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

/// Returns the numbers of a list.
pub(crate) fn read_numbers(list: &Value) -> Vec<f64> {
    list.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}
