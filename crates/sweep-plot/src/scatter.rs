//! Points that are scattered rather than on a grid: what a design's figures need of its file.

use super::error::Result;
use super::influence::Influence;
use super::label::{self, Label};
use super::layer::{self, Group, Level};
use super::read::Source;
use super::{Options, swept};
use crate::{PlotError, Share};
use sweep_parameter::Worse;

/// Most numbers of points that are kept; of a longer file some points are picked.
const MOST_NUMBERS: usize = 600_000;

/// What a point is, by the quantity that is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The side that is asked for: reliable, or a gap that stays open.
    Good,
    /// The other one.
    Bad,
    /// Neither, and yet no failure: nothing was excited.
    Undefined,
    /// No result.
    Failed,
}

impl Side {
    /// All, in drawing order: rare ones over frequent ones.
    pub(crate) const ALL: [Self; 4] = [Self::Good, Self::Bad, Self::Undefined, Self::Failed];
}

/// A parameter that varies from point to point.
pub(crate) struct Spread {
    /// As in grid files.
    pub(crate) name: String,
    /// In words, with its unit.
    pub(crate) label: Label,
    /// Spread evenly by the logarithm.
    pub(crate) log: bool,
    /// One per kept point.
    pub(crate) values: Vec<f64>,
    /// The parameter's influence on the quantity; none if that is the same everywhere.
    pub(crate) influence: Option<Influence>,
}

/// The points of a design.
pub(crate) struct Scatter {
    /// The file.
    pub(crate) source: Source,
    /// What the quantity is, for headings.
    pub(crate) title: String,
    /// What its axis shows.
    pub(crate) label: Label,
    /// The same where there is little room.
    pub(crate) short: Label,
    /// The channel of the quantity, in words; empty without one.
    pub(crate) channel: String,
    /// The value that divides the points, if one does.
    pub(crate) level: Option<Level>,
    /// Better shown by the logarithm.
    pub(crate) log: bool,
    /// In file order.
    pub(crate) parameters: Vec<Spread>,
    /// Numbers of the kept points.
    pub(crate) points: Vec<usize>,
    /// The quantity at each, in shown units; NaN where there is none.
    pub(crate) quantity: Vec<f64>,
    /// What each is.
    pub(crate) sides: Vec<Side>,
    /// How many of all points, kept or not, are what, as in [`Side::ALL`].
    pub(crate) counts: [u64; 4],
}

/// What a point is by its value, or by the verdict where no level divides the points.
fn side_of(level: Option<&Level>, value: f64, verdict: Option<&str>, status: Option<&str>) -> Side {
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
    /// Reads a design's file: every point for the counts, and as many as a figure keeps.
    ///
    /// # Errors
    /// As [`Source::each_row`] and [`layer::chosen`]; [`PlotError::Undrawable`] without points or
    /// parameters that vary; [`PlotError::Unfit`] for a quantity that is no number.
    pub(crate) fn read(source: Source, options: &Options) -> Result<Self> {
        let Some(shown) = layer::chosen(&source, options)? else {
            return Err(PlotError::Unfit(
                "status is no number, and figures of designs mark failed points in any case"
                    .to_owned(),
            ));
        };
        let facts = source.column(shown.column());
        let (unit, factor) = label::shown(facts.map_or("", |facts| &facts.unit));
        let (title, words) = shown.words(&source);
        let level = shown.level(&source);
        let ratio = shown.group == Group::Ratio;
        let axes: Vec<&str> =
            swept::columns(&source).iter().map(|column| column.name.as_str()).collect();
        let stride = (source.rows * (axes.len() + 3)).div_ceil(MOST_NUMBERS).max(1) as u64;
        // The verdict itself, where that is what is shown.
        let dividing = level.as_ref().filter(|_| !shown.is_verdict(&source));
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); axes.len()];
        let (mut points, mut quantity, mut sides) = (Vec::new(), Vec::new(), Vec::new());
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
            return Err(source.empty("the design has no points"));
        }
        let spread = axes.iter().zip(values).filter_map(|(name, values)| {
            let facts = source.column(name)?;
            let varies = values.iter().any(|value| *value != values[0]);
            varies.then(|| Spread {
                name: (*name).to_owned(),
                label: Label::new(&label::words(name), &facts.unit),
                log: source.is_log(name) && values.iter().all(|value| *value > 0.0),
                influence: Influence::of(&values, &quantity),
                values,
            })
        });
        let parameters: Vec<Spread> = spread.collect();
        if parameters.is_empty() {
            return Err(source.empty("no parameter varies from point to point"));
        }
        let spans = || crate::chart::spans_decades(quantity.iter().copied());
        let log = ratio || (level.is_none() && spans());
        let label = Label::new(&label::capitalised(&words), unit);
        let short = Label::new(&shown.short(), unit);
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

    /// The share of points on the good side among those on either.
    pub(crate) fn share(&self) -> Option<Share> {
        let [good, bad, ..] = self.counts;
        Share::of(good, good + bad)
    }

    /// What it means to be on a side.
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

    /// Name of the run, its points and how they were placed, and what is not shown of them.
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

    /// How many points have a value of the quantity.
    pub(crate) fn valued(&self) -> usize {
        self.quantity.iter().filter(|value| value.is_finite()).count()
    }

    /// Places of the kept points, or of the one of `stride` of them.
    pub(crate) fn picked(&self, stride: usize) -> Vec<usize> {
        let of = |&k: &usize| picked(self.points[k] as u64 ^ SECOND, stride as u64);
        (0..self.points.len()).filter(of).collect()
    }

    /// Places of the parameters, the most influential first.
    pub(crate) fn by_influence(&self) -> Vec<usize> {
        let size = |k: usize| self.parameters[k].influence.map_or(0.0, Influence::size);
        let mut places: Vec<usize> = (0..self.parameters.len()).collect();
        places.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
        places
    }
}

/// Makes the second choice of points independent of the first.
const SECOND: u64 = 0x5bf0_3635_0000_0000;

/// Whether a row is among the one of `stride` that are kept. Every `stride`-th would pick from a
/// part of the box alone where the stride is a power of two and the points are Sobol's.
fn picked(row: u64, stride: u64) -> bool {
    // Steele, Lea and Flood's SplitMix64.
    let mixed = row.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (mixed ^ (mixed >> 31)).is_multiple_of(stride)
}
