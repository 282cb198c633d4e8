//! The evaluator over a model: its distances at trial points; and the settings a plan gives a
//! search.

use super::{Evaluate, Search, TracedQuantity, Trial};
use crate::asking::{Asking, Stopped};
use crate::store::{Column, Done, Key, Rows};
use crate::{Axis, AxisValues, Model, Plan};
use sweep_parameter::Parameter as _;

/// Rows of all curves together that are accepted: what is known of them stays in memory.
const MOST_ROWS: u64 = 1_000_000;

/// The narrowest tolerance, as a part of the range: below it, rounding decides.
const FINEST: f64 = 1e-9;

/// Parts of the range in the default tolerance.
const DEFAULT_PARTS: f64 = 480.0;

/// Why a plan has no boundary to trace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// Fewer than two axes.
    #[error(
        "a boundary runs over two axes, and this grid has {0}: give [[axis]] twice, first the one \
         along which the curve is wanted, then the one that is searched; one that --at gives a \
         value is no axis, one with `values` of one number is"
    )]
    Axes(usize),
    /// The points come from a design.
    #[error(
        "a boundary runs over the axes of a grid, and this file has a [design]: remove it, and \
         give [[axis]] twice"
    )]
    Design,
    /// The second axis has no extent.
    #[error(
        "the second axis, `{0}`, has one value: give it the range to search, as range = {{ from, \
         to, count }} or as `values` whose least and greatest are its ends"
    )]
    NoRange(String),
    /// Too many rows.
    #[error(
        "{rows} rows (values of the first axis, times the combinations of the axes beyond the \
         second) are more than {MOST_ROWS}: trace parts of them"
    )]
    Rows {
        /// How many.
        rows: u64,
    },
    /// A tolerance that cannot be met or means nothing.
    #[error(
        "--tolerance {given} is out of range: expected from {least:e} to {greatest} for the \
         second axis"
    )]
    Tolerance {
        /// As given.
        given: f64,
        /// Least.
        least: f64,
        /// Greatest.
        greatest: f64,
    },
}

/// What is traced over which values.
#[derive(Clone, Debug)]
pub struct BoundaryTask {
    /// Values of the first axis, in grid order.
    pub firsts: Vec<f64>,
    /// Number of curves: combinations of the axes beyond the second.
    pub curves: usize,
    /// The search along the second axis.
    pub search: Search,
}

impl BoundaryTask {
    /// The task of a plan. `tolerance` is in the second axis's unit, or a fraction of its value if
    /// that axis is logarithmic; the default is 1/480 of the range.
    ///
    /// # Errors
    /// Any [`BoundaryError`].
    pub fn new<M: Model>(
        plan: &Plan<M>,
        tolerance: Option<f64>,
        lattice: usize,
    ) -> Result<Self, BoundaryError> {
        if plan.design.is_some() {
            return Err(BoundaryError::Design);
        }
        let [first, second, further @ ..] = plan.axes.as_slice() else {
            return Err(BoundaryError::Axes(plan.axes.len()));
        };
        let [least, greatest] = second.values.extremes().map(|k| second.values.value(k));
        if least >= greatest {
            return Err(BoundaryError::NoRange(second.parameter.name().to_owned()));
        }
        // Plans hold at most 1e12 points, so the products fit.
        let curves: u64 = further.iter().map(|axis| axis.values.len()).product();
        let rows = first.values.len() * curves;
        let curves = usize::try_from(curves).ok().filter(|_| rows <= MOST_ROWS);
        let curves = curves.ok_or(BoundaryError::Rows { rows })?;
        let second_log = matches!(second.values, AxisValues::Log { .. });
        let extent = if second_log { libm::log(greatest / least) } else { greatest - least };
        let given = tolerance.unwrap_or(extent / DEFAULT_PARTS);
        let allowed = [extent * FINEST, extent];
        if !(allowed[0]..=allowed[1]).contains(&given) {
            let [least, greatest] = allowed;
            return Err(BoundaryError::Tolerance { given, least, greatest });
        }
        let search = Search {
            least,
            greatest,
            first_log: matches!(first.values, AxisValues::Log { .. }),
            second_log,
            tolerance: given,
            lattice,
        };
        Ok(Self { firsts: all(first), curves, search })
    }
}

fn all<M: Model>(axis: &Axis<M>) -> Vec<f64> {
    (0..axis.values.len()).map(|k| axis.values.value(k)).collect()
}

/// A model at trial points.
pub struct Models<'a, M: Model> {
    plan: &'a Plan<M>,
    quantity: &'a TracedQuantity,
    /// The quantity's column of the plan's rows, and its place among them.
    column: Option<(usize, Column)>,
    asking: Asking<'a>,
}

impl<'a, M: Rows> Models<'a, M> {
    /// An evaluator over a plan by its engine.
    pub fn new(plan: &'a Plan<M>, quantity: &'a TracedQuantity, asking: Asking<'a>) -> Self {
        let mut columns = M::layout(plan).columns.into_iter().enumerate();
        let column = columns.find(|(_, column)| column.name == quantity.name);
        Self { plan, quantity, column, asking }
    }

    /// What it asks.
    pub fn into_asking(self) -> Asking<'a> {
        self.asking
    }

    fn distance(&self, done: &Done) -> Option<f64> {
        let (place, column) = self.column.as_ref()?;
        let value = column.number(done.rows.first()?[*place])?;
        Some(self.quantity.distance(value))
    }
}

impl<M: Rows> Evaluate for Models<'_, M> {
    type Stop = Stopped;

    fn evaluate(&self, trials: &[Trial]) -> Result<Vec<Option<f64>>, Stopped> {
        let keys: Vec<Vec<Key>> = trials.iter().map(|trial| vec![key(trial)]).collect();
        let values = |k: usize, _| {
            let Trial { curve, first, second } = trials[k];
            // The axes beyond the second vary fastest.
            let mut values = self.plan.axis_values(curve as u64);
            values[..2].copy_from_slice(&[first, second]);
            values
        };
        let answer = |_, points: Vec<Done>| Ok(points.iter().map(|of| self.distance(of)).collect());
        Ok(self.asking.ask(&keys, 1, &values, &answer)?.concat())
    }
}

/// The key under which a trial is stored.
const fn key(trial: &Trial) -> Key {
    [trial.curve as u64, trial.first.to_bits(), trial.second.to_bits()]
}
