//! The fast method as a ladder: the same trajectory by finer and finer rungs, until two of them agree.
//!
//! The lower rungs cap the modes of bearings and hinge (`washer_model::Cases`), each for a smaller error than the one
//! before; the last two are plain RK4 at two steps, the shorter one the reference. What a rung leaves of error shows in how far its
//! trajectory is from the rung's before: the first-order difference of the two, over the whole course of the motion and in every
//! number of the row. The rule knows by how much the rung's error is smaller than that of the one before, so the difference times
//! that share is the error left, as long as errors are small enough to be of first order. Motions that pass through bands of
//! instability amplify errors a thousandfold and climb; motions that are chaotic climb to the top, where RK4 does not agree with
//! itself.
//!
//! Nothing is taken from other points, so a row depends on the plan and its own parameters alone.

use std::fmt;

use washer_model::{Cases, Formula, Gear, Geared, Method, ModelKind};

/// Which rung a row's numbers come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Level {
    /// The lowest rung that a row may hold: bearings and hinge with capped modes.
    Fast,
    /// The same with less error.
    Fine,
    /// The same with shorter steps and higher caps.
    Finest,
    /// Plain RK4.
    Rk4,
    /// Dormand-Prince 5(4).
    Dopri5,
    /// Rodas5P.
    Rodas5p,
}

impl Level {
    /// Every level; the position is its code in chunk files, so new ones go to the end.
    pub const ALL: [Self; 6] = [Self::Fast, Self::Fine, Self::Finest, Self::Rk4, Self::Dopri5, Self::Rodas5p];

    /// As in the file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Fine => "fine",
            Self::Finest => "finest",
            Self::Rk4 => "rk4",
            Self::Dopri5 => "dopri5",
            Self::Rodas5p => "rodas5p",
        }
    }
}

/// Step of the reference method, where the machine allows it (s): amplitudes are converged to about 1e-9.
const REFERENCE_STEP_S: f64 = 2e-4;

/// Share of the longest stable step that the reference method may use.
pub(crate) const REFERENCE_SHARE: f64 = 0.75;

/// Step of plain RK4 where it is run first, as a multiple of the reference's.
const LONGER_STEP: f64 = 1.25;

/// Error of the reference as a share of its difference from that: 1 / (1.25^4 - 1).
const REFERENCE_CONTRACTION: f64 = 0.7;

/// By how much the finest capped rung's steps are shorter than the fine one's, and its caps higher.
const FINEST: [f64; 2] = [2.5, 3.0];

/// A finest rung is climbed if it costs less than this share of the reference.
const WORTH_IT: f64 = 0.5;

/// For what error the rungs are chosen, in parts of the accuracy. The first one only shows the error of the second.
///
/// The linear model amplifies nothing, so its first rung may be coarser and its second needs less in reserve.
const fn aims(model: ModelKind) -> [f64; 3] {
    match model {
        ModelKind::Nonlinear => [10.0, 0.1, 0.01],
        ModelKind::Linear => [100.0, 0.3, 0.01],
    }
}

/// The same of plain RK4 and the finest capped rung, whose error is what the difference shows: RK4's is smaller by orders of
/// magnitude.
const FIRST_ORDER_OF_RK4: f64 = 0.2;

/// Up to which difference of two rungs errors are of first order.
const fn first_order(model: ModelKind) -> f64 {
    match model {
        ModelKind::Nonlinear => 0.1,
        ModelKind::Linear => 0.3,
    }
}

/// A contraction better than this is not believed.
const BEST_CONTRACTION: f64 = 1e-3;

/// One way to integrate a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rung {
    /// What the row says of it.
    pub(crate) level: Level,
    /// The method.
    pub(crate) method: Method,
    /// Its error as a share of the rung's before; 1 for the first.
    contraction: f64,
}

impl fmt::Display for Rung {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.level.name();
        match &self.method {
            Method::Geared(geared) => {
                let Gear { step_s, caps, .. } = geared.top();
                let order = match geared.formula {
                    Formula::Rk4 => 4,
                    Formula::Dop853 => 8,
                };
                let bearings = caps.bearings_rad_per_s;
                write!(
                    f,
                    "{name} (order {order}, step {:.3} ms, bearings capped at {bearings:.0}",
                    1e3 * step_s
                )?;
                match caps.hinge_rad_per_s {
                    Some(hinge) => write!(f, " and hinge at {hinge:.0} rad/s)"),
                    None => write!(f, " rad/s)"),
                }
            }
            Method::Rk4 { step_s } => write!(f, "{name} (step {:.3} ms)", 1e3 * step_s),
            Method::Dopri5(_) | Method::Rodas5p(_) => write!(f, "{name}"),
        }
    }
}

