//! Bounds the swing of hinge and bearings after jumps of the drum's acceleration.
//!
//! A jump of the acceleration is a jump of the loads of everything that turns with the drum:
//! unbalances, and bodies that their own weight holds off the spin axis. Every method resolves the
//! slow modes. Hinge and bearings have no damping of their own, so that they swing about their new
//! deflection after the jump. Steps longer than the periods do not resolve this swing. Two runs
//! with such steps lose the same part of it, so that their comparison does not show the error.
//!
//! The static deflection under the jump bounds the swing, without eigenvalues. The suspension is
//! slow, so that the machine is taken as free: the load is that of the linear model (Eq. 41) less
//! the part that accelerates the machine as a rigid body (inertia relief).
//!
//! While the drum stands, the machine has constant coefficients, and the swing decays at least as
//! fast as its slowest mode.

use core::f64::consts::PI;

use lane_ode::{Lu, N};
use std::sync::Arc;

use crate::channel::{CHANNELS, ChannelKind};
use crate::coordinates::{
    HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW,
    TUB_Z,
};
use crate::machine::spin::SpinSegment;
use crate::{COORDINATES, Channel, Machine, Matrices, Timing};

/// The greatest swing of an undamped body after a jump of its load, as a multiple of the static
/// deflection.
const SWING_FACTOR: f64 = 2.0;

/// The coordinates of the tub, and of the shaft in the same order.
const RIGID_COORDINATE_PAIRS: [[usize; 2]; 4] =
    [[TUB_Y, SHAFT_Y], [TUB_Z, SHAFT_Z], [TUB_YAW, SHAFT_YAW], [TUB_PITCH, SHAFT_PITCH]];

/// The coordinates that deflect bearings and hinge while the tub stands still.
const ELASTIC_COORDINATES: [usize; 6] =
    [SHAFT_Y, SHAFT_Z, SHAFT_YAW, SHAFT_PITCH, HINGE_YAW, HINGE_PITCH];

/// The jump of the drum's acceleration (rad/s^2) for which deflections are computed. They are
/// proportional to it, because loads and model are linear.
const UNIT_JUMP_RAD_PER_S2: f64 = 1.0;

/// The angles (rad) of the unbalance at which loads are computed. A load turns with the drum or is
/// fixed in direction, so that four angles include its greatest components along both axes.
const ANGLES_RAD: [f64; 4] = [0.0, 0.5 * PI, PI, 1.5 * PI];

/// The deflections of the machine without its suspension: of the fronts of drum and tub, and the
/// tub's angle.
#[derive(Clone, Copy, Debug, Default)]
struct FrontDeflection {
    drum_front_m: f64,
    tub_front_m: f64,
    tub_angle_rad: f64,
    /// The speed of the tub's front in the free vibration that begins with this deflection.
    tub_front_m_per_s: f64,
}

impl FrontDeflection {
    /// Returns the component-wise maximum.
    fn max(self, other: Self) -> Self {
        Self {
            drum_front_m: self.drum_front_m.max(other.drum_front_m),
            tub_front_m: self.tub_front_m.max(other.tub_front_m),
            tub_angle_rad: self.tub_angle_rad.max(other.tub_angle_rad),
            tub_front_m_per_s: self.tub_front_m_per_s.max(other.tub_front_m_per_s),
        }
    }
}

/// The jumps of the drum's acceleration in a run.
#[derive(Clone, Debug)]
pub(crate) struct AccelerationJumps {
    /// The jumps before the end of the window, grouped by the time for which the drum stands
    /// after them.
    before_window_end: Vec<JumpGroup>,
    /// The sum of all jumps of the run (rad/s^2).
    sum_rad_per_s2: f64,
}

/// Jumps after which the drum stands equally long until the window begins.
#[derive(Clone, Copy, Debug)]
struct JumpGroup {
    sum_rad_per_s2: f64,
    standing_s: f64,
}

