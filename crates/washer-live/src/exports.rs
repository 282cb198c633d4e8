//! The module's exports. A caller writes numbers where [`input`] says and calls a function with how
//! many they are; what it returns is how many numbers stand at [`output`], 0 if there is no answer.
//!
//! Numbers are 64 bit floats. An answer is 1, or 0 if the point is impossible or -1 if it has no
//! equilibrium; whether it is sensitive; a record of each model, the nonlinear one first; the ratio
//! of each channel; the static sag (m). What is not there is NaN.
//!
//! A record is the level's place and name, the error left, `failure` (0 none, 1 diverged, 2 step
//! too small, 3 step limit), its time (s), `steps`, the least gap (m), the amplitude of each
//! channel and the map's metrics of the model.
#![allow(unsafe_code)]
// A module's exports are not this crate's.
#![allow(unreachable_pub)]

use std::sync::{Mutex, MutexGuard, PoisonError};

use lane_ode::{Failure, Simd};
use washer_model::{Channel, ModelKind, instants};
use washer_row::{Status, Trajectory};

use crate::point::{Answer, NoPoint, Scenario, check, motion};
use crate::setup::Setup;

#[derive(Default)]
struct State {
    input: Vec<f64>,
    output: Vec<f64>,
    setup: Option<Setup>,
}

static STATE: Mutex<State> =
    Mutex::new(State { input: Vec::new(), output: Vec::new(), setup: None });

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes room for so many numbers and says where.
// SAFETY (of every export): no other symbol of the module has its name.
#[unsafe(no_mangle)]
pub extern "C" fn input(count: usize) -> *mut f64 {
    let mut state = state();
    state.input.clear();
    state.input.resize(count, 0.0);
    state.input.as_mut_ptr()
}

/// Where the last answer stands, until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const f64 {
    state().output.as_ptr()
}

/// Trajectories side by side.
#[unsafe(no_mangle)]
pub extern "C" fn lanes() -> usize {
    Simd::best().lanes()
}

/// Takes a setup; 1 if it is one.
#[unsafe(no_mangle)]
pub extern "C" fn setup() -> usize {
    let state = &mut *state();
    state.setup = Setup::from_numbers(&state.input);
    usize::from(state.setup.is_some())
}

/// Answers by the setup and the input; without a setup there is no answer.
fn answer(write: impl FnOnce(&Setup, &[f64], &mut Vec<f64>)) -> usize {
    let State { input, output, setup } = &mut *state();
    output.clear();
    if let Some(setup) = setup {
        write(setup, input, output);
    }
    output.len()
}

/// Both models at the quick level at points of so many values each: an answer for each point.
#[unsafe(no_mangle)]
pub extern "C" fn quick(values: usize) -> usize {
    answer(|setup, input, output| {
        let points: Vec<&[f64]> = input.chunks_exact(values.max(1)).collect();
        for found in crate::quick(setup, &points) {
            write_answer(output, &found, setup);
        }
    })
}

/// One checked point: its answer.
#[unsafe(no_mangle)]
pub extern "C" fn checked() -> usize {
    answer(|setup, input, output| write_answer(output, &check(setup, input), setup))
}

/// The motion of a model (0 nonlinear, 1 linear) at a point at a refinement level, or at the quick
/// one if there is none of this number: 1, 0 or -1 as above, the failure and its time, how many
/// instants; of each, the channels and the gap.
#[unsafe(no_mangle)]
pub extern "C" fn history(model: usize, place: usize, every_s: f64) -> usize {
    let model = if model == 0 { ModelKind::Nonlinear } else { ModelKind::Linear };
    answer(|setup, input, output| match motion(setup, input, model, Some(place), every_s) {
        Err(why) => output.push(code(Some(&why))),
        Ok(motion) => {
            let [failure, time_s] = failure(motion.failure);
            output.extend([1.0, failure, time_s, motion.gaps_m.len() as f64]);
            for (channels, gap_m) in motion.channels.iter().zip(&motion.gaps_m) {
                output.extend(channels);
                output.push(*gap_m);
            }
        }
    })
}

