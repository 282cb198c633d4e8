//! A prepared point: the quantities that are computed once, before the point's trajectories are
//! integrated.

pub(crate) mod friction;
pub(crate) mod input;
pub(crate) mod ringing;

use crate::channel::CHANNELS;
use crate::coordinates::{TUB_PITCH, TUB_Y};
use crate::lanes::InLanes as _;
use crate::linear::outputs::{LinearOutputs, OutputLinearisation};
use crate::linear::{LinearCoefficients, Linearisation, tub_tangents};
use crate::machine::feet::Feet;
use crate::machine::spin::{SpinSegment, SpinState, segment_index};
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::equilibrium;
use crate::nonlinear::outputs::{BodyAxes, MovingCoordinates};
use crate::point::ringing::{AccelerationJumps, Ringing};
use crate::{
    COORDINATES, FrictionSpeed, Machine, Matrices, ModelKind, Spin, Swing, UnresolvedModes,
};
use core::iter::zip;
use lane_ode::{Kernel, Lane, N, Simd};
use std::sync::Arc;

/// The end of a run, its window and its checkpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// The end of the run, which starts at 0.
    pub end_s: f64,
    /// The closed interval over which amplitudes are taken, within the run.
    pub window_s: [f64; 2],
    /// The number of equal parts of the run at whose ends states are recorded; 0 for none.
    pub checkpoints: u32,
}

/// The initial distance of a perturbed run from its original (m, rad).
///
/// Basis: far above rounding, and so small that the separation of a chaotic motion grows by a
/// factor of e twenty times before it is as large as the motion. Doubling it reduces this number by
/// less than one.
const INITIAL_PERTURBATION: f64 = 1e-10;

/// The greatest deviation of a machine at rest, relative to the clearance between drum and tub (for
/// angles, to the clearance over a lever of one metre).
///
/// Basis: rounding of an equilibrium leaves about 1e-15 of the clearance, and a billionth of it has
/// no effect on any machine. Doubling it changes no row.
const REST_DEVIATION_PER_CLEARANCE: f64 = 1e-9;

/// The error of a machine without a stable static equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the machine has no stable static equilibrium: {}", self.reason())]
pub struct NoEquilibrium {
    /// The least stable rigid motion of tub and drum, if its stiffness is negative: its name, its
    /// stiffness and the unit of the stiffness.
    pub unstable_motion: Option<(&'static str, f64, &'static str)>,
}

impl NoEquilibrium {
    /// Returns the reason in words.
    fn reason(&self) -> String {
        match self.unstable_motion {
            Some((motion, stiffness, unit)) => format!(
                "loaded springs push it {motion}, with a stiffness of {stiffness:.4} {unit} there; \
                 give it a spring or a bushing that holds it against that"
            ),
            None => "its springs cannot carry its weight".to_owned(),
        }
    }
}

/// A machine and its spin, prepared for the integration of either model.
#[derive(Clone, Debug)]
pub struct Point {
    pub(crate) machine: MachineCoefficients<f64>,
    pub(crate) equilibrium: [f64; COORDINATES],
    /// The channels at the equilibrium (m, rad).
    pub(crate) channel_rest_values: [f64; CHANNELS],
    pub(crate) linear_coefficients: LinearCoefficients,
    pub(crate) linear_outputs: LinearOutputs<f64>,
    /// The speed amplitudes of the dampers with friction.
    pub(crate) friction_speeds: Vec<FrictionSpeed>,
    /// The linear model with the steepest tangents of all elements, which limits explicit steps;
    /// `None` if these are the tangents at equilibrium.
    pub(crate) steepest_model: Option<Box<LinearCoefficients>>,
    pub(crate) spin_segments: Arc<[SpinSegment]>,
    pub(crate) segments: Arc<[PlannedSegment]>,
    pub(crate) ringing: Ringing,
    /// The initial deviation of every coordinate of the nonlinear model from equilibrium (m, rad).
    pub(crate) perturbation: f64,
    /// The instants of snapshots (s).
    pub(crate) instants_s: Arc<[f64]>,
    /// The weight of all bodies (N).
    pub(crate) weight_n: f64,
    /// The distribution of loads on the cabinet's feet, if the machine has a cabinet.
    pub(crate) feet: Option<Feet>,
}

/// A part of the run between two kinks of its spin, edges of its window or checkpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlannedSegment {
    pub(crate) start_s: f64,
    pub(crate) end_s: f64,
    /// The index of the spin segment.
    pub(crate) spin_segment_index: usize,
    /// Whether the segment is within the window.
    pub(crate) is_in_window: bool,
    /// The greatest speed of the drum up to the end of the segment (rad/s).
    pub(crate) max_speed_rad_per_s: f64,
}

