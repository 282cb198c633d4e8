//! The two models as systems over lanes, and what they have in common.

use crate::coefficients::Coefficients;
use crate::floating::Factors;
use crate::harmonics::TermLanes;
use crate::lanes::SetLane;
use crate::linear::{self, Constants, RotorAt};
use crate::linear_outputs::features;
use crate::nonlinear::{self, COORDINATES};
use crate::outputs::{CHANNELS, OUTPUTS, outputs};
use crate::point::Point;
use crate::spin::{SpinLanes, SpinState, SpinStretch};
use core::f64::consts::FRAC_PI_2;
use lane_ode::{Dual, Lane, N, Real, System};

/// States: ten coordinates, then their speeds.
pub(crate) const STATES: usize = 2 * COORDINATES;

/// Coordinates farther than this from equilibrium (m) have left the machine.
const FARTHEST_M: f64 = 10.0;

/// A time derivative carried along; nested for the second.
pub(crate) type Jet<T> = Dual<Dual<T>>;

/// One of the two models, over lanes.
pub(crate) trait Model<T: Lane>: System<T, STATES> {
    /// The same point in every lane.
    fn splat(zero: N<T>, point: &Point) -> Self;
    /// Puts a point into one lane.
    fn set_point(&mut self, lane: usize, point: &Point);
    /// Puts a stretch of its spin into one lane.
    fn set_spin(&mut self, lane: usize, stretch: &SpinStretch);
    /// State at rest.
    fn at_rest(point: &Point) -> [f64; STATES];
    /// The spin at time `t_s`.
    fn spin_at(&self, t_s: N<T>) -> SpinState<T>;
    /// The spin in a forcing.
    fn spin(forcing: &Self::Forcing) -> &SpinState<T>;
    /// Outputs and their first time derivatives; channels as deviations from equilibrium.
    fn rates(&self, spin: &SpinState<T>, x: &[N<T>; STATES]) -> [N<Dual<T>>; OUTPUTS];
    /// The same with second derivatives; `dx` is the state's derivative.
    fn curvatures(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
    ) -> [N<Jet<T>>; OUTPUTS];
}

/// sin and cos of theta with one time derivative.
#[inline(always)]
pub(crate) fn theta_rate<T: Real>(spin: &SpinState<T>) -> (N<Dual<T>>, N<Dual<T>>) {
    let n = spin.speed;
    (
        N(Dual { value: spin.sin.0, slope: (n * spin.cos).v().0 }),
        N(Dual { value: spin.cos.0, slope: (-n * spin.sin).v().0 }),
    )
}

/// sin and cos of theta with two time derivatives.
#[inline(always)]
pub(crate) fn theta_jet<T: Real>(spin: &SpinState<T>) -> (N<Jet<T>>, N<Jet<T>>) {
    let (n, a) = (spin.speed, spin.acceleration);
    let nn = (n * n).v();
    (
        jet(spin.sin, (n * spin.cos).v(), a * spin.cos - nn * spin.sin),
        jet(spin.cos, (-n * spin.sin).v(), -(a * spin.sin) - nn * spin.cos),
    )
}

/// A value with its first two time derivatives.
#[inline(always)]
fn jet<T: Copy>(v: N<T>, d: N<T>, dd: N<T>) -> N<Jet<T>> {
    N(Dual { value: Dual { value: v.0, slope: d.0 }, slope: Dual { value: d.0, slope: dd.0 } })
}

/// Coordinates with their speeds.
#[inline(always)]
fn coordinate_rates<T: Copy>(x: &[N<T>; STATES]) -> [N<Dual<T>>; COORDINATES] {
    core::array::from_fn(|i| N(Dual { value: x[i].0, slope: x[COORDINATES + i].0 }))
}

/// Coordinates with their speeds and accelerations.
#[inline(always)]
fn coordinate_jets<T: Copy>(x: &[N<T>; STATES], dx: &[N<T>; STATES]) -> [N<Jet<T>>; COORDINATES] {
    core::array::from_fn(|i| jet(x[i], x[COORDINATES + i], dx[COORDINATES + i]))
}

