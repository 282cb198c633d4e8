//! Layers of a map: one column with its words and colours.

use sweep_parameter::{Worse, named};

use super::PlotOptions;
use super::colour::ColourScale;
use super::error::{PlotError, Result};
use super::gather::{CellMap, CellSides};
use super::label::{self, capitalise};
use super::read::{ColumnFacts, FigureFile, FigureKind};

/// A column of numbers that a map can show.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShownColumn {
    facts: ColumnFacts,
    /// The group of columns that it belongs to.
    pub(crate) column_group: ColumnGroup,
    /// The channel, if the column is one of a channel.
    pub(crate) channel: Option<String>,
}

named! {
    /// The group of a column, in the order in which a page offers them. The names are those of a
    /// page, and the prefixes of a channel's columns.
    pub(crate) enum ColumnGroup {
        /// A ratio of both models.
        Ratio = "ratio",
        Nonlinear = "nonlinear",
        Linear = "linear",
        Other = "other",
    }
}

impl ColumnGroup {
    /// Returns the group in words, for a list to choose from.
    pub(crate) const fn in_words(self) -> &'static str {
        match self {
            Self::Ratio => "ratio, nonlinear / linear",
            Self::Nonlinear => "amplitude, nonlinear model",
            Self::Linear => "amplitude, linear model",
            Self::Other => "further quantities",
        }
    }
}

/// The values of a column in each cell of a map, with their colours and limit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layer {
    /// The title of the figure.
    pub(crate) title: String,
    /// The label of the colours, with unit.
    pub(crate) label: String,
    /// The values in displayed units; NaN where there is none.
    pub(crate) values: Vec<f64>,
    pub(crate) scale: ColourScale,
    /// Whether the values depend on the nonlinear motion, which may be chaotic.
    pub(crate) is_nonlinear: bool,
    /// The limit whose line is drawn, if there is one.
    pub(crate) limit: Option<DividingLimit>,
    /// The sides of the limit on which the points lie, in cells of several points.
    pub(crate) sides: Option<CellSides>,
}

/// A limit that divides the map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DividingLimit {
    /// The limit in displayed units.
    pub(crate) value: f64,
    /// Whether distances from the limit are taken of logarithms.
    pub(crate) is_log: bool,
    /// The side of the limit on which values are bad.
    pub(crate) worse: Worse,
    /// The name of the line.
    pub(crate) line_name: String,
    /// The meaning of the side above the limit, in the picture and in the legend.
    pub(crate) above_meanings: [String; 2],
    /// The meaning of the side below the limit, in the picture and in the legend.
    pub(crate) below_meanings: [String; 2],
    /// The legend entry of cells with points on both sides.
    pub(crate) both_meaning: String,
}

impl DividingLimit {
    /// Returns the signed distance of a value from the limit; zero or more is above it.
    pub(crate) fn offset(&self, value: f64) -> f64 {
        if self.is_log { (value / self.value).ln() } else { value - self.value }
    }
}

impl Layer {
    /// Returns whether a cell has points on both sides of the limit.
    pub(crate) fn is_divided(&self, cell: usize) -> bool {
        self.sides.as_ref().is_some_and(|sides| sides.is_divided[cell])
    }

    /// Returns whether a cell of several points has some that did not fail and yet have no value.
    pub(crate) fn has_undefined(&self, cell: usize) -> bool {
        self.sides.as_ref().is_some_and(|sides| sides.has_undefined[cell])
    }

    /// Returns the value that the line of the limit follows: the mean of the cell's points.
    pub(crate) fn mean_value(&self, cell: usize) -> f64 {
        self.sides.as_ref().map_or(self.values[cell], |sides| sides.mean_values[cell])
    }
}

/// A quantity with its column of each model, or with its only column.
pub(crate) struct QuantityColumns<'a> {
    /// The channel, or else the name of the columns without unit and model: `min_gap`.
    pub(crate) name: String,
    pub(crate) words: String,
    /// Whether the quantity is the amplitude of a channel.
    pub(crate) is_channel: bool,
    /// The columns with their model, which is empty if none is named.
    pub(crate) columns: Vec<(&'static str, &'a ColumnFacts)>,
}

/// Returns all quantities of a file but ratios: channels, then the others in file order.
pub(crate) fn collect_quantities(source: &FigureFile) -> Vec<QuantityColumns<'_>> {
    let mut quantities: Vec<QuantityColumns<'_>> = Vec::new();
    for column in
        all_columns(source).into_iter().filter(|column| column.column_group != ColumnGroup::Ratio)
    {
        let Some(facts) = source.column(column.name()) else { continue };
        let (words, model) = match &column.channel {
            Some(channel) => (label::channel_in_words(channel), column.column_group.name()),
            None => label::split_model(&facts.name),
        };
        match quantities.iter_mut().find(|quantity| quantity.words == words) {
            Some(quantity) => quantity.columns.push((model, facts)),
            None => {
                let is_channel = column.channel.is_some();
                let name = column.channel.unwrap_or_else(|| words.replace(' ', "_"));
                quantities.push(QuantityColumns {
                    name,
                    words,
                    is_channel,
                    columns: vec![(model, facts)],
                });
            }
        }
    }
    quantities
}