impl Point {
    /// Returns the coordinates at static equilibrium with the unbalance up (m, rad).
    pub const fn equilibrium(&self) -> &[f64; COORDINATES] {
        &self.equilibrium
    }

    /// Returns the sag of the tub's mass centre (m), from its position in the machine file to the
    /// static equilibrium. At the positions of the machine file springs carry no load, unless they
    /// have free lengths.
    pub fn static_sag_m(&self) -> f64 {
        let (sin_pitch, _) = N(self.equilibrium[TUB_PITCH]).sin_cos();
        -(self.machine.bodies.tub_centre_x * sin_pitch + N(self.equilibrium[TUB_Y])).0
    }

    /// Returns a bound on the swing of unresolved modes after all jumps of the drum's acceleration.
    pub fn ringing(&self, unresolved_modes: UnresolvedModes) -> Swing {
        self.ringing.swing(unresolved_modes)
    }

    /// Returns the point with an initial deviation of 1e-10 (m, rad) in every coordinate of the
    /// nonlinear model. The separation of this perturbed run distinguishes chaos from steps that
    /// are too long.
    #[must_use]
    pub fn perturbed(&self) -> Self {
        Self { perturbation: INITIAL_PERTURBATION, ..self.clone() }
    }

    /// Returns the point with the instants (s, rising) of the snapshots of
    /// [`Recorders`](crate::Recorders).
    #[must_use]
    pub fn with_snapshots_at(self, instants_s: Arc<[f64]>) -> Self {
        Self { instants_s, ..self }
    }

    /// Returns the weight of all bodies (N).
    pub const fn weight_n(&self) -> f64 {
        self.weight_n
    }

    /// Returns the gap between drum and tub at rest (m).
    pub const fn clearance_m(&self) -> f64 {
        self.machine.bodies.clearance.0
    }

    /// Returns the greatest deviation of a machine at rest (m; rad for angles).
    pub fn rest_limit_m(&self) -> f64 {
        REST_DEVIATION_PER_CLEARANCE * self.clearance_m()
    }

    /// Returns the edges of the window (s).
    pub fn window_s(&self) -> [f64; 2] {
        let window_segments = || self.segments.iter().filter(|segment| segment.is_in_window);
        let start_s = window_segments().next().map_or(0.0, |segment| segment.start_s);
        [start_s, window_segments().next_back().map_or(start_s, |segment| segment.end_s)]
    }

    /// Returns the speed amplitudes at which the linear model linearises the friction of dampers.
    pub fn friction_speeds(&self) -> &[FrictionSpeed] {
        &self.friction_speeds
    }

    /// Returns the greatest factor between the speed amplitude of a damper's friction and the
    /// damper's greatest speed (m/s, for all dampers) in a motion of this model; `None` if no
    /// friction is compared. A speed amplitude that was found from the linear motion agrees with
    /// that motion by definition. Therefore the nonlinear motion is compared only with amplitudes
    /// that the user gave.
    pub fn friction_speed_factor(&self, model: ModelKind, speeds_m_per_s: &[f64]) -> Option<f64> {
        let is_compared = |friction_speed: &&FrictionSpeed| {
            model == ModelKind::Linear || !friction_speed.is_from_motion
        };
        let speed_factor = |friction_speed: &FrictionSpeed| {
            let speed = speeds_m_per_s
                .get(friction_speed.damper_index)?
                .max(friction_speed.viscous_limit_m_per_s);
            let speed_ratio =
                friction_speed.speed_m_per_s.max(friction_speed.viscous_limit_m_per_s) / speed;
            Some(speed_ratio.max(1.0 / speed_ratio))
        };
        self.friction_speeds.iter().filter(is_compared).filter_map(speed_factor).reduce(f64::max)
    }

    /// Returns the point with other speed amplitudes (m/s) for the dampers whose amplitudes follow
    /// from the motion, in the order of these dampers.
    pub(crate) fn with_motion_friction_speeds(&self, speeds_m_per_s: &[f64]) -> Self {
        let mut remaining_speeds = speeds_m_per_s.iter().copied();
        self.with_friction_speeds(|friction_speed| {
            if friction_speed.is_from_motion { remaining_speeds.next() } else { None }
        })
    }

    /// Returns the point with a linear model without friction.
    pub(crate) fn without_friction(&self) -> Self {
        self.with_friction_speeds(|_| Some(f64::INFINITY))
    }

