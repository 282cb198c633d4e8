//! What a map can show: one column, with its words and colours.

use sweep_parameter::{Worse, named};

use super::Options;
use super::colour::ColourScale;
use super::error::{PlotError, Result};
use super::gather::{Map, Sides};
use super::label::{self, capitalised};
use super::read::{ColumnFacts, Kind, Source};

/// A column of numbers that a map shows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    facts: ColumnFacts,
    /// What it is of.
    pub(crate) group: Group,
    /// Its channel, if it has one.
    pub(crate) channel: Option<String>,
}

named! {
    /// What columns are of, in the order in which a page offers them: by the name that a page has
    /// for it, which is what the names of a channel's columns start with.
    pub(crate) enum Group {
        /// A ratio of both models.
        Ratio = "ratio",
        /// An amplitude of the nonlinear model.
        Nonlinear = "nonlinear",
        /// An amplitude of the linear model.
        Linear = "linear",
        /// Anything else.
        Other = "other",
    }
}

impl Group {
    /// In words, for a list to choose from.
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Ratio => "ratio, nonlinear / linear",
            Self::Nonlinear => "amplitude, nonlinear model",
            Self::Linear => "amplitude, linear model",
            Self::Other => "further quantities",
        }
    }
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
    /// Where points lie about the level, in cells of several points.
    pub(crate) divided: Option<Sides>,
}

/// A level that divides the map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    /// In shown units.
    pub(crate) value: f64,
    /// Distances from the level are taken by the logarithm.
    pub(crate) log: bool,
    /// The side that is bad.
    pub(crate) worse: Worse,
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

    /// The value that the level's line follows: the mean of the cell's points.
    pub(crate) fn typical(&self, cell: usize) -> f64 {
        self.divided.as_ref().map_or(self.values[cell], |divided| divided.mean[cell])
    }
}

/// A quantity with its column of each model, or the one of none.
pub(crate) struct Family<'a> {
    /// A channel, or else what the columns are called without unit and model: `min_gap`.
    pub(crate) name: String,
    /// In words.
    pub(crate) words: String,
    /// Whether it is an amplitude of a channel.
    pub(crate) is_channel: bool,
    /// The columns by model; the empty one where no model is named.
    pub(crate) columns: Vec<(&'static str, &'a ColumnFacts)>,
}

/// Everything but ratios that a file has to show: channels, then the rest in file order.
pub(crate) fn families(source: &Source) -> Vec<Family<'_>> {
    let mut found: Vec<Family<'_>> = Vec::new();
    for shown in all(source).into_iter().filter(|shown| shown.group != Group::Ratio) {
        let Some(facts) = source.column(shown.column()) else { continue };
        let (words, model) = match &shown.channel {
            Some(channel) => (label::channel(channel), shown.group.name()),
            None => label::of_model(&facts.name),
        };
        match found.iter_mut().find(|family| family.words == words) {
            Some(family) => family.columns.push((model, facts)),
            None => {
                let is_channel = shown.channel.is_some();
                let name = shown.channel.unwrap_or_else(|| words.replace(' ', "_"));
                found.push(Family { name, words, is_channel, columns: vec![(model, facts)] });
            }
        }
    }
    found
}

/// The one column that the options ask for; none if that is the status, which has no values.
///
/// # Errors
/// As [`asked`]; [`PlotError::Unfit`] for several.
pub(crate) fn chosen(source: &Source, options: &Options) -> Result<Option<Shown>> {
    let mut asked = asked(source, options)?;
    match asked.len() {
        0 | 1 => Ok(asked.pop().flatten()),
        _ => Err(PlotError::Unfit(
            "a map over two axes shows one column at a time: give `--quantity` once".to_owned(),
        )),
    }
}

/// The columns that the options ask for, else the first that the file has to show; none for the
/// status.
///
/// # Errors
/// [`PlotError::Unfit`] for a column that the file does not have.
pub(crate) fn asked(source: &Source, options: &Options) -> Result<Vec<Option<Shown>>> {
    let mut all = all(source);
    if options.quantity.is_empty() {
        all.truncate(1);
        return Ok(all.into_iter().map(Some).collect());
    }
    let known = || all.iter().map(Shown::column).chain([STATUS]).collect::<Vec<_>>().join(", ");
    let of_name = |name: &String| match all.iter().find(|shown| shown.column() == name) {
        None if name == STATUS => Ok(None),
        None => Err(source.not_there("--quantity", name, "column of numbers to show", known())),
        shown => Ok(shown.cloned()),
    };
    options.quantity.iter().map(of_name).collect()
}

/// The column that says how each point ended.
pub(crate) const STATUS: &str = "status";

/// Everything that a map file has to show, in the order in which a page offers it: every column of
/// numbers but the axes and counts.
pub(crate) fn all(source: &Source) -> Vec<Shown> {
    let axes = super::swept::columns(source);
    let numbers = source.numeric().filter(|column| {
        let is_count = ["point", "steps_", "rejected_", "starts"];
        !axes.contains(column) && !is_count.iter().any(|start| column.name.starts_with(start))
    });
    let mut all: Vec<Shown> = numbers.map(Shown::new).collect();
    all.sort_by_key(|shown| {
        let is = |column| shown.column() == column;
        (!is("ratio_change"), shown.group as usize, !is("ratio_max"), shown.channel.is_some())
    });
    all
}

