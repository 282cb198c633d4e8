//! The exports of the WebAssembly module. A caller writes numbers to the address that [`input`]
//! returns and calls a function with their count. The function returns the count of numbers at
//! [`output`], or 0 without an answer.
//!
//! Numbers are 64-bit floats. The answer for a point is: a code (1, 0 for an impossible point, -1
//! for one without equilibrium); 1 if the motion is sensitive, else 0; a record of the nonlinear
//! and of the linear model; the ratio of each channel; the static sag (m). Missing numbers are NaN.
//!
//! A record is: the index and the name of the refinement level, the remaining error, the failure (0
//! none, 1 diverged, 2 step too small, 3 step limit) and its time (s), the number of steps, the
//! least gap (m), the amplitude of each channel, and the map's metrics of the model.
#![allow(unsafe_code)]
// Exports of the module are not public items of this crate.
#![allow(unreachable_pub)]

use std::sync::{Mutex, MutexGuard, PoisonError};

use lane_ode::{Failure, Simd};
use washer_model::{Channel, ModelKind, instant_count};
use washer_row::{Status, Trajectory};

use crate::point::{Answer, PointError, check_point, integrate_motion, point_input};
use crate::setup::Setup;

#[derive(Default)]
struct ModuleState {
    input: Vec<f64>,
    output: Vec<f64>,
    setup: Option<Setup>,
}

/// The state between two calls of exports. A module has one thread.
static MODULE_STATE: Mutex<ModuleState> =
    Mutex::new(ModuleState { input: Vec::new(), output: Vec::new(), setup: None });

fn lock_state() -> MutexGuard<'static, ModuleState> {
    MODULE_STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Allocates the input for `count` numbers and returns its address.
// SAFETY (of every export): no other symbol of the module has its name.
#[unsafe(no_mangle)]
pub extern "C" fn input(count: usize) -> *mut f64 {
    let mut state = lock_state();
    state.input.clear();
    state.input.resize(count, 0.0);
    state.input.as_mut_ptr()
}

/// Returns the address of the last answer, which is valid until the next call of an export.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const f64 {
    lock_state().output.as_ptr()
}

/// Returns the number of trajectories that are integrated side by side.
#[unsafe(no_mangle)]
pub extern "C" fn lanes() -> usize {
    Simd::widest().lanes()
}

/// Reads the setup from the input. Returns 1 if it is valid, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn setup() -> usize {
    let state = &mut *lock_state();
    state.setup = Setup::from_numbers(&state.input);
    usize::from(state.setup.is_some())
}

/// Writes an answer from the setup and the input, and returns its length; 0 without a setup.
fn answer_with_setup(write: impl FnOnce(&Setup, &[f64], &mut Vec<f64>)) -> usize {
    let ModuleState { input, output, setup } = &mut *lock_state();
    output.clear();
    if let Some(setup) = setup {
        write(setup, input, output);
    }
    output.len()
}

/// Answers points with `value_count` numbers each, by both models at the quick level.
#[unsafe(no_mangle)]
pub extern "C" fn quick(value_count: usize) -> usize {
    answer_with_setup(|setup, input, output| {
        let points: Vec<&[f64]> = input.chunks_exact(value_count.max(1)).collect();
        for answer in crate::evaluate_points(setup, &points) {
            write_answer(output, &answer, setup);
        }
    })
}

/// Answers one point with an error estimate.
#[unsafe(no_mangle)]
pub extern "C" fn checked() -> usize {
    answer_with_setup(|setup, input, output| {
        write_answer(output, &check_point(setup, input), setup)
    })
}

/// Writes the motion of a model (0 nonlinear, 1 linear) at a point and a refinement level; the
/// quick level if there is none at this index. Output: the code, the failure and its time (s), the
/// number of instants; for each instant the channels and the gap.
#[unsafe(no_mangle)]
pub extern "C" fn history(model: usize, level_index: usize, every_s: f64) -> usize {
    let model = if model == 0 { ModelKind::Nonlinear } else { ModelKind::Linear };
    answer_with_setup(|setup, input, output| {
        match integrate_motion(setup, input, model, Some(level_index), every_s) {
            Err(reason) => output.push(point_code(Some(&reason))),
            Ok(motion) => {
                let [failure, time_s] = failure_code(motion.failure);
                output.extend([1.0, failure, time_s, motion.gaps_m.len() as f64]);
                for (channels, gap_m) in motion.channels.iter().zip(&motion.gaps_m) {
                    output.extend(channels);
                    output.push(*gap_m);
                }
            }
        }
    })
}

