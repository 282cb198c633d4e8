//! The growth of disturbances while a run crosses a band of speeds. Classical Runge-Kutta without
//! caps integrates the run, and dual numbers give its tangent map.

use super::Response;
use super::turn::integrate_step;
use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES, mirror_state};
use crate::machine::spin::{SpinSegment, segment_index};
use crate::nonlinear::coupling::Coupling;
use crate::point::Point;
use crate::run::model::{LaneModel, NonlinearModel};
use core::f64::consts::TAU;
use faer::linalg::solvers::Solve as _;
use faer::{Mat, Side};
use lane_ode::{Kernel, Lane, N, OutOfLine, Simd, System};

/// An interval of time in which a run crosses a band of speeds.
#[derive(Clone, Copy, Debug)]
pub struct Crossing<'a> {
    /// The times at which the run enters and leaves the band (s).
    pub interval_s: [f64; 2],
    /// The periodic responses at the speeds at which the run enters and leaves the band, if they
    /// exist; if the drum turns backwards, the responses of the mirrored machine, whose drum turns
    /// forwards.
    pub responses: [Option<&'a Response>; 2],
    /// Whether the drum turns backwards.
    pub is_backward: bool,
}

/// The effect of a crossing on disturbances, measured by their kinetic energy plus the elastic
/// energy of the linear stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossingEffect {
    /// The largest factor by which the amplitude of a small disturbance grows: the largest singular
    /// value of the tangent map in units of the square root of energy.
    pub amplification: f64,
    /// The energy (J) of the difference of the run's state and the periodic response at both ends;
    /// `None` without a response.
    pub departure_j: [Option<f64>; 2],
}

/// The error of a run that left the range in which the model holds.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the nonlinear run leaves the model's range at {time_s:.3} s")]
pub struct LeftRangeError {
    /// The time at which the run left the range (s).
    pub time_s: f64,
}

