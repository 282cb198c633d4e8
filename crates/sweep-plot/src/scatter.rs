//! The points of a design as its figures need them.

use super::error::Result;
use super::influence::RankInfluence;
use super::label::{self, Label};
use super::layer::{self, ColumnGroup, DividingLimit};
use super::read::FigureFile;
use super::{PlotOptions, swept};
use crate::{PlotError, ShareInterval};
use sweep_parameter::Worse;

/// Maximum number of values that are kept; of a longer file some points are picked. Basis: 5 MB of
/// memory and a page of some megabytes. Doubling it doubles both.
const MAX_KEPT_VALUES: usize = 600_000;

/// The side of the limit on which a point lies, or the reason why it lies on none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The good side of the limit, such as reliable or a gap that stays open.
    Good,
    /// The bad side of the limit.
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
    pub(crate) is_log: bool,
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
    pub(crate) short_label: Label,
    /// The channel of the quantity in words; empty without one.
    pub(crate) channel: String,
    /// The limit that divides the points, if there is one.
    pub(crate) limit: Option<DividingLimit>,
    /// Whether the quantity is shown on a logarithmic axis.
    pub(crate) is_log: bool,
    /// The varying parameters in file order.
    pub(crate) parameters: Vec<DesignParameter>,
    /// The row numbers of the kept points.
    pub(crate) point_rows: Vec<usize>,
    /// The quantity at each kept point in displayed units; NaN where there is none.
    pub(crate) quantity_values: Vec<f64>,
    /// The side of each kept point.
    pub(crate) sides: Vec<Side>,
    /// The number of points on each of [`Side::ALL`], including points that are not kept.
    pub(crate) side_counts: [u64; 4],
}

