//! The product's evaluator: both models at the trial points, on all cores, and the settings a plan gives a search.

use std::sync::atomic::{AtomicU64, Ordering};

use super::quantity::Quantity;
use super::{Evaluate, Search, Trial};
use crate::engine::{Demand, ModelEngine};
use crate::interrupt::Interrupt;
use crate::plan::{Axis, AxisValues, Plan};
use crate::run::Watch;
use crate::threads::{self, ThreadsError};

/// Rows of all curves together that are accepted: what is known of them stays in memory.
const MOST_ROWS: u64 = 1_000_000;

/// The narrowest tolerance, as a part of the range: below it, rounding decides.
const FINEST: f64 = 1e-9;

/// Parts of the range in the default tolerance: 0.5 N s/m of the paper's 60 to 300.
const DEFAULT_PARTS: f64 = 480.0;

/// Why a plan has no boundary to trace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// Fewer than two axes.
    #[error(
        "a boundary runs over two axes, and this grid has {0}: give [[axis]] twice, first the one along which the \
         curve is wanted, then the one that is searched"
    )]
    Axes(usize),
    /// The points come from a design.
    #[error(
        "a boundary runs over the axes of a grid, and this file has a [design]: remove it, and give [[axis]] twice"
    )]
    Design,
    /// The second axis has no extent.
    #[error(
        "the second axis, `{0}`, has one value: give it the range to search, as range = {{ from, to, count }} or as \
         `values` whose least and greatest are its ends"
    )]
    NoRange(String),
    /// Too many rows.
    #[error(
        "{rows} rows (values of the first axis, times the combinations of the axes beyond the second) are more than \
         {MOST_ROWS}: trace parts of them"
    )]
    Rows {
        /// How many.
        rows: u64,
    },
    /// A tolerance that cannot be met or means nothing.
    #[error("--tolerance {given} is out of range: expected from {least:e} to {greatest} for the second axis")]
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
pub struct Task {
    /// Values of the first axis, in grid order.
    pub firsts: Vec<f64>,
    /// Number of curves: combinations of the axes beyond the second.
    pub curves: usize,
    /// The search along the second axis.
    pub search: Search,
}

impl Task {
    /// The task of a plan. `tolerance` is in the second axis's unit, or a fraction of its value if that axis is
    /// logarithmic; the default is 1/480 of the range.
    ///
    /// # Errors
    /// Any [`BoundaryError`].
    pub fn new(plan: &Plan, tolerance: Option<f64>, lattice: usize) -> Result<Self, BoundaryError> {
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

fn all(axis: &Axis) -> Vec<f64> {
    (0..axis.values.len()).map(|k| axis.values.value(k)).collect()
}

/// Values of the axes beyond the second, of a curve; the last varies fastest.
#[must_use]
pub fn further_values(plan: &Plan, curve: usize) -> Vec<f64> {
    let further = plan.axes.get(2..).unwrap_or_default();
    let mut values = vec![0.0; further.len()];
    let mut rest = curve as u64;
    for (value, axis) in values.iter_mut().zip(further).rev() {
        *value = axis.values.value(rest % axis.values.len());
        rest /= axis.values.len();
    }
    values
}

/// Both models at trial points.
pub struct Models<'a> {
    plan: &'a Plan,
    engine: ModelEngine<'a>,
    quantity: Quantity,
    pool: rayon::ThreadPool,
    interrupt: &'a Interrupt,
    done: AtomicU64,
    tell: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Models<'a> {
    /// An evaluator of `quantity` over [`Quantity::plan`]; `tell` hears how many trials are done.
    ///
    /// # Errors
    /// [`ThreadsError::Start`].
    pub fn new(
        plan: &'a Plan,
        engine: ModelEngine<'a>,
        quantity: Quantity,
        threads: usize,
        interrupt: &'a Interrupt,
        tell: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        let pool = threads::pool(threads)?;
        Ok(Self { plan, engine, quantity, pool, interrupt, done: AtomicU64::new(0), tell })
    }
}

impl Evaluate for Models<'_> {
    fn evaluate(&self, trials: &[Trial]) -> Option<Vec<Option<f64>>> {
        let axis_values: Vec<Vec<f64>> = trials
            .iter()
            .map(|trial| {
                let further = further_values(self.plan, trial.curve);
                [trial.first, trial.second].into_iter().chain(further).collect()
            })
            .collect();
        let watch = Watch::new(self.interrupt);
        let outcomes = self.pool.install(|| self.engine.evaluate_for(&axis_values, Demand::Side, &watch))?;
        let done = self.done.fetch_add(trials.len() as u64, Ordering::Relaxed);
        (self.tell)(done + trials.len() as u64);
        Some(outcomes.iter().map(|outcome| self.quantity.distance(outcome, self.plan)).collect())
    }
}
