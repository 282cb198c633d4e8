//! Layers of a map: one column with its words and colours.

use sweep_parameter::{Worse, named};

use super::PlotOptions;
use super::colour::ColourScale;
use super::error::{PlotError, Result};
use super::gather::{CellMap, Sides};
use super::label::{self, capitalised};
use super::read::{ColumnFacts, FigureFile, FigureKind};

/// A column of numbers that a map can show.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShownColumn {
    facts: ColumnFacts,
    /// The group of columns that it belongs to.
    pub(crate) group: Group,
    /// The channel, if the column is one of a channel.
    pub(crate) channel: Option<String>,
}

named! {
    /// The group of a column, in the order in which a page offers them. The names are those of a
    /// page, and the prefixes of a channel's columns.
    pub(crate) enum Group {
        /// A ratio of both models.
        Ratio = "ratio",
        Nonlinear = "nonlinear",
        Linear = "linear",
        Other = "other",
    }
}

impl Group {
    /// Returns the group in words, for a list to choose from.
    pub(crate) const fn words(self) -> &'static str {
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
    pub(crate) nonlinear: bool,
    /// The limit whose line is drawn, if there is one.
    pub(crate) level: Option<DividingLimit>,
    /// The sides of the limit on which the points lie, in cells of several points.
    pub(crate) divided: Option<Sides>,
}

/// A limit that divides the map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DividingLimit {
    /// The limit in displayed units.
    pub(crate) value: f64,
    /// Whether distances from the limit are taken of logarithms.
    pub(crate) log: bool,
    /// The bad side.
    pub(crate) worse: Worse,
    /// The name of the line.
    pub(crate) line: String,
    /// The meaning of the side above the limit, in the picture and in the legend.
    pub(crate) above: [String; 2],
    /// The meaning of the side below the limit, in the picture and in the legend.
    pub(crate) below: [String; 2],
    /// The legend entry of cells with points on both sides.
    pub(crate) both: String,
}

impl DividingLimit {
    /// Returns the signed distance of a value from the limit; zero or more is above it.
    pub(crate) fn offset(&self, value: f64) -> f64 {
        if self.log { (value / self.value).ln() } else { value - self.value }
    }
}

impl Layer {
    /// Returns whether a cell has points on both sides of the limit.
    pub(crate) fn both(&self, cell: usize) -> bool {
        self.divided.as_ref().is_some_and(|divided| divided.both[cell])
    }

    /// Returns whether a cell of several points has some that did not fail and yet have no value.
    pub(crate) fn undefined(&self, cell: usize) -> bool {
        self.divided.as_ref().is_some_and(|divided| divided.undefined[cell])
    }

