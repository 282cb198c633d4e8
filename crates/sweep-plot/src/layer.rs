//! What a map can show: one value per cell, with its words and colours.

use super::colour::ColourScale;
use super::error::PlotError;
use super::gather::{Divide, Map};
use super::label::{self, capitalised};
use super::read::{ColumnFacts, Source};
use super::{PlotOptions, Quantity};

/// A quantity of a map and the column that holds it, before any row is read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shown {
    /// What it is.
    pub(crate) quantity: Quantity,
    /// Its channel, if it has one; for a load, the stop or the foot.
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
    /// The value that the line follows, in cells of several points.
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

    /// The value that the level's line follows: the mean of the cell's points.
    pub(crate) fn typical(&self, cell: usize) -> f64 {
        self.divided.as_ref().map_or(self.values[cell], |divided| divided.mean[cell])
    }
}

/// A quantity of a point that no channel has: of both models, or of the machine at rest.
pub(crate) struct Whole {
    /// Short name, of a chart's panel and of a page's row.
    pub(crate) name: &'static str,
    /// What it is, for headings and axes.
    pub(crate) words: &'static str,
    /// The same beside the colours.
    label: &'static str,
    /// The quantities by model (empty at rest) and column.
    pub(crate) columns: &'static [(Quantity, &'static str, &'static str)],
}

/// Every [`Whole`], in the order in which a page offers them.
pub(crate) const WHOLE: [Whole; 10] = [
    Whole {
        name: "gap",
        words: "least gap between drum and tub",
        label: "least gap over the run",
        columns: &[
            (Quantity::GapNonlinear, "nonlinear", "min_gap_nonlinear_m"),
            (Quantity::GapLinear, "linear", "min_gap_linear_m"),
        ],
    },
    Whole {
        name: "cabinet_force",
        words: "greatest force on the cabinet",
        label: "greatest force in the window",
        columns: &[
            (Quantity::CabinetForceNonlinear, "nonlinear", "cabinet_force_nonlinear_n"),
            (Quantity::CabinetForceLinear, "linear", "cabinet_force_linear_n"),
        ],
    },
    Whole {
        name: "clash_time",
        words: "time of clash between drum and tub",
        label: "time of clash in the window",
        columns: &[
            (Quantity::ClashTimeNonlinear, "nonlinear", "clash_time_nonlinear_s"),
            (Quantity::ClashTimeLinear, "linear", "clash_time_linear_s"),
        ],
    },
    Whole {
        name: "static_sag",
        words: "static sag of the tub",
        label: "static sag of the tub",
        columns: &[(Quantity::StaticSag, "", "static_sag_m")],
    },
    Whole {
        name: "stop_force",
        words: "greatest push of a stop",
        label: "greatest push in the window",
        columns: &[
            (Quantity::StopForceNonlinear, "nonlinear", "stop_force_nonlinear_n"),
            (Quantity::StopForceLinear, "linear", "stop_force_linear_n"),
        ],
    },
    Whole {
        name: "stop_contact",
        words: "time that a stop is closed",
        label: "time of contact in the window",
        columns: &[
            (Quantity::StopContactNonlinear, "nonlinear", "stop_contact_nonlinear_s"),
            (Quantity::StopContactLinear, "linear", "stop_contact_linear_s"),
        ],
    },
    Whole {
        name: "foot_load",
        words: "least load of a foot",
        label: "least load in the window",
        columns: &[
            (Quantity::FootLoadNonlinear, "nonlinear", "foot_load_nonlinear_n"),
            (Quantity::FootLoadLinear, "linear", "foot_load_linear_n"),
        ],
    },
    Whole {
        name: "slip_margin",
        words: "least margin against slipping",
        label: "least margin in the window",
        columns: &[
            (Quantity::SlipMarginNonlinear, "nonlinear", "slip_margin_nonlinear_n"),
            (Quantity::SlipMarginLinear, "linear", "slip_margin_linear_n"),
        ],
    },
    Whole {
        name: "ratio_change",
        words: "change of the greatest ratio, second over first",
        label: "factor of the greatest ratio",
        columns: &[(Quantity::RatioChange, "", "ratio_change")],
    },
    Whole {
        name: "gap_change",
        words: "change of the least gap, second less first",
        label: "change of the least gap",
        columns: &[(Quantity::GapChange, "", "gap_change_m")],
    },
];

