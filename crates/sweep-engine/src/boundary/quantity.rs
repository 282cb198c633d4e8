//! The quantity of a boundary, and its limit.

use sweep_parameter::Channel as _;

use crate::model::Model;
use crate::plan::Plan;

/// A quantity with a limit, named as its column in a result file.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedQuantity {
    /// The column's name.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// The value at which the boundary runs.
    pub limit: f64,
    /// What its distances from the limit are.
    pub scale: Scale,
}

/// What a distance from a limit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// The logarithm of the quantity over its limit.
    Logarithm,
    /// The quantity, whose limit is zero, over this; negative where less of it is worse.
    Over(f64),
}

impl TracedQuantity {
    /// Signed distance of a value from the limit, negative on the reliable side.
    #[must_use]
    pub fn distance(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Logarithm => {
                let distance = libm::log(value / self.limit);
                // A ratio one rounding below the limit is still below it.
                if value < self.limit { distance.min(-f64::MIN_POSITIVE) } else { distance }
            }
            Scale::Over(per) => value / per,
        }
    }

    /// The quantity at a distance from its limit.
    #[must_use]
    pub fn value(&self, distance: f64) -> f64 {
        match self.scale {
            Scale::Logarithm => self.limit * libm::exp(distance),
            Scale::Over(per) => distance * per,
        }
    }
}

/// A ratio at its limit, and the plan that computes it: a channel of its own is compared even if
/// the grid file leaves it out.
#[must_use]
pub fn ratio<M: Model>(plan: &Plan<M>, name: &str) -> (TracedQuantity, Plan<M>) {
    let mut plan = plan.clone();
    let of = |channel: &&M::Channel| name.strip_prefix("ratio_") == Some(channel.name());
    if let Some(channel) = M::Channel::every().iter().find(of) {
        plan.reliability.channels = vec![*channel];
    }
    let limit = plan.reliability.ratio_limit;
    let quantity =
        TracedQuantity { name: name.to_owned(), unit: "1", limit, scale: Scale::Logarithm };
    (quantity, plan)
}
