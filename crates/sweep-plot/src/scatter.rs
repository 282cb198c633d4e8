//! The points of a design as its figures need them.

use super::error::Result;
use super::influence::RankInfluence;
use super::label::{self, Label};
use super::layer::{self, DividingLimit, Group};
use super::read::FigureFile;
use super::{PlotOptions, swept};
use crate::{PlotError, Share};
use sweep_parameter::Worse;

/// Maximum number of values that are kept; of a longer file some points are picked. Basis: 5 MB of
/// memory and a page of some megabytes. Doubling it doubles both.
const MAX_NUMBERS: usize = 600_000;

/// The side of the limit on which a point lies, or the reason why it lies on none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The good side: reliable, or a gap that stays open.
    Good,
    /// The bad side.
    Bad,
    /// A point without a value that did not fail, because nothing was excited.
    Undefined,
    /// A point that failed.
    Failed,
}

impl Side {
    /// The sides in drawing order: rare ones are drawn over frequent ones.
    pub(crate) const ALL: [Self; 4] = [Self::Good, Self::Bad, Self::Undefined, Self::Failed];
}

/// A parameter that varies from point to point.
pub(crate) struct DesignParameter {
    /// The name in grid files.
    pub(crate) name: String,
    pub(crate) label: Label,
    /// Whether the parameter is spread evenly by its logarithm.
    pub(crate) log: bool,
    /// The parameter's value at each point that is drawn.
    pub(crate) values: Vec<f64>,
    /// The influence on the quantity; `None` if the quantity is constant.
    pub(crate) influence: Option<RankInfluence>,
}

/// The points of a design with the quantity that is shown.
pub(crate) struct Scatter {
    pub(crate) source: FigureFile,
    /// The title of the figure.
    pub(crate) title: String,
    /// The label of the quantity's axis.
    pub(crate) label: Label,
    /// A shorter label, for axes with little room.
    pub(crate) short: Label,
    /// The channel of the quantity in words; empty without one.
    pub(crate) channel: String,
    /// The limit that divides the points, if there is one.
    pub(crate) level: Option<DividingLimit>,
    /// Whether the quantity is shown on a logarithmic axis.
    pub(crate) log: bool,
    /// The varying parameters in file order.
    pub(crate) parameters: Vec<DesignParameter>,
    /// The row numbers of the kept points.
    pub(crate) points: Vec<usize>,
    /// The quantity at each kept point in displayed units; NaN where there is none.
    pub(crate) quantity: Vec<f64>,
    /// The side of each kept point.
    pub(crate) sides: Vec<Side>,
    /// The number of all points, kept or not, on each of [`Side::ALL`].
    pub(crate) counts: [u64; 4],
}

/// Returns the side of a point by its value, or by its verdict if no limit divides the points.
fn side_of(
    level: Option<&DividingLimit>,
    value: f64,
    verdict: Option<&str>,
    status: Option<&str>,
) -> Side {
    let good = match level {
        Some(level) => {
            let is_good = match level.worse {
                Worse::Greater => value < level.value,
                Worse::Less => value >= level.value,
            };
            (value.is_finite() && (value > 0.0 || !level.log)).then_some(is_good)
        }
        None => verdict.map(|verdict| verdict == "true"),
    };
    match good {
        Some(true) => Side::Good,
        Some(false) => Side::Bad,
        None if status == Some("ok") => Side::Undefined,
        None => Side::Failed,
    }
}

