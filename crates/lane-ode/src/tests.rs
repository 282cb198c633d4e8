//! Tests of the integrators on small equations whose solutions are known.

mod allocation;
pub(crate) mod array;
mod dual;
mod failures;
mod lanes;
mod order;
mod peaks;
mod recorders;
mod trig;

use crate::{
    Kernel, Lane, MAX_LANES, N, ObservedStep, Segment, SegmentEnd, SemiImplicit, Simd, StepCount,
    System, Task, Tolerance, additive, dop853, dop853_adaptive, dopri5, rk4,
};
use core::marker::PhantomData;

/// A family of equations x' = f(p, t, x) with `P` parameters, whose values differ between lanes.
trait Equation<const D: usize, const P: usize> {
    /// The limit of the components' magnitudes, beyond which a state is out of range.
    const RANGE_LIMIT: f64 = 1e6;
    /// Computes f.
    fn derivative<T: Lane>(p: &[N<T>; P], t_s: N<T>, x: &[N<T>; D]) -> [N<T>; D];
    /// Solves k = H(t, x, r + g k) for k, with H(t, x, x) = f(t, x). By default H is f(t, x).
    fn solve_implicit_stage<T: Lane>(
        p: &[N<T>; P],
        t_s: N<T>,
        x: &[N<T>; D],
        _r: &[N<T>; D],
        _g: N<T>,
    ) -> [N<T>; D] {
        Self::derivative(p, t_s, x)
    }
    /// Computes the solution; NaN if it is not known.
    fn exact_state(_p: &[f64; P], _t_s: f64) -> [f64; D] {
        [f64::NAN; D]
    }
}

/// A trajectory of one member of the family.
#[derive(Clone, Debug)]
struct TestTrajectory<const D: usize, const P: usize> {
    parameters: [f64; P],
    start_state: [f64; D],
    segments: Vec<Segment>,
}

#[derive(Clone, Copy, Debug)]
enum TestMethod {
    Rk4,
    Dop853,
    Dop853Adaptive(Tolerance),
    Dopri5(Tolerance),
    Additive(Tolerance),
}

/// The result of a trajectory.
#[derive(Clone, Copy, Debug)]
struct TestOutcome<const D: usize> {
    /// The end of the last segment.
    segment_end: SegmentEnd,
    /// The steps of all segments.
    step_count: StepCount,
    /// The state at the end.
    x: [f64; D],
    /// The end of the last step that an observer received.
    observed_to_s: f64,
    /// The largest error of [`ObservedStep::interpolate`] inside a step.
    error_inside: f64,
}

impl<const D: usize> TestOutcome<D> {
    const EMPTY_OUTCOME: Self = Self {
        segment_end: SegmentEnd::Idle,
        step_count: StepCount { accepted: 0, rejected: 0 },
        x: [f64::NAN; D],
        observed_to_s: f64::NAN,
        error_inside: 0.0,
    };

    /// Returns whether both trajectories have the same bits and the same steps.
    fn is_same(&self, other: &Self) -> bool {
        self.x.map(f64::to_bits) == other.x.map(f64::to_bits)
            && self.segment_end == other.segment_end
            && self.step_count == other.step_count
            && self.error_inside.to_bits() == other.error_inside.to_bits()
            && self.observed_to_s.to_bits() == other.observed_to_s.to_bits()
    }
}

/// Returns the instruction sets of this processor.
fn instruction_sets() -> Vec<Simd> {
    Simd::ALL.into_iter().filter(|simd| simd.is_available()).collect()
}

/// Solves every trajectory. Returns the outcomes, and the number of heap allocations during the
/// integration.
fn solve<E: Equation<D, P>, const D: usize, const P: usize>(
    simd: Simd,
    method: TestMethod,
    trajectories: &[TestTrajectory<D, P>],
) -> (Vec<TestOutcome<D>>, u64) {
    simd.dispatch(SolveKernel::<E, D, P> { method, trajectories, equation: PhantomData })
}

struct SolveKernel<'a, E, const D: usize, const P: usize> {
    method: TestMethod,
    trajectories: &'a [TestTrajectory<D, P>],
    equation: PhantomData<E>,
}

