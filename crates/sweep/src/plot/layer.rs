//! What a map can show: one value per cell, with its words and colours.

use super::colour::ColourScale;
use super::error::PlotError;
use super::gather::{Divide, Map};
use super::label;
use super::read::{ColumnFacts, Source};
use super::{PlotOptions, Quantity};

/// A quantity of a map and the column that holds it, before any row is read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    /// What it is.
    pub(crate) quantity: Quantity,
    /// The channel it is of, if it is of one.
    pub(crate) channel: Option<String>,
    /// Name of its column.
    pub(crate) column: String,
}

/// One value per cell of a map.
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
    /// Whether it depends on the nonlinear motion, which may be chaotic.
    pub(crate) nonlinear: bool,
    /// The level whose line is drawn, if one has a meaning.
    pub(crate) level: Option<Level>,
    /// Of cells of several points, what the line goes by.
    divided: Option<Divided>,
}

/// How the points of a map's cells lie about the level.
#[derive(Clone, Debug, PartialEq)]
struct Divided {
    both: Vec<bool>,
    undefined: Vec<bool>,
    /// In shown units.
    mean: Vec<f64>,
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
    /// What a cell with points on both sides holds.
    pub(crate) both: String,
}

impl Level {
    /// Signed distance of a value from the level; zero or more is above.
    pub(crate) fn offset(&self, value: f64) -> f64 {
        if self.log { (value / self.value).ln() } else { value - self.value }
    }
}

impl Layer {
    /// Whether a cell has points on both sides of the level.
    pub(crate) fn both(&self, cell: usize) -> bool {
        self.divided.as_ref().is_some_and(|divided| divided.both[cell])
    }

    /// Whether a cell of several points has some that did not fail and yet have no value.
    pub(crate) fn undefined(&self, cell: usize) -> bool {
        self.divided.as_ref().is_some_and(|divided| divided.undefined[cell])
    }

    /// The cells with points on both sides of the level, and those with points without a value, if
    /// cells hold more than one point.
    pub(crate) fn mixed(&self) -> Option<[&[bool]; 2]> {
        self.divided.as_ref().map(|divided| [&divided.both[..], &divided.undefined[..]])
    }

    /// The value by which the level's line finds its way: the mean of the cell's points.
    pub(crate) fn typical(&self, cell: usize) -> f64 {
        self.divided.as_ref().map_or(self.values[cell], |divided| divided.mean[cell])
    }
}

/// The names by which a channel's column can go: `ratio_<channel>` and the like, without `ratio_max`.
pub(crate) fn channels<'a>(source: &'a Source, prefix: &str) -> Vec<(&'a str, &'a ColumnFacts)> {
    let mut columns = source.with_prefix(prefix);
    columns.retain(|(name, _)| *name != "max");
    columns
}

/// What the options ask for; none if that is the status, which has no values.
///
/// # Errors
/// [`PlotError::NotThere`] for a channel that the file does not have, [`PlotError::Unfit`] for a quantity that needs
/// another choice of channel.
pub(crate) fn chosen(source: &Source, options: &PlotOptions) -> Result<Option<Shown>, PlotError> {
    let channel = match &options.channels[..] {
        [] => None,
        [one] => Some(one.as_str()),
        _ => {
            return Err(PlotError::Unfit(
                "a map shows one channel at a time: give `--channel` once".to_owned(),
            ));
        }
    };
    let quantity = options.quantity;
    match (quantity.prefix(), channel) {
        (Some(_), None) if quantity == Quantity::Ratio => Ok(Some(Shown::whole(quantity, "ratio_max"))),
        (Some(prefix), None) => Err(PlotError::Unfit(format!(
            "an amplitude is that of one channel: add `--channel NAME`, one of {}",
            listed(&channels(source, prefix))
        ))),
        (Some(prefix), Some(channel)) => {
            let known = channels(source, prefix);
            match known.iter().find(|(name, _)| *name == channel) {
                Some((name, column)) => Ok(Some(Shown::of_channel(quantity, name, column))),
                None => Err(PlotError::NotThere {
                    option: "--channel",
                    given: channel.to_owned(),
                    path: source.path.clone(),
                    what: "channel",
                    known: listed(&known),
                }),
            }
        }
        (None, Some(_)) => {
            Err(PlotError::Unfit("gap and status belong to no channel: leave out `--channel`".to_owned()))
        }
        (None, None) => Ok(quantity.column().map(|column| Shown::whole(quantity, column))),
    }
}

/// Everything that a map file has to show, in the order in which a page offers it.
pub(crate) fn all(source: &Source) -> Vec<Shown> {
    let mut shown = vec![Shown::whole(Quantity::Ratio, "ratio_max")];
    for quantity in [Quantity::Ratio, Quantity::Nonlinear, Quantity::Linear] {
        let prefix = quantity.prefix().unwrap_or_default();
        let channels = channels(source, prefix).into_iter();
        shown.extend(channels.map(|(name, column)| Shown::of_channel(quantity, name, column)));
    }
    for quantity in [Quantity::GapNonlinear, Quantity::GapLinear] {
        let column = quantity.column().and_then(|name| source.column(name));
        shown.extend(column.map(|column| Shown::whole(quantity, &column.name)));
    }
    shown
}

