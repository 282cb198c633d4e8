//! Ladders: ways to integrate a trajectory, from the quickest. A point climbs until two rungs
//! agree.

use washer_model::{Formula, Gear, Method, MethodNumbers, ModelKind};

use crate::{Convergence, Level};

/// One way to integrate a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    /// What the row says of it.
    pub level: Level,
    /// The method.
    pub method: Method,
    /// What its difference from the rung before says.
    pub convergence: Convergence,
    /// The shares of what hinge and bearings swing after a jump of the drum's acceleration that its
    /// numbers leave out.
    pub left_out: [f64; 2],
}

impl Rung {
    /// The rung in words, as one of this model's.
    pub fn describe(&self, model: ModelKind) -> String {
        let name = self.level.name();
        let mut method = self.method;
        match method.numbers() {
            MethodNumbers::Gears(geared) => {
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
            MethodNumbers::Step(step_s) => format!("{name} (step {:.3} ms)", 1e3 * *step_s),
            MethodNumbers::Tolerance(tolerance) => {
                format!("{name} (tolerance {:.0e})", tolerance.relative)
            }
        }
    }
}

/// The rungs of one model, from the quickest.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    /// From the quickest; at least one.
    pub rungs: Vec<Rung>,
    /// The place of the reference, if rungs check one another.
    reference: Option<usize>,
    /// What elements of the machines hold the quick rungs back, if any do.
    pub held_back: Option<String>,
}

impl Ladder {
    /// One method, which nothing is compared with.
    pub fn direct(level: Level, method: Method) -> Self {
        let rung = Rung { level, method, convergence: Convergence::NONE, left_out: [0.0; 2] };
        Self { rungs: vec![rung], reference: None, held_back: None }
    }

    /// Rungs that check one another, at least two, of which the last is the reference: a formula
    /// on the machine as it is, after the same in longer steps.
    pub const fn checked(rungs: Vec<Rung>, held_back: Option<String>) -> Self {
        let reference = Some(rungs.len() - 1);
        Self { rungs, reference, held_back }
    }

    /// With rungs of shorter steps behind the reference, for rows that it leaves in doubt.
    #[must_use]
    pub fn with_finer(mut self, finer: impl IntoIterator<Item = Rung>) -> Self {
        self.rungs.extend(finer);
        self
    }

    /// The place of the reference, which agrees with the rung before, mostly. None where there is
    /// nothing but one method.
    pub const fn reference(&self) -> Option<usize> {
        self.reference
    }

    /// Whether this rung is behind the reference.
    pub(crate) fn is_finer(&self, rung: usize) -> bool {
        self.reference.is_some_and(|reference| rung > reference)
    }

    /// The place of the rung whose twin tells chaos: the one behind the reference where there is
    /// one, because that settles most of what the reference leaves in doubt.
    pub(crate) fn judge(&self) -> Option<usize> {
        self.reference.map(|reference| (reference + 1).min(self.rungs.len() - 1))
    }

    /// Stands behind all rungs for the last one that rows are judged by, from a start beside the
    /// row's own ([`Point::nudged`](washer_model::Point::nudged)).
    pub const fn twin(&self) -> usize {
        self.rungs.len()
    }

    /// The method of a rung, or of the twin.
    pub fn method(&self, rung: usize) -> &Method {
        let of_twin = self.judge().unwrap_or(0);
        &self.rungs[if rung == self.twin() { of_twin } else { rung }].method
    }

    /// The method of the rows that capped modes of this level hold; of a ladder without such a
    /// rung, the finest capped one's below it.
    pub fn capped(&self, level: Level) -> Option<Method> {
        let is_capped = |rung: &&Rung| rung.level.is_capped() && rung.level <= level;
        self.rungs.iter().rfind(is_capped).map(|rung| rung.method)
    }
}
