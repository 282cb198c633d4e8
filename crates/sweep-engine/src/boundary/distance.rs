//! A quantity with its limit, and distances from that.

use sweep_parameter::Worse;

/// A quantity with a limit, named as its column in a result file.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedQuantity {
    /// The column's name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The value at which the boundary runs.
    pub limit: f64,
    /// The side of the limit that is bad.
    pub worse: Worse,
    /// What its distances from the limit are.
    pub scale: Scale,
}

/// What a distance from a limit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// The logarithm of the quantity over its limit.
    Logarithm,
    /// The difference over this.
    Over(f64),
}

impl TracedQuantity {
    /// Signed distance of a value from the limit, negative on the good side.
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

    /// The quantity at a distance from its limit.
    pub fn value(&self, distance: f64) -> f64 {
        let away = self.worse.by(distance, 0.0);
        match self.scale {
            Scale::Logarithm => self.limit * libm::exp(away),
            Scale::Over(per) => self.limit + away * per,
        }
    }
}
