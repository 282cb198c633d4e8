//! The quantity of a boundary, its limit, and distances from that: any column of numbers that a
//! plan's rows can have.

use sweep_parameter::{Channel as _, Worse};

use crate::store::{Column, Holds};
use crate::{Error, Plan, Swept, nearest};

/// The prefix of the columns of ratios.
const RATIO: &str = "ratio_";
/// The column of the least ratio.
const LEAST_RATIO: &str = "ratio_min";

/// A quantity with a limit, named as its column in a result file.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedQuantity {
    /// The column's name.
    pub name: String,
    /// The unit.
    pub unit: String,
    /// The value at which the boundary runs.
    pub limit: f64,
    /// The side of the limit that is bad.
    pub worse: Worse,
    /// The scale of distances from the limit.
    pub scale: Scale,
}

/// The scale of distances from a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// The logarithm of the quantity over its limit.
    Logarithm,
    /// The difference over this.
    Over(f64),
}

impl TracedQuantity {
    /// Returns the signed distance of a value from the limit, negative on the good side.
    pub fn distance(&self, value: f64) -> f64 {
        match (self.scale, self.worse) {
            (Scale::Logarithm, worse) => {
                let distance = worse.by(libm::log(value / self.limit), 0.0);
                // A ratio one rounding on the good side of the limit is still there.
                let is_good = worse.by(value, self.limit) < 0.0;
                if is_good { distance.min(-f64::MIN_POSITIVE) } else { distance }
            }
            (Scale::Over(per), worse) => worse.by(value, self.limit) / per,
        }
    }

    /// Returns the quantity at a signed distance from the limit.
    pub fn value(&self, distance: f64) -> f64 {
        let away = self.worse.by(distance, 0.0);
        match self.scale {
            Scale::Logarithm => self.limit * libm::exp(away),
            Scale::Over(per) => self.limit + away * per,
        }
    }
}

/// Returns every column that a boundary of this plan can be drawn through, each with the plan that
/// computes it: a channel is compared even if the grid file leaves it out, and so is a metric
/// measured that the model can have.
pub fn offered<M: Swept>(plan: &Plan<M>) -> Vec<(Column, Plan<M>)> {
    // A search of one channel does not make sure of the others.
    let channel_plan = |channel: &M::Channel| {
        let mut plan = plan.clone();
        plan.reliability.channels = vec![*channel];
        (plan, Some(channel_columns(channel.name())))
    };
    let mut least = plan.clone();
    least.reliability.limits.least = Some(plan.reliability.limits.over_estimate());
    let further = [plan.clone(), least].into_iter().chain(M::variants(plan));
    let plans = M::channels().iter().map(channel_plan).chain(further.map(|plan| (plan, None)));
    let mut offered: Vec<(Column, Plan<M>)> = Vec::new();
    for (plan, only) in plans {
        for column in M::layout(&plan).columns {
            let is_number = matches!(column.kind, Holds::Measured | Holds::Time | Holds::Count);
            let is_asked = only.as_ref().is_none_or(|only| only.contains(&column.name));
            let is_new = offered.iter().all(|(known, _)| known.name != column.name);
            if is_number && column.worse.is_some() && is_asked && is_new {
                offered.push((column, plan.clone()));
            }
        }
    }
    // The verdict's ratios foremost.
    offered.sort_by_key(|(column, _)| !["ratio_max", LEAST_RATIO].contains(&&*column.name));
    offered
}

/// Returns the names of a channel's columns.
fn channel_columns(name: &str) -> [String; 3] {
    [RATIO, "nonlinear_", "linear_"].map(|kind| format!("{kind}{name}"))
}

/// Returns the column of this name at a limit, its own if none is given, and the plan that computes
/// it.
///
/// # Errors
/// A column that the plan's rows cannot have, or that has no limit of its own where none is given.
pub fn traced<M: Swept>(
    plan: &Plan<M>,
    name: &str,
    limit: Option<f64>,
) -> Result<(TracedQuantity, Plan<M>), Error> {
    let mut offered = offered(plan);
    let Some(at) = offered.iter().position(|(column, _)| column.name == name) else {
        let names = || offered.iter().map(|(column, _)| column.name.as_str());
        let kind = |name: &str| name.split('_').next().map(str::to_owned);
        let is_of_kind = |known: &str| kind(known) == kind(name);
        if let Some(needed) = M::needed(name).filter(|_| !names().any(is_of_kind)) {
            return Err(Error::option("--quantity", name, needed));
        }
        let meant = nearest(name, names());
        let meant = meant.map_or(String::new(), |name| format!("; did you mean `{name}`?"));
        let known_columns: Vec<String> =
            M::channels().iter().flat_map(|channel| channel_columns(channel.name())).collect();
        let is_of_channel = |name: &&str| known_columns.iter().any(|known| known == name);
        let names: Vec<&str> = names().filter(|name| !is_of_channel(name)).collect();
        let names = names.join(", ");
        let [ratio, nonlinear, linear] = channel_columns("CHANNEL");
        let further = M::FURTHER;
        let expected = format!("one of {names}, {ratio}, {nonlinear}, {linear}{further}{meant}");
        return Err(Error::option("--quantity", name, expected));
    };
    let (column, mut plan) = offered.swap_remove(at);
    let own = column.limit;
    let Some(value) = limit.or(own.map(|limit| limit.value)) else {
        let unit = &column.unit;
        let expected = format!("--limit with it, in {unit}: it has no limit of its own");
        return Err(Error::option("--quantity", name, expected));
    };
    let is_ratio = name.starts_with(RATIO);
    let scale = own.map_or(value.abs(), |limit| limit.scale);
    if !value.is_finite() || (is_ratio && value <= 0.0) || scale == 0.0 {
        let expected = format!("a number greater than 0, as {name} is never below");
        return Err(Error::option("--limit", value, expected));
    }
    if name == LEAST_RATIO {
        plan.reliability.limits.least = Some(value);
    } else if is_ratio {
        plan.reliability.limits.most = value;
    }
    let quantity = TracedQuantity {
        name: column.name,
        unit: column.unit,
        limit: value,
        worse: column.worse.unwrap_or(Worse::Greater),
        scale: if is_ratio { Scale::Logarithm } else { Scale::Over(scale) },
    };
    Ok((quantity, plan))
}
