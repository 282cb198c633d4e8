//! What computes a model's rows.

use sweep_parameter::Channel;

use crate::boundary::quantity::{TracedQuantity, ratio};
use crate::boundary::search::Distances;
use crate::estimate::Estimate;
use crate::exit::Error;
use crate::model::Model;
use crate::plan::Plan;
use crate::store::Rows;
use crate::watch::Engine;

/// A model whose rows can be computed: all that commands need.
pub trait Swept: Rows {
    /// What computes the rows of a plan.
    ///
    /// # Errors
    /// No engine for it.
    fn engine(plan: &Plan<Self>) -> Result<Box<dyn Engine + '_>, Error>;

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

    /// What a boundary can be drawn through, the default first.
    fn quantities() -> Vec<String> {
        let ratios =
            Self::Channel::every().iter().map(|channel| format!("ratio_{}", channel.name()));
        std::iter::once("ratio_max".to_owned()).chain(ratios).collect()
    }

    /// One of [`Self::quantities`], and the plan that computes it.
    ///
    /// # Errors
    /// A plan that cannot compute it.
    fn traced(plan: &Plan<Self>, name: &str) -> Result<(TracedQuantity, Plan<Self>), Error> {
        Ok(ratio(plan, name))
    }

    /// What computes distances of a quantity from its limit.
    ///
    /// # Errors
    /// As [`Self::engine`].
    fn search<'a>(
        plan: &'a Plan<Self>,
        quantity: &TracedQuantity,
    ) -> Result<Box<dyn Distances + 'a>, Error>;

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