impl Scatter {
    /// Reads the file of a design: every point for the counts, and as many as a figure keeps.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`] and [`layer::requested_one`];
    /// [`PlotError::Undrawable`] without points or parameters that vary; [`PlotError::Unfit`] for a
    /// quantity that is no number.
    pub(crate) fn read(source: FigureFile, options: &PlotOptions) -> Result<Self> {
        let Some(shown) = layer::requested_one(&source, options)? else {
            return Err(PlotError::Unfit(
                "status is no number, and figures of designs mark failed points in any case"
                    .to_owned(),
            ));
        };
        let facts = source.column(shown.column());
        let (unit, factor) = label::display_unit(facts.map_or("", |facts| &facts.unit));
        let (title, words) = shown.words(&source);
        let level = shown.level(&source);
        let ratio = shown.group == Group::Ratio;
        let axes: Vec<&str> =
            swept::columns(&source).iter().map(|column| column.name.as_str()).collect();
        let stride = (source.rows * (axes.len() + 3)).div_ceil(MAX_NUMBERS).max(1) as u64;
        // The verdict itself divides the points if it depends on the column alone.
        let dividing = level.as_ref().filter(|_| !shown.is_verdict(&source));
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); axes.len()];
        let mut points = Vec::new();
        let mut quantity = Vec::new();
        let mut sides = Vec::new();
        let mut counts = [0; 4];
        let names = [&axes[..], &[shown.column(), "reliable", layer::STATUS]].concat();
        source.each_row(&names, |row| {
            let own = axes.len();
            let value = row.number(own) * factor;
            let side = side_of(dividing, value, row.word(own + 1), row.word(own + 2));
            counts[side as usize] += 1;
            if picked(row.index() as u64, stride) {
                let none = ratio && !(value > 0.0 && value.is_finite());
                quantity.push(if none { f64::NAN } else { value });
                sides.push(side);
                points.push(row.index());
                for (column, values) in values.iter_mut().enumerate() {
                    values.push(row.number(column));
                }
            }
            Ok(())
        })?;
        if points.is_empty() {
            return Err(source.nothing_to_draw("the design has no points"));
        }
        let spread = axes.iter().zip(values).filter_map(|(name, values)| {
            let facts = source.column(name)?;
            let varies = values.iter().any(|value| *value != values[0]);
            varies.then(|| DesignParameter {
                name: (*name).to_owned(),
                label: Label::new(&label::words(name), &facts.unit),
                log: source.is_log(name) && values.iter().all(|value| *value > 0.0),
                influence: RankInfluence::new(&values, &quantity),
                values,
            })
        });
        let parameters: Vec<DesignParameter> = spread.collect();
        if parameters.is_empty() {
            return Err(source.nothing_to_draw("no parameter varies from point to point"));
        }
        let spans = || crate::chart::spans_decades(quantity.iter().copied());
        let log = ratio || (level.is_none() && spans());
        let label = Label::new(&label::capitalised(&words), unit);
        let short = Label::new(&shown.short_name(), unit);
        Ok(Self {
            source,
            title,
            label,
            short,
            channel: shown.channel.as_deref().map_or_else(String::new, label::channel),
            level,
            log,
            parameters,
            points,
            quantity,
            sides,
            counts,
        })
    }

    /// Returns the share of points on the good side among points on either side.
    pub(crate) fn share(&self) -> Option<Share> {
        let [good, bad, ..] = self.counts;
        Share::wilson(good, good + bad)
    }

    /// Returns the legend entry of a side.
    pub(crate) fn words(&self, side: Side) -> String {
        match (side, &self.level) {
            (Side::Good | Side::Bad, Some(level)) => {
                let is_above = (side == Side::Bad) == (level.worse == Worse::Greater);
                if is_above { level.above[1].clone() } else { level.below[1].clone() }
            }
            (Side::Good, None) => "reliable".to_owned(),
            (Side::Bad, None) => "unreliable".to_owned(),
            (Side::Undefined, _) => "undefined: no excitation".to_owned(),
            (Side::Failed, _) => "failed: no result".to_owned(),
        }
    }

    /// Returns the subtitle: name of the run, number and placement of the points, and notes.
    pub(crate) fn subtitle(&self, rest: &[String]) -> String {
        let all: u64 = self.counts.iter().sum();
        let mut parts = self.source.notes([match self.source.design_method() {
            Some("latin_hypercube") => format!("Latin hypercube of {all} points"),
            Some("sobol") => format!("Sobol sequence of {all} points"),
            Some("monte_carlo") => format!("{all} points at random"),
            _ => format!("list of {all} points"),
        }]);
        if (self.points.len() as u64) < all {
            parts.push(format!("{} of them picked at random", self.points.len()));
        }
        parts.extend(rest.iter().cloned());
        parts.join(" · ")
    }

    /// Returns the number of points with a value of the quantity.
    pub(crate) fn count_with_value(&self) -> usize {
        self.quantity.iter().filter(|value| value.is_finite()).count()
    }

    /// Returns the indices of about one in `stride` of the kept points.
    pub(crate) fn picked(&self, stride: usize) -> Vec<usize> {
        let is_picked = |&k: &usize| picked(self.points[k] as u64 ^ SECOND_CHOICE, stride as u64);
        (0..self.points.len()).filter(is_picked).collect()
    }

    /// Returns the indices of the parameters, the most influential first.
    pub(crate) fn by_influence(&self) -> Vec<usize> {
        let size = |k: usize| self.parameters[k].influence.map_or(0.0, RankInfluence::size);
        let mut places: Vec<usize> = (0..self.parameters.len()).collect();
        places.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
        places
    }
}

/// Bits that make the choice of drawn points independent of the choice of kept ones.
const SECOND_CHOICE: u64 = 0x5bf0_3635_0000_0000;

/// Whether a row is picked when one row in `stride` is. Picking every `stride`-th row would leave
/// out parts of the box if the stride is a power of two and the points are a Sobol sequence.
fn picked(row: u64, stride: u64) -> bool {
    // The hash is SplitMix64 of Steele, Lea and Flood.
    let mixed = row.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (mixed ^ (mixed >> 31)).is_multiple_of(stride)
}