/// The names by which a channel's column can go: `ratio_<channel>` and the like, without
/// `ratio_max`.
pub(crate) fn channels<'a>(source: &'a Source, prefix: &str) -> Vec<(&'a str, &'a ColumnFacts)> {
    let mut columns = source.with_prefix(prefix);
    columns.retain(|(name, _)| *name != "max");
    columns
}

/// What one stop or foot has of a [`Whole`].
pub(crate) struct OfPart<'a> {
    /// The part, as a channel: `stop_2`.
    pub(crate) part: &'a str,
    /// Short name, as [`Whole::name`]: `stop_2_force`.
    pub(crate) name: String,
    /// As [`Whole::words`].
    pub(crate) words: String,
    /// The columns by model.
    pub(crate) columns: [(&'static str, &'a str); 2],
}

impl Whole {
    /// The columns of single stops or feet in a file, if there are several.
    pub(crate) fn parts<'a>(&self, source: &'a Source) -> Vec<OfPart<'a>> {
        let [(_, first, of_first), (_, second, of_second)] = self.columns else {
            return Vec::new();
        };
        let what = self.name.split('_').next_back().unwrap_or_default();
        let pairs = parts(source, of_first).into_iter().zip(parts(source, of_second));
        pairs
            .map(|((part, of_first), (_, of_second))| OfPart {
                part,
                name: format!("{part}_{what}"),
                words: format!("{}: {}", self.words, label::channel(part)),
                columns: [(*first, &of_first.name), (*second, &of_second.name)],
            })
            .collect()
    }
}

/// The columns of single stops or feet beside the one of all, as channels: beside
/// `stop_force_linear_n` stands `stop_2_force_linear_n`, of `stop_2`.
pub(crate) fn parts<'a>(source: &'a Source, column: &str) -> Vec<(&'a str, &'a ColumnFacts)> {
    let of_part = |facts: &'a ColumnFacts| Some((part_of(&facts.name, column)?, facts));
    source.columns.iter().filter_map(of_part).collect()
}

/// The part that a column is of, if it stands beside this one of all.
fn part_of<'a>(name: &'a str, column: &str) -> Option<&'a str> {
    let (kind, what) = column.split_once('_')?;
    let part = name.strip_suffix(what)?.strip_suffix('_')?;
    let number = part.strip_prefix(kind)?.strip_prefix('_')?;
    number.parse::<u32>().is_ok().then_some(part)
}

/// A column in words, if it is of a [`Whole`] or of one of its parts.
pub(crate) fn words_of_whole(name: &str) -> Option<String> {
    WHOLE.iter().find_map(|whole| {
        let mut columns = whole.columns.iter().map(|(.., column)| *column);
        if columns.clone().any(|column| column == name) {
            return Some(capitalised(whole.words));
        }
        let part = columns.find_map(|column| part_of(name, column))?;
        Some(format!("{}: {}", capitalised(whole.words), label::channel(part)))
    })
}

/// What the options ask for; none if that is the status, which has no values.
///
/// # Errors
/// [`PlotError::NotThere`] for a channel that the file does not have, [`PlotError::Unfit`] for a
/// quantity that needs another choice of channel.
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
        (Some(_), None) if quantity == Quantity::Ratio => {
            Ok(Some(Shown::whole(quantity, "ratio_max")))
        }
        (Some(prefix), None) => Err(PlotError::Unfit(format!(
            "an amplitude is that of one channel: add `--channel NAME`, one of {}",
            listed(&channels(source, prefix))
        ))),
        (Some(prefix), Some(channel)) => {
            find(source, quantity, &channels(source, prefix), channel).map(Some)
        }
        (None, Some(channel)) => {
            quantity.there(source)?;
            let known = quantity.column().map_or_else(Vec::new, |column| parts(source, column));
            if known.is_empty() {
                return Err(PlotError::Unfit(format!(
                    "{} belongs to no channel: leave out `--channel`",
                    quantity.name().replace('-', " ")
                )));
            }
            find(source, quantity, &known, channel).map(Some)
        }
        (None, None) => {
            quantity.there(source)?;
            Ok(quantity.column().map(|column| Shown::whole(quantity, column)))
        }
    }
}