/// Coordinates of a state.
#[inline(always)]
pub(crate) fn split<T: Copy>(x: &[N<T>; STATES]) -> ([N<T>; COORDINATES], [N<T>; COORDINATES]) {
    (core::array::from_fn(|i| x[i]), core::array::from_fn(|i| x[COORDINATES + i]))
}

#[inline(always)]
fn joined<T: Copy>(u: &[N<T>; COORDINATES], a: &[N<T>; COORDINATES]) -> [N<T>; STATES] {
    core::array::from_fn(|i| if i < COORDINATES { u[i] } else { a[i - COORDINATES] })
}

/// Every lane whose angles stay within a quarter turn and its translations in the house.
#[inline(always)]
fn in_range<T: Lane>(x: &[N<T>; STATES]) -> T::Mask {
    // One sum of squares, each over its own limit: NaN and infinity fail the comparison too.
    let mut sum = x[0].lit(0.0);
    for (i, q) in x[..COORDINATES].iter().enumerate() {
        let limit = if i < 4 { FARTHEST_M } else { FRAC_PI_2 };
        let share = (*q * (1.0 / limit)).v();
        sum += share * share;
    }
    sum.0.less(sum.lit(1.0).0)
}

/// The nonlinear model.
pub(crate) struct Nonlinear<T> {
    machine: Coefficients<T>,
    spin: SpinLanes<T>,
    /// Channels at the static equilibrium.
    rest: [N<T>; CHANNELS],
}

impl<T: Lane> System<T, STATES> for Nonlinear<T> {
    type Forcing = SpinState<T>;

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> SpinState<T> {
        self.spin.at(t_s)
    }

    #[inline(always)]
    fn derivative(&self, spin: &SpinState<T>, x: &[N<T>; STATES]) -> [N<T>; STATES] {
        let (q, u) = split(x);
        joined(&u, &nonlinear::accelerations(&self.machine.view(), spin, &q, &u))
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; STATES]) -> T::Mask {
        in_range(x)
    }
}

impl<T: Lane> Model<T> for Nonlinear<T> {
    #[inline(always)]
    fn splat(zero: N<T>, point: &Point) -> Self {
        Self {
            machine: Coefficients::splat(zero, &point.machine),
            spin: SpinLanes::splat(zero, &point.stretches[0]),
            rest: point.rest.map(|y| zero.lit(y)),
        }
    }

    fn set_point(&mut self, lane: usize, point: &Point) {
        self.machine.set_lane(lane, &point.machine);
        self.rest.set_lane(lane, &point.rest.map(N));
    }

    fn set_spin(&mut self, lane: usize, stretch: &SpinStretch) {
        self.spin.set_lane(lane, stretch);
    }

    fn at_rest(point: &Point) -> [f64; STATES] {
        core::array::from_fn(|i| if i < COORDINATES { point.equilibrium[i] } else { 0.0 })
    }

    #[inline(always)]
    fn spin_at(&self, t_s: N<T>) -> SpinState<T> {
        self.spin.at(t_s)
    }

    #[inline(always)]
    fn spin(forcing: &SpinState<T>) -> &SpinState<T> {
        forcing
    }

    #[inline(always)]
    fn rates(&self, spin: &SpinState<T>, x: &[N<T>; STATES]) -> [N<Dual<T>>; OUTPUTS] {
        let mut y = outputs(&self.machine.bodies.constant(), theta_rate(spin), &coordinate_rates(x));
        for (y, rest) in y.iter_mut().zip(&self.rest) {
            y.0.value = y.0.value.sub(rest.0);
        }
        y
    }

    #[inline(always)]
    fn curvatures(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
    ) -> [N<Jet<T>>; OUTPUTS] {
        let bodies = self.machine.bodies.constant().constant();
        let mut y = outputs(&bodies, theta_jet(spin), &coordinate_jets(x, dx));
        for (y, rest) in y.iter_mut().zip(&self.rest) {
            y.0.value.value = y.0.value.value.sub(rest.0);
        }
        y
    }
}