    /// Returns the point with other speed amplitudes (m/s) for the dampers for which `new_speed`
    /// returns one.
    fn with_friction_speeds(
        &self,
        mut new_speed: impl FnMut(&FrictionSpeed) -> Option<f64>,
    ) -> Self {
        let mut point = self.clone();
        for friction_speed in &mut point.friction_speeds {
            if let Some(speed_m_per_s) = new_speed(friction_speed) {
                friction_speed.speed_m_per_s = speed_m_per_s;
                point
                    .machine
                    .elements
                    .linearise_friction(friction_speed.damper_index, speed_m_per_s);
            }
        }
        let tangents =
            tub_tangents(&point.machine.with_viscous_friction(), &self.equilibrium.map(N));
        point.linear_coefficients = point.linear_coefficients.with_tub_tangents(tangents);
        point
    }

    /// Computes M, C, K and F of the linear model (Eq. 41) at a spin angle, speed and acceleration.
    pub fn matrices(
        &self,
        theta_rad: f64,
        speed_rad_per_s: f64,
        acceleration_rad_per_s2: f64,
    ) -> Matrices {
        let spin =
            SpinState::new(N(theta_rad).sin_cos(), N(speed_rad_per_s), N(acceleration_rad_per_s2));
        self.linear_coefficients.matrices(&self.machine.bodies, &spin)
    }
}

/// Prepares points on lanes, except for friction's speed amplitudes that depend on the motion.
///
/// # Errors
/// [`NoEquilibrium`] for each point without one.
pub(crate) fn prepare(
    points: &[(Machine, Spin)],
    timing: &Timing,
) -> Vec<Result<Point, NoEquilibrium>> {
    Simd::dispatch_narrow(PreparationKernel { points, planned_spins: plan_spins(points, timing) })
}

/// The kernel that prepares points.
struct PreparationKernel<'a> {
    points: &'a [(Machine, Spin)],
    planned_spins: Vec<PlannedSpin>,
}

impl Kernel for PreparationKernel<'_> {
    type Output = Vec<Result<Point, NoEquilibrium>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let zero = N(zero);
        let mut prepared_points = Vec::with_capacity(self.points.len());
        let mut planned_spins = self.planned_spins.into_iter();
        for group in self.points.chunks(T::LANES) {
            let mut machines: Vec<_> =
                group.iter().map(|(machine, _)| MachineCoefficients::new(machine)).collect();
            let lane_coefficients = copy_to_lanes(zero, &machines);
            let (q, solved_lanes) = zero.0.run_out_of_line(equilibrium::EquilibriumSolution {
                zero,
                machine: &lane_coefficients,
            });
            for (lane, machine) in machines.iter_mut().enumerate() {
                machine.elements.centre_free_strokes(&q.map(|q| q.0.get(lane)));
            }
            let steepest_tangents = steepest_tangents(&machines, &q);
            let viscous_machines: Vec<_> =
                machines.iter().map(MachineCoefficients::with_viscous_friction).collect();
            let linear_coefficients = zero.0.run_out_of_line(Linearisation {
                machine: &copy_to_lanes(zero, &viscous_machines),
                q: &q,
            });
            let linear_outputs = zero
                .0
                .run_out_of_line(OutputLinearisation { bodies: &lane_coefficients.bodies, q: &q });
            let zeros = [zero; COORDINATES];
            let rest_coordinates = MovingCoordinates { q, u: zeros, a: zeros };
            let spin_at_rest = SpinState::new((zero, zero.lit(1.0)), zero, zero);
            let rest_channels = BodyAxes::new(&spin_at_rest, &rest_coordinates)
                .channels(&lane_coefficients.bodies, &rest_coordinates);
            let models =
                zip(zip(machines, linear_coefficients), zip(linear_outputs, steepest_tangents));
            let inputs = zip(group, planned_spins.by_ref());
            for (lane, (model, ((machine, _), planned_spin))) in zip(models, inputs).enumerate() {
                if solved_lanes >> lane & 1 == 0 {
                    let q = q.map(|q| q.0.get(lane));
                    let unstable_motion = equilibrium::unstable_motion(&model.0.0, &q);
                    prepared_points.push(Err(NoEquilibrium { unstable_motion }));
                    continue;
                }
                let ((coefficients, linear_coefficients), (linear_outputs, steepest_tangents)) =
                    model;
                let steepest_model = steepest_tangents
                    .map(|tangents| Box::new(linear_coefficients.with_tub_tangents(tangents)));
                let matrices_at = |angle_rad: f64, acceleration_rad_per_s2: f64| {
                    let spin =
                        SpinState::new(N(angle_rad).sin_cos(), N(0.0), N(acceleration_rad_per_s2));
                    linear_coefficients.matrices(&coefficients.bodies, &spin)
                };
                prepared_points.push(Ok(Point {
                    ringing: Ringing::new(machine, planned_spin.jumps, matrices_at),
                    perturbation: 0.0,
                    instants_s: [].into(),
                    machine: coefficients,
                    equilibrium: q.map(|q| q.0.get(lane)),
                    channel_rest_values: core::array::from_fn(|i| {
                        rest_channels[i].value.0.get(lane)
                    }),
                    linear_coefficients,
                    linear_outputs,
                    friction_speeds: FrictionSpeed::for_dampers(machine),
                    steepest_model,
                    spin_segments: planned_spin.spin_segments,
                    segments: planned_spin.segments,
                    weight_n: machine.weight_n(),
                    feet: Feet::new(machine),
                }));
            }
        }
        prepared_points
    }
}