/// The channel that was asked for, among those that the quantity has.
fn find(
    source: &Source,
    quantity: Quantity,
    known: &[(&str, &ColumnFacts)],
    channel: &str,
) -> Result<Shown, PlotError> {
    match known.iter().find(|(name, _)| *name == channel) {
        Some((name, column)) => Ok(Shown::of_channel(quantity, name, column)),
        None => Err(PlotError::NotThere {
            option: "--channel",
            given: channel.to_owned(),
            path: source.path.clone(),
            what: "channel",
            known: listed(known),
        }),
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
    let whole = WHOLE.iter().flat_map(|whole| whole.columns);
    let there = whole.filter(|(_, _, column)| source.column(column).is_some());
    for (quantity, _, column) in there {
        shown.push(Shown::whole(*quantity, column));
        let parts = parts(source, column).into_iter();
        shown.extend(parts.map(|(name, column)| Shown::of_channel(*quantity, name, column)));
    }
    shown
}

/// Words with the model that they are of, if they are of one.
fn of_model(words: &str, model: &str) -> String {
    if model.is_empty() { words.to_owned() } else { format!("{words}, {model} model") }
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
            _ => None,
        }
    }

    /// A quantity without a channel: the quantity, its model (empty at rest), its column.
    pub(crate) fn whole(self) -> Option<(&'static Whole, &'static str, &'static str)> {
        WHOLE.iter().find_map(|whole| {
            let (_, model, column) = whole.columns.iter().find(|(known, ..)| *known == self)?;
            Some((whole, *model, *column))
        })
    }

    /// The column of a quantity that channels do not have.
    fn column(self) -> Option<&'static str> {
        self.whole().map(|(_, _, column)| column)
    }

    /// Refuses a quantity that a map file does not have.
    ///
    /// # Errors
    /// [`PlotError::NotThere`].
    pub(crate) fn there(self, source: &Source) -> Result<(), PlotError> {
        if self.column().is_none_or(|column| source.column(column).is_some()) {
            return Ok(());
        }
        let whole = WHOLE.iter().flat_map(|whole| whole.columns);
        let there = whole.filter(|(_, _, column)| source.column(column).is_some());
        let known = ["ratio", "nonlinear", "linear"].into_iter();
        let known = known.chain(there.map(|(quantity, ..)| quantity.name())).chain(["status"]);
        Err(PlotError::NotThere {
            option: "--quantity",
            given: self.name().to_owned(),
            path: source.path.clone(),
            what: "quantity",
            known: known.collect::<Vec<_>>().join(", "),
        })
    }

    /// As on the command line; a page knows it by the same name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Ratio => "ratio",
            Self::Nonlinear => "nonlinear",
            Self::Linear => "linear",
            Self::GapNonlinear => "gap-nonlinear",
            Self::GapLinear => "gap-linear",
            Self::CabinetForceNonlinear => "cabinet-force-nonlinear",
            Self::CabinetForceLinear => "cabinet-force-linear",
            Self::ClashTimeNonlinear => "clash-time-nonlinear",
            Self::ClashTimeLinear => "clash-time-linear",
            Self::StaticSag => "static-sag",
            Self::StopForceNonlinear => "stop-force-nonlinear",
            Self::StopForceLinear => "stop-force-linear",
            Self::StopContactNonlinear => "stop-contact-nonlinear",
            Self::StopContactLinear => "stop-contact-linear",
            Self::FootLoadNonlinear => "foot-load-nonlinear",
            Self::FootLoadLinear => "foot-load-linear",
            Self::SlipMarginNonlinear => "slip-margin-nonlinear",
            Self::SlipMarginLinear => "slip-margin-linear",
            Self::RatioChange => "ratio-change",
            Self::GapChange => "gap-change",
            Self::Status => "status",
        }
    }

    /// In words, for a list to choose from.
    pub(crate) fn words(self) -> String {
        match (self, self.whole()) {
            (Self::Ratio, _) => "ratio, nonlinear / linear".to_owned(),
            (Self::Nonlinear, _) => "amplitude, nonlinear model".to_owned(),
            (Self::Linear, _) => "amplitude, linear model".to_owned(),
            (_, Some((whole, model, _))) => of_model(whole.words, model),
            (_, None) => "status".to_owned(),
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
        let extent =
            extent.into_iter().flat_map(|extent| extent.values().map(|value| value * factor));
        let limit = map.table.source.ratio_limit();
        let ratio = self.quantity == Quantity::Ratio;
        // No excitation can leave an infinite ratio, which has no place on any scale.
        let value = |value: f64| {
            if ratio && !(value > 0.0 && value.is_finite()) { f64::NAN } else { value }
        };
        let scale = match self.quantity {
            Quantity::Ratio => ColourScale::ratio(extent, limit),
            Quantity::GapChange => ColourScale::difference(extent, true),
            Quantity::RatioChange => ColourScale::factor(extent),
            Quantity::GapNonlinear
            | Quantity::GapLinear
            | Quantity::FootLoadNonlinear
            | Quantity::FootLoadLinear
            | Quantity::SlipMarginNonlinear
            | Quantity::SlipMarginLinear => ColourScale::gap(extent),
            Quantity::ClashTimeNonlinear
            | Quantity::ClashTimeLinear
            | Quantity::StopForceNonlinear
            | Quantity::StopForceLinear
            | Quantity::StopContactNonlinear
            | Quantity::StopContactLinear
            | Quantity::StaticSag => ColourScale::even(extent),
            _ => ColourScale::amplitude(extent),
        };
        let (title, label) = self.words(map.table.source.compared(), unit);
        Ok(Layer {
            nonlinear: match self.quantity.whole() {
                Some((_, model, _)) => model == "nonlinear",
                None => self.quantity != Quantity::Linear,
            },
            title,
            label,
            values: numbers.iter().map(|number| value(number * factor)).collect(),
            level: self.level(limit).filter(|_| matches!(scale, ColourScale::Diverging { .. })),
            scale,
            divided: map.sides.get(&self.column).map(|sides| Divided {
                both: sides.both.clone(),
                undefined: sides.undefined.clone(),
                mean: sides.mean.iter().map(|mean| mean * factor).collect(),
            }),
        })
    }

    /// For the heading, and beside the colours.
    pub(crate) fn words(&self, compared: &str, unit: &str) -> (String, String) {
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
            (quantity, channel) => match quantity.whole() {
                Some((whole, model, _)) => {
                    let of_part = channel.map_or_else(String::new, |part| format!(": {part}"));
                    (
                        label::capitalised(&of_model(whole.words, model)) + &of_part,
                        label::with_unit(whole.label, unit),
                    )
                }
                None => {
                    let title = format!("{}: {}", quantity.words(), channel.unwrap_or_default());
                    (label::capitalised(&title), label::with_unit(&quantity.words(), unit))
                }
            },
        }
    }

    /// The level that divides its values, if one does.
    pub(crate) fn level(&self, limit: f64) -> Option<Level> {
        let said = label::significant(limit, 4);
        let words = |[inside, legend]: [&str; 2]| [inside.to_owned(), legend.to_owned()];
        match (self.quantity, &self.channel) {
            (Quantity::Ratio, channel) => {
                let [at_least, below] =
                    [format!("ratio {said} or more"), format!("ratio below {said}")];
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
                        above: words([
                            "linear model unreliable",
                            &format!("unreliable: {at_least}"),
                        ]),
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
            _ => None,
        }
    }
}
