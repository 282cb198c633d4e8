//! A grid point made ready: everything that is computed once, before its trajectories start.

pub(crate) mod friction;
pub(crate) mod ringing;

use crate::channel::CHANNELS;
use crate::coordinates::{TUB_PITCH, TUB_Y};
use crate::lanes::InLanes as _;
use crate::linear::outputs::{LinearOutputs, LineariseOutputs};
use crate::linear::{LinearPoint, Linearise, tub_tangents};
use crate::machine::feet::Feet;
use crate::machine::spin::{SpinState, SpinStretch, stretch_at};
use crate::nonlinear::coefficients::Coefficients;
use crate::nonlinear::equilibrium;
use crate::nonlinear::outputs::{Axes, MovingCoordinates};
use crate::point::ringing::{Ringing, jumps_rad_per_s2};
use crate::{
    COORDINATES, FrictionSpeed, Machine, Matrices, ModelKind, Spin, Swing, UnresolvedModes,
};
use core::iter::zip;
use lane_ode::{Kernel, Lane, N, Simd};
use std::sync::Arc;

/// When a trajectory ends, and when its amplitudes are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// The run is from 0 to here.
    pub end_s: f64,
    /// Amplitudes are taken over this closed interval within the run.
    pub window_s: [f64; 2],
    /// Into how many even parts the run is cut, so that states at their ends can be compared; 0 for
    /// none.
    pub checkpoints: u32,
}

/// How far a twin's start is from its original's (m, rad).
const NUDGE: f64 = 1e-10;

/// The machine has no static equilibrium, or none that is stable.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the machine has no stable static equilibrium: {}", self.reason())]
pub struct NoEquilibrium {
    /// The motion of tub and drum together against which springs and weight hold least, if they
    /// push along it: its name, its stiffness and the stiffness's unit.
    pub unstable: Option<(&'static str, f64, &'static str)>,
}

impl NoEquilibrium {
    /// Returns the reason in words.
    fn reason(&self) -> String {
        match self.unstable {
            Some((motion, stiffness, unit)) => format!(
                "loaded springs push it {motion}, with a stiffness of {stiffness:.4} {unit} there; \
                 give it a spring or a bushing that holds it against that"
            ),
            None => "its springs cannot carry its weight".to_owned(),
        }
    }
}

/// A machine and its spin, ready to be integrated by either model.
#[derive(Clone, Debug)]
pub struct Point {
    pub(crate) machine: Coefficients<f64>,
    pub(crate) equilibrium: [f64; COORDINATES],
    /// Channels at the equilibrium.
    pub(crate) rest: [f64; CHANNELS],
    pub(crate) linear: LinearPoint,
    pub(crate) linear_outputs: LinearOutputs<f64>,
    /// Of the dampers with friction.
    pub(crate) friction_speeds: Vec<FrictionSpeed>,
    /// The linear model of the machine at its steepest, if its elements are not linear along their
    /// lines: what explicit steps must bear.
    pub(crate) steepest: Option<Box<LinearPoint>>,
    pub(crate) stretches: Arc<[SpinStretch]>,
    pub(crate) legs: Arc<[PlannedLeg]>,
    pub(crate) ringing: Ringing,
    /// By how much the nonlinear model starts beside its equilibrium, in every coordinate (m, rad).
    pub(crate) nudge: f64,
    /// When all outputs are recorded, if they are (s).
    pub(crate) instants_s: Arc<[f64]>,
    /// Weight of all bodies (N).
    pub(crate) weight_n: f64,
    /// What the cabinet's feet take of its loads, if it is described.
    pub(crate) feet: Option<Feet>,
}

/// A stretch of the run between two kinks: of the spin, or of what is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlannedLeg {
    pub(crate) start_s: f64,
    pub(crate) end_s: f64,
    /// Which stretch of the spin holds.
    pub(crate) stretch: usize,
    /// Whether amplitudes are taken.
    pub(crate) in_window: bool,
    /// The drum's greatest speed so far, at its end (rad/s).
    pub(crate) fastest_rad_per_s: f64,
}