/// Copies machines into lanes, and the first machine also into the remaining lanes.
#[inline(always)]
fn copy_to_lanes<T: Lane>(
    zero: N<T>,
    machines: &[MachineCoefficients<f64>],
) -> MachineCoefficients<T> {
    let mut lane_coefficients = MachineCoefficients::splat(zero, &machines[0]);
    for (lane, machine) in machines.iter().enumerate() {
        lane_coefficients.set_lane(lane, machine);
    }
    lane_coefficients
}

/// Computes the stiffness and the damping of each machine's tub with the steepest tangents of all
/// elements, at equilibria `q`; `None` if these are the tangents at equilibrium.
fn steepest_tangents<T: Lane>(
    machines: &[MachineCoefficients<f64>],
    q: &[N<T>; COORDINATES],
) -> Vec<Option<[[[N<f64>; 4]; 4]; 2]>> {
    let tangents = |(lane, machine): (usize, &MachineCoefficients<f64>)| {
        let q = q.map(|q| q.0.get(lane));
        let elements = machine.elements.with_steepest_tangents(&q)?;
        Some(tub_tangents(&MachineCoefficients { elements, bodies: machine.bodies }, &q.map(N)))
    };
    machines.iter().enumerate().map(tangents).collect()
}

/// The spin of a trajectory, and the segments of the run.
#[derive(Clone)]
struct PlannedSpin {
    spin_segments: Arc<[SpinSegment]>,
    segments: Arc<[PlannedSegment]>,
    jumps: Arc<AccelerationJumps>,
}

/// Plans the spin of each point. Consecutive points with the same spin share a plan, because a
/// table may have thousands of rows.
fn plan_spins(points: &[(Machine, Spin)], timing: &Timing) -> Vec<PlannedSpin> {
    let mut planned_spins: Vec<PlannedSpin> = Vec::with_capacity(points.len());
    for (k, (_, spin)) in points.iter().enumerate() {
        let shared_plan =
            if k > 0 && points[k - 1].1 == *spin { planned_spins.last().cloned() } else { None };
        planned_spins.push(shared_plan.unwrap_or_else(|| {
            let spin_segments = spin.segments();
            let jumps = AccelerationJumps::new(&spin_segments, timing).into();
            let segments = plan_segments(&spin_segments, timing).into();
            PlannedSpin { segments, jumps, spin_segments: spin_segments.into() }
        }));
    }
    planned_spins
}

/// Divides the run into segments at every kink of the spin, edge of the window and checkpoint.
pub(crate) fn plan_segments(spin_segments: &[SpinSegment], timing: &Timing) -> Vec<PlannedSegment> {
    let [from, to] = timing.window_s;
    let boundary_times_s =
        spin_segments.iter().map(|s| s.start_s.0).chain([0.0, from, to, timing.end_s]);
    let checkpoint_count = f64::from(timing.checkpoints);
    let boundary_times_s = boundary_times_s
        .chain((1..timing.checkpoints).map(|k| timing.end_s * (f64::from(k) / checkpoint_count)));
    let mut sorted_times_s: Vec<f64> =
        boundary_times_s.filter(|t| (0.0..=timing.end_s).contains(t)).collect();
    sorted_times_s.sort_by(f64::total_cmp);
    sorted_times_s.dedup();
    let mut max_speed_rad_per_s = 0.0_f64;
    sorted_times_s
        .windows(2)
        .map(|pair| {
            let start_s = pair[0];
            let end_s = pair[1];
            let spin_segment_index = segment_index(spin_segments, start_s);
            // The speed is monotonic within a spin segment.
            for time_s in [start_s, end_s] {
                max_speed_rad_per_s = max_speed_rad_per_s
                    .max(spin_segments[spin_segment_index].speed_rad_per_s(time_s).abs());
            }
            let is_in_window = from <= start_s && end_s <= to;
            PlannedSegment { start_s, end_s, spin_segment_index, is_in_window, max_speed_rad_per_s }
        })
        .collect()
}