/// Integrates a point's nonlinear run from rest through crossings, which are in order of time and
/// do not overlap, in steps of at most `step_s`.
///
/// # Errors
/// Returns [`LeftRangeError`] for each crossing whose end the run does not reach.
#[must_use]
pub fn follow_crossings(
    point: &Point,
    step_s: f64,
    crossings: &[Crossing<'_>],
) -> Vec<Result<CrossingEffect, LeftRangeError>> {
    let rest_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(point);
    let mut current_s = 0.0;
    let mut state = rest_state;
    let mut failure = None;
    let mut effects = Vec::with_capacity(crossings.len());
    for crossing in crossings {
        let mut integrate_to = |to_s: f64| -> Result<[f64; STATES], LeftRangeError> {
            if let Some(failure) = failure {
                return Err(failure);
            }
            let result = integrate_run(point, step_s, [current_s, to_s], &state);
            failure = result.failure;
            (current_s, state) = (to_s, result.end_state);
            failure.map_or(Ok(state), Err)
        };
        let [from_s, to_s] = crossing.interval_s;
        effects.push(integrate_to(from_s).and_then(|entry_state| {
            let exit_state = integrate_to(to_s)?;
            let tangent_map = Simd::dispatch_narrow(TangentMap {
                point,
                step_s,
                crossing,
                entry_state: &entry_state,
            });
            let energy_norms = crossing.interval_s.map(|time_s| EnergyNorm::new(point, time_s));
            let departure_energy_j = |index: usize, state: &[f64; STATES]| {
                let response = crossing.responses[index]?;
                let time_s = crossing.interval_s[index];
                let response_state =
                    response_state_at(point, step_s, response, crossing.is_backward, time_s);
                let difference = core::array::from_fn(|i| state[i] - response_state[i]);
                Some(energy_norms[index].energy_j(&difference))
            };
            Ok(CrossingEffect {
                amplification: amplification(&energy_norms, &tangent_map),
                departure_j: [
                    departure_energy_j(0, &entry_state),
                    departure_energy_j(1, &exit_state),
                ],
            })
        }));
    }
    effects
}

/// Returns the largest deviations (m, rad; in the order of [`Channel::ALL`](crate::Channel::ALL))
/// of the nonlinear model within a window, in a run that enters each crossing on the periodic
/// response, without the departures of earlier crossings. The run is otherwise that of
/// [`follow_crossings`]. If a crossing's response at entry is `None`, the run continues unchanged.
///
/// # Errors
/// [`LeftRangeError`].
pub fn peaks_without_departures(
    point: &Point,
    step_s: f64,
    crossings: &[Crossing<'_>],
    window_s: [f64; 2],
) -> Result<[f64; CHANNELS], LeftRangeError> {
    let mut state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(point);
    let mut time_s = 0.0;
    let mut peaks = [0.0_f64; CHANNELS];
    let mut integrate_to = |to_s: f64, state: &mut [f64; STATES]| {
        // The run is divided at the ends of the window.
        for part_end_s in [window_s[0].min(to_s), window_s[1].min(to_s), to_s] {
            if part_end_s > time_s {
                let result = integrate_run(point, step_s, [time_s, part_end_s], state);
                if let Some(failure) = result.failure {
                    return Err(failure);
                }
                if time_s >= window_s[0] && part_end_s <= window_s[1] {
                    for (peak, step_peak) in peaks.iter_mut().zip(result.peaks) {
                        *peak = peak.max(step_peak);
                    }
                }
                (time_s, *state) = (part_end_s, result.end_state);
            }
        }
        Ok(())
    };
    for crossing in crossings {
        let from_s = crossing.interval_s[0];
        if from_s > window_s[1] {
            break;
        }
        integrate_to(from_s, &mut state)?;
        if let Some(response) = crossing.responses[0] {
            state = response_state_at(point, step_s, response, crossing.is_backward, from_s);
        }
    }
    integrate_to(window_s[1], &mut state)?;
    Ok(peaks)
}

/// A sequence of equal steps within one spin segment.
struct StepSequence {
    spin_segment: SpinSegment,
    start_s: f64,
    step_s: f64,
    step_count: usize,
}

impl StepSequence {
    /// Returns the time (s) after a number of steps.
    fn time_s(&self, step_count: f64) -> f64 {
        self.start_s + self.step_s * step_count
    }

    /// Returns the forcing at the start, the middle and the end of step `k`.
    #[inline(always)]
    fn forcings<T: Lane, S: System<T, STATES>>(
        &self,
        zero: N<T>,
        system: &S,
        k: usize,
    ) -> [S::Forcing; 3] {
        let mut forcings = [system.forcing_out_of_line(zero.lit(self.time_s(k as f64))); 3];
        // This is a loop, because a closure would be compiled without the instruction set.
        for instant in 1..3 {
            let step_count = k as f64 + 0.5 * instant as f64;
            forcings[instant] = system.forcing_out_of_line(zero.lit(self.time_s(step_count)));
        }
        forcings
    }
}

/// Divides the time from `from_s` to `to_s` at the kinks of the spin.
fn step_sequences(point: &Point, step_s: f64, [from_s, to_s]: [f64; 2]) -> Vec<StepSequence> {
    let kink_times_s = point.spin_segments.iter().map(|spin_segment| spin_segment.start_s.0);
    let inner_kinks_s = kink_times_s.filter(|&kink_s| kink_s > from_s && kink_s < to_s);
    let mut start_s = from_s;
    let mut sequences = Vec::new();
    for end_s in inner_kinks_s.chain([to_s]) {
        let step_count = ((end_s - start_s) / step_s).ceil().max(1.0);
        sequences.push(StepSequence {
            spin_segment: point.spin_segments[segment_index(&point.spin_segments, start_s)],
            start_s,
            step_s: (end_s - start_s) / step_count,
            step_count: step_count as usize,
        });
        start_s = end_s;
    }
    sequences
}

/// The result of a run over an interval of time.
struct RunResult {
    end_state: [f64; STATES],
    /// The largest deviations of the channels at the ends of steps.
    peaks: [f64; CHANNELS],
    failure: Option<LeftRangeError>,
}

fn integrate_run(
    point: &Point,
    step_s: f64,
    interval_s: [f64; 2],
    start_state: &[f64; STATES],
) -> RunResult {
    let sequences = step_sequences(point, step_s, interval_s);
    Simd::one_lane(SequenceIntegration { point, sequences: &sequences, start_state })
}

struct SequenceIntegration<'a> {
    point: &'a Point,
    sequences: &'a [StepSequence],
    start_state: &'a [f64; STATES],
}

impl OutOfLine for SequenceIntegration<'_> {
    type Output = RunResult;

    #[inline(always)]
    fn run(self) -> RunResult {
        let zero = N(0.0);
        let mut model: NonlinearModel<f64> = LaneModel::splat(zero, self.point, Coupling::Springs);
        let mut x = [zero; STATES];
        for i in 0..STATES {
            x[i] = N(self.start_state[i]);
        }
        let mut peaks = [0.0_f64; CHANNELS];
        let mut failure = None;
        'run: for sequence in self.sequences {
            model.set_spin(0, &sequence.spin_segment);
            for k in 0..sequence.step_count {
                let forcings = sequence.forcings(zero, &model, k);
                integrate_step(&model, N(sequence.step_s), &forcings, &mut x);
                if !model.in_range(&x) {
                    failure = Some(LeftRangeError { time_s: sequence.time_s(k as f64 + 1.0) });
                    break 'run;
                }
                if let (_, Some(channels)) = model.observe(&forcings[2], &x, &[zero; STATES], true)
                {
                    for i in 0..CHANNELS {
                        peaks[i] = peaks[i].max(channels[i].value.0.abs());
                    }
                }
            }
        }
        let mut end_state = [0.0; STATES];
        for i in 0..STATES {
            end_state[i] = x[i].0;
        }
        RunResult { end_state, peaks, failure }
    }
}

/// The computation of the tangent map over a crossing: the derivative of the state at the end by
/// the state at the start. Lanes hold the columns of the map.
struct TangentMap<'a> {
    point: &'a Point,
    step_s: f64,
    crossing: &'a Crossing<'a>,
    entry_state: &'a [f64; STATES],
}

