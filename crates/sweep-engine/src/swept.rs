//! The trait of models whose rows can be computed.

use crate::{Engine, Error, Estimate, Model, Plan, Rows};

/// A model whose rows can be computed, as commands need it.
pub trait Swept: Rows {
    /// Creates the engine that computes the rows of a plan.
    ///
    /// With `only` the caller reads a single column, and the others may hold anything. If the
    /// column is a ratio, it has to be on the correct side of the plan's limit, and accurate near
    /// the limit only.
    ///
    /// # Errors
    /// A plan that has no engine.
    fn engine<'a>(plan: &'a Plan<Self>, only: Option<&str>) -> Result<Box<dyn Engine + 'a>, Error>;

    /// Estimates the time and memory of a run on a number of threads.
    ///
    /// # Errors
    /// The errors of [`Self::engine`].
    fn estimate(plan: &Plan<Self>, threads: usize) -> Result<Estimate, Error>;

    /// Returns the lines that `check` adds for this model.
    fn words(_: &Plan<Self>) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Returns the words after "below 2" in summaries, where ratios are not those of the largest
    /// deviations.
    fn criterion(&self) -> &'static str {
        ""
    }

    /// The sentence on optional columns in the message about an unknown column.
    const FURTHER: &'static str = "";

    /// Returns the setting that a column requires, if not every plan has the column.
    fn needed(_column: &str) -> Option<&'static str> {
        None
    }

    /// Returns plans of the same points whose rows have further columns, one plan for each kind of
    /// measurement that this plan lacks.
    fn variants(_: &Plan<Self>) -> Vec<Plan<Self>> {
        Vec::new()
    }

    /// Returns a plan of the same points whose rows have every measurement that this plan can have.
    fn complete(plan: &Plan<Self>) -> Plan<Self> {
        plan.clone()
    }

    /// Returns the lines of `parameters`; without a plan, those that need no grid file.
    fn listed(plan: Option<&Plan<Self>>) -> Vec<Listed<Self>>;
}

/// A line of the listing of parameters.
pub struct Listed<M: Model> {
    /// The parameter.
    pub parameter: M::Parameter,
    /// The value, if there is one.
    pub value: Option<f64>,
    /// The source of the value.
    pub source: String,
}