impl Shown {
    fn new(facts: &ColumnFacts) -> Self {
        let name = facts.name.as_str();
        let of =
            |group: &Group| Some((*group, name.strip_prefix(group.name())?.strip_prefix('_')?));
        let found = Group::ALL.iter().find_map(of).filter(|(_, rest)| *rest != "change");
        let (group, channel) = found.map_or((Group::Other, None), |(group, rest)| {
            // Differences of two files have max_a and max_b.
            let of_all = ["max", "min", "max_a", "max_b"];
            (group, (!of_all.contains(&rest)).then(|| rest.to_owned()))
        });
        Self { facts: facts.clone(), group, channel }
    }

    /// Name of its column.
    pub(crate) fn column(&self) -> &str {
        &self.facts.name
    }

    /// Which way it is bad, if it is.
    pub(crate) const fn worse(&self) -> Option<Worse> {
        self.facts.worse
    }

    /// Whether it alone is what the verdict goes by.
    pub(crate) fn is_verdict(&self, source: &Source) -> bool {
        self.column() == "ratio_max" && source.column("ratio_min").is_none()
    }

    /// The values of a map that was read with this column.
    ///
    /// # Errors
    /// [`PlotError::Undrawable`] if it was not, because the file does not have it.
    pub(crate) fn layer(&self, map: &Map) -> Result<Layer> {
        let numbers = map.table.numbers(self.column())?;
        let (unit, factor) = label::shown(&self.facts.unit);
        let (extent, sides) = &map.seen[self.column()];
        let extent = extent.values().map(|value| value * factor);
        let source = &map.table.source;
        let ratio = self.group == Group::Ratio;
        // No excitation can leave an infinite ratio, which has no place on any scale.
        let value = |value: f64| {
            if ratio && !(value > 0.0 && value.is_finite()) { f64::NAN } else { value }
        };
        let is_less_worse = self.worse() == Some(Worse::Less);
        let scale = match (source.kind, source.limit(&self.facts)) {
            (Kind::DIFFERENCES, _) if self.column() == "ratio_change" => {
                ColourScale::factor(extent)
            }
            (Kind::DIFFERENCES, _) if !ratio => ColourScale::difference(extent, is_less_worse),
            (_, Some(limit)) if ratio => ColourScale::ratio(extent, limit, is_less_worse),
            (_, Some(limit)) => ColourScale::about(extent, limit * factor, is_less_worse),
            (_, None) => ColourScale::amplitude(extent),
        };
        let (title, words) = self.words(source);
        let level = self.level(source);
        Ok(Layer {
            nonlinear: self.group == Group::Ratio || label::of_model(self.column()).1 != "linear",
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

    /// For a list to choose from, beside its group.
    pub(crate) fn short(&self) -> String {
        match (self.group, &self.channel, label::of_model(self.column())) {
            (_, Some(channel), _) => capitalised(&label::channel(channel)),
            (Group::Ratio, None, _) => {
                format!("{} ratio", capitalised(self.worse().unwrap_or(Worse::Greater).extreme()))
            }
            (_, None, (words, "")) => capitalised(&words),
            (_, None, (words, model)) => format!("{}, {model} model", capitalised(&words)),
        }
    }

    /// For the heading, and beside the colours without their unit.
    pub(crate) fn words(&self, source: &Source) -> (String, String) {
        let compared = source.compared();
        // Which of two files is over which.
        let told = self.facts.description.split(';').next().unwrap_or_default();
        match (self.group, self.channel.as_deref().map(label::channel)) {
            (Group::Ratio, None) if source.kind == Kind::DIFFERENCES => {
                (capitalised(told), format!("largest ratio of {compared}, nonlinear / linear"))
            }
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
                    Kind::DIFFERENCES => capitalised(told),
                    _ => self.short(),
                };
                (title, label::of_model(self.column()).0)
            }
        }
    }

    /// The level that divides its values, if one does.
    pub(crate) fn level(&self, source: &Source) -> Option<Level> {
        let (limit, worse) = (source.limit(&self.facts)?, self.worse().unwrap_or(Worse::Greater));
        let (unit, factor) = label::shown(&self.facts.unit);
        let (value, log) = (limit * factor, self.group == Group::Ratio);
        let said = label::valued("", value, unit);
        let what = if log { "ratio".to_owned() } else { label::of_model(self.column()).0 };
        let [above, below] = [format!("{what} above {said}"), format!("{what} below {said}")];
        let mut level = Level {
            value,
            log,
            worse,
            line: format!("boundary: {what} {said}"),
            above: [above, format!("{what} {said} or more")],
            below: [below.clone(), below],
            both: "both: points on either side".to_owned(),
        };
        if self.is_verdict(source) {
            level.above =
                ["linear model unreliable".to_owned(), format!("unreliable: ratio {said} or more")];
            level.below = ["linear model reliable".to_owned(), format!("reliable: below {said}")];
            level.both = "both: reliable and unreliable points".to_owned();
        }
        Some(level)
    }
}
