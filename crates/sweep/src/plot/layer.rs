//! What a map can show: one value per row, with its words and colours.

use super::colour::ColourScale;
use super::error::PlotError;
use super::label;
use super::read::{Column, Table};
use super::{PlotOptions, Quantity};

/// One value per row of a map file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layer {
    /// What is shown, for the heading.
    pub(crate) title: String,
    /// What the colours mean, with unit.
    pub(crate) label: String,
    /// In shown units; NaN where there is none.
    pub(crate) values: Vec<f64>,
    /// Values to colours.
    pub(crate) scale: ColourScale,
    /// The level whose line is drawn, if one has a meaning.
    pub(crate) level: Option<Level>,
}

/// A level that divides the map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    /// In shown units.
    pub(crate) value: f64,
    /// Distances from the level are taken by the logarithm.
    pub(crate) log: bool,
    /// Name of the line.
    pub(crate) line: String,
    /// What it means to lie above, within the picture and in the legend.
    pub(crate) above: [String; 2],
    /// What it means to lie below.
    pub(crate) below: [String; 2],
}

impl Level {
    /// Signed distance of a value from the level; zero or more is above.
    pub(crate) fn offset(&self, value: f64) -> f64 {
        if self.log { (value / self.value).ln() } else { value - self.value }
    }
}

/// The names by which a channel's column can go: `ratio_<channel>` and the like, without `ratio_max`.
pub(crate) fn channels<'a>(table: &'a Table, prefix: &str) -> Vec<(&'a str, &'a Column)> {
    let mut columns = table.with_prefix(prefix);
    columns.retain(|(name, _)| *name != "max");
    columns
}

/// The layer that the options ask for.
///
/// # Errors
/// [`PlotError::NotThere`] for a channel that the file does not have, [`PlotError::Unfit`] for a quantity that needs
/// another choice of channel.
pub(crate) fn layer(table: &Table, options: &PlotOptions) -> Result<Layer, PlotError> {
    let channel = match &options.channels[..] {
        [] => None,
        [one] => Some(one.as_str()),
        _ => {
            return Err(PlotError::Unfit(
                "a map shows one channel at a time: give `--channel` once".to_owned(),
            ));
        }
    };
    match (options.quantity, channel) {
        (Quantity::Ratio, None) => ratio(table, None),
        (Quantity::Ratio, Some(channel)) => ratio(table, Some(channel)),
        (Quantity::Nonlinear, Some(channel)) => amplitude(table, "nonlinear", channel),
        (Quantity::Linear, Some(channel)) => amplitude(table, "linear", channel),
        (quantity @ (Quantity::Nonlinear | Quantity::Linear), None) => {
            let prefix = if quantity == Quantity::Linear { "linear_" } else { "nonlinear_" };
            Err(PlotError::Unfit(format!(
                "an amplitude is that of one channel: add `--channel NAME`, one of {}",
                listed(&channels(table, prefix))
            )))
        }
        (Quantity::GapNonlinear, None) => gap(table, "nonlinear"),
        (Quantity::GapLinear, None) => gap(table, "linear"),
        (Quantity::GapNonlinear | Quantity::GapLinear | Quantity::Status, Some(_)) => {
            Err(PlotError::Unfit("gap and status belong to no channel: leave out `--channel`".to_owned()))
        }
        (Quantity::Status, None) => Err(PlotError::Unfit(
            "status has no values: it is drawn by kind, on a map of two or more axes".to_owned(),
        )),
    }
}

fn listed(columns: &[(&str, &Column)]) -> String {
    columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

fn find<'a>(table: &'a Table, prefix: &str, channel: &str) -> Result<&'a Column, PlotError> {
    let known = channels(table, prefix);
    known.iter().find(|(name, _)| *name == channel).map(|(_, column)| *column).ok_or_else(|| {
        PlotError::NotThere {
            option: "--channel",
            given: channel.to_owned(),
            path: table.path.clone(),
            what: "channel",
            known: listed(&known),
        }
    })
}

fn ratio(table: &Table, channel: Option<&str>) -> Result<Layer, PlotError> {
    let limit = table.ratio_limit();
    let values = match channel {
        None => table.numbers("ratio_max")?.to_vec(),
        Some(channel) => find(table, "ratio_", channel)?.numbers().unwrap_or_default().to_vec(),
    };
    // No excitation can leave an infinite ratio, which has no place on any scale.
    let values: Vec<f64> =
        values.into_iter().map(|v| if v > 0.0 && v.is_finite() { v } else { f64::NAN }).collect();
    let said = label::significant(limit, 4);
    let compared = table.compared();
    let (title, label, above, below) = match channel {
        None => (
            "Where the linear model can be trusted".to_owned(),
            format!("largest ratio of {compared}, nonlinear / linear"),
            ["linear model unreliable".to_owned(), format!("unreliable: ratio {said} or more")],
            ["linear model reliable".to_owned(), format!("reliable: below {said}")],
        ),
        Some(channel) => (
            format!("Ratio of {compared}: {}", label::channel(channel)),
            format!("ratio of {compared}, nonlinear / linear"),
            [format!("ratio above {said}"), format!("ratio {said} or more")],
            [format!("ratio below {said}"), format!("ratio below {said}")],
        ),
    };
    Ok(Layer {
        title,
        label,
        scale: ColourScale::ratio(values.iter().copied(), limit),
        values,
        level: Some(Level { value: limit, log: true, line: format!("boundary: ratio {said}"), above, below }),
    })
}

fn amplitude(table: &Table, model: &str, channel: &str) -> Result<Layer, PlotError> {
    let column = find(table, &format!("{model}_"), channel)?;
    let (unit, factor) = label::shown(&column.unit);
    let values: Vec<f64> = column.numbers().unwrap_or_default().iter().map(|value| value * factor).collect();
    Ok(Layer {
        title: format!("Amplitude, {model} model: {}", label::channel(channel)),
        label: label::with_unit(&format!("amplitude, {model} model"), unit),
        scale: ColourScale::amplitude(values.iter().copied()),
        values,
        level: None,
    })
}

fn gap(table: &Table, model: &str) -> Result<Layer, PlotError> {
    let name = format!("min_gap_{model}_m");
    let (unit, factor) = label::shown("m");
    let values: Vec<f64> = table.numbers(&name)?.iter().map(|value| value * factor).collect();
    Ok(Layer {
        title: format!("Least gap between drum and tub, {model} model"),
        label: label::with_unit("least gap over the run", unit),
        scale: ColourScale::gap(values.iter().copied()),
        values,
        level: Some(Level {
            value: 0.0,
            log: false,
            line: "gap closed".to_owned(),
            above: ["drum and tub apart".to_owned(), "apart".to_owned()],
            below: ["drum touches tub".to_owned(), "contact: gap below 0".to_owned()],
        }),
    })
}