/// How disturbances grow at a point of so many values while the drum turns at the constant speeds
/// (rpm) behind them: 1, 0 or -1 as above; for each speed how fast the fastest one grows (1/s; NaN
/// where there is no periodic response), its frequency (cycles per minute), what it is, by its
/// place among [`washer_model::Kind::ALL`], and 1 where the response is on the curve of a machine
/// that runs up, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn growth(values: usize) -> usize {
    answer(|setup, input, output| {
        let Some((values, speeds_rpm)) = input.split_at_checked(values) else { return };
        let found = crate::growth(setup, values, speeds_rpm);
        output.push(code(found.as_ref().err()));
        for disturbance in found.unwrap_or_default() {
            output.extend(disturbance.map_or([f64::NAN; 4], |(of, is_on_curve)| {
                let [kind, on_curve] = [of.kind() as u8, u8::from(is_on_curve)].map(f64::from);
                [of.growth_per_s(), of.frequency_cpm(), kind, on_curve]
            }));
        }
    })
}

/// How far the motions go that a point of so many values ends in at the constant speeds (rpm)
/// behind them: 1, 0 or -1 as above; the speed at which the tub turns farthest (NaN where nothing
/// was found), what that motion is, by its place among [`washer_model::Ending::KIND_NAMES`], and the
/// largest deviation of each channel (m, rad).
#[unsafe(no_mangle)]
pub extern "C" fn dwell(values: usize) -> usize {
    answer(|setup, input, output| {
        let Some((values, speeds_rpm)) = input.split_at_checked(values) else { return };
        let found = crate::dwell(setup, values, speeds_rpm);
        output.push(code(found.as_ref().err()));
        match found.ok().flatten() {
            Some(dwelt) => {
                output.extend([dwelt.speed_rpm, dwelt.kind as f64]);
                output.extend(dwelt.deviations);
            }
            None => output.extend([f64::NAN; 2 + Channel::ALL.len()]),
        }
    })
}

/// Speeds (rpm) at a point, every `every_s` from 0 to the end.
#[unsafe(no_mangle)]
pub extern "C" fn speeds(every_s: f64) -> usize {
    answer(|setup, input, output| {
        if let Ok(scenario) = Scenario::new(setup, input) {
            let places = 0..instants(setup.rule.end_s, every_s);
            let times_s = places.map(|k| k as f64 * every_s);
            output.extend(scenario.spin.speeds_rpm(times_s));
        }
    })
}

fn code(why: Option<&NoPoint>) -> f64 {
    match why {
        None => 1.0,
        Some(NoPoint::Impossible) => 0.0,
        Some(NoPoint::NoEquilibrium) => -1.0,
    }
}

/// Why and when (s) a run failed; the reasons in the order of [`Failure`].
fn failure(failure: Option<(Failure, f64)>) -> [f64; 2] {
    failure.map_or([0.0, f64::NAN], |(why, time_s)| [1.0 + f64::from(why as u8), time_s])
}

fn write_answer(output: &mut Vec<f64>, found: &Result<Answer, NoPoint>, setup: &Setup) {
    let metrics = setup.rule.measures.of_model().count();
    output.push(code(found.as_ref().err()));
    let Ok(answer) = found else {
        let channels = Channel::ALL.len();
        let width = 2 + 2 * (7 + channels + metrics) + channels;
        output.resize(output.len() + width, f64::NAN);
        return;
    };
    let Answer { outcome, amplitudes, ratios, places, levels, errors } = answer;
    output.push(f64::from(u8::from(outcome.sensitive == Some(true))));
    for (model, run) in [&outcome.nonlinear, &outcome.linear].into_iter().enumerate() {
        let error = errors[model].unwrap_or(f64::NAN);
        output.extend([places[model] as f64, f64::from(levels[model] as u8), error]);
        let Trajectory { status, fail_time_s, steps, min_gap_m, metrics: found, .. } = run;
        // Those of runs come first, in the order of `Failure`.
        let failure = f64::from((*status as u8).min(Status::StepLimit as u8));
        let or_none = |value: &Option<f64>| value.unwrap_or(f64::NAN);
        output.extend([failure, or_none(fail_time_s), *steps as f64, or_none(min_gap_m)]);
        output.extend(amplitudes[model]);
        let found = found.iter().copied().chain(std::iter::repeat(f64::NAN));
        output.extend(found.take(metrics));
    }
    output.extend(ratios.iter().map(|ratio| ratio.unwrap_or(f64::NAN)));
    output.push(outcome.static_sag_m.unwrap_or(f64::NAN));
}