fn listed(columns: &[(&str, &ColumnFacts)]) -> String {
    columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

/// The level of a column that has one: the limit of ratios, and gaps that close.
pub(crate) fn divide(ratio_limit: f64, column: &str) -> Option<Divide> {
    if column.starts_with("ratio_") {
        Some(Divide { value: ratio_limit, log: true })
    } else {
        column.starts_with("min_gap_").then_some(Divide { value: 0.0, log: false })
    }
}

impl Quantity {
    /// What the column of a channel starts with, of a quantity that channels have.
    fn prefix(self) -> Option<&'static str> {
        match self {
            Self::Ratio => Some("ratio_"),
            Self::Nonlinear => Some("nonlinear_"),
            Self::Linear => Some("linear_"),
            Self::GapNonlinear | Self::GapLinear | Self::Status => None,
        }
    }

    /// The column of a quantity that channels do not have.
    fn column(self) -> Option<&'static str> {
        match self {
            Self::GapNonlinear => Some("min_gap_nonlinear_m"),
            Self::GapLinear => Some("min_gap_linear_m"),
            Self::Ratio | Self::Nonlinear | Self::Linear | Self::Status => None,
        }
    }
}

impl Shown {
    fn whole(quantity: Quantity, column: &str) -> Self {
        Self { quantity, channel: None, column: column.to_owned() }
    }

    fn of_channel(quantity: Quantity, channel: &str, column: &ColumnFacts) -> Self {
        Self { quantity, channel: Some(channel.to_owned()), column: column.name.clone() }
    }

    /// The values of a map that was read with this column.
    ///
    /// # Errors
    /// [`PlotError::Column`] if it was not, because the file does not have it.
    pub(crate) fn layer(&self, map: &Map) -> Result<Layer, PlotError> {
        let numbers = map.table.numbers(&self.column)?;
        let facts = map.table.source.column(&self.column);
        let (unit, factor) = label::shown(facts.map_or("", |facts| &facts.unit));
        let extent = map.extents.get(&self.column).copied();
        let extent = extent.into_iter().flat_map(|extent| extent.values().map(|value| value * factor));
        let limit = map.table.source.ratio_limit();
        let ratio = self.quantity == Quantity::Ratio;
        // No excitation can leave an infinite ratio, which has no place on any scale.
        let value = |value: f64| if ratio && !(value > 0.0 && value.is_finite()) { f64::NAN } else { value };
        let (title, label) = self.words(map.table.source.compared(), unit);
        Ok(Layer {
            nonlinear: !matches!(self.quantity, Quantity::Linear | Quantity::GapLinear),
            title,
            label,
            scale: match self.quantity {
                Quantity::Ratio => ColourScale::ratio(extent, limit),
                Quantity::GapNonlinear | Quantity::GapLinear => ColourScale::gap(extent),
                Quantity::Nonlinear | Quantity::Linear | Quantity::Status => ColourScale::amplitude(extent),
            },
            values: numbers.iter().map(|number| value(number * factor)).collect(),
            level: self.level(limit),
            divided: map.sides.get(&self.column).map(|sides| Divided {
                both: sides.both.clone(),
                undefined: sides.undefined.clone(),
                mean: sides.mean.iter().map(|mean| mean * factor).collect(),
            }),
        })
    }

    fn words(&self, compared: &str, unit: &str) -> (String, String) {
        let channel = self.channel.as_deref().map(label::channel);
        match (self.quantity, channel) {
            (Quantity::Ratio, None) => (
                "Where the linear model can be trusted".to_owned(),
                format!("largest ratio of {compared}, nonlinear / linear"),
            ),
            (Quantity::Ratio, Some(channel)) => (
                format!("Ratio of {compared}: {channel}"),
                format!("ratio of {compared}, nonlinear / linear"),
            ),
            (quantity @ (Quantity::GapNonlinear | Quantity::GapLinear), _) => {
                let model = if quantity == Quantity::GapLinear { "linear" } else { "nonlinear" };
                let title = format!("Least gap between drum and tub, {model} model");
                (title, label::with_unit("least gap over the run", unit))
            }
            (quantity, channel) => {
                let model = if quantity == Quantity::Linear { "linear" } else { "nonlinear" };
                let title = format!("Amplitude, {model} model: {}", channel.unwrap_or_default());
                (title, label::with_unit(&format!("amplitude, {model} model"), unit))
            }
        }
    }

    fn level(&self, limit: f64) -> Option<Level> {
        let said = label::significant(limit, 4);
        let words = |[inside, legend]: [&str; 2]| [inside.to_owned(), legend.to_owned()];
        match (self.quantity, &self.channel) {
            (Quantity::Ratio, channel) => {
                let [at_least, below] = [format!("ratio {said} or more"), format!("ratio below {said}")];
                let line = format!("boundary: ratio {said}");
                let level = Level {
                    value: limit,
                    log: true,
                    line,
                    above: [format!("ratio above {said}"), at_least.clone()],
                    below: [below.clone(), below],
                    both: "both: points on either side".to_owned(),
                };
                Some(match channel {
                    Some(_) => level,
                    None => Level {
                        above: words(["linear model unreliable", &format!("unreliable: {at_least}")]),
                        below: words(["linear model reliable", &format!("reliable: below {said}")]),
                        both: "both: reliable and unreliable points".to_owned(),
                        ..level
                    },
                })
            }
            (Quantity::GapNonlinear | Quantity::GapLinear, _) => Some(Level {
                value: 0.0,
                log: false,
                line: "gap closed".to_owned(),
                above: words(["drum and tub apart", "apart"]),
                below: words(["drum touches tub", "contact: gap below 0"]),
                both: "both: points with and without contact".to_owned(),
            }),
            (Quantity::Nonlinear | Quantity::Linear | Quantity::Status, _) => None,
        }
    }
}
