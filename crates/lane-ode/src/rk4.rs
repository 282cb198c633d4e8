//! The classical fourth-order Runge-Kutta method with a fixed step.
//!
//! W. Kutta, Zeitschrift fuer Mathematik und Physik 46 (1901) 435; Hairer, Norsett, Wanner, Solving
//! Ordinary Differential Equations I, Table II.1.2.

use crate::fixed::FixedSegments;
use crate::{Lane, N, ObservedStep, System as _, Task};
use core::hint::black_box;

/// The limit of stability on the imaginary axis: the method is stable up to |h w| = 2 sqrt(2).
pub const RK4_STABILITY_LIMIT: f64 = 2.828_427_124_746_190_3;

/// The coefficients a21, a32 and a43; all others are zero.
const A: [f64; 3] = [0.5, 0.5, 1.0];

/// Integrates every trajectory of the task. A lane starts the next trajectory as soon as its own
/// has ended.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(zero: T, task: &mut P) {
    let zero = N(zero);
    let mut x = [zero; D];
    let mut segments = FixedSegments::new(zero);
    while let Some(mut step_limit) = segments.start_pending_lanes(task, &mut x) {
        let clock = segments.clock;
        let mut index = segments.step_index;
        let h = clock.h;
        let one_third = zero.lit(1.0 / 3.0);
        let h_sixth = h / zero.lit(6.0);
        let mut time_s = clock.time_after(index);
        // The forcing at the step's start, then at its middle, then at its end, which is the start
        // of the next step. `black_box` prevents the compiler from keeping the forcing in
        // variables, all of which it would copy in every step.
        let mut forcing = task.system().forcing_out_of_line(time_s);
        let forcing = black_box(&mut forcing);
        // The states and slopes at the start of this step and of the last one, which swap places,
        // and the states of two stages. One array holds them, so that their addresses need no
        // further registers. There are only four, so that they fit in the first-level cache.
        let mut states = [x; 4];
        let mut slopes = [x; 2];
        let mut current_index = 0;
        let mut previous_index = 1;
        let mut is_start = true;
        let mut step_count = 0;
        loop {
            // The iteration after the last step only evaluates the slope, because observers need it
            // at both ends of a step.
            let is_last = step_count == step_limit;
            let next_time_s = clock.time_after(index + 1.0);
            // The state at the last step's start is overwritten only after that step has been
            // observed.
            let second_index = 2;
            let third_index = previous_index;
            let fourth_index = 3;
            // The stages are a loop, because four copies of the right-hand side do not fit in the
            // instruction cache.
            let stage_inputs = [current_index, second_index, third_index, fourth_index];
            for stage in 0..4 {
                if stage % 2 == 1 {
                    task.system().update_forcing(
                        if stage == 1 { clock.time_after(index + 0.5) } else { next_time_s },
                        forcing,
                    );
                }
                let slope = task.system().derivative(forcing, &states[stage_inputs[stage]]);
                if stage == 3 {
                    // Computes x + h (k1 + 2 k2 + 2 k3 + k4) / 6, where h k1 to h k3 follow from
                    // the states of the later stages. No sum of slopes is stored, because stores
                    // are the bottleneck of this loop.
                    for i in 0..D {
                        let x = states[current_index][i];
                        let stage_sum = states[second_index][i]
                            + states[fourth_index][i]
                            + 2.0 * states[third_index][i]
                            - 4.0 * x;
                        states[previous_index][i] = x + one_third * stage_sum + h_sixth * slope[i];
                    }
                    break;
                }
                let stage_output = [second_index, third_index, fourth_index][stage];
                let a_step = (h * A[stage]).v();
                for i in 0..D {
                    states[stage_output][i] = states[current_index][i] + a_step * slope[i];
                }
                if stage == 0 {
                    slopes[current_index] = slope;
                    if is_start {
                        task.begin(forcing, &states[current_index], &slopes[current_index]);
                        is_start = false;
                    } else {
                        task.observe(
                            forcing,
                            &ObservedStep {
                                end_s: time_s,
                                length_s: h,
                                start_state: &states[previous_index],
                                start_slope: &slopes[previous_index],
                                end_state: &states[current_index],
                                end_slope: &slopes[current_index],
                                dense_term: None,
                            },
                        );
                    }
                    if is_last {
                        break;
                    }
                }
            }
            if is_last {
                break;
            }
            (current_index, previous_index) = (previous_index, current_index);
            index = index + 1.0;
            time_s = next_time_s;
            step_count += 1;
            let in_range = task.system().in_range(&states[current_index]);
            if !T::all(in_range) && segments.end_failed_segments(in_range, time_s, step_count) {
                step_limit = step_count;
            }
        }
        x = states[current_index];
        segments.step_index = index;
        segments.count_steps(step_count);
    }
}