impl AccelerationJumps {
    /// Finds the jumps of a spin in a run.
    pub(crate) fn new(spin_segments: &[SpinSegment], timing: &Timing) -> Self {
        let [window_start_s, window_end_s] = timing.window_s;
        let sizes_rad_per_s2 = jumps_rad_per_s2(spin_segments);
        let mut jump_groups: Vec<JumpGroup> = Vec::new();
        let mut sum_rad_per_s2 = 0.0;
        let mut standing_s = 0.0;
        let mut next_start_s = f64::INFINITY;
        for (spin_segment, size_rad_per_s2) in spin_segments.iter().zip(sizes_rad_per_s2).rev() {
            let start_s = spin_segment.start_s.0;
            if spin_segment.is_standing() {
                standing_s += (next_start_s.min(window_start_s) - start_s).max(0.0);
            }
            next_start_s = start_s;
            if start_s < timing.end_s {
                sum_rad_per_s2 += size_rad_per_s2;
            }
            if start_s >= window_end_s {
                continue;
            }
            match jump_groups.last_mut().filter(|group| group.standing_s == standing_s) {
                Some(group) => group.sum_rad_per_s2 += size_rad_per_s2,
                None => jump_groups.push(JumpGroup { sum_rad_per_s2: size_rad_per_s2, standing_s }),
            }
        }
        Self { before_window_end: jump_groups, sum_rad_per_s2 }
    }

    /// Whether the drum stands after a jump and before the window.
    fn is_any_before_standstill(&self) -> bool {
        let is_before_standstill =
            |group: &JumpGroup| group.standing_s > 0.0 && group.sum_rad_per_s2 > 0.0;
        self.before_window_end.iter().any(is_before_standstill)
    }

    /// Returns the sum of the jumps before the window's end (rad/s^2), each reduced by the decay of
    /// the swing (1/s) while the drum stands.
    fn reduced_sum_rad_per_s2(&self, decay_per_s: f64) -> f64 {
        let reduced_jump =
            |group: &JumpGroup| group.sum_rad_per_s2 * libm::exp(-decay_per_s * group.standing_s);
        self.before_window_end.iter().map(reduced_jump).sum()
    }
}

/// The greatest deflections under all jumps of the drum's acceleration.
#[derive(Clone, Debug)]
pub(crate) struct Ringing {
    jumps: Arc<AccelerationJumps>,
    /// The rate at which the swing decays while the drum stands (1/s).
    decay_per_s: f64,
    /// The deflections by a jump of [`UNIT_JUMP_RAD_PER_S2`].
    bearings_deflection: FrontDeflection,
    hinge_and_bearings_deflection: FrontDeflection,
}

/// Returns the jump of the drum's acceleration at the start of each segment of the spin (rad/s^2).
fn jumps_rad_per_s2(spin_segments: &[SpinSegment]) -> Vec<f64> {
    let mut previous_rad_per_s2 = 0.0;
    let mut acceleration_jumps = Vec::with_capacity(spin_segments.len());
    for (i, spin_segment) in spin_segments.iter().enumerate() {
        let start_rad_per_s2 = spin_segment.acceleration_rad_per_s2(spin_segment.start_s.0);
        acceleration_jumps.push((start_rad_per_s2 - previous_rad_per_s2).abs());
        if let Some(next) = spin_segments.get(i + 1) {
            previous_rad_per_s2 = spin_segment.acceleration_rad_per_s2(next.start_s.0);
        }
    }
    acceleration_jumps
}

/// The modes that a step does not resolve, because it is longer than their periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnresolvedModes {
    /// The modes of the hinge and of the bearings: the step resolves neither.
    HingeAndBearings,
    /// The modes of the bearings only: the step resolves those of the hinge.
    Bearings,
}

/// The swing of the quantities that a row reports of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// The swing of each channel in the window (m, rad), in the order of [`Channel::ALL`].
    pub channels: [f64; CHANNELS],
    /// The swing of the gap between drum and tub in the whole run (m).
    pub gap_m: f64,
    /// The speed of the tub's front by its swing in the window (m/s).
    pub tub_speed_m_per_s: f64,
}

