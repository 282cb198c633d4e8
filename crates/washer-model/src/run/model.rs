//! The two models as systems of ordinary differential equations over lanes.

use crate::channel::CHANNELS;
use crate::coordinates::{FIRST_ANGLE, STATES, TUB_COORDINATES};
use crate::lanes::InLanes;
use crate::linear::outputs::{LinearMotion, LinearOutputs};
use crate::linear::rotor_terms::RotorCoefficients;
use crate::linear::step::{self, RotorArrays, StepConstants};
use crate::machine::parameters::MAX_COORDINATE_M;
use crate::machine::spin::{SpinSegment, SpinSegmentLanes, SpinState};
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::coupling::{Coupling, Sag};
use crate::nonlinear::elements::TubMotion;
use crate::nonlinear::elements::corners::CornerForce;
use crate::nonlinear::implicit_stage::solve_implicit_stage;
use crate::nonlinear::outputs::{BodyAxes, MovingCoordinates, RADIAL_COMPONENTS};
use crate::{COORDINATES, Caps, Point, nonlinear};
use core::f64::consts::FRAC_PI_2;
use lane_ode::{Lane, N, Sample, SemiImplicit, System};

/// The nonlinear or the linear model over lanes. The springs of bearings and hinge are the stiff
/// part.
pub(crate) trait LaneModel<T: Lane>: SemiImplicit<T, STATES> {
    /// Creates the model with the same point in every lane.
    fn splat(zero: N<T>, point: &Point, coupling: Coupling<T>) -> Self;
    /// Sets the point of one lane.
    fn set_point(&mut self, lane: usize, point: &Point);
    /// Sets the spin segment of one lane.
    fn set_spin(&mut self, lane: usize, spin_segment: &SpinSegment);
    /// Sets the caps of one lane.
    fn set_caps(&mut self, lane: usize, caps: &Caps);
    /// Widens the corners of forces that depend on distances to a width (m), in one lane.
    fn widen_corners(&mut self, _lane: usize, _width_m: f64) {}
    /// Returns the state at rest, from which trajectories start.
    fn rest_state(point: &Point) -> [f64; STATES];
    /// Appends the forces with corners at a state to a list, if the model has any.
    fn append_corner_forces(&self, _x: &[N<T>; STATES], _forces: &mut Vec<CornerForce<T>>) {}
    /// Computes the position of the drum's front centre relative to the tub axis, and if
    /// `with_channels`, the channels' deviations from equilibrium. `dx` is the state's derivative.
    fn observe(
        &self,
        forcing: &Self::Forcing,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        with_channels: bool,
    ) -> ([Sample<T>; RADIAL_COMPONENTS], Option<[Sample<T>; CHANNELS]>);
}

/// Returns the coordinates with two derivatives, from a state and its derivative.
#[inline(always)]
fn moving_coordinates<T: Copy>(x: &[N<T>; STATES], dx: &[N<T>; STATES]) -> MovingCoordinates<T> {
    let (q, u) = split_state(x);
    let (_, a) = split_state(dx);
    MovingCoordinates { q: *q, u: *u, a: *a }
}

/// Splits a state, or its derivative, into the parts of coordinates and of speeds, without a copy.
#[inline(always)]
pub(crate) fn split_state<T>(x: &[N<T>; STATES]) -> (&[N<T>; COORDINATES], &[N<T>; COORDINATES]) {
    let (parts, _) = x.as_chunks();
    (&parts[0], &parts[1])
}

/// Returns the tub's coordinates with two derivatives, from a state and its derivative.
#[inline(always)]
pub(super) fn tub_samples<T: Copy>(x: &[N<T>; STATES], dx: &[N<T>; STATES]) -> [Sample<T>; 4] {
    TUB_COORDINATES.map(|q| Sample { value: x[q], slope: dx[q], curvature: dx[COORDINATES + q] })
}

/// Joins speeds and accelerations to the derivative of a state.
#[inline(always)]
fn join_derivative<T: Copy>(u: &[N<T>; COORDINATES], a: &[N<T>; COORDINATES]) -> [N<T>; STATES] {
    core::array::from_fn(|i| if i < COORDINATES { u[i] } else { a[i - COORDINATES] })
}

/// Returns the lanes whose states are in the range of the model: the sum of squares over all
/// coordinates, each divided by its limit (a quarter turn or [`MAX_COORDINATE_M`]), is less than 1.
#[inline(always)]
fn in_range<T: Lane>(x: &[N<T>; STATES]) -> T::Mask {
    // A single comparison of the sum is enough; NaN and infinity fail it too.
    let mut sum_of_squares = x[0].lit(0.0);
    for (i, q) in x[..COORDINATES].iter().enumerate() {
        let limit = if i < FIRST_ANGLE { MAX_COORDINATE_M } else { FRAC_PI_2 };
        let relative_coordinate = (*q * (1.0 / limit)).v();
        sum_of_squares += relative_coordinate * relative_coordinate;
    }
    sum_of_squares.0.less(sum_of_squares.lit(1.0).0)
}