/// Returns the side of a point by its value, or by its verdict if no limit divides the points.
fn classify_side(
    limit: Option<&DividingLimit>,
    value: f64,
    verdict: Option<&str>,
    status: Option<&str>,
) -> Side {
    let is_on_good_side = match limit {
        Some(limit) => {
            let is_on_good_side = match limit.worse {
                Worse::Greater => value < limit.value,
                Worse::Less => value >= limit.value,
            };
            (value.is_finite() && (value > 0.0 || !limit.is_log)).then_some(is_on_good_side)
        }
        None => verdict.map(|verdict| verdict == "true"),
    };
    match is_on_good_side {
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
    /// Returns the errors of [`FigureFile::each_row`] and [`layer::requested_column`];
    /// [`PlotError::Undrawable`] without points or parameters that vary; [`PlotError::Unfit`] for a
    /// quantity that is no number.
    pub(crate) fn read(source: FigureFile, options: &PlotOptions) -> Result<Self> {
        let Some(column) = layer::requested_column(&source, options)? else {
            return Err(PlotError::Unfit(
                "status is no number, and figures of designs mark failed points in any case"
                    .to_owned(),
            ));
        };
        let facts = source.column(column.name());
        let (unit, factor) = label::display_unit(facts.map_or("", |facts| facts.unit()));
        let (title, quantity_label) = column.title_and_label(&source);
        let limit = column.dividing_limit(&source);
        let is_ratio = column.column_group == ColumnGroup::Ratio;
        let axes: Vec<&str> =
            swept::axis_columns(&source).iter().map(|column| column.name.as_str()).collect();
        let stride = (source.rows * (axes.len() + 3)).div_ceil(MAX_KEPT_VALUES).max(1) as u64;
        // The verdict itself divides the points if it depends on the column alone.
        let dividing_limit = limit.as_ref().filter(|_| !column.is_verdict(&source));
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); axes.len()];
        let mut point_rows = Vec::new();
        let mut quantity_values = Vec::new();
        let mut sides = Vec::new();
        let mut side_counts = [0; 4];
        let column_names = [&axes[..], &[column.name(), "reliable", layer::STATUS_COLUMN]].concat();
        source.each_row(&column_names, |row| {
            let axis_count = axes.len();
            let value = row.number(axis_count) * factor;
            let side = classify_side(
                dividing_limit,
                value,
                row.word(axis_count + 1),
                row.word(axis_count + 2),
            );
            side_counts[side as usize] += 1;
            if is_picked(row.index() as u64, stride) {
                let is_missing = is_ratio && !(value > 0.0 && value.is_finite());
                quantity_values.push(if is_missing { f64::NAN } else { value });
                sides.push(side);
                point_rows.push(row.index());
                for (column, values) in values.iter_mut().enumerate() {
                    values.push(row.number(column));
                }
            }
            Ok(())
        })?;
        if point_rows.is_empty() {
            return Err(source.nothing_to_draw_error("the design has no points"));
        }
        let varying_axes = axes.iter().zip(values).filter_map(|(name, values)| {
            let facts = source.column(name)?;
            let varies = values.iter().any(|value| *value != values[0]);
            varies.then(|| DesignParameter {
                name: (*name).to_owned(),
                label: Label::new(&label::name_in_words(name), facts.unit()),
                is_log: source.is_log_axis(name) && values.iter().all(|value| *value > 0.0),
                influence: RankInfluence::new(&values, &quantity_values),
                values,
            })
        });
        let parameters: Vec<DesignParameter> = varying_axes.collect();
        if parameters.is_empty() {
            return Err(source.nothing_to_draw_error("no parameter varies from point to point"));
        }
        let spans_decades = || crate::chart::spans_decades(quantity_values.iter().copied());
        let is_log = is_ratio || (limit.is_none() && spans_decades());
        let label = Label::new(&label::capitalise(&quantity_label), unit);
        let short_label = Label::new(&column.short_name(), unit);
        Ok(Self {
            source,
            title,
            label,
            short_label,
            channel: column.channel.as_deref().map_or_else(String::new, label::channel_in_words),
            limit,
            is_log,
            parameters,
            point_rows,
            quantity_values,
            sides,
            side_counts,
        })
    }

    /// Returns the share of points on the good side among points on either side.
    pub(crate) fn good_share(&self) -> Option<ShareInterval> {
        let [good, bad, ..] = self.side_counts;
        ShareInterval::wilson(good, good + bad)
    }

    /// Returns the legend entry of a side.
    pub(crate) fn side_meaning(&self, side: Side) -> String {
        match (side, &self.limit) {
            (Side::Good | Side::Bad, Some(limit)) => {
                let is_above = (side == Side::Bad) == (limit.worse == Worse::Greater);
                if is_above {
                    limit.above_meanings[1].clone()
                } else {
                    limit.below_meanings[1].clone()
                }
            }
            (Side::Good, None) => "reliable".to_owned(),
            (Side::Bad, None) => "unreliable".to_owned(),
            (Side::Undefined, _) => "undefined: no excitation".to_owned(),
            (Side::Failed, _) => "failed: no result".to_owned(),
        }
    }

    /// Returns the subtitle: name of the run, number and placement of the points, and notes.
    pub(crate) fn subtitle(&self, further_notes: &[String]) -> String {
        let point_count: u64 = self.side_counts.iter().sum();
        let mut phrases = self.source.notes([match self.source.design_method() {
            Some("latin_hypercube") => format!("Latin hypercube of {point_count} points"),
            Some("sobol") => format!("Sobol sequence of {point_count} points"),
            Some("monte_carlo") => format!("{point_count} points at random"),
            _ => format!("list of {point_count} points"),
        }]);
        if (self.point_rows.len() as u64) < point_count {
            phrases.push(format!("{} of them picked at random", self.point_rows.len()));
        }
        phrases.extend(further_notes.iter().cloned());
        phrases.join(" · ")
    }

    /// Returns the number of points with a value of the quantity.
    pub(crate) fn count_with_value(&self) -> usize {
        self.quantity_values.iter().filter(|value| value.is_finite()).count()
    }

    /// Returns the indices of about one in `stride` of the kept points.
    pub(crate) fn pick_points(&self, stride: usize) -> Vec<usize> {
        let is_picked =
            |&k: &usize| is_picked(self.point_rows[k] as u64 ^ DRAWN_POINTS_SALT, stride as u64);
        (0..self.point_rows.len()).filter(is_picked).collect()
    }

    /// Returns the indices of the parameters, the most influential first.
    pub(crate) fn indices_by_influence(&self) -> Vec<usize> {
        let parameter_influence =
            |k: usize| self.parameters[k].influence.map_or(0.0, RankInfluence::strength);
        let mut indices: Vec<usize> = (0..self.parameters.len()).collect();
        indices.sort_by(|&a, &b| parameter_influence(b).total_cmp(&parameter_influence(a)));
        indices
    }
}

/// Bits that make the choice of drawn points independent of the choice of kept ones.
const DRAWN_POINTS_SALT: u64 = 0x5bf0_3635_0000_0000;

/// Whether a row is picked when one row in `stride` is. Picking every `stride`-th row would leave
/// out parts of the box if the stride is a power of two and the points are a Sobol sequence.
fn is_picked(row: u64, stride: u64) -> bool {
    // The hash is SplitMix64 of Steele, Lea and Flood.
    let hash = row.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (hash ^ (hash >> 31)).is_multiple_of(stride)
}