    /// Returns the value that the line of the limit follows: the mean of the cell's points.
    pub(crate) fn typical(&self, cell: usize) -> f64 {
        self.divided.as_ref().map_or(self.values[cell], |divided| divided.mean[cell])
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
pub(crate) fn quantities(source: &FigureFile) -> Vec<QuantityColumns<'_>> {
    let mut found: Vec<QuantityColumns<'_>> = Vec::new();
    for shown in all(source).into_iter().filter(|shown| shown.group != Group::Ratio) {
        let Some(facts) = source.column(shown.column()) else { continue };
        let (words, model) = match &shown.channel {
            Some(channel) => (label::channel(channel), shown.group.name()),
            None => label::split_model(&facts.name),
        };
        match found.iter_mut().find(|quantity| quantity.words == words) {
            Some(quantity) => quantity.columns.push((model, facts)),
            None => {
                let is_channel = shown.channel.is_some();
                let name = shown.channel.unwrap_or_else(|| words.replace(' ', "_"));
                found.push(QuantityColumns {
                    name,
                    words,
                    is_channel,
                    columns: vec![(model, facts)],
                });
            }
        }
    }
    found
}

/// Returns the one column that the options request; `None` for the status, which has no values.
///
/// # Errors
/// The errors of [`requested`]; [`PlotError::Unfit`] for several columns.
pub(crate) fn requested_one(
    source: &FigureFile,
    options: &PlotOptions,
) -> Result<Option<ShownColumn>> {
    let mut requested = requested(source, options)?;
    match requested.len() {
        0 | 1 => Ok(requested.pop().flatten()),
        _ => Err(PlotError::Unfit(
            "a map over two axes shows one column at a time: give `--quantity` once".to_owned(),
        )),
    }
}

/// Returns the columns that the options request, or else the first column of the file; `None`
/// stands for the status.
///
/// # Errors
/// [`PlotError::Unfit`] for a column that the file does not have.
pub(crate) fn requested(
    source: &FigureFile,
    options: &PlotOptions,
) -> Result<Vec<Option<ShownColumn>>> {
    let mut all = all(source);
    if options.quantity.is_empty() {
        all.truncate(1);
        return Ok(all.into_iter().map(Some).collect());
    }
    let known =
        || all.iter().map(ShownColumn::column).chain([STATUS]).collect::<Vec<_>>().join(", ");
    let find = |name: &String| match all.iter().find(|shown| shown.column() == name) {
        None if name == STATUS => Ok(None),
        None => Err(source.unknown_name("--quantity", name, "column of numbers to show", known())),
        shown => Ok(shown.cloned()),
    };
    options.quantity.iter().map(find).collect()
}

/// The column of each point's status.
pub(crate) const STATUS: &str = "status";

/// Returns all columns that a map file can show, in the order in which a page offers them: every
/// column of numbers but axes and counts.
pub(crate) fn all(source: &FigureFile) -> Vec<ShownColumn> {
    let axes = super::swept::columns(source);
    let numbers = source.numeric().filter(|column| {
        let is_count = ["point", "steps_", "rejected_", "starts"];
        !axes.contains(column) && !is_count.iter().any(|start| column.name.starts_with(start))
    });
    let mut all: Vec<ShownColumn> = numbers.map(ShownColumn::new).collect();
    all.sort_by_key(|shown| {
        let is = |column| shown.column() == column;
        (!is("ratio_change"), shown.group as usize, !is("ratio_max"), shown.channel.is_some())
    });
    all
}

impl ShownColumn {
    fn new(facts: &ColumnFacts) -> Self {
        let name = facts.name.as_str();
        let split =
            |group: &Group| Some((*group, name.strip_prefix(group.name())?.strip_prefix('_')?));
        let found = Group::ALL.iter().find_map(split).filter(|(_, rest)| *rest != "change");
        let (group, channel) = found.map_or((Group::Other, None), |(group, rest)| {
            // Differences of two files have max_a and max_b.
            let not_channels = ["max", "min", "max_a", "max_b"];
            (group, (!not_channels.contains(&rest)).then(|| rest.to_owned()))
        });
        Self { facts: facts.clone(), group, channel }
    }

    /// Returns the name of the column.
    pub(crate) fn column(&self) -> &str {
        &self.facts.name
    }

    /// Returns the bad direction of the values, if there is one.
    pub(crate) const fn worse(&self) -> Option<Worse> {
        self.facts.worse
    }

    /// Returns whether the verdict depends on this column alone.
    pub(crate) fn is_verdict(&self, source: &FigureFile) -> bool {
        self.column() == "ratio_max" && source.column("ratio_min").is_none()
    }

    /// Returns the layer of a map that was read with this column.
    ///
    /// # Errors
    /// [`PlotError::Undrawable`] if the file does not have the column.
    pub(crate) fn layer(&self, map: &CellMap) -> Result<Layer> {
        let numbers = map.table.numbers(self.column())?;
        let (unit, factor) = label::display_unit(&self.facts.unit);
        let (extent, sides) = &map.seen[self.column()];
        let extent = extent.values().map(|value| value * factor);
        let source = &map.table.source;
        let ratio = self.group == Group::Ratio;
        // A linear model at rest gives an infinite ratio, which has no place on any scale.
        let value = |value: f64| {
            if ratio && !(value > 0.0 && value.is_finite()) { f64::NAN } else { value }
        };
        let is_less_worse = self.worse() == Some(Worse::Less);
        let scale = match (source.kind, source.limit(&self.facts)) {
            (FigureKind::DIFFERENCES, _) if self.column() == "ratio_change" => {
                ColourScale::factor(extent)
            }
            (FigureKind::DIFFERENCES, _) if !ratio => {
                ColourScale::difference(extent, is_less_worse)
            }
            (_, Some(limit)) if ratio => ColourScale::ratio(extent, limit, is_less_worse),
            (_, Some(limit)) => ColourScale::about(extent, limit * factor, is_less_worse),
            (_, None) => ColourScale::amplitude(extent),
        };
        let (title, words) = self.words(source);
        let level = self.level(source);
        Ok(Layer {
            nonlinear: self.group == Group::Ratio
                || label::split_model(self.column()).1 != "linear",
            title,
            label: label::with_unit(&words, unit),
            values: numbers.iter().map(|number| value(number * factor)).collect(),
            level: level.filter(|_| scale.centre.is_some()),
            scale,
            divided: sides.as_ref().map(|sides| Sides {
                mean: sides.mean.iter().map(|mean| mean * factor).collect(),
                ..sides.clone()
            }),
        })
    }