/// The nonlinear model.
pub(crate) struct NonlinearModel<T> {
    coupling: Coupling<T>,
    machine: MachineCoefficients<T>,
    spin: SpinSegmentLanes<T>,
    /// The channels at the static equilibrium.
    channel_rest_values: [N<T>; CHANNELS],
    sag: Sag<T>,
}

impl<T: Lane> System<T, STATES> for NonlinearModel<T> {
    type Forcing = SpinState<T>;

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> SpinState<T> {
        self.spin.state_at(t_s)
    }

    #[inline(always)]
    fn derivative(&self, spin: &SpinState<T>, x: &[N<T>; STATES]) -> [N<T>; STATES] {
        let (q, u) = split_state(x);
        let Self { machine, coupling, sag, .. } = self;
        join_derivative(u, &nonlinear::accelerations(machine, coupling, sag, spin, q, u))
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; STATES]) -> T::Mask {
        in_range(x)
    }
}

/// Requires that bearings and hinge are not capped.
impl<T: Lane> SemiImplicit<T, STATES> for NonlinearModel<T> {
    #[inline(always)]
    fn solve_implicit_stage(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
        r: &[N<T>; STATES],
        g_s: N<T>,
    ) -> [N<T>; STATES] {
        let (q, u) = split_state(x);
        solve_implicit_stage(&self.machine, spin, q, u, r, g_s)
    }
}

impl<T: Lane> NonlinearModel<T> {
    /// Computes the motions on which forces with corners depend: depth (m) and speed (m/s) of each.
    #[inline(always)]
    pub(crate) fn corner_motions(&self, x: &[N<T>; STATES]) -> Vec<[N<T>; 2]> {
        let tub = TubMotion::new(
            &TUB_COORDINATES.map(|i| x[i]),
            &TUB_COORDINATES.map(|i| x[COORDINATES + i]),
        );
        self.machine.elements.corner_motions(&tub)
    }

    /// Computes the accelerations due to a unit of generalised force on each of the tub's
    /// coordinates.
    #[inline(always)]
    pub(crate) fn accelerations_per_load(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
    ) -> [[N<T>; COORDINATES]; TUB_COORDINATES.len()] {
        let (q, u) = split_state(x);
        nonlinear::accelerations_per_load(&self.machine, &self.coupling, &self.sag, spin, q, u)
    }
}

impl<T: Lane> LaneModel<T> for NonlinearModel<T> {
    #[inline(always)]
    fn splat(zero: N<T>, point: &Point, coupling: Coupling<T>) -> Self {
        Self {
            coupling,
            machine: MachineCoefficients::splat(zero, &point.machine),
            spin: SpinSegmentLanes::splat(zero, &point.spin_segments[0]),
            channel_rest_values: InLanes::splat(zero, &point.channel_rest_values.map(N)),
            sag: Sag::splat(zero, &Sag::new(&point.equilibrium)),
        }
    }

    fn set_point(&mut self, lane: usize, point: &Point) {
        self.machine.set_lane(lane, &point.machine);
        self.channel_rest_values.set_lane(lane, &point.channel_rest_values.map(N));
        self.sag.set_lane(lane, &Sag::new(&point.equilibrium));
    }

    fn set_spin(&mut self, lane: usize, spin_segment: &SpinSegment) {
        self.spin.set_lane(lane, spin_segment);
    }

    fn set_caps(&mut self, lane: usize, caps: &Caps) {
        self.coupling.set_caps(lane, caps);
    }

    fn widen_corners(&mut self, lane: usize, width_m: f64) {
        self.machine.elements.widen_corners(lane, width_m);
    }

    fn rest_state(point: &Point) -> [f64; STATES] {
        let perturbed_coordinate = |i: usize| point.equilibrium[i] + point.perturbation;
        core::array::from_fn(|i| if i < COORDINATES { perturbed_coordinate(i) } else { 0.0 })
    }

    #[inline(always)]
    fn append_corner_forces(&self, x: &[N<T>; STATES], forces: &mut Vec<CornerForce<T>>) {
        self.machine.elements.append_corner_forces(&self.corner_motions(x), forces);
    }

    #[inline(always)]
    fn observe(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        with_channels: bool,
    ) -> ([Sample<T>; RADIAL_COMPONENTS], Option<[Sample<T>; CHANNELS]>) {
        let motion = moving_coordinates(x, dx);
        let axes = BodyAxes::new(spin, &motion);
        let bodies = &self.machine.bodies;
        let mut channels = None;
        if with_channels {
            let mut samples = axes.channels(bodies, &motion);
            for i in 0..CHANNELS {
                samples[i].value -= self.channel_rest_values[i];
            }
            channels = Some(samples);
        }
        (axes.radial_position(bodies, &motion), channels)
    }
}

