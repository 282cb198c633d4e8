//! What computes a model's rows.

use crate::{Engine, Error, Estimate, Model, Plan, Rows};

/// A model whose rows can be computed: all that commands need.
pub trait Swept: Rows {
    /// What computes the rows of a plan. If one column alone is asked for, the others may be
    /// anything, and a ratio need only be good for telling on which side of the plan's limit it is,
    /// and near the limit for its value.
    ///
    /// # Errors
    /// No engine for it.
    fn engine<'a>(plan: &'a Plan<Self>, only: Option<&str>) -> Result<Box<dyn Engine + 'a>, Error>;

    /// What a run of a plan will take, on so many threads.
    ///
    /// # Errors
    /// As [`Self::engine`].
    fn estimate(plan: &Plan<Self>, threads: usize) -> Result<Estimate, Error>;

    /// Lines that `check` shows of the model's own.
    fn words(_: &Plan<Self>) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Words behind "below 2" in summaries, where ratios are not of the largest deviations.
    fn criterion(&self) -> &'static str {
        ""
    }

    /// What a message about a column that no row has says of those that a grid file can ask for.
    const FURTHER: &'static str = "";

    /// What a column needs, if it is one of a kind that not every plan's rows have.
    fn needed(_column: &str) -> Option<&'static str> {
        None
    }

    /// Plans of the same points whose rows hold further columns, which this one does not ask for:
    /// one plan for each thing that can be measured.
    fn variants(_: &Plan<Self>) -> Vec<Plan<Self>> {
        Vec::new()
    }

    /// Every parameter with its value, as `parameters` lists them; without a plan those that need
    /// no grid file.
    fn listed(plan: Option<&Plan<Self>>) -> Vec<Listed<Self>>;
}

/// A line of the listing of parameters.
pub struct Listed<M: Model> {
    /// The parameter.
    pub parameter: M::Parameter,
    /// Its value, if there is one.
    pub value: Option<f64>,
    /// Where that comes from.
    pub source: String,
}