/// The rungs of one model, from the quickest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ladder {
    pub(crate) rungs: Vec<Rung>,
    first_order: f64,
    /// Whether there is more than one, and the last two are plain RK4.
    is_checked: bool,
}

impl Ladder {
    /// One method, which nothing is compared with.
    pub(crate) fn direct(level: Level, method: Method) -> Self {
        let rungs = vec![Rung { level, method, contraction: 1.0 }];
        Self { rungs, first_order: 0.0, is_checked: false }
    }

    /// The fast method's for these cases.
    pub(crate) fn new(cases: &Cases<'_>, model: ModelKind, accuracy: f64) -> Self {
        let reference_step_s = reference_step_s(cases);
        let mut rungs: Vec<Rung> = Vec::new();
        let mut error = f64::INFINITY;
        let mut push = |level: Level, method: Method, next: f64| {
            let contraction = (next / error).clamp(BEST_CONTRACTION, 1.0);
            rungs.push(Rung { level, method, contraction });
            error = next;
        };
        let levels = [Level::Fast, Level::Fast, Level::Fine];
        let mut last: Option<(Geared, f64)> = None;
        for (level, aim) in levels.into_iter().zip(aims(model)) {
            // Corners without an equilibrium or without modes are rows that say so; the rest climbs by plain RK4.
            let Ok(Some(geared)) = cases.choose(aim * accuracy) else { continue };
            let Ok(expected) = cases.expected_error(&geared) else { continue };
            if last.is_none_or(|(_, before)| expected < 0.5 * before) {
                push(level, Method::Geared(geared), expected);
                last = Some((geared, expected));
            }
        }
        let finest = last.map(|(geared, expected)| (refined(&geared), expected));
        if let Some((finest, expected)) = finest
            && finest.evaluations_per_s() < WORTH_IT * Formula::Rk4.evaluations_per_s(reference_step_s)
        {
            let [_, caps] = FINEST;
            push(Level::Finest, Method::Geared(finest), expected / (caps * caps));
        }
        push(Level::Rk4, Method::Rk4 { step_s: LONGER_STEP * reference_step_s }, 0.0);
        push(Level::Rk4, Method::Rk4 { step_s: reference_step_s }, 0.0);
        if let Some(last) = rungs.last_mut() {
            last.contraction = REFERENCE_CONTRACTION;
        }
        Self { rungs, first_order: first_order(model), is_checked: true }
    }

    /// The last rung, if there are others below it.
    pub(crate) fn top(&self) -> Option<usize> {
        self.is_checked.then(|| self.rungs.len() - 1)
    }

    /// The error left at a rung whose run differs so much from that of the rung before.
    pub(crate) fn error_left(&self, rung: usize, difference: f64) -> f64 {
        let first_order = match self.top() {
            Some(top) if rung == top => f64::INFINITY,
            Some(top) if rung + 1 == top => FIRST_ORDER_OF_RK4,
            _ => self.first_order,
        };
        if difference <= first_order { self.rungs[rung].contraction * difference } else { difference }
    }
}

/// With shorter steps and higher caps.
fn refined(geared: &Geared) -> Geared {
    let [steps, factor] = FINEST;
    let gears = geared.gears.map(|gear| {
        let mut caps = gear.caps;
        caps.bearings_rad_per_s *= factor;
        caps.hinge_rad_per_s = caps.hinge_rad_per_s.map(|cap| factor * cap);
        Gear { step_s: gear.step_s / steps, caps, ..gear }
    });
    Geared { gears, ..*geared }
}

/// Step of the reference method.
pub(crate) fn reference_step_s(cases: &Cases<'_>) -> f64 {
    let stable_s = cases.plain_step_s().map_or(f64::INFINITY, |longest_s| REFERENCE_SHARE * longest_s);
    REFERENCE_STEP_S.min(stable_s)
}