/// The linear model.
pub(crate) struct LinearModel<T> {
    coupling: Coupling<T>,
    flexure_stiffness: N<T>,
    constants: StepConstants<T>,
    rotor_coefficients: RotorCoefficients<T>,
    /// The hinge's coordinates q9 and q10 at equilibrium (rad).
    sag: [N<T>; 2],
    outputs: LinearOutputs<T>,
    spin: SpinSegmentLanes<T>,
}

/// The linear model's functions of time at an instant.
#[derive(Clone, Copy)]
pub(crate) struct LinearForcing<T> {
    spin: SpinState<T>,
    rotor: RotorArrays<T>,
}

impl<T: Lane> System<T, STATES> for LinearModel<T> {
    type Forcing = LinearForcing<T>;

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> LinearForcing<T> {
        let spin = self.spin.state_at(t_s);
        let hinge_mass = self.coupling.hinge_mass(self.flexure_stiffness, &spin, self.sag);
        let rotor = RotorArrays::new(
            &self.constants,
            &self.coupling,
            &self.rotor_coefficients,
            &spin,
            hinge_mass,
        );
        LinearForcing { spin, rotor }
    }

    #[inline(always)]
    fn update_forcing(&self, t_s: N<T>, forcing: &mut LinearForcing<T>) {
        forcing.spin = self.spin.state_at(t_s);
        let hinge_mass = self.coupling.hinge_mass(self.flexure_stiffness, &forcing.spin, self.sag);
        let Self { constants, coupling, rotor_coefficients, .. } = self;
        forcing.rotor.update(constants, coupling, rotor_coefficients, &forcing.spin, hinge_mass);
    }

    #[inline(always)]
    fn derivative(&self, forcing: &LinearForcing<T>, x: &[N<T>; STATES]) -> [N<T>; STATES] {
        let (q, u) = split_state(x);
        join_derivative(
            u,
            &step::accelerations(&self.constants, &self.coupling, &forcing.rotor, q, u),
        )
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; STATES]) -> T::Mask {
        in_range(x)
    }
}

/// Requires that bearings and hinge are not capped.
impl<T: Lane> SemiImplicit<T, STATES> for LinearModel<T> {
    #[inline(always)]
    fn solve_implicit_stage(
        &self,
        forcing: &LinearForcing<T>,
        x: &[N<T>; STATES],
        r: &[N<T>; STATES],
        g_s: N<T>,
    ) -> [N<T>; STATES] {
        let (q, u) = split_state(x);
        let Self { constants, rotor_coefficients, flexure_stiffness, .. } = self;
        step::solve_implicit_stage(
            constants,
            rotor_coefficients,
            *flexure_stiffness,
            &forcing.spin,
            (q, u),
            r,
            g_s,
        )
    }
}

fn step_constants(point: &Point) -> StepConstants<f64> {
    StepConstants::new(&point.machine.bodies, &point.linear_coefficients.constants)
}

impl<T: Lane> LaneModel<T> for LinearModel<T> {
    #[inline(always)]
    fn splat(zero: N<T>, point: &Point, coupling: Coupling<T>) -> Self {
        Self {
            coupling,
            flexure_stiffness: zero.lit(point.machine.bodies.flexure_stiffness.0),
            constants: StepConstants::splat(zero, &step_constants(point)),
            rotor_coefficients: RotorCoefficients::splat(
                zero,
                &point.linear_coefficients.rotor_coefficients,
            ),
            sag: Sag::splat(zero, &Sag::new(&point.equilibrium)).hinge_angles,
            outputs: LinearOutputs::splat(zero, &point.linear_outputs),
            spin: SpinSegmentLanes::splat(zero, &point.spin_segments[0]),
        }
    }

    fn set_point(&mut self, lane: usize, point: &Point) {
        self.flexure_stiffness.set_lane(lane, &point.machine.bodies.flexure_stiffness);
        self.constants.set_lane(lane, &step_constants(point));
        self.sag.set_lane(lane, &Sag::new(&point.equilibrium).hinge_angles);
        self.rotor_coefficients.set_lane(lane, &point.linear_coefficients.rotor_coefficients);
        self.outputs.set_lane(lane, &point.linear_outputs);
    }

    fn set_spin(&mut self, lane: usize, spin_segment: &SpinSegment) {
        self.spin.set_lane(lane, spin_segment);
    }

    fn set_caps(&mut self, lane: usize, caps: &Caps) {
        self.coupling.set_caps(lane, caps);
    }

    fn rest_state(_: &Point) -> [f64; STATES] {
        [0.0; STATES]
    }

    #[inline(always)]
    fn observe(
        &self,
        forcing: &LinearForcing<T>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        with_channels: bool,
    ) -> ([Sample<T>; RADIAL_COMPONENTS], Option<[Sample<T>; CHANNELS]>) {
        let motion = LinearMotion::new(&forcing.spin, &moving_coordinates(x, dx));
        let channels = if with_channels { Some(self.outputs.channels(&motion)) } else { None };
        (self.outputs.radial_position(&motion), channels)
    }
}
