//! Machines drawn from a seed, states over time, and the equations as a residual.

use crate::coefficients::Coefficients;
use crate::coupling::Coupling;
use crate::equilibrium;
use crate::floating::Floating;
use crate::model::{Model, STATES};
use crate::nonlinear::{COORDINATES, Half, Halves, halves};
use crate::outputs::CHANNELS;
use crate::point::Point;
use crate::spin::SpinState;
use crate::{Machine, Parameter, Source, Spin, Timing, prepare};
use lane_ode::{Ended, Leg, N, Real, Simd, Step, System, Task, rk4};

/// Fig. 12's spin.
pub(super) fn triangular() -> Spin {
    Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 }
}

/// The paper's machine at another unbalance mass and damping.
pub(super) fn paper(unbalance_mass_kg: f64, damping_n_s_per_m: f64) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = damping_n_s_per_m);
    machine
}

/// A machine with every number within a fifth of the paper's, drawn again until it is sound and rests somewhere.
pub(super) fn random_machine(rng: &mut fastrand::Rng) -> Machine {
    loop {
        let (mut machine, mut spin) = (Machine::paper(), triangular());
        for parameter in Parameter::all(&machine, &spin) {
            let value = parameter.get(&machine, &spin);
            if let (Some(value), false) =
                (value, parameter.writes_several() || parameter.source() == Source::Grid)
            {
                parameter.set(&mut machine, &mut spin, value * (0.8 + 0.4 * rng.f64()));
            }
        }
        if machine.violations().is_empty()
            && equilibrium::find(N(0.0), &Coefficients::new(&machine)).1 & 1 == 1
        {
            return machine;
        }
    }
}

/// A spin of each kind in turn.
pub(super) fn random_spin(rng: &mut fastrand::Rng, kind: usize, end_s: f64) -> Spin {
    let peak_rpm = 200.0 + 400.0 * rng.f64();
    let ramp_s = end_s * (0.3 + 0.4 * rng.f64());
    match kind % 4 {
        0 => Spin::Cycloidal { peak_rpm, ramp_s },
        1 => Spin::Triangular { peak_rpm, ramp_s },
        2 => Spin::Ramp { peak_rpm: -peak_rpm, ramp_s },
        _ => Spin::Table { time_s: vec![0.0, 0.4 * ramp_s, ramp_s], speed_rpm: vec![100.0, peak_rpm, 50.0] },
    }
}

/// One scenario made ready.
pub(super) fn ready(machine: Machine, spin: Spin, end_s: f64) -> Point {
    let timing = Timing { end_s, window_s: [0.0, end_s] };
    prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
}

/// One trajectory's state at equal intervals.
pub(super) struct Sampler<'a, M> {
    pub(super) model: M,
    point: &'a Point,
    start: [f64; STATES],
    every_s: f64,
    end_s: f64,
    step_s: f64,
    /// State at each sample, the first at 0.
    pub(super) states: Vec<[f64; STATES]>,
}

impl<'a, M: Model<f64>> Sampler<'a, M> {
    /// Runs from `start` by RK4; the spin's kinks must be at samples.
    pub(super) fn run(point: &'a Point, start: [f64; STATES], every_s: f64, end_s: f64, step_s: f64) -> Self {
        let model = M::splat(N(0.0), point, Coupling::Springs);
        let mut sampler = Self { model, point, start, every_s, end_s, step_s, states: vec![start] };
        rk4::integrate(0.0, &mut sampler);
        sampler
    }

    /// Channels at sample `i`.
    pub(super) fn channels(&mut self, i: usize) -> [f64; CHANNELS] {
        let leg = self.leg(i.saturating_sub(1));
        self.enter(&leg);
        let t_s = if i == 0 { 0.0 } else { leg.end_s };
        let (forcing, x) = (self.model.forcing(N(t_s)), self.states[i].map(N));
        let dx = self.model.derivative(&forcing, &x);
        let (_, channels) = self.model.observe(&forcing, &x, &dx, true);
        channels.unwrap().map(|sample| sample.value.0)
    }

    fn leg(&self, i: usize) -> Leg {
        let [start_s, end_s] = [i, i + 1].map(|i| i as f64 * self.every_s);
        Leg { start_s, end_s, step_s: self.step_s }
    }

