//! Wrong units of speed and time, which are found before a search.
//!
//! An unbalance shakes the tub once a turn. So a record turns with the drum's angle in the right
//! units, whatever the machine's numbers are; in wrong units it does not. Units in which the record
//! turns with the drum are tried by a short fit each, and the best is named. In the right units no
//! other unit is tried, so that this costs no trajectory.

use std::f64::consts::TAU;

use super::algebra::{EigenDecomposition, dot, scale_to_unit_diagonal, subtract_mean};
use super::measurement::{MAX_ROW_SPACING_S, MAX_RUN_S, Signal, usual_step};
use super::model::{FitCase, FreeParameter, Problem};
use super::search::{Descent, DescentError, descend};
use super::statistics::MIN_EXPLAINED_RATIO;

/// Turns of the drum over which a record's amplitude and phase are taken as constant. Basis: a
/// resonance of a suspension with a tenth of the critical damping is five turns wide. Doubling it
/// blurs resonances; halving it tells fewer units apart.
const TURNS_PER_BLOCK: f64 = 2.0;
/// The least number of samples of such a block: four for each of its three numbers. Doubling it
/// makes blocks of coarse records longer than [`BLOCK_TURNS`].
const MIN_BLOCK_SAMPLES: usize = 12;
/// The least number of samples of a turn. Basis: with two, a motion cannot be told from one that
/// turns backwards. Doubling it leaves fast parts of coarse records out.
const MIN_SAMPLES_PER_TURN: f64 = 4.0;
/// The least part of a record's variance that turns with the drum in a unit that is tried. Basis:
/// of noise none does; and in a band of instability most of a record turns otherwise, in any unit.
/// Doubling it leaves out such records.
const MIN_TURNING_RATIO: f64 = 0.1;
/// The least ratio of the part by a unit to that by the unit as given. Basis: a right unit's part
/// is no such multiple of it in another. Doubling it leaves out records that turn a little in wrong
/// units too.
const MIN_TURNING_GAIN: f64 = 2.0;
/// The greatest number of evaluations of a short fit. Basis: test
/// `a_wrong_unit_of_speed_or_time_is_named`. Doubling it makes a trial as long as a fit.
pub(super) const MAX_TRIAL_EVALUATIONS: usize = 8;
/// The number of free parameters of a short fit: those that the record depends on most. Basis: two
/// describe the size and the time of a motion. Doubling it lengthens short fits.
const TRIAL_PARAMETER_COUNT: usize = 2;

/// The column whose unit may be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ClockColumn {
    Speed,
    Time,
}

/// A unit other than the column's own.
#[derive(Clone, Copy, Debug)]
struct ClockUnit {
    column: ClockColumn,
    name: &'static str,
    /// The size of the unit in the column's own.
    factor: f64,
}

/// Units in which speeds and times are recorded by mistake.
const CLOCK_UNITS: [ClockUnit; 12] = [
    ClockUnit { column: ClockColumn::Speed, name: "rad/s", factor: 60.0 / TAU },
    ClockUnit { column: ClockColumn::Speed, name: "Hz", factor: 60.0 },
    ClockUnit { column: ClockColumn::Speed, name: "degrees per s", factor: 1.0 / 6.0 },
    ClockUnit { column: ClockColumn::Speed, name: "tenths of rpm", factor: 0.1 },
    ClockUnit { column: ClockColumn::Speed, name: "tens of rpm", factor: 10.0 },
    ClockUnit { column: ClockColumn::Speed, name: "thousands of rpm", factor: 1e3 },
    ClockUnit { column: ClockColumn::Time, name: "min", factor: 60.0 },
    ClockUnit { column: ClockColumn::Time, name: "h", factor: 3600.0 },
    ClockUnit { column: ClockColumn::Time, name: "ms", factor: 1e-3 },
    ClockUnit { column: ClockColumn::Time, name: "hundredths of s", factor: 1e-2 },
    ClockUnit { column: ClockColumn::Time, name: "tenths of s", factor: 0.1 },
    ClockUnit { column: ClockColumn::Time, name: "tens of s", factor: 10.0 },
];

/// Returns for each file a clause that its column seems to be in another unit, if it does.
pub(super) fn find_suspected_units(
    problem: &Problem<'_>,
) -> Result<Vec<Option<String>>, DescentError> {
    (0..problem.cases.len()).map(|case| find_suspected_unit(problem, case)).collect()
}