impl Kernel for TangentMap<'_> {
    type Output = Vec<[f64; STATES]>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let zero = N(zero).constant();
        let sequences = step_sequences(self.point, self.step_s, self.crossing.interval_s);
        let mut model: NonlinearModel<lane_ode::Dual<T>> =
            LaneModel::splat(zero, self.point, Coupling::Springs);
        let mut columns = Vec::with_capacity(STATES);
        while columns.len() < STATES {
            let first_column = columns.len();
            let mut x = [zero; STATES];
            for i in 0..STATES {
                x[i] = zero.lit(self.entry_state[i]);
            }
            for lane in 0..T::LANES {
                // Surplus lanes repeat the last column.
                let column = (first_column + lane).min(STATES - 1);
                x[column].0.slope.set(lane, 1.0);
            }
            for sequence in &sequences {
                for lane in 0..T::LANES {
                    model.set_spin(lane, &sequence.spin_segment);
                }
                for k in 0..sequence.step_count {
                    let forcings = sequence.forcings(zero, &model, k);
                    integrate_step(&model, zero.lit(sequence.step_s), &forcings, &mut x);
                }
            }
            for lane in 0..T::LANES.min(STATES - first_column) {
                let mut column = [0.0; STATES];
                for i in 0..STATES {
                    column[i] = x[i].0.slope.get(lane);
                }
                columns.push(column);
            }
        }
        columns
    }
}

/// Returns the state of a periodic response at the drum's angle at a time.
fn response_state_at(
    point: &Point,
    step_s: f64,
    response: &Response,
    is_backward: bool,
    time_s: f64,
) -> [f64; STATES] {
    let speed_rad_per_s = response.speed_rpm * TAU / 60.0;
    let (start_state, direction) = match is_backward {
        true => (mirror_state(&response.start_state), -1.0),
        false => (response.start_state, 1.0),
    };
    let angle_rad = (direction * theta_rad(point, time_s)).rem_euclid(TAU);
    let end_s = angle_rad / speed_rad_per_s;
    if end_s <= 0.0 {
        return start_state;
    }
    let step_count = (end_s / step_s).ceil().max(1.0);
    let sequence = StepSequence {
        spin_segment: SpinSegment::at_constant_speed(direction * response.speed_rpm),
        start_s: 0.0,
        step_s: end_s / step_count,
        step_count: step_count as usize,
    };
    Simd::one_lane(SequenceIntegration { point, sequences: &[sequence], start_state: &start_state })
        .end_state
}

/// Returns the drum's angle (rad) at a time, from -pi to pi.
fn theta_rad(point: &Point, time_s: f64) -> f64 {
    let spin = point.spin_segments[segment_index(&point.spin_segments, time_s)].state_at(N(time_s));
    libm::atan2(spin.sin.0, spin.cos.0)
}

/// The energy norm of disturbances at the drum's angle at a time.
struct EnergyNorm {
    /// The Cholesky factor L of the matrix of twice the energy; `None` if the matrix is not
    /// positive definite.
    cholesky_factor: Option<Mat<f64>>,
}

impl EnergyNorm {
    fn new(point: &Point, time_s: f64) -> Self {
        let matrices = point.matrices(theta_rad(point, time_s), 0.0, 0.0);
        let doubled_energy_matrix = Mat::from_fn(STATES, STATES, |i, j| {
            let block_row = i / COORDINATES;
            let block_column = j / COORDINATES;
            let i = i % COORDINATES;
            let j = j % COORDINATES;
            match (block_row, block_column) {
                (0, 0) => 0.5 * (matrices.stiffness[i][j] + matrices.stiffness[j][i]),
                (1, 1) => matrices.mass[i][j],
                _ => 0.0,
            }
        });
        let cholesky_factor =
            doubled_energy_matrix.llt(Side::Lower).ok().map(|factors| factors.L().to_owned());
        Self { cholesky_factor }
    }

    /// Returns the energy (J) of a disturbance; NaN without a stable equilibrium.
    fn energy_j(&self, disturbance: &[f64; STATES]) -> f64 {
        let Some(cholesky_factor) = &self.cholesky_factor else { return f64::NAN };
        let weighted_component =
            |j: usize| (j..STATES).map(|i| cholesky_factor[(i, j)] * disturbance[i]).sum::<f64>();
        0.5 * (0..STATES).map(|j| weighted_component(j) * weighted_component(j)).sum::<f64>()
    }
}

/// Returns the largest singular value of L2^T Phi L1^-T, with the factors L1 at the entry and L2 at
/// the exit.
fn amplification([entry, exit]: &[EnergyNorm; 2], tangent_map: &[[f64; STATES]]) -> f64 {
    let (Some(entry), Some(exit)) = (&entry.cholesky_factor, &exit.cholesky_factor) else {
        return f64::NAN;
    };
    let tangent_map = Mat::from_fn(STATES, STATES, |i, j| tangent_map[j][i]);
    let weighted_map = exit.transpose() * &tangent_map;
    let scaled_map = entry.partial_piv_lu().solve(weighted_map.transpose().to_owned());
    let singular_values = scaled_map.singular_values();
    singular_values
        .ok()
        .and_then(|singular_values| singular_values.first().copied())
        .unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests;