impl Ringing {
    /// Computes the deflections under jumps of the drum's acceleration, without a decay.
    /// `matrices_at` returns the linear model's matrices at an angle (rad) and an acceleration
    /// (rad/s^2) of the drum at rest.
    pub(crate) fn new(
        machine: &Machine,
        jumps: Arc<AccelerationJumps>,
        matrices_at: impl Fn(f64, f64) -> Matrices,
    ) -> Self {
        let mut ringing = Self {
            jumps,
            decay_per_s: 0.0,
            bearings_deflection: FrontDeflection::default(),
            hinge_and_bearings_deflection: FrontDeflection::default(),
        };
        for angle_rad in ANGLES_RAD {
            let rest_matrices = matrices_at(angle_rad, 0.0);
            let jump_matrices = matrices_at(angle_rad, UNIT_JUMP_RAD_PER_S2);
            let load: [f64; COORDINATES] =
                core::array::from_fn(|i| jump_matrices.force[i] - rest_matrices.force[i]);
            // The system has no solution if bearings or hinge have no stiffness; no level is stable
            // for such a machine.
            let Some(unsuspended_machine) = UnsuspendedMachine::new(&rest_matrices) else {
                continue;
            };
            let Some(elastic_deflection) = unsuspended_machine.static_deflection(&load) else {
                continue;
            };
            let mut bearings_deflection = elastic_deflection;
            bearings_deflection[HINGE_YAW] = 0.0;
            bearings_deflection[HINGE_PITCH] = 0.0;
            ringing.bearings_deflection = ringing
                .bearings_deflection
                .max(unsuspended_machine.front_deflection(machine, &bearings_deflection));
            ringing.hinge_and_bearings_deflection = ringing
                .hinge_and_bearings_deflection
                .max(unsuspended_machine.front_deflection(machine, &elastic_deflection));
        }
        ringing
    }

    /// Whether the swing in the window depends on its decay.
    pub(crate) fn depends_on_decay(&self) -> bool {
        self.jumps.is_any_before_standstill()
    }

    /// Sets the rate at which the swing decays while the drum stands (1/s).
    pub(crate) fn set_decay(&mut self, decay_per_s: f64) {
        self.decay_per_s = decay_per_s;
    }

    /// Returns the greatest swing of each channel in the window and of the gap in the whole run, by
    /// the modes that are not resolved.
    pub(crate) fn swing(&self, unresolved_modes: UnresolvedModes) -> Swing {
        let deflection = match unresolved_modes {
            UnresolvedModes::HingeAndBearings => self.hinge_and_bearings_deflection,
            UnresolvedModes::Bearings => self.bearings_deflection,
        };
        let window_jumps_rad_per_s2 = self.jumps.reduced_sum_rad_per_s2(self.decay_per_s);
        let window_factor = SWING_FACTOR * window_jumps_rad_per_s2 / UNIT_JUMP_RAD_PER_S2;
        let run_factor = SWING_FACTOR * self.jumps.sum_rad_per_s2 / UNIT_JUMP_RAD_PER_S2;
        let channels = Channel::ALL.map(|channel| {
            window_factor
                * match channel.kind() {
                    ChannelKind::DrumPoint => deflection.drum_front_m,
                    ChannelKind::TubPoint => deflection.tub_front_m,
                    ChannelKind::TubAngle => deflection.tub_angle_rad,
                }
        });
        let gap_m = run_factor * (deflection.drum_front_m + deflection.tub_front_m);
        let tub_speed_m_per_s = window_factor * deflection.tub_front_m_per_s;
        Swing { channels, gap_m, tub_speed_m_per_s }
    }
}

/// The linear model of the machine without its suspension, which moves as a rigid body and deflects
/// bearings and hinge.
struct UnsuspendedMachine<'a> {
    matrices: &'a Matrices,
    /// The factors of the rigid body's mass matrix S' M S; each column of S has ones at a pair of
    /// [`RIGID_COORDINATE_PAIRS`].
    rigid_mass_factors: Lu<4>,
}

impl<'a> UnsuspendedMachine<'a> {
    /// Creates the free machine; `None` if it has no mass.
    fn new(matrices: &'a Matrices) -> Option<Self> {
        let rigid_mass_factors = RIGID_COORDINATE_PAIRS.map(|row| {
            RIGID_COORDINATE_PAIRS.map(|column| {
                let column_pair_sum =
                    |i: usize| matrices.mass[i][column[0]] + matrices.mass[i][column[1]];
                N(column_pair_sum(row[0]) + column_pair_sum(row[1]))
            })
        });
        Some(Self { matrices, rigid_mass_factors: Lu::new(rigid_mass_factors)? })
    }

    /// Returns the product of the mass matrix and a vector of coordinates.
    fn multiply_mass(&self, vector: &[f64; COORDINATES]) -> [f64; COORDINATES] {
        self.matrices
            .mass
            .map(|row| row.iter().zip(vector).map(|(entry, value)| entry * value).sum())
    }

