//! The force that reaches the cabinet through springs and dampers, over lanes.

use crate::coefficients::Coefficients;
use crate::forces::suspension_on_tub;
use crate::frame::{Tilt, dot};
use crate::lanes::SetLane;
use crate::linear::TUB;
use crate::model::STATES;
use crate::nonlinear::COORDINATES;
use crate::point::Point;
use crate::run::ModelKind;
use crate::suspension::forces;
use lane_ode::{Dual, Lane, N, Sample};

/// One of the two models' force.
pub(crate) enum CabinetForce<T> {
    /// Of the machine as it stands; as duals, for the force's derivative in time.
    Nonlinear(Coefficients<Dual<T>>),
    /// To first order in the deviations from equilibrium.
    Linear(Expansion<T>),
}

/// The force's three components, cabinet axes.
pub(crate) struct Expansion<T> {
    /// At equilibrium.
    rest: [N<T>; 3],
    /// Per deviation of each of [`TUB`].
    by_place: [[N<T>; 4]; 3],
    /// Per speed of each of [`TUB`].
    by_speed: [[N<T>; 4]; 3],
}

impl<T: Lane> CabinetForce<T> {
    /// The same point in every lane.
    #[inline(always)]
    pub(crate) fn splat(zero: N<T>, model: ModelKind, point: &Point) -> Self {
        match model {
            ModelKind::Nonlinear => Self::Nonlinear(Coefficients::splat(zero.constant(), &point.machine)),
            ModelKind::Linear => {
                let mut expansion =
                    Expansion { rest: [zero; 3], by_place: [[zero; 4]; 3], by_speed: [[zero; 4]; 3] };
                for lane in 0..T::LANES {
                    expansion.set_point(lane, point);
                }
                Self::Linear(expansion)
            }
        }
    }

    /// Puts a point into one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        match self {
            Self::Nonlinear(machine) => machine.set_lane(lane, &point.machine),
            Self::Linear(expansion) => expansion.set_point(lane, point),
        }
    }

    /// The square of the force (N^2) at a state whose derivative is `dx`, with its own derivative; its curvature is not known.
    #[inline(always)]
    pub(crate) fn squared(&self, x: &[N<T>; STATES], dx: &[N<T>; STATES]) -> Sample<T> {
        match self {
            Self::Nonlinear(machine) => {
                let mut q = [x[0].constant(); 4];
                let mut u = q;
                for k in 0..4 {
                    let (place, speed) = (TUB[k], COORDINATES + TUB[k]);
                    q[k] = N(Dual { value: x[place].0, slope: dx[place].0 });
                    u[k] = N(Dual { value: x[speed].0, slope: dx[speed].0 });
                }
                let tilt = Tilt::new(q[2], q[3]);
                let rate = tilt.motion(u[2], u[3]).rate;
                // On the tub and in its axes: as large as on the cabinet.
                let (force, _) =
                    suspension_on_tub(&machine.view(), &tilt, &[q[0], q[1]], &[u[0], u[1]], &rate);
                let squared = dot(&force, &force).0;
                Sample { value: N(squared.value), slope: N(squared.slope), curvature: x[0].lit(0.0) }
            }
            Self::Linear(expansion) => {
                let zero = x[0].lit(0.0);
                let (mut value, mut slope) = (zero, zero);
                for i in 0..3 {
                    let mut force = expansion.rest[i];
                    let mut rate = zero;
                    for k in 0..4 {
                        let (by_place, by_speed) = (expansion.by_place[i][k], expansion.by_speed[i][k]);
                        force += by_place * x[TUB[k]];
                        force += by_speed * x[COORDINATES + TUB[k]];
                        rate += by_place * dx[TUB[k]];
                        rate += by_speed * dx[COORDINATES + TUB[k]];
                    }
                    value += force * force;
                    slope += (2.0 * force).v() * rate;
                }
                Sample { value, slope, curvature: zero }
            }
        }
    }
}

impl<T: Lane> Expansion<T> {
    fn set_point(&mut self, lane: usize, point: &Point) {
        let at = |place: Option<usize>| {
            let mut state = [0.0; STATES];
            if let Some(place) = place {
                state[place] = 1.0;
            }
            forces(point, ModelKind::Linear, &state).cabinet_n
        };
        let rest = at(None);
        self.rest.set_lane(lane, &rest.map(N));
        for k in 0..4 {
            let (by_place, by_speed) = (at(Some(TUB[k])), at(Some(COORDINATES + TUB[k])));
            for i in 0..3 {
                self.by_place[i][k].0.set(lane, by_place[i] - rest[i]);
                self.by_speed[i][k].0.set(lane, by_speed[i] - rest[i]);
            }
        }
    }
}