impl<E: Equation<D, P>, const D: usize, const P: usize> Kernel for SolveKernel<'_, E, D, P> {
    type Output = (Vec<TestOutcome<D>>, u64);

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut batch = Batch::<'_, T, E, D, P> {
            test_system: TestSystem { p: [N(zero); P], equation: PhantomData },
            trajectories: self.trajectories,
            started: 0,
            current_segments: [(0, 0); MAX_LANES],
            outcomes: vec![TestOutcome::EMPTY_OUTCOME; self.trajectories.len()],
        };
        let heap_use = allocation_counter::measure(|| match self.method {
            TestMethod::Rk4 => rk4::integrate(zero, &mut batch),
            TestMethod::Dop853 => dop853::integrate(zero, &mut batch),
            TestMethod::Dop853Adaptive(tolerance) => {
                dop853_adaptive::integrate(zero, &mut batch, &tolerance)
            }
            TestMethod::Dopri5(tolerance) => dopri5::integrate(zero, &mut batch, &tolerance),
            TestMethod::Additive(tolerance) => additive::integrate(zero, &mut batch, &tolerance),
        });
        (batch.outcomes, heap_use.count_total)
    }
}

/// A task that passes trajectories through the lanes, one after another.
struct Batch<'a, T, E, const D: usize, const P: usize> {
    test_system: TestSystem<T, E, P>,
    trajectories: &'a [TestTrajectory<D, P>],
    started: usize,
    /// The indices of the trajectory and of the segment in each lane.
    current_segments: [(usize, usize); MAX_LANES],
    outcomes: Vec<TestOutcome<D>>,
}

/// The member of the family in each lane.
struct TestSystem<T, E, const P: usize> {
    p: [N<T>; P],
    equation: PhantomData<E>,
}

impl<T: Lane, E: Equation<D, P>, const D: usize, const P: usize> System<T, D>
    for TestSystem<T, E, P>
{
    type Forcing = N<T>;

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> N<T> {
        t_s
    }

    #[inline(always)]
    fn derivative(&self, t_s: &N<T>, x: &[N<T>; D]) -> [N<T>; D] {
        E::derivative(&self.p, *t_s, x)
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; D]) -> T::Mask {
        let mut sum = x[0].lit(0.0);
        for x in x {
            let ratio = (*x * (1.0 / E::RANGE_LIMIT)).v();
            sum += ratio * ratio;
        }
        sum.0.less(sum.lit(1.0).0)
    }
}

impl<T: Lane, E: Equation<D, P>, const D: usize, const P: usize> SemiImplicit<T, D>
    for TestSystem<T, E, P>
{
    #[inline(always)]
    fn solve_implicit_stage(
        &self,
        t_s: &N<T>,
        x: &[N<T>; D],
        r: &[N<T>; D],
        g_s: N<T>,
    ) -> [N<T>; D] {
        E::solve_implicit_stage(&self.p, *t_s, x, r, g_s)
    }
}

impl<T: Lane, E: Equation<D, P>, const D: usize, const P: usize> Task<T, D>
    for Batch<'_, T, E, D, P>
{
    type System = TestSystem<T, E, P>;

    #[inline(always)]
    fn system(&self) -> &TestSystem<T, E, P> {
        &self.test_system
    }

    fn next_segment(
        &mut self,
        lane: usize,
        segment_end: SegmentEnd,
        x: &mut [N<T>; D],
    ) -> Option<Segment> {
        if segment_end != SegmentEnd::Idle {
            let (trajectory, segment) = &mut self.current_segments[lane];
            let segments = &self.trajectories[*trajectory].segments;
            let outcome = &mut self.outcomes[*trajectory];
            outcome.segment_end = segment_end;
            match segment_end {
                SegmentEnd::Completed(count) | SegmentEnd::Failed { count, .. } => {
                    outcome.step_count.add(count);
                }
                SegmentEnd::Idle => {}
            }
            if matches!(segment_end, SegmentEnd::Completed(_)) && *segment + 1 < segments.len() {
                *segment += 1;
                return Some(segments[*segment]);
            }
            outcome.x = x.map(|x| x.0.get(lane));
        }
        let trajectory = self.trajectories.get(self.started)?;
        self.current_segments[lane] = (self.started, 0);
        self.started += 1;
        for (p, value) in self.test_system.p.iter_mut().zip(trajectory.parameters) {
            p.0.set(lane, value);
        }
        for (x, start) in x.iter_mut().zip(trajectory.start_state) {
            x.0.set(lane, start);
        }
        Some(trajectory.segments[0])
    }

    fn begin(&mut self, _: &N<T>, _: &[N<T>; D], _: &[N<T>; D]) {}

    fn observe(&mut self, _: &N<T>, step: &ObservedStep<'_, T, D>) {
        for fraction in [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875] {
            let interpolated = step.interpolate(step.length_s.lit(fraction));
            for lane in (0..T::LANES).filter(|&lane| step.length_s.0.get(lane) > 0.0) {
                let (trajectory, _) = self.current_segments[lane];
                let outcome = &mut self.outcomes[trajectory];
                outcome.observed_to_s = step.end_s.0.get(lane);
                let t_s = outcome.observed_to_s - (1.0 - fraction) * step.length_s.0.get(lane);
                let exact = E::exact_state(&self.trajectories[trajectory].parameters, t_s);
                for i in 0..D {
                    // `max` ignores NaN, so that a trajectory without a known solution has no
                    // error.
                    outcome.error_inside =
                        outcome.error_inside.max((interpolated[i].0.get(lane) - exact[i]).abs());
                }
            }
        }
    }
}