    /// Returns the rigid-body acceleration a under a load f: (S' M S) a = S' f.
    fn rigid_motion(&self, load: &[f64; COORDINATES]) -> [f64; COORDINATES] {
        let rigid_force = RIGID_COORDINATE_PAIRS.map(|[tub, shaft]| N(load[tub] + load[shaft]));
        let accelerations = self.rigid_mass_factors.solve(&rigid_force);
        let mut rigid_acceleration = [0.0; COORDINATES];
        for ([tub, shaft], acceleration) in RIGID_COORDINATE_PAIRS.into_iter().zip(accelerations) {
            rigid_acceleration[tub] = acceleration.0;
            rigid_acceleration[shaft] = acceleration.0;
        }
        rigid_acceleration
    }

    /// Returns the static deflection of bearings and hinge under a load (N, N m), relative to the
    /// tub; `None` if a spring is missing.
    fn static_deflection(&self, load: &[f64; COORDINATES]) -> Option<[f64; COORDINATES]> {
        let inertia_load = self.multiply_mass(&self.rigid_motion(load));
        let stiffness = ELASTIC_COORDINATES
            .map(|i| ELASTIC_COORDINATES.map(|j| N(self.matrices.stiffness[i][j])));
        let relieved_load = ELASTIC_COORDINATES.map(|i| N(load[i] - inertia_load[i]));
        let elastic_solution = Lu::new(stiffness)?.solve(&relieved_load);
        let mut deflection = [0.0; COORDINATES];
        for (i, value) in ELASTIC_COORDINATES.into_iter().zip(elastic_solution) {
            deflection[i] = value.0;
        }
        Some(deflection)
    }

    /// Returns the deflections of the free machine if bearings and hinge deflect by
    /// `elastic_deflection`. The tub moves in the opposite direction, so that momentum is
    /// conserved.
    fn front_deflection(
        &self,
        machine: &Machine,
        elastic_deflection: &[f64; COORDINATES],
    ) -> FrontDeflection {
        let recoil = self.rigid_motion(&self.multiply_mass(elastic_deflection));
        let drum = &machine.drum;
        let tub_m = recoil[TUB_Y].hypot(recoil[TUB_Z]);
        let tub_angle_rad = recoil[TUB_YAW].hypot(recoil[TUB_PITCH]);
        let bearings_m = elastic_deflection[SHAFT_Y].hypot(elastic_deflection[SHAFT_Z]);
        let bearings_rad = elastic_deflection[SHAFT_YAW].hypot(elastic_deflection[SHAFT_PITCH]);
        let hinge_rad = elastic_deflection[HINGE_YAW].hypot(elastic_deflection[HINGE_PITCH]);
        let drum_front_m = bearings_m
            + drum.front_x_m.abs() * bearings_rad
            + (drum.front_x_m - drum.hinge_x_m).abs() * hinge_rad;
        let tub_front_m = tub_m + machine.tub.front_x_m.abs() * tub_angle_rad;
        FrontDeflection {
            drum_front_m: drum_front_m + tub_m + drum.front_x_m.abs() * tub_angle_rad,
            tub_front_m,
            tub_angle_rad,
            tub_front_m_per_s: self.frequency_rad_per_s(elastic_deflection, &recoil) * tub_front_m,
        }
    }

    /// Returns the frequency of the free vibration with the shape of an elastic deflection less the
    /// recoil of the whole machine, by Rayleigh's quotient.
    fn frequency_rad_per_s(
        &self,
        elastic_deflection: &[f64; COORDINATES],
        recoil: &[f64; COORDINATES],
    ) -> f64 {
        let shape: [f64; COORDINATES] = core::array::from_fn(|i| elastic_deflection[i] - recoil[i]);
        let momentum = self.multiply_mass(&shape);
        let modal_mass: f64 = shape.iter().zip(&momentum).map(|(x, p)| x * p).sum();
        let modal_stiffness: f64 = ELASTIC_COORDINATES
            .iter()
            .flat_map(|&i| ELASTIC_COORDINATES.map(|j| [i, j]))
            .map(|[i, j]| {
                elastic_deflection[i] * self.matrices.stiffness[i][j] * elastic_deflection[j]
            })
            .sum();
        if modal_mass > 0.0 { (modal_stiffness / modal_mass).sqrt() } else { 0.0 }
    }
}