fn find_suspected_unit(problem: &Problem<'_>, case: usize) -> Result<Option<String>, DescentError> {
    let fit_case = &problem.cases[case];
    let min_turning_ratio =
        MIN_TURNING_RATIO.max(MIN_TURNING_GAIN * compute_turning_ratio(fit_case));
    let mut best_unit: Option<(ClockUnit, f64)> = None;
    for unit in CLOCK_UNITS {
        let Some(converted_case) = convert_column(fit_case, unit) else { continue };
        let ratio = compute_turning_ratio(&converted_case);
        if ratio < min_turning_ratio {
            continue;
        }
        let explained_ratio = fit_shortly(problem, case, converted_case)?;
        // Half, as for the model itself: less is no evidence of this unit.
        let is_evident = explained_ratio.max(ratio) > MIN_EXPLAINED_RATIO;
        if is_evident && best_unit.is_none_or(|(_, best_ratio)| explained_ratio > best_ratio) {
            best_unit = Some((unit, explained_ratio));
        }
    }
    Ok(best_unit.map(|(unit, ratio)| {
        let (column, own_unit) = match unit.column {
            ClockColumn::Speed => ("speed_rpm", "rpm"),
            ClockColumn::Time => ("time_s", "s"),
        };
        let name = unit.name;
        let factor = unit.factor;
        let file_name = &fit_case.measurement.name;
        let evidence = if ratio > MIN_EXPLAINED_RATIO {
            format!("converted, a short fit explains {:.0} % of the record", 100.0 * ratio)
        } else {
            "converted, the record turns with the drum".to_owned()
        };
        format!(
            "{column} of {file_name} seems to be in {name}, expected {own_unit} (times \
             {factor:.5}): {evidence}"
        )
    }))
}

/// Returns a case whose column is converted from a unit; none if there is no such column, the run
/// would be too long, or its rows would show no turn of a drum.
fn convert_column(case: &FitCase, unit: ClockUnit) -> Option<FitCase> {
    let mut measurement = case.measurement.clone();
    let column = match unit.column {
        ClockColumn::Speed => measurement.speed_rpm.as_mut()?,
        ClockColumn::Time => &mut measurement.time_s,
    };
    column.iter_mut().for_each(|value| *value *= unit.factor);
    if let (ClockColumn::Time, Some(pulses)) = (unit.column, &mut measurement.pulses) {
        pulses.pulse_times_s.iter_mut().for_each(|pulse_time_s| *pulse_time_s *= unit.factor);
    }
    let end_s = *measurement.time_s.last()?;
    if end_s > MAX_RUN_S || usual_step(&measurement.time_s)? > MAX_ROW_SPACING_S {
        return None;
    }
    let smoothed_spin = measurement.smooth_spin();
    Some(FitCase { plan: case.plan.clone(), measurement, smoothed_spin })
}

/// Computes the part of a record's variance that turns with the drum, the mean of its signals: by
/// least squares, block by block, a constant and the drum's sine and cosine.
fn compute_turning_ratio(case: &FitCase) -> f64 {
    let turns = integrate_turns(case);
    let signals = &case.measurement.signals;
    let signal_turning_ratio = |signal: &Signal| {
        let samples: Vec<[f64; 2]> =
            signal.samples().map(|(row, value)| [turns[row], value]).collect();
        let centred_values = signal.centred_values();
        compute_turning_square(&samples) / dot(&centred_values, &centred_values)
    };
    signals.iter().map(signal_turning_ratio).sum::<f64>() / signals.len() as f64
}

/// Computes the turns of the drum up to every row, by the trapezoidal rule.
fn integrate_turns(case: &FitCase) -> Vec<f64> {
    let times = &case.measurement.time_s;
    let speeds: Vec<f64> = case.spin().speeds_rpm(times.iter().copied()).collect();
    let mut turns = vec![0.0; times.len()];
    for row in 1..times.len() {
        let mean_rpm = 0.5 * (speeds[row] + speeds[row - 1]);
        turns[row] = turns[row - 1] + mean_rpm.abs() / 60.0 * (times[row] - times[row - 1]);
    }
    turns
}

/// Computes the sum of squares that turns, of samples of turns and value: beyond what three numbers
/// a block explain of noise.
fn compute_turning_square(samples: &[[f64; 2]]) -> f64 {
    let mut sum = 0.0;
    let mut remaining = samples;
    while let Some(&[first_turn, _]) = remaining.first() {
        let count_in_block =
            remaining.partition_point(|[turn, _]| *turn < first_turn + TURNS_PER_BLOCK);
        let block_count = count_in_block.max(MIN_BLOCK_SAMPLES);
        if block_count > remaining.len() {
            break;
        }
        let (block, remaining_after) = remaining.split_at(block_count);
        remaining = remaining_after;
        if block_count as f64 >= MIN_SAMPLES_PER_TURN * (block[block_count - 1][0] - first_turn) {
            sum += explained_block_square(block);
        }
    }
    sum
}