/// Writes the growth of disturbances at a point of `value_count` numbers, at the constant speeds
/// (rpm) that follow it in the input. Output: the code; for each speed the growth of the fastest
/// disturbance (1/s; NaN without a periodic response), its frequency (cycles per minute), its kind
/// as an index into [`washer_model::StabilityKind::ALL`], and 1 if the response is on the curve of
/// a machine that runs up, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn growth(value_count: usize) -> usize {
    answer_with_setup(|setup, input, output| {
        let Some((values, speeds_rpm)) = input.split_at_checked(value_count) else { return };
        let disturbances = crate::find_disturbances(setup, values, speeds_rpm);
        output.push(point_code(disturbances.as_ref().err()));
        for disturbance in disturbances.unwrap_or_default() {
            output.extend(disturbance.map_or([f64::NAN; 4], |(disturbance, is_on_curve)| {
                let [kind, on_curve] =
                    [disturbance.kind() as u8, u8::from(is_on_curve)].map(f64::from);
                [disturbance.growth_per_s(), disturbance.frequency_cpm(), kind, on_curve]
            }));
        }
    })
}

/// Writes the largest attractor of a point of `value_count` numbers at the constant speeds (rpm)
/// that follow it in the input. Output: the code; the speed at which yaw or pitch of the tub is
/// greatest (NaN if no attractor was found), the attractor's kind as an index into
/// [`washer_model::Attractor::KIND_NAMES`], and the largest deviation of each channel (m, rad).
#[unsafe(no_mangle)]
pub extern "C" fn dwell(value_count: usize) -> usize {
    answer_with_setup(|setup, input, output| {
        let Some((values, speeds_rpm)) = input.split_at_checked(value_count) else { return };
        let largest_attractor = crate::find_largest_attractor(setup, values, speeds_rpm);
        output.push(point_code(largest_attractor.as_ref().err()));
        match largest_attractor.ok().flatten() {
            Some(attractor) => {
                output.extend([attractor.speed_rpm, attractor.kind as f64]);
                output.extend(attractor.deviations);
            }
            None => output.extend([f64::NAN; 2 + Channel::ALL.len()]),
        }
    })
}

/// Writes the speeds (rpm) at a point, at intervals of `every_s` from 0 to the end.
#[unsafe(no_mangle)]
pub extern "C" fn speeds(every_s: f64) -> usize {
    answer_with_setup(|setup, input, output| {
        if let Ok(point_input) = point_input(setup, input) {
            let instants = 0..instant_count(setup.rule.end_s, every_s);
            let times_s = instants.map(|k| k as f64 * every_s);
            output.extend(point_input.spin.speeds_rpm(times_s));
        }
    })
}

fn point_code(reason: Option<&PointError>) -> f64 {
    match reason {
        None => 1.0,
        Some(PointError::Impossible) => 0.0,
        Some(PointError::NoEquilibrium) => -1.0,
    }
}

/// Returns the code and the time (s) of a failure; codes follow the order of [`Failure`].
fn failure_code(failure: Option<(Failure, f64)>) -> [f64; 2] {
    failure.map_or([0.0, f64::NAN], |(reason, time_s)| [1.0 + f64::from(reason as u8), time_s])
}

fn write_answer(output: &mut Vec<f64>, result: &Result<Answer, PointError>, setup: &Setup) {
    let metric_count = setup.rule.measures.model_columns().count();
    output.push(point_code(result.as_ref().err()));
    let Ok(answer) = result else {
        let channels = Channel::ALL.len();
        let number_count = 2 + 2 * (7 + channels + metric_count) + channels;
        output.resize(output.len() + number_count, f64::NAN);
        return;
    };
    let Answer { outcome, amplitudes, ratios, level_indices, method_kinds, errors } = answer;
    output.push(f64::from(u8::from(outcome.sensitive == Some(true))));
    for (model, run) in [&outcome.nonlinear, &outcome.linear].into_iter().enumerate() {
        let error = errors[model].unwrap_or(f64::NAN);
        output.extend([level_indices[model] as f64, f64::from(method_kinds[model] as u8), error]);
        let Trajectory { status, fail_time_s, steps, min_gap_m, metrics, .. } = run;
        // Failures of runs are the first statuses, in the order of `Failure`.
        let failure = f64::from((*status as u8).min(Status::StepLimit as u8));
        let or_nan = |value: &Option<f64>| value.unwrap_or(f64::NAN);
        output.extend([failure, or_nan(fail_time_s), *steps as f64, or_nan(min_gap_m)]);
        output.extend(amplitudes[model]);
        let metrics = metrics.iter().copied().chain(std::iter::repeat(f64::NAN));
        output.extend(metrics.take(metric_count));
    }
    output.extend(ratios.iter().map(|ratio| ratio.unwrap_or(f64::NAN)));
    output.push(outcome.static_sag_m.unwrap_or(f64::NAN));
}