/// Returns the single column that the options request; `None` for the status, which has no values.
///
/// # Errors
/// The errors of [`requested_columns`]; [`PlotError::Unfit`] for several columns.
pub(crate) fn requested_column(
    source: &FigureFile,
    options: &PlotOptions,
) -> Result<Option<ShownColumn>> {
    let mut columns = requested_columns(source, options)?;
    match columns.len() {
        0 | 1 => Ok(columns.pop().flatten()),
        _ => Err(PlotError::Unfit(
            "a map over two axes shows one column at a time: give `--quantity` once".to_owned(),
        )),
    }
}

/// Returns the columns that the options request; without a request, the first column of the file.
/// `None` stands for the status.
///
/// # Errors
/// [`PlotError::Unfit`] for a column that the file does not have.
pub(crate) fn requested_columns(
    source: &FigureFile,
    options: &PlotOptions,
) -> Result<Vec<Option<ShownColumn>>> {
    let mut columns = all_columns(source);
    if options.quantity.is_empty() {
        columns.truncate(1);
        return Ok(columns.into_iter().map(Some).collect());
    }
    let known_names = || {
        columns.iter().map(ShownColumn::name).chain([STATUS_COLUMN]).collect::<Vec<_>>().join(", ")
    };
    let find_by_name = |name: &String| match columns.iter().find(|column| column.name() == name) {
        None if name == STATUS_COLUMN => Ok(None),
        None => Err(source.unknown_name_error(
            "--quantity",
            name,
            "column of numbers to show",
            known_names(),
        )),
        column => Ok(column.cloned()),
    };
    options.quantity.iter().map(find_by_name).collect()
}

/// The column of each point's status.
pub(crate) const STATUS_COLUMN: &str = "status";

/// Returns all columns that a map file can show, in the order in which a page offers them: every
/// column of numbers but axes and counts.
pub(crate) fn all_columns(source: &FigureFile) -> Vec<ShownColumn> {
    let axes = super::swept::axis_columns(source);
    let number_columns = source.number_columns().filter(|column| {
        let is_count = ["point", "steps_", "rejected_", "starts"];
        !axes.contains(column) && !is_count.iter().any(|prefix| column.name.starts_with(prefix))
    });
    let mut shown_columns: Vec<ShownColumn> = number_columns.map(ShownColumn::new).collect();
    shown_columns.sort_by_key(|shown_column| {
        let is_named = |column| shown_column.name() == column;
        (
            !is_named("ratio_change"),
            shown_column.column_group as usize,
            !is_named("ratio_max"),
            shown_column.channel.is_some(),
        )
    });
    shown_columns
}

impl ShownColumn {
    fn new(facts: &ColumnFacts) -> Self {
        let name = facts.name.as_str();
        let split_off_group = |group: &ColumnGroup| {
            Some((*group, name.strip_prefix(group.name())?.strip_prefix('_')?))
        };
        let group_and_channel = ColumnGroup::ALL
            .iter()
            .find_map(split_off_group)
            .filter(|(_, name_after_group)| *name_after_group != "change");
        let (group, channel) =
            group_and_channel.map_or((ColumnGroup::Other, None), |(group, name_after_group)| {
                // Differences of two files have max_a and max_b.
                let not_channels = ["max", "min", "max_a", "max_b"];
                (
                    group,
                    (!not_channels.contains(&name_after_group))
                        .then(|| name_after_group.to_owned()),
                )
            });
        Self { facts: facts.clone(), column_group: group, channel }
    }

    /// Returns the name of the column.
    pub(crate) fn name(&self) -> &str {
        &self.facts.name
    }

    /// Returns the direction in which values are bad, if there is one.
    pub(crate) const fn worse(&self) -> Option<Worse> {
        self.facts.metadata.worse
    }

    /// Returns whether the verdict depends on this column alone.
    pub(crate) fn is_verdict(&self, source: &FigureFile) -> bool {
        self.name() == "ratio_max" && source.column("ratio_min").is_none()
    }