    fn enter(&mut self, leg: &Leg) {
        let middle_s = 0.5 * (leg.start_s + leg.end_s);
        let stretch = self.point.stretches.iter().rfind(|s| s.start_s <= middle_s).unwrap();
        self.model.set_spin(0, stretch);
    }
}

impl<M: Model<f64>> System<f64, STATES> for Sampler<'_, M> {
    type Forcing = M::Forcing;
    fn forcing(&self, t_s: N<f64>) -> M::Forcing {
        self.model.forcing(t_s)
    }
    fn derivative(&self, forcing: &M::Forcing, x: &[N<f64>; STATES]) -> [N<f64>; STATES] {
        self.model.derivative(forcing, x)
    }
    fn in_range(&self, x: &[N<f64>; STATES]) -> bool {
        self.model.in_range(x)
    }
}

impl<M: Model<f64>> Task<f64, STATES> for Sampler<'_, M> {
    fn next_leg(&mut self, _: usize, ended: Ended, x: &mut [N<f64>; STATES]) -> Option<Leg> {
        match ended {
            Ended::Idle => *x = self.start.map(N),
            Ended::Arrived(_) => self.states.push(x.map(|x| x.0)),
            Ended::Failed { reason, time_s, .. } => panic!("{reason:?} at {time_s} s"),
        }
        let leg = self.leg(self.states.len() - 1);
        self.enter(&leg);
        (leg.end_s < self.end_s + 0.5 * self.every_s).then_some(leg)
    }
    fn begin(&mut self, _: &M::Forcing, _: &[N<f64>; STATES], _: &[N<f64>; STATES]) {}
    fn observe(&mut self, _: &M::Forcing, _: &Step<'_, f64, STATES>) {}
}

/// M a of one half: y and z of its midpoint, then its rotations.
fn inertia_forces<T: Real, const R: usize>(
    half: &Half<T, R>,
    midpoint: [N<T>; 2],
    rotation: [N<T>; R],
) -> ([N<T>; 2], [N<T>; R]) {
    let Floating { per_mass, arm, .. } = &half.floating;
    let mut centre = midpoint;
    for i in 0..2 {
        for r in 0..R {
            centre[i] += arm[r][i] * rotation[r];
        }
        centre[i] = centre[i] / *per_mass;
    }
    let mut about = rotation;
    for r in 0..R {
        about[r] = arm[r][0] * centre[0] + arm[r][1] * centre[1];
        for s in 0..R {
            about[r] += half.inertia[r.max(s)][r.min(s)] * rotation[s];
        }
    }
    (centre, about)
}

/// M a and f of the equations M a = f of both halves, as they are loaded.
pub(super) fn equations_of<T: Real>(both: &Halves<T>, a: &[N<T>; COORDINATES]) -> [[N<T>; COORDINATES]; 2] {
    let ([i1, i2], [i5, i6]) = inertia_forces(&both.tub, [a[0], a[1]], [a[4], a[5]]);
    let ([i3, i4], [i7, i8, i9, i10]) = inertia_forces(&both.rotor, [a[2], a[3]], [a[6], a[7], a[8], a[9]]);
    let ([f1, f2], [f5, f6]) = both.tub.floating.generalised_forces();
    let ([f3, f4], [f7, f8, f9, f10]) = both.rotor.floating.generalised_forces();
    [[i1, i2, i3, i4, i5, i6, i7, i8, i9, i10], [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10]]
}

/// M(q, theta) a and f(q, u, theta, theta', theta'') of the nonlinear equations M a = f.
pub(super) fn equations<T: Real>(
    machine: &Coefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
    a: &[N<T>; COORDINATES],
) -> [[N<T>; COORDINATES]; 2] {
    equations_of(&halves(&machine.view(), spin, q, u), a)
}

/// The mass matrix of the nonlinear model, column by column from unit accelerations.
pub(super) fn mass_matrix(
    machine: &Coefficients<f64>,
    spin: &SpinState<f64>,
    q: &[f64; COORDINATES],
) -> [[f64; COORDINATES]; COORDINATES] {
    let (q, still) = (q.map(N), [N(0.0); COORDINATES]);
    let mut matrix = [[0.0; COORDINATES]; COORDINATES];
    for j in 0..COORDINATES {
        let mut unit = still;
        unit[j] = N(1.0);
        let [column, _] = equations(machine, spin, &q, &still, &unit);
        for i in 0..COORDINATES {
            matrix[i][j] = column[i].0;
        }
    }
    matrix
}