impl Point {
    /// Coordinates at static equilibrium (m, rad), unbalance up.
    pub const fn equilibrium(&self) -> &[f64; COORDINATES] {
        &self.equilibrium
    }

    /// How far the tub's mass centre sinks (m) from its place in the machine file to the static
    /// equilibrium. In the machine file springs carry no load, unless they have free lengths.
    pub fn static_sag_m(&self) -> f64 {
        let (sin_pitch, _) = N(self.equilibrium[TUB_PITCH]).sin_cos();
        -(self.machine.bodies.tub_centre * sin_pitch + N(self.equilibrium[TUB_Y])).0
    }

    /// Returns a bound on the swing of unresolved modes after all jumps of the drum's acceleration.
    pub fn ringing(&self, unresolved: UnresolvedModes) -> Swing {
        self.ringing.swing(unresolved)
    }

    /// The same point, started 1e-10 (m, rad) beside its equilibrium in every coordinate of the
    /// nonlinear model: a near twin, whose departure tells chaos from a step that is too long.
    #[must_use]
    pub fn nudged(&self) -> Self {
        Self { nudge: NUDGE, ..self.clone() }
    }

    /// The same point, with instants (s, rising) at which [`Recorders`](crate::Recorders) can have
    /// its outputs recorded.
    #[must_use]
    pub fn seen_at(self, instants_s: Arc<[f64]>) -> Self {
        Self { instants_s, ..self }
    }

    /// Weight (N) of what the springs carry.
    pub const fn weight_n(&self) -> f64 {
        self.weight_n
    }

    /// The gap between drum and tub at rest (m).
    pub const fn clearance_m(&self) -> f64 {
        self.machine.bodies.clearance.0
    }

    /// The window's edges (s).
    pub fn window_s(&self) -> [f64; 2] {
        let inside = || self.legs.iter().filter(|leg| leg.in_window);
        let from = inside().next().map_or(0.0, |leg| leg.start_s);
        [from, inside().next_back().map_or(from, |leg| leg.end_s)]
    }

    /// At which speed amplitudes the linear model takes the friction of the dampers that have it.
    pub fn friction_speeds(&self) -> &[FrictionSpeed] {
        &self.friction_speeds
    }

    /// By what factor these are off from the speeds (m/s) that the dampers had in a motion of this
    /// model, the greatest of all; `None` if there are none. Own speeds are the linear motion's by
    /// definition, so the nonlinear one is compared with given ones alone.
    pub fn friction_speed_off(&self, model: ModelKind, occurred_m_per_s: &[f64]) -> Option<f64> {
        let of_model = |taken: &&FrictionSpeed| model == ModelKind::Linear || !taken.is_own;
        let off = self.friction_speeds.iter().filter(of_model).filter_map(|taken| {
            let occurred = occurred_m_per_s.get(taken.damper)?.max(taken.least_m_per_s);
            let quotient = taken.speed_m_per_s.max(taken.least_m_per_s) / occurred;
            Some(quotient.max(1.0 / quotient))
        });
        off.reduce(f64::max)
    }

    /// The same point with friction taken at other own speeds, in their order.
    pub(crate) fn at_own_speeds(&self, speeds_m_per_s: &[f64]) -> Self {
        let mut own = speeds_m_per_s.iter().copied();
        self.at_speeds(|taken| if taken.is_own { own.next() } else { None })
    }

    /// The same point whose linear model has no friction.
    pub(crate) fn without_friction(&self) -> Self {
        self.at_speeds(|_| Some(f64::INFINITY))
    }

