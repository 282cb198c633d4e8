//! The force that reaches the cabinet through springs and dampers, over lanes.

use crate::coordinates::{COORDINATES, STATES, TUB};
use crate::kind::ModelKind;
use crate::lanes::InLanes as _;
use crate::nonlinear::elements::{Elements, TubMotion};
use crate::nonlinear::frame::{Tilt, dot};
use crate::point::Point;
use crate::run::suspension::forces;
use lane_ode::{Dual, Lane, N, Peaks, Sample};

/// One of the two models' force.
enum CabinetForce<T> {
    /// Of the machine's elements, over duals for the force's derivative in time.
    Nonlinear(Elements<Dual<T>>),
    /// To first order in the deviations from equilibrium.
    Linear(Expansion<T>),
}

/// The force's three components, cabinet axes.
struct Expansion<T> {
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
    fn splat(zero: N<T>, model: ModelKind, point: &Point) -> Self {
        match model {
            ModelKind::Nonlinear => {
                Self::Nonlinear(Elements::splat(zero.constant(), &point.machine.elements))
            }
            ModelKind::Linear => {
                let mut expansion = Expansion {
                    rest: [zero; 3],
                    by_place: [[zero; 4]; 3],
                    by_speed: [[zero; 4]; 3],
                };
                for lane in 0..T::LANES {
                    expansion.set_point(lane, point);
                }
                Self::Linear(expansion)
            }
        }
    }

    /// Puts a point into one lane.
    fn set_point(&mut self, lane: usize, point: &Point) {
        match self {
            Self::Nonlinear(elements) => elements.set_lane(lane, &point.machine.elements),
            Self::Linear(expansion) => expansion.set_point(lane, point),
        }
    }

    /// The square of the force (N^2) at coordinates, speeds and accelerations of [`TUB`], with its
    /// derivative; without its curvature.
    #[inline(always)]
    fn squared(&self, tub: &[Sample<T>; 4]) -> Sample<T> {
        match self {
            Self::Nonlinear(elements) => {
                // In the order of `TUB`.
                let mut q = [tub[0].value.constant(); 4];
                let mut u = q;
                for (k, Sample { value, slope, curvature }) in tub.iter().enumerate() {
                    q[k] = N(Dual { value: value.0, slope: slope.0 });
                    u[k] = N(Dual { value: slope.0, slope: curvature.0 });
                }
                let tilt = Tilt::new(q[2], q[3]);
                let rate = tilt.motion(u[2], u[3]).rate;
                // On the tub and in its axes: as large as on the cabinet.
                let (force, _) = elements.on_tub(&TubMotion {
                    tilt: &tilt,
                    midpoint: [q[0], q[1]],
                    midpoint_velocity: [u[0], u[1]],
                    rate: &rate,
                });
                let squared = dot(&force, &force).0;
                Sample {
                    value: N(squared.value),
                    slope: N(squared.slope),
                    curvature: tub[0].value.lit(0.0),
                }
            }
            Self::Linear(expansion) => {
                let zero = tub[0].value.lit(0.0);
                let (mut value, mut slope) = (zero, zero);
                for i in 0..3 {
                    let mut force = expansion.rest[i];
                    let mut rate = zero;
                    for k in 0..4 {
                        let (by_place, by_speed) =
                            (expansion.by_place[i][k], expansion.by_speed[i][k]);
                        force += by_place * tub[k].value;
                        force += by_speed * tub[k].slope;
                        rate += by_place * tub[k].slope;
                        rate += by_speed * tub[k].curvature;
                    }
                    value += force * force;
                    slope += (2.0 * force).v() * rate;
                }
                Sample { value, slope, curvature: zero }
            }
        }
    }
}

/// The greatest force so far, over lanes.
///
/// The force has no second derivative here. So the motion between the ends of a long step is
/// interpolated first, and the force evaluated at a few places of it.
pub(crate) struct GreatestForce<T> {
    force: CabinetForce<T>,
    squared: Peaks<T, 1>,
    /// Coordinates, speeds and accelerations of [`TUB`] where the next step begins.
    last: [Sample<T>; 4],
    /// Parts that a step is cut into.
    parts: u32,
}

impl<T: Lane> GreatestForce<T> {
    /// Nothing seen yet, with the same point in every lane.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, model: ModelKind, point: &Point, parts: u32) -> Self {
        let force = CabinetForce::splat(zero, model, point);
        Self { force, squared: Peaks::new(zero), last: [Sample::still(zero, zero); 4], parts }
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.squared.reset(lane);
        self.force.set_point(lane, point);
    }

    /// The force of one lane, N.
    pub(crate) fn lane_n(&self, lane: usize) -> f64 {
        let [squared] = self.squared.lane(lane);
        squared.sqrt()
    }

    /// A state whose derivative is `dx`: at the end of a step, of which end and length (s) are
    /// given, or where a leg begins. `counts` says in which lanes it counts.
    #[inline(always)]
    pub(crate) fn see(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        counts: T::Mask,
    ) {
        let mut now = self.last;
        for (sample, q) in now.iter_mut().zip(TUB) {
            *sample = Sample { value: x[q], slope: dx[q], curvature: dx[COORDINATES + q] };
        }
        if let Some((_, length_s)) = step {
            let share = 1.0 / f64::from(self.parts);
            for part in 1..self.parts {
                let mut tub = now;
                for k in 0..4 {
                    tub[k] =
                        Sample::between(&self.last[k], &now[k], length_s, share * f64::from(part));
                }
                let squared = self.force.squared(&tub);
                self.squared.advance_by_slopes((share * length_s).v(), &[squared], counts);
            }
            let squared = self.force.squared(&now);
            self.squared.advance_by_slopes((share * length_s).v(), &[squared], counts);
        } else {
            let squared = self.force.squared(&now);
            self.squared.begin(&[squared], counts);
        }
        self.last = now;
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
