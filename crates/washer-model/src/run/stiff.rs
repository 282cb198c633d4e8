//! Trajectories by the stiff method: one at a time, its derivatives by lanes of dual numbers.

use super::{Reading, Record, Run, Simulate};
use crate::coordinates::STATES;
use crate::run::method::{ByRodas, Family};
use crate::run::model::Model;
use crate::run::tangent::Tangent;
use crate::{COORDINATES, Point};
use lane_ode::{Dual, Ended, Forcing, Kernel, Lane, Leg, N, Partials, Step, Task, rodas};

impl<F: Family> Kernel for Simulate<'_, F, ByRodas> {
    type Output = Option<(Vec<Record>, Vec<Reading>)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let Self(order, ByRodas(tolerance), _) = self;
        let first = order.points[0];
        let run = Run::<f64, F::Over<f64>>::new(N(0.0), order, F::KIND);
        let mut run = StiffTask::<T, _, F::Over<Dual<T>>>::new(zero, run, first);
        rodas::integrate(&mut run, &tolerance);
        run.task.recorded()
    }
}

/// A task of one lane that says where it is.
pub(crate) trait OnLeg: Task<f64, STATES> {
    /// The current trajectory's point, and which of its legs it is on.
    fn place(&self) -> (&Point, usize);
}

impl<M: Model<f64>> OnLeg for Run<'_, f64, M> {
    fn place(&self) -> (&Point, usize) {
        let state = &self.lanes[0];
        (self.points[state.point], state.leg)
    }
}

/// A task, with its model's derivatives.
pub(crate) struct StiffTask<T, R, J> {
    pub(crate) task: R,
    tangent: Tangent<T, J>,
}

impl<T: Lane, R: OnLeg, J: Model<Dual<T>>> StiffTask<T, R, J> {
    /// `point` is the first that the task takes up, or any.
    #[inline(always)]
    pub(crate) fn new(zero: T, task: R, point: &Point) -> Self {
        Self { task, tangent: Tangent::new(zero, point) }
    }
}

impl<T: Lane, R: OnLeg, J: Model<Dual<T>>> Task<f64, STATES> for StiffTask<T, R, J> {
    type System = R::System;

    #[inline(always)]
    fn system(&self) -> &R::System {
        self.task.system()
    }

    #[inline(never)]
    fn next_leg(&mut self, lane: usize, ended: Ended, x: &mut [N<f64>; STATES]) -> Option<Leg> {
        let leg = self.task.next_leg(lane, ended, x)?;
        let (point, index) = self.task.place();
        if index == 0 {
            self.tangent.set_point(point);
        }
        self.tangent.set_spin(&point.stretches[point.legs[index].stretch]);
        Some(leg)
    }

    #[inline(always)]
    fn begin(
        &mut self,
        forcing: &Forcing<R, f64, STATES>,
        x: &[N<f64>; STATES],
        dx: &[N<f64>; STATES],
    ) {
        self.task.begin(forcing, x, dx);
    }

    #[inline(always)]
    fn observe(&mut self, forcing: &Forcing<R, f64, STATES>, step: &Step<'_, f64, STATES>) {
        self.task.observe(forcing, step);
    }

    fn is_stopped(&self) -> bool {
        self.task.is_stopped()
    }
}

impl<T: Lane, R: OnLeg, J: Model<Dual<T>>> rodas::Stiff<STATES, COORDINATES>
    for StiffTask<T, R, J>
{
    #[inline(always)]
    fn partials(&self, t_s: f64, x: &[N<f64>; STATES], partials: &mut Partials<COORDINATES>) {
        self.tangent.partials(t_s, x, partials);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Machine, Method, ModelKind, Spin, Timing, prepare};
    use lane_ode::{Simd, Tolerance};

    const TIMING: Timing = Timing { end_s: 3.0, window_s: [0.7, 2.9], checkpoints: 0 };

    /// A run-up past the resonances, with kinks inside and outside of the window.
    fn point(bearing_stiffness_n_per_m: f64) -> Point {
        let mut machine = Machine::paper();
        machine.bearings.front_stiffness_n_per_m = bearing_stiffness_n_per_m;
        machine.bearings.rear_stiffness_n_per_m = bearing_stiffness_n_per_m;
        let spin = Spin::Table {
            time_s: vec![0.0, 0.5, 1.5, 2.5],
            speed_rpm: vec![0.0, 100.0, 400.0, 300.0],
        };
        prepare(Simd::best(), &[(machine, spin)], &TIMING).remove(0).unwrap()
    }

    fn rodas(relative: f64) -> Method {
        Method::Rodas5p(Tolerance { relative, absolute: 1e-3 * relative, max_steps: 1_000_000 })
    }

    /// Largest relative difference of two records' amplitudes.
    fn apart(a: &Record, b: &Record) -> f64 {
        assert_eq!((a.failure, b.failure), (None, None));
        let gap = (a.min_gap_m - b.min_gap_m).abs() / b.min_gap_m;
        Channel::ALL.iter().map(|c| c.index()).fold(gap, |worst, i| {
            worst.max((a.amplitudes[i] - b.amplitudes[i]).abs() / b.amplitudes[i])
        })
    }

    #[test]
    fn agrees_with_converged_rk4() {
        let point = point(2e8);
        for model in ModelKind::ALL {
            let run =
                |method: &Method| crate::simulate(Simd::best(), model, method, &[&point]).remove(0);
            let reference = run(&Method::Rk4 { step_s: 5e-5 });
            for (relative, allowed) in [(1e-5, 1e-4), (1e-7, 1e-6)] {
                let ours = run(&rodas(relative));
                let error = apart(&ours, &reference);
                assert!(
                    error < allowed,
                    "{model:?} at {relative}: {error:e} after {} steps",
                    ours.steps
                );
            }
        }
    }

    #[test]
    fn serves_bearings_on_which_explicit_methods_crawl() {
        let [stiff, rigid] = [2e9, 1e11].map(point);
        for model in ModelKind::ALL {
            let run = |method: &Method, point| {
                crate::simulate(Simd::best(), model, method, &[point]).remove(0)
            };
            assert!(run(&Method::Rk4 { step_s: 5e-5 }, &rigid).failure.is_some());
            let ours = run(&rodas(1e-4), &rigid);
            // Bearings give way by a tenth of a micrometre, so rigid ones change little.
            let error = apart(&ours, &run(&Method::Rk4 { step_s: 5e-5 }, &stiff));
            assert!(error < 5e-4, "{model:?}: {error:e}");
            assert!(ours.steps + ours.rejected < 10_000, "{model:?}: {} steps", ours.steps);
        }
    }

    #[test]
    fn records_do_not_depend_on_company() {
        let points = [2e8, 1e7, 1e8].map(point);
        let all = [&points[0], &points[1], &points[2]];
        let tolerance = Tolerance { relative: 1e-5, absolute: 1e-8, max_steps: 1_000_000 };
        // One lane takes the points one after another; another instruction set may have them side
        // by side.
        for method in [rodas(1e-5), Method::Dopri5(tolerance), Method::Rk4 { step_s: 2e-4 }] {
            for model in ModelKind::ALL {
                let together = crate::simulate(Simd::Scalar, model, &method, &all);
                for (point, record) in all.iter().zip(together) {
                    let alone = crate::simulate(Simd::best(), model, &method, &[point]);
                    assert_eq!(alone, [record], "{model:?} by {method:?}");
                }
            }
        }
    }
}