    /// The same point with friction taken at other speeds (m/s), where there are others.
    fn at_speeds(&self, mut other: impl FnMut(&FrictionSpeed) -> Option<f64>) -> Self {
        let mut point = self.clone();
        for taken in &mut point.friction_speeds {
            if let Some(speed_m_per_s) = other(taken) {
                taken.speed_m_per_s = speed_m_per_s;
                point.machine.elements.linearise_friction(taken.damper, speed_m_per_s);
            }
        }
        let tangents =
            tub_tangents(&point.machine.with_viscous_friction(), &self.equilibrium.map(N));
        point.linear = point.linear.with_tub(tangents);
        point
    }

    /// M, C, K and F of the linear model (Eq. 41) at spin angle `theta_rad`, speed and
    /// acceleration.
    pub fn matrices(
        &self,
        theta_rad: f64,
        speed_rad_per_s: f64,
        acceleration_rad_per_s2: f64,
    ) -> Matrices {
        let spin =
            SpinState::new(N(theta_rad).sin_cos(), N(speed_rad_per_s), N(acceleration_rad_per_s2));
        self.linear.matrices(&self.machine.bodies, &spin)
    }
}

/// Makes points ready, on lanes, but for speeds at which friction is taken that the motion has.
///
/// # Errors
/// Per point: [`NoEquilibrium`].
pub(crate) fn prepare(
    points: &[(Machine, Spin)],
    timing: &Timing,
) -> Vec<Result<Point, NoEquilibrium>> {
    Simd::dispatch_narrow(Prepare { points, courses: courses(points, timing) })
}

struct Prepare<'a> {
    points: &'a [(Machine, Spin)],
    courses: Vec<Course>,
}

impl Kernel for Prepare<'_> {
    type Output = Vec<Result<Point, NoEquilibrium>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let zero = N(zero);
        let mut ready = Vec::with_capacity(self.points.len());
        let mut courses = self.courses.into_iter();
        for group in self.points.chunks(T::LANES) {
            let machines: Vec<_> =
                group.iter().map(|(machine, _)| Coefficients::new(machine)).collect();
            let lanes = in_lanes(zero, &machines);
            let (q, found) = zero.0.aside(equilibrium::SolveEquilibrium { zero, machine: &lanes });
            let steepest = steepest(&machines, &q);
            let viscous: Vec<_> =
                machines.iter().map(Coefficients::with_viscous_friction).collect();
            let linear = zero.0.aside(Linearise { machine: &in_lanes(zero, &viscous), q: &q });
            let linear_outputs = zero.0.aside(LineariseOutputs { bodies: &lanes.bodies, q: &q });
            let still = [zero; COORDINATES];
            let at_rest = MovingCoordinates { q, u: still, a: still };
            let unbalance_up = SpinState::new((zero, zero.lit(1.0)), zero, zero);
            let rest = Axes::new(&unbalance_up, &at_rest).channels(&lanes.bodies, &at_rest);
            let models = zip(zip(machines, linear), zip(linear_outputs, steepest));
            let given = zip(group, courses.by_ref());
            for (lane, (model, ((machine, _), course))) in zip(models, given).enumerate() {
                if found >> lane & 1 == 0 {
                    let q = q.map(|q| q.0.get(lane));
                    let unstable = equilibrium::unstable_motion(&model.0.0, &q);
                    ready.push(Err(NoEquilibrium { unstable }));
                    continue;
                }
                let ((coefficients, linear), (linear_outputs, steepest)) = model;
                let steepest = steepest.map(|tangents| Box::new(linear.with_tub(tangents)));
                let matrices_at = |angle_rad: f64, acceleration_rad_per_s2: f64| {
                    let spin =
                        SpinState::new(N(angle_rad).sin_cos(), N(0.0), N(acceleration_rad_per_s2));
                    linear.matrices(&coefficients.bodies, &spin)
                };
                ready.push(Ok(Point {
                    ringing: Ringing::new(machine, course.jumps_rad_per_s2, matrices_at),
                    nudge: 0.0,
                    instants_s: [].into(),
                    machine: coefficients,
                    equilibrium: q.map(|q| q.0.get(lane)),
                    rest: core::array::from_fn(|i| rest[i].value.0.get(lane)),
                    linear,
                    linear_outputs,
                    friction_speeds: FrictionSpeed::all(machine),
                    steepest,
                    stretches: course.stretches,
                    legs: course.legs,
                    weight_n: machine.weight_n(),
                    feet: Feet::new(machine),
                }));
            }
        }
        ready
    }
}