/// Computes the part of a block's sum of squares about its mean that sine and cosine explain.
fn explained_block_square(block: &[[f64; 2]]) -> f64 {
    let values = subtract_mean(block.iter().map(|[_, value]| *value).collect()).0;
    let centred_wave = |wave: fn(f64) -> f64| {
        subtract_mean(block.iter().map(|[turn, _]| wave(TAU * turn.fract())).collect()).0
    };
    let centred_waves = [centred_wave(libm::cos), centred_wave(libm::sin)];
    let normal_matrix: Vec<Vec<f64>> =
        centred_waves.iter().map(|a| centred_waves.iter().map(|b| dot(a, b)).collect()).collect();
    let (unit_matrix, scales) = scale_to_unit_diagonal(&normal_matrix);
    let rhs: Vec<f64> =
        centred_waves.iter().zip(&scales).map(|(wave, scale)| dot(wave, &values) / scale).collect();
    // A block of a hundredth of a turn has a parabola, but no wave.
    let bounded_inverse = |value: f64| if value > 1e-3 { 1.0 / value } else { 0.0 };
    let explained_square =
        dot(&EigenDecomposition::from_matrix(&unit_matrix).apply(&rhs, bounded_inverse), &rhs);
    let noise_variance = (dot(&values, &values) - explained_square) / (block.len() as f64 - 3.0);
    explained_square - 2.0 * noise_variance
}

/// Fits the leading free parameters to a converted case alone, in few evaluations, and returns the
/// part of its variance that the model explains, the mean of its signals; 0 if it does not get
/// through.
fn fit_shortly(
    problem: &Problem<'_>,
    case: usize,
    converted_case: FitCase,
) -> Result<f64, DescentError> {
    let cases = vec![converted_case];
    let Ok(method) = Problem::select_method(&cases) else { return Ok(0.0) };
    let case_parameters = problem.free_parameters.iter().filter(|free| free.belongs_to(case));
    let trial_parameters =
        case_parameters.map(|free| FreeParameter { case: None, ..free.clone() }).collect();
    let trial_problem =
        Problem { cases, free_parameters: trial_parameters, fits_shift: false, method, ..*problem };
    let start = trial_problem.start_point();
    let evaluate = |x: &[f64]| {
        let comparisons = trial_problem.compare(x);
        if trial_problem.cancel.is_requested() {
            return Err(DescentError::Cancelled);
        }
        Ok(comparisons.map(|comparisons| trial_problem.normal_equations(&comparisons)))
    };
    let Some(equations) = evaluate(&start)? else { return Ok(0.0) };
    let relative_influence = |k: usize| equations.normal_matrix[k][k] * start[k] * start[k];
    let mut unknowns_by_influence: Vec<usize> = (0..start.len()).collect();
    unknowns_by_influence.sort_by(|&a, &b| relative_influence(b).total_cmp(&relative_influence(a)));
    let mut ranges: Vec<[f64; 2]> = start.iter().map(|&value| [value; 2]).collect();
    for &k in unknowns_by_influence.iter().take(TRIAL_PARAMETER_COUNT) {
        ranges[k] = trial_problem.unknown_range(k);
    }
    let descent = descend(&start, &ranges, MAX_TRIAL_EVALUATIONS, &evaluate)?;
    Ok(descent.map_or(0.0, |descent| compute_explained_ratio(&trial_problem, &descent)))
}

/// Returns whether the model explains most of the record at the end of a descent.
pub(super) fn explains_record(problem: &Problem<'_>, end: &Descent) -> bool {
    compute_explained_ratio(problem, end) > MIN_EXPLAINED_RATIO
}

/// Computes the part of the record's variance that the model explains at the end of a descent, the
/// mean of its signals.
fn compute_explained_ratio(problem: &Problem<'_>, descent: &Descent) -> f64 {
    let signals = problem.signals().zip(&descent.equations.sigma);
    let signal_explained_ratio = |((.., signal), sigma): ((usize, usize, &Signal), &f64)| {
        let centred_values = signal.centred_values();
        1.0 - sigma * sigma * centred_values.len() as f64 / dot(&centred_values, &centred_values)
    };
    signals.map(signal_explained_ratio).sum::<f64>() / descent.equations.sigma.len() as f64
}