    /// Returns the layer of a map that was read with this column.
    ///
    /// # Errors
    /// [`PlotError::Undrawable`] if the file does not have the column.
    pub(crate) fn create_layer(&self, map: &CellMap) -> Result<Layer> {
        let values = map.table.numbers(self.name())?;
        let (unit, factor) = label::display_unit(self.facts.unit());
        let (column_extremes, sides) = &map.ranges_and_sides[self.name()];
        let column_extremes = column_extremes.values().map(|value| value * factor);
        let source = &map.table.source;
        let is_ratio = self.column_group == ColumnGroup::Ratio;
        // A linear model at rest gives an infinite ratio, which has no place on any scale.
        let or_nan_if_infinite = |value: f64| {
            if is_ratio && !(value > 0.0 && value.is_finite()) { f64::NAN } else { value }
        };
        let is_less_worse = self.worse() == Some(Worse::Less);
        let scale = match (source.kind, source.column_limit(&self.facts)) {
            (FigureKind::DIFFERENCES, _) if self.name() == "ratio_change" => {
                ColourScale::for_factors(column_extremes)
            }
            (FigureKind::DIFFERENCES, _) if !is_ratio => {
                ColourScale::for_differences(column_extremes, is_less_worse)
            }
            (_, Some(limit)) if is_ratio => {
                ColourScale::for_ratios(column_extremes, limit, is_less_worse)
            }
            (_, Some(limit)) => {
                ColourScale::with_limit(column_extremes, limit * factor, is_less_worse)
            }
            (_, None) => ColourScale::without_limit(column_extremes),
        };
        let (title, label) = self.title_and_label(source);
        let limit = self.dividing_limit(source);
        Ok(Layer {
            is_nonlinear: self.column_group == ColumnGroup::Ratio
                || label::split_model(self.name()).1 != "linear",
            title,
            label: label::with_unit(&label, unit),
            values: values.iter().map(|number| or_nan_if_infinite(number * factor)).collect(),
            limit: limit.filter(|_| scale.centre.is_some()),
            scale,
            sides: sides.as_ref().map(|sides| CellSides {
                mean_values: sides.mean_values.iter().map(|mean| mean * factor).collect(),
                ..sides.clone()
            }),
        })
    }

    /// Returns the column in words for a list to choose from, beside its group.
    pub(crate) fn short_name(&self) -> String {
        match (self.column_group, &self.channel, label::split_model(self.name())) {
            (_, Some(channel), _) => capitalise(&label::channel_in_words(channel)),
            (ColumnGroup::Ratio, None, _) => {
                format!(
                    "{} ratio",
                    capitalise(self.worse().unwrap_or(Worse::Greater).worst_value_word())
                )
            }
            (_, None, (words, "")) => capitalise(&words),
            (_, None, (words, model)) => format!("{}, {model} model", capitalise(&words)),
        }
    }

    /// Returns the title of the figure, and the label of the colours without unit.
    pub(crate) fn title_and_label(&self, source: &FigureFile) -> (String, String) {
        let compared_quantity = source.compared_quantity();
        // The description of a column of differences says which file is divided by which.
        let description = self.facts.metadata.description.split(';').next().unwrap_or_default();
        match (self.column_group, self.channel.as_deref().map(label::channel_in_words)) {
            (ColumnGroup::Ratio, None) if source.kind == FigureKind::DIFFERENCES => (
                capitalise(description),
                format!("largest ratio of {compared_quantity}, nonlinear / linear"),
            ),
            (ColumnGroup::Ratio, None) => {
                let (title, row_choice) = match self.worse() {
                    Some(Worse::Less) => ("Where the linear model over-estimates", "least"),
                    _ if self.is_verdict(source) => {
                        ("Where the linear model can be trusted", "largest")
                    }
                    _ => ("Where the linear model under-estimates", "largest"),
                };
                (
                    title.to_owned(),
                    format!("{row_choice} ratio of {compared_quantity}, nonlinear / linear"),
                )
            }
            (ColumnGroup::Ratio, Some(channel)) => (
                format!("Ratio of {compared_quantity}: {channel}"),
                format!("ratio of {compared_quantity}, nonlinear / linear"),
            ),
            (group @ (ColumnGroup::Nonlinear | ColumnGroup::Linear), Some(channel)) => (
                capitalise(&format!("{}: {channel}", group.in_words())),
                group.in_words().to_owned(),
            ),
            _ => {
                let title = match source.kind {
                    FigureKind::DIFFERENCES => capitalise(description),
                    _ => self.short_name(),
                };
                (title, label::split_model(self.name()).0)
            }
        }
    }

    /// Returns the limit that divides the values, if there is one.
    pub(crate) fn dividing_limit(&self, source: &FigureFile) -> Option<DividingLimit> {
        let limit = source.column_limit(&self.facts)?;
        let worse = self.worse().unwrap_or(Worse::Greater);
        let (unit, factor) = label::display_unit(self.facts.unit());
        let value = limit * factor;
        let is_log = self.column_group == ColumnGroup::Ratio;
        let phrase = label::with_value("", value, unit);
        let quantity = if is_log { "ratio".to_owned() } else { label::split_model(self.name()).0 };
        let [above_meaning, below_meaning] =
            [format!("{quantity} above {phrase}"), format!("{quantity} below {phrase}")];
        let mut limit = DividingLimit {
            value,
            is_log,
            worse,
            line_name: format!("boundary: {quantity} {phrase}"),
            above_meanings: [above_meaning, format!("{quantity} {phrase} or more")],
            below_meanings: [below_meaning.clone(), below_meaning],
            both_meaning: "both: points on either side".to_owned(),
        };
        if self.is_verdict(source) {
            limit.above_meanings = [
                "linear model unreliable".to_owned(),
                format!("unreliable: ratio {phrase} or more"),
            ];
            limit.below_meanings =
                ["linear model reliable".to_owned(), format!("reliable: below {phrase}")];
            limit.both_meaning = "both: reliable and unreliable points".to_owned();
        }
        Some(limit)
    }
}