/// Machines in lanes, the first also in those beyond the last.
#[inline(always)]
fn in_lanes<T: Lane>(zero: N<T>, machines: &[Coefficients<f64>]) -> Coefficients<T> {
    let mut lanes = Coefficients::splat(zero, &machines[0]);
    for (lane, machine) in machines.iter().enumerate() {
        lanes.set_lane(lane, machine);
    }
    lanes
}

/// Stiffness and damping of each machine's tub at its steepest, with equilibria `q`; `None` where
/// they are those of its linear model.
fn steepest<T: Lane>(
    machines: &[Coefficients<f64>],
    q: &[N<T>; COORDINATES],
) -> Vec<Option<[[[N<f64>; 4]; 4]; 2]>> {
    let tangents = |(lane, machine): (usize, &Coefficients<f64>)| {
        let q = q.map(|q| q.0.get(lane));
        let elements = machine.elements.steepest(&q)?;
        Some(tub_tangents(&Coefficients { elements, bodies: machine.bodies }, &q.map(N)))
    };
    machines.iter().enumerate().map(tangents).collect()
}

/// The course of a trajectory's spin.
#[derive(Clone)]
struct Course {
    stretches: Arc<[SpinStretch]>,
    legs: Arc<[PlannedLeg]>,
    /// All jumps of the drum's acceleration, added.
    jumps_rad_per_s2: f64,
}

/// One per point. Neighbours with the same spin share it, because a table may have thousands of
/// rows.
fn courses(points: &[(Machine, Spin)], timing: &Timing) -> Vec<Course> {
    let mut courses: Vec<Course> = Vec::with_capacity(points.len());
    for (k, (_, spin)) in points.iter().enumerate() {
        let shared = if k > 0 && points[k - 1].1 == *spin { courses.last().cloned() } else { None };
        courses.push(shared.unwrap_or_else(|| {
            let stretches = spin.stretches();
            let jumps_rad_per_s2 = jumps_rad_per_s2(&stretches, timing.end_s);
            let legs = legs(&stretches, timing).into();
            Course { legs, jumps_rad_per_s2, stretches: stretches.into() }
        }));
    }
    courses
}

/// The run cut at every kink.
pub(crate) fn legs(stretches: &[SpinStretch], timing: &Timing) -> Vec<PlannedLeg> {
    let [from, to] = timing.window_s;
    let kinks = stretches.iter().map(|s| s.start_s.0).chain([0.0, from, to, timing.end_s]);
    let parts = f64::from(timing.checkpoints);
    let kinks = kinks.chain((1..timing.checkpoints).map(|k| timing.end_s * (f64::from(k) / parts)));
    let mut times: Vec<f64> = kinks.filter(|t| (0.0..=timing.end_s).contains(t)).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let mut fastest_rad_per_s = 0.0_f64;
    times
        .windows(2)
        .map(|pair| {
            let (start_s, end_s) = (pair[0], pair[1]);
            let stretch = stretch_at(stretches, start_s);
            // Within a stretch the speed rises or falls all the way.
            for time_s in [start_s, end_s] {
                fastest_rad_per_s =
                    fastest_rad_per_s.max(stretches[stretch].speed_rad_per_s(time_s).abs());
            }
            let in_window = from <= start_s && end_s <= to;
            PlannedLeg { start_s, end_s, stretch, in_window, fastest_rad_per_s }
        })
        .collect()
}
