//! The eighth-order Runge-Kutta method of Dormand and Prince, adaptive, every lane with its own
//! time and step.
//!
//! Coefficients and error estimate: Hairer, Norsett, Wanner, Solving Ordinary Differential
//! Equations I, section II.10, and its program `dop853.f`. With the largest ratios n5 and n3 of the
//! embedded formulas' errors to the tolerance, the error of a step is n5^2 / (n5^2 + n3^2 / 100)^½,
//! which is of order 7. The program's dense output is omitted.

use crate::adaptive::AdaptiveLanes;
use crate::control::ControlExponents;
use crate::dop853::{A, B, C, DOP853_STAGES, SparseRow, add_slopes};
use crate::{Lane, N, ObservedStep, System as _, Task, Tolerance};
use core::hint::black_box;

/// Error of the embedded formula of order 5.
const E5: SparseRow = &[
    (0, 1.312_004_499_419_488_073_250_102_996e-2),
    (5, -1.225_156_446_376_204_440_720_569_753),
    (6, -4.957_589_496_572_501_915_214_079_952e-1),
    (7, 1.664_377_182_454_986_536_961_530_415),
    (8, -3.503_288_487_499_736_816_886_487_290e-1),
    (9, 3.341_791_187_130_174_790_297_318_841e-1),
    (10, 8.192_320_648_511_571_246_570_742_613e-2),
    (11, -2.235_530_786_388_629_525_884_427_845e-2),
];

/// Weights of the embedded formula of order 3.
const B3: SparseRow = &[
    (0, 2.440_944_881_889_763_779_527_559_055e-1),
    (8, 7.338_466_882_816_118_573_413_617_415e-1),
    (11, 2.205_882_352_941_176_470_588_235_294e-2),
];

/// The index of the state at the start of a step.
const START_STATE: usize = 0;
/// The index of the state at the end of a step.
const END_STATE: usize = 1;
/// The index of the state of a stage.
const STAGE_STATE: usize = 2;

/// Integrates every trajectory of the task. The lanes accept and reject steps independently.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(
    zero: T,
    task: &mut P,
    tolerance: &Tolerance,
) {
    let zero = N(zero);
    let mut lanes = AdaptiveLanes::new(zero, ControlExponents::Order8);
    let mut states = [[zero; D]; 3];
    let mut slopes = [[zero; D]; DOP853_STAGES];
    let mut start_state = states[START_STATE];
    let mut start_slope = start_state;
    let mut length_s = zero;
    let mut is_start = lanes.start_pending_lanes(task, &mut states[START_STATE]);
    while lanes.has_active_lane() && !task.cancel().is_requested() {
        // `black_box` prevents the compiler from copying the forcing repeatedly.
        let mut forcing = task.system().forcing_out_of_line(lanes.time_s);
        let forcing = black_box(&mut forcing);
        slopes[0] = task.system().derivative(forcing, &states[START_STATE]);
        if is_start {
            task.begin(forcing, &states[START_STATE], &slopes[0]);
        } else {
            task.observe(
                forcing,
                &ObservedStep {
                    end_s: lanes.time_s,
                    length_s,
                    start_state: &start_state,
                    start_slope: &start_slope,
                    end_state: &states[START_STATE],
                    end_slope: &slopes[0],
                    dense_term: None,
                },
            );
            is_start = lanes.start_pending_lanes(task, &mut states[START_STATE]);
            if is_start {
                continue;
            }
        }
        is_start = false;

        let h = lanes.steps(tolerance);
        for stage in 1..DOP853_STAGES {
            task.system().update_forcing(h * C[stage] + lanes.time_s, forcing);
            add_slopes(h, A[stage - 1], &slopes, &mut states, START_STATE, STAGE_STATE);
            slopes[stage] = task.system().derivative(forcing, &states[STAGE_STATE]);
        }
        add_slopes(h, B, &slopes, &mut states, START_STATE, END_STATE);
        // The result of the formula of order 3 overwrites the state of the last stage, which is no
        // longer needed.
        add_slopes(h, B3, &slopes, &mut states, START_STATE, STAGE_STATE);
        let mut error_5 = [zero; D];
        let mut error_3 = [zero; D];
        for i in 0..D {
            let mut sum = zero;
            for (stage, weight) in E5 {
                sum += slopes[*stage][i] * *weight;
            }
            error_5[i] = (h * sum).v();
            error_3[i] = states[END_STATE][i] - states[STAGE_STATE][i];
        }

        let [start, end, _] = &states;
        let in_range = task.system().in_range(end);
        let n5 = tolerance.error_norm(start, end, &error_5);
        let n3 = tolerance.error_norm(start, end, &error_3);
        let error = joint_error(n5, n3);
        start_state = *start;
        start_slope = slopes[0];
        let accepted_lanes = error.0.less(zero.lit(1.0).0);
        for i in 0..D {
            states[START_STATE][i] =
                N(T::select(accepted_lanes, states[END_STATE][i].0, states[START_STATE][i].0));
        }
        length_s = lanes.accept_or_reject(h, error, [accepted_lanes, in_range], tolerance);
    }
}

/// Returns the error of a step from those of the formulas of order 5 and 3.
#[inline(always)]
fn joint_error<T: Lane>(n5: N<T>, n3: N<T>) -> N<T> {
    let squared_5 = (n5 * n5).v();
    let squared_3 = (n3 * n3).v();
    // The least positive number prevents the quotient of two zeros.
    let square_sum = squared_3 * 0.01 + squared_5 + n5.lit(f64::MIN_POSITIVE);
    squared_5 / square_sum.sqrt()
}