    /// Returns the column in words for a list to choose from, beside its group.
    pub(crate) fn short_name(&self) -> String {
        match (self.group, &self.channel, label::split_model(self.column())) {
            (_, Some(channel), _) => capitalised(&label::channel(channel)),
            (Group::Ratio, None, _) => {
                format!("{} ratio", capitalised(self.worse().unwrap_or(Worse::Greater).extreme()))
            }
            (_, None, (words, "")) => capitalised(&words),
            (_, None, (words, model)) => format!("{}, {model} model", capitalised(&words)),
        }
    }

    /// Returns the title of the figure, and the label of the colours without unit.
    pub(crate) fn words(&self, source: &FigureFile) -> (String, String) {
        let compared = source.compared();
        // The description of a column of differences says which file is divided by which.
        let description = self.facts.description.split(';').next().unwrap_or_default();
        match (self.group, self.channel.as_deref().map(label::channel)) {
            (Group::Ratio, None) if source.kind == FigureKind::DIFFERENCES => (
                capitalised(description),
                format!("largest ratio of {compared}, nonlinear / linear"),
            ),
            (Group::Ratio, None) => {
                let (title, which) = match self.worse() {
                    Some(Worse::Less) => ("Where the linear model over-estimates", "least"),
                    _ if self.is_verdict(source) => {
                        ("Where the linear model can be trusted", "largest")
                    }
                    _ => ("Where the linear model under-estimates", "largest"),
                };
                (title.to_owned(), format!("{which} ratio of {compared}, nonlinear / linear"))
            }
            (Group::Ratio, Some(channel)) => (
                format!("Ratio of {compared}: {channel}"),
                format!("ratio of {compared}, nonlinear / linear"),
            ),
            (group @ (Group::Nonlinear | Group::Linear), Some(channel)) => {
                (capitalised(&format!("{}: {channel}", group.words())), group.words().to_owned())
            }
            _ => {
                let title = match source.kind {
                    FigureKind::DIFFERENCES => capitalised(description),
                    _ => self.short_name(),
                };
                (title, label::split_model(self.column()).0)
            }
        }
    }

    /// Returns the limit that divides the values, if there is one.
    pub(crate) fn level(&self, source: &FigureFile) -> Option<DividingLimit> {
        let limit = source.limit(&self.facts)?;
        let worse = self.worse().unwrap_or(Worse::Greater);
        let (unit, factor) = label::display_unit(&self.facts.unit);
        let value = limit * factor;
        let log = self.group == Group::Ratio;
        let phrase = label::with_value("", value, unit);
        let what = if log { "ratio".to_owned() } else { label::split_model(self.column()).0 };
        let [above, below] = [format!("{what} above {phrase}"), format!("{what} below {phrase}")];
        let mut level = DividingLimit {
            value,
            log,
            worse,
            line: format!("boundary: {what} {phrase}"),
            above: [above, format!("{what} {phrase} or more")],
            below: [below.clone(), below],
            both: "both: points on either side".to_owned(),
        };
        if self.is_verdict(source) {
            level.above = [
                "linear model unreliable".to_owned(),
                format!("unreliable: ratio {phrase} or more"),
            ];
            level.below = ["linear model reliable".to_owned(), format!("reliable: below {phrase}")];
            level.both = "both: reliable and unreliable points".to_owned();
        }
        Some(level)
    }
}
