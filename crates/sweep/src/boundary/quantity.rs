//! What a boundary is drawn through: a ratio at its limit, or a gap at zero.

use washer_model::Channel;
use washer_row::{Outcome, Verdict};

use super::product::BoundaryError;
use crate::plan::Plan;

/// Gaps are compared with this, so that their distances are of order one, as those of ratios.
const GAP_SCALE_M: f64 = 0.010;

/// A quantity with a limit, named as its column in a result file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TracedQuantity {
    /// The greatest ratio over the channels.
    RatioMax,
    /// One channel's ratio.
    Ratio(Channel),
    /// The least gap between drum and tub, nonlinear model.
    GapNonlinear,
    /// The least gap between drum and tub, linear model.
    GapLinear,
    /// The largest growth of a disturbance over the speeds of `[stability]`.
    Growth,
}

impl TracedQuantity {
    /// Every quantity.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let ratios = Channel::ALL.into_iter().map(Self::Ratio);
        [Self::RatioMax]
            .into_iter()
            .chain(ratios)
            .chain([Self::GapNonlinear, Self::GapLinear, Self::Growth])
            .collect()
    }

    /// The column's name.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::RatioMax => "ratio_max".to_owned(),
            Self::Ratio(channel) => format!("ratio_{}", channel.name()),
            Self::GapNonlinear => "min_gap_nonlinear_m".to_owned(),
            Self::GapLinear => "min_gap_linear_m".to_owned(),
            Self::Growth => "growth".to_owned(),
        }
    }

    /// `"1"`, `"m"` or `"1/s"`.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::RatioMax | Self::Ratio(_) => "1",
            Self::GapNonlinear | Self::GapLinear => "m",
            Self::Growth => "1/s",
        }
    }

    /// The value at which the boundary runs: the plan's ratio limit, or no gap.
    #[must_use]
    pub const fn limit(self, plan: &Plan) -> f64 {
        match self {
            Self::RatioMax | Self::Ratio(_) => plan.reliability.ratio_limit,
            Self::GapNonlinear | Self::GapLinear | Self::Growth => 0.0,
        }
    }

    /// The plan that computes it: a channel of its own is compared even if the grid file leaves it
    /// out.
    ///
    /// # Errors
    /// [`BoundaryError::Speeds`] where growth is asked for and the plan names no speeds.
    pub fn plan(self, plan: &Plan) -> Result<Plan, BoundaryError> {
        let mut plan = plan.clone();
        match self {
            Self::Ratio(channel) => plan.reliability.channels = vec![channel],
            Self::Growth if plan.growth_speeds.is_none() => {
                return Err(BoundaryError::Speeds);
            }
            Self::RatioMax | Self::GapNonlinear | Self::GapLinear | Self::Growth => {}
        }
        Ok(plan)
    }

    /// Signed distance of an outcome of [`TracedQuantity::plan`] from the limit: negative where the
    /// ratio is below it, a gap is left or disturbances decay. The logarithm of a ratio over its
    /// limit, a gap in centimetres, or a growth in 1/s.
    #[must_use]
    pub fn distance(self, outcome: &Outcome, plan: &Plan) -> Option<f64> {
        match self {
            Self::RatioMax | Self::Ratio(_) => {
                let limit = plan.reliability.ratio_limit;
                let verdict = Verdict::new(outcome, plan.reliability.channels.len(), limit);
                let (_, ratio) = verdict.greatest?;
                let distance = libm::log(ratio / limit);
                // A ratio one rounding below the limit is still below it.
                Some(if ratio < limit { distance.min(-f64::MIN_POSITIVE) } else { distance })
            }
            Self::GapNonlinear => outcome.nonlinear.min_gap_m.map(|gap_m| -gap_m / GAP_SCALE_M),
            Self::GapLinear => outcome.linear.min_gap_m.map(|gap_m| -gap_m / GAP_SCALE_M),
            Self::Growth => Some(outcome.growth.as_ref()?.fastest.growth_per_s()),
        }
    }

    /// The quantity at a distance from its limit.
    #[must_use]
    pub fn value(self, distance: f64, plan: &Plan) -> f64 {
        match self {
            Self::RatioMax | Self::Ratio(_) => plan.reliability.ratio_limit * libm::exp(distance),
            Self::GapNonlinear | Self::GapLinear => -distance * GAP_SCALE_M,
            Self::Growth => distance,
        }
    }
}

impl std::str::FromStr for TracedQuantity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::all().into_iter().find(|quantity| quantity.name() == text).ok_or_else(|| {
            let names: Vec<String> = Self::all().into_iter().map(Self::name).collect();
            format!("expected one of {}; got `{text}`", names.join(", "))
        })
    }
}
