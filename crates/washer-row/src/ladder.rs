//! Ladders: ways to integrate a trajectory, from the quickest. A point climbs until two rungs
//! agree.

use washer_model::{Formula, Gear, Method, ModelKind};

use crate::convergence::Convergence;
use crate::level::Level;

/// One way to integrate a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    /// What the row says of it.
    pub level: Level,
    /// The method.
    pub method: Method,
    /// What its difference from the rung before says.
    pub convergence: Convergence,
}

impl Rung {
    /// The rung in words, as one of this model's.
    #[must_use]
    pub fn describe(&self, model: ModelKind) -> String {
        let name = self.level.name();
        match &self.method {
            Method::Geared(geared) => {
                let Gear { step_s, caps, .. } = geared.top();
                let order = match Formula::of(model) {
                    Formula::Rk4 => 4,
                    Formula::Dop853 => 8,
                };
                let bearings = caps.bearings_rad_per_s;
                let hinge = match caps.hinge_rad_per_s {
                    Some(hinge) => format!(" and hinge at {hinge:.0}"),
                    None => String::new(),
                };
                format!(
                    "{name} (order {order}, step {:.3} ms, bearings capped at {bearings:.0}{hinge} \
                     rad/s)",
                    1e3 * step_s
                )
            }
            Method::Rk4 { step_s } => format!("{name} (step {:.3} ms)", 1e3 * step_s),
            // Not on the fast method's ladder.
            Method::Dopri5(_) | Method::Rodas5p(_) => name.to_owned(),
        }
    }
}

/// The rungs of one model, from the quickest.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    /// From the quickest; at least one.
    pub rungs: Vec<Rung>,
    /// Whether there is more than one, and the last ones are plain RK4.
    is_checked: bool,
    /// What elements of the machines hold the quick rungs back, if any do.
    pub held_back: Option<String>,
}

impl Ladder {
    /// One method, which nothing is compared with.
    #[must_use]
    pub fn direct(level: Level, method: Method) -> Self {
        let rungs = vec![Rung { level, method, convergence: Convergence::NONE }];
        Self { rungs, is_checked: false, held_back: None }
    }

    /// Rungs that check one another, the last ones plain RK4; at least two.
    #[must_use]
    pub const fn checked(rungs: Vec<Rung>, held_back: Option<String>) -> Self {
        Self { rungs, is_checked: true, held_back }
    }

    /// The last rung, if there are others below it.
    #[must_use]
    pub fn top(&self) -> Option<usize> {
        self.is_checked.then(|| self.rungs.len() - 1)
    }

    /// The method of the rows that capped modes of this level hold; of a ladder without such a
    /// rung, the finest capped one's below it.
    #[must_use]
    pub fn capped(&self, level: Level) -> Option<Method> {
        let is_capped = |rung: &&Rung| rung.level.is_capped() && rung.level <= level;
        self.rungs.iter().rfind(is_capped).map(|rung| rung.method)
    }
}
