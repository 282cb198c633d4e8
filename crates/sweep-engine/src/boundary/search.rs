//! The evaluator over a model: its distances at trial points, on all cores, with a memory; and the
//! settings a plan gives a search.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard};

use super::{Evaluate, Search, TracedQuantity, Trial};
use crate::store::{Key, Trials};
use crate::threads::{self};
use crate::{Axis, AxisValues, Interrupt, Model, Plan, StoreError, ThreadsError, Watch};
use sweep_files::panics::{lock, unlocked};
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

/// Values of the axes beyond the second, of a curve; the last varies fastest.
pub fn further_values<M: Model>(plan: &Plan<M>, curve: usize) -> Vec<f64> {
    let further = plan.axes.get(2..).unwrap_or_default();
    let mut values = vec![0.0; further.len()];
    let mut rest = curve as u64;
    for (value, axis) in values.iter_mut().zip(further).rev() {
        *value = axis.values.value(rest % axis.values.len());
        rest /= axis.values.len();
    }
    values
}

/// What computes the numbers of a column.
pub trait Values: Sync {
    /// One number a point given by the values of the axes, `None` where it is null. Each is shown
    /// to `seen` by its position as it comes, on any thread of the rayon pool that this is called
    /// in; `None` if `watch` stopped it. A ratio's is good for telling on which side of the plan's
    /// limit it is, and near the limit for its value.
    fn values(
        &self,
        axis_values: &[Vec<f64>],
        seen: &(dyn Fn(usize, Option<f64>) + Sync),
        watch: &Watch<'_>,
    ) -> Option<Vec<Option<f64>>>;
}

/// A model at trial points.
pub struct Models<'a, M: Model> {
    plan: &'a Plan<M>,
    quantity: &'a TracedQuantity,
    values: Box<dyn Values + 'a>,
    pool: rayon::ThreadPool,
    interrupt: &'a Interrupt,
    /// What is known from before, and where answers are kept as they come.
    kept: Option<Mutex<Trials>>,
    done: AtomicU64,
    tell: &'a (dyn Fn(u64) + Sync),
}

impl<'a, M: Model> Models<'a, M> {
    /// An evaluator over a plan; `tell` hears how many trials are done.
    ///
    /// # Errors
    /// [`ThreadsError::Start`].
    pub fn new(
        plan: &'a Plan<M>,
        (quantity, values): (&'a TracedQuantity, Box<dyn Values + 'a>),
        threads: usize,
        interrupt: &'a Interrupt,
        tell: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        let pool = threads::pool(threads)?;
        let done = AtomicU64::new(0);
        Ok(Self { plan, quantity, values, pool, interrupt, kept: None, done, tell })
    }

    /// The same with a memory: it makes no trial again that is known from before.
    pub fn keeping(self, trials: Trials) -> Self {
        Self { kept: Some(Mutex::new(trials)), ..self }
    }

    /// The memory, at the end.
    pub fn into_kept(self) -> Option<Trials> {
        self.kept.map(unlocked)
    }

    fn kept(&self) -> Option<MutexGuard<'_, Trials>> {
        self.kept.as_ref().map(lock)
    }

    /// Counts trials that are done.
    fn count(&self, trials: u64) {
        (self.tell)(self.done.fetch_add(trials, Ordering::Relaxed) + trials);
    }
}

/// Why the evaluator stopped. The answers that it has given are kept.
#[derive(Debug)]
pub enum Stopped {
    /// The interrupt stopped it.
    Interrupted,
    /// An answer could not be kept.
    Failed(StoreError),
}

impl<M: Model> Evaluate for Models<'_, M> {
    type Stop = Stopped;

    fn evaluate(&self, trials: &[Trial]) -> Result<Vec<Option<f64>>, Stopped> {
        let known = |trial: &Trial| self.kept()?.recall(&key(trial));
        let mut distances: Vec<Option<Option<f64>>> = trials.iter().map(known).collect();
        let new: Vec<usize> = (0..trials.len()).filter(|k| distances[*k].is_none()).collect();
        self.count((trials.len() - new.len()) as u64);
        let values = |k: &usize| {
            let trial = trials[*k];
            let further = further_values(self.plan, trial.curve);
            [trial.first, trial.second].into_iter().chain(further).collect()
        };
        let axis_values: Vec<Vec<f64>> = new.iter().map(values).collect();
        let watch = Watch::new(self.interrupt);
        let failure = Mutex::new(None);
        let distance = |value: Option<f64>| value.map(|value| self.quantity.distance(value));
        let seen = |place: usize, value| {
            if let (Some(mut kept), Some(position)) = (self.kept(), new.get(place))
                && let Err(error) = kept.keep(key(&trials[*position]), distance(value))
            {
                lock(&failure).get_or_insert(error);
                watch.abort();
            }
            self.count(1);
        };
        let found = self.pool.install(|| self.values.values(&axis_values, &seen, &watch));
        let settled = self.kept().map_or(Ok(()), |kept| kept.settle());
        let failure = unlocked(failure);
        if let Some(error) = failure.or(settled.err()) {
            return Err(Stopped::Failed(error));
        }
        for (position, value) in new.iter().zip(found.ok_or(Stopped::Interrupted)?) {
            distances[*position] = Some(distance(value));
        }
        Ok(distances.into_iter().flatten().collect())
    }
}

/// The key under which a trial is stored.
const fn key(trial: &Trial) -> Key {
    [trial.curve as u64, trial.first.to_bits(), trial.second.to_bits()]
}
