//! Functions for benchmarks, which evaluate parts of the right-hand side.

use crate::coordinates::STATES;
use crate::nonlinear::coupling::Coupling;
use crate::run::method::{LinearFamily, ModelFamily, NonlinearFamily};
use crate::run::model::LaneModel;
use crate::{Caps, ModelKind, Point};
use core::hint::black_box;
use core::marker::PhantomData;
use lane_ode::{Kernel, Lane, N, Simd, System};

/// A part of the right-hand side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RhsPart {
    /// The functions that depend on time only, which an RK4 step evaluates twice.
    Forcing,
    /// The derivative of the state, which an RK4 step evaluates four times.
    Derivative,
}

/// Evaluates a part of one model's right-hand side `evaluations` times in sequence, with the same
/// point in every lane; with capped modes if caps are given.
pub fn evaluate(
    simd: Simd,
    model: ModelKind,
    part: RhsPart,
    point: &Point,
    caps: Option<Caps>,
    evaluations: u64,
) {
    let arguments = (point, part, caps, evaluations);
    match model {
        ModelKind::Nonlinear => {
            simd.dispatch(RhsPartKernel::<NonlinearFamily>(arguments, PhantomData))
        }
        ModelKind::Linear => simd.dispatch(RhsPartKernel::<LinearFamily>(arguments, PhantomData)),
    }
}

/// The kernel that evaluates a part of the right-hand side.
struct RhsPartKernel<'a, F>((&'a Point, RhsPart, Option<Caps>, u64), PhantomData<F>);

impl<F: ModelFamily> Kernel for RhsPartKernel<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) {
        let zero = N(zero);
        let (point, part, caps, evaluations) = self.0;
        let coupling = Coupling::new(zero, caps.as_ref());
        let model = <F::OnLanes<T> as LaneModel<T>>::splat(zero, point, coupling);
        let mut x = [zero; STATES];
        for (x, at_rest) in x.iter_mut().zip(<F::OnLanes<T> as LaneModel<T>>::rest_state(point)) {
            *x = zero.lit(at_rest);
        }
        let mut t = zero.lit(10.0);
        match part {
            RhsPart::Forcing => {
                let mut forcing = model.forcing_out_of_line(t);
                for _ in 0..evaluations {
                    t += zero.lit(1e-4);
                    model.update_forcing(t, &mut forcing);
                    black_box(&forcing);
                }
            }
            RhsPart::Derivative => {
                let forcing = model.forcing_out_of_line(t);
                for _ in 0..evaluations {
                    // The compiler does not see through `black_box`, so that it computes nothing
                    // in advance.
                    let slope = model.derivative(black_box(&forcing), &x);
                    for i in 0..STATES {
                        x[i] += slope[i] * 1e-9;
                    }
                }
                black_box(&x);
            }
        }
    }
}