/// A nonautonomous equation and an oscillator: x' = w x cos(w t), y' = w z, z' = -w y.
struct SwingEquation;

impl Equation<3, 1> for SwingEquation {
    #[inline(always)]
    fn derivative<T: Lane>(&[w]: &[N<T>; 1], t_s: N<T>, x: &[N<T>; 3]) -> [N<T>; 3] {
        let (_, cos) = (w * t_s).v().sin_cos();
        [(w * (x[0] * cos)).v(), (w * x[2]).v(), -(w * x[1]).v()]
    }

    /// The implicit part of the oscillator is w (1 + y^2), which exceeds the oscillator's
    /// frequency, so that the explicit part has the opposite sign.
    #[inline(always)]
    fn solve_implicit_stage<T: Lane>(
        p: &[N<T>; 1],
        t_s: N<T>,
        x: &[N<T>; 3],
        r: &[N<T>; 3],
        g: N<T>,
    ) -> [N<T>; 3] {
        let [x_rate, y_rate, z_rate] = Self::derivative(p, t_s, x);
        let square = (x[1] * x[1]).v();
        let rate = (p[0] * (1.0 + square)).v();
        let angle = (g * rate).v();
        let residual = [rate * r[2] - square * y_rate, -(rate * r[1]) - square * z_rate];
        let y_slope = (residual[0] + angle * residual[1]) / (1.0 + angle * angle);
        [x_rate, y_slope, residual[1] - angle * y_slope]
    }

    fn exact_state(&[w]: &[f64; 1], t_s: f64) -> [f64; 3] {
        let (sin, cos) = (w * t_s).sin_cos();
        [sin.exp(), cos, -sin]
    }
}

/// Two masses with a stiff spring between them, the first one on a soft spring: x1'' = k (x2 - x1)
/// - x1, x2'' = k (x1 - x2). The stiff spring is implicit.
struct CoupledEquation;

impl Equation<4, 1> for CoupledEquation {
    #[inline(always)]
    fn derivative<T: Lane>(&[k]: &[N<T>; 1], _: N<T>, x: &[N<T>; 4]) -> [N<T>; 4] {
        let pull = (k * (x[1] - x[0])).v();
        [x[2], x[3], pull - x[0], -pull]
    }

    #[inline(always)]
    fn solve_implicit_stage<T: Lane>(
        &[k]: &[N<T>; 1],
        _: N<T>,
        x: &[N<T>; 4],
        r: &[N<T>; 4],
        g: N<T>,
    ) -> [N<T>; 4] {
        let spring_stretch = r[1] - r[0] + g * (r[3] - r[2] + g * x[0]);
        let pull = (k * spring_stretch).v() / (1.0 + 2.0 * (k * (g * g).v()).v());
        let accelerations = [pull - x[0], -pull];
        [
            r[2] + g * accelerations[0],
            r[3] + g * accelerations[1],
            accelerations[0],
            accelerations[1],
        ]
    }
}

impl TestTrajectory<3, 1> {
    /// Returns a trajectory of [`SwingEquation`] from 0 to `end_s` in `count` equal segments.
    fn swing(w: f64, end_s: f64, count: u32, step_s: f64) -> Self {
        let boundary_s = |i: u32| end_s * f64::from(i) / f64::from(count);
        let segments = (0..count)
            .map(|i| Segment { start_s: boundary_s(i), end_s: boundary_s(i + 1), step_s })
            .collect();
        Self { parameters: [w], start_state: [1.0, 1.0, 0.0], segments }
    }
}