/// The linear model.
pub(crate) struct Linear<T> {
    machine: Coefficients<T>,
    constants: Constants<T>,
    tub_inertia: Factors<T, 2>,
    terms: TermLanes<T>,
    outputs: TermLanes<T>,
    spin: SpinLanes<T>,
}

/// What the linear model needs of an instant.
pub(crate) struct LinearForcing<T> {
    spin: SpinState<T>,
    rotor: RotorAt<T>,
}

impl<T: Lane> System<T, STATES> for Linear<T> {
    type Forcing = LinearForcing<T>;

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> LinearForcing<T> {
        let spin = self.spin.at(t_s);
        LinearForcing { rotor: linear::rotor_at(&self.terms, &spin), spin }
    }

    #[inline(always)]
    fn derivative(&self, forcing: &LinearForcing<T>, x: &[N<T>; STATES]) -> [N<T>; STATES] {
        let (q, u) = split(x);
        let bodies = &self.machine.bodies;
        joined(&u, &linear::accelerations(bodies, &self.constants, &self.tub_inertia, &forcing.rotor, &q, &u))
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; STATES]) -> T::Mask {
        in_range(x)
    }
}

impl<T: Lane> Model<T> for Linear<T> {
    #[inline(always)]
    fn splat(zero: N<T>, point: &Point) -> Self {
        let constants = Constants::splat(zero, &point.linear.constants);
        Self {
            machine: Coefficients::splat(zero, &point.machine),
            tub_inertia: linear::tub_factors(&constants),
            constants,
            terms: TermLanes::splat(zero, &point.linear.terms),
            outputs: TermLanes::splat(zero, &point.linear_outputs),
            spin: SpinLanes::splat(zero, &point.stretches[0]),
        }
    }

    fn set_point(&mut self, lane: usize, point: &Point) {
        self.machine.set_lane(lane, &point.machine);
        self.constants.set_lane(lane, &point.linear.constants);
        self.tub_inertia.set_lane(lane, &linear::tub_factors(&point.linear.constants));
        self.terms.set_lane(lane, &point.linear.terms);
        self.outputs.set_lane(lane, &point.linear_outputs);
    }

    fn set_spin(&mut self, lane: usize, stretch: &SpinStretch) {
        self.spin.set_lane(lane, stretch);
    }

    fn at_rest(_: &Point) -> [f64; STATES] {
        [0.0; STATES]
    }

    #[inline(always)]
    fn spin_at(&self, t_s: N<T>) -> SpinState<T> {
        self.spin.at(t_s)
    }

    #[inline(always)]
    fn spin(forcing: &LinearForcing<T>) -> &SpinState<T> {
        &forcing.spin
    }

    #[inline(always)]
    fn rates(&self, spin: &SpinState<T>, x: &[N<T>; STATES]) -> [N<Dual<T>>; OUTPUTS] {
        let features = features(theta_rate(spin), &coordinate_rates(x));
        let y: [N<T>; OUTPUTS] = self.outputs.sum(&features.map(|f| N(f.0.value)));
        let dy: [N<T>; OUTPUTS] = self.outputs.sum(&features.map(|f| N(f.0.slope)));
        core::array::from_fn(|i| N(Dual { value: y[i].0, slope: dy[i].0 }))
    }

    #[inline(always)]
    fn curvatures(
        &self,
        spin: &SpinState<T>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
    ) -> [N<Jet<T>>; OUTPUTS] {
        let features = features(theta_jet(spin), &coordinate_jets(x, dx));
        let y: [N<T>; OUTPUTS] = self.outputs.sum(&features.map(|f| N(f.0.value.value)));
        let dy: [N<T>; OUTPUTS] = self.outputs.sum(&features.map(|f| N(f.0.slope.value)));
        let ddy: [N<T>; OUTPUTS] = self.outputs.sum(&features.map(|f| N(f.0.slope.slope)));
        core::array::from_fn(|i| jet(y[i], dy[i], ddy[i]))
    }
}
