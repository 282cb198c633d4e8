//! Computes the Campbell diagram: the modes over spin speed, and the speeds at which they resonate
//! (Eqs. 43 to 45, the paper's Fig. 7).
//!
//! The order of eigenvalues does not identify modes where two frequencies cross, but shapes do.
//! From speed to speed and from angle to angle, a mode continues as the mode with the greatest
//! modal assurance criterion (MAC), weighted by the mass matrix. An interval in which the least MAC
//! is too small is halved.

use crate::modes::modal_assurance;
use crate::modes::shape::dominant_motion;
use crate::{COORDINATES, Mode, ModeMotion, Modes, ModesError, Point, modes};
use core::f64::consts::TAU;
use lane_ode::Cancel;

/// The number of angles over which frequencies are averaged. Basis: twelve suffice for the mean
/// over harmonics 1 and 2 of theta; with 36 the errors of the least and of the greatest frequency
/// are below 1 - cos(pi / 36), or 0.4 %, of the variation. Doubling it reduces these errors to 0.1
/// %.
const ANGLE_COUNT: usize = 36;

/// The least MAC at which two shapes count as those of one mode. Basis: the usual threshold of
/// modal analysis. With twice this value, which no MAC reaches, every interval would be halved to
/// the limit.
const MIN_MODAL_ASSURANCE: f64 = 0.9;

/// The greatest number of halvings of an interval. Basis: the two modes of a shaft without a
/// preferred direction are indistinguishable in intervals of any length. Doubling it takes up to 64
/// times as long for such modes.
const MAX_INTERVAL_HALVINGS: u32 = 6;

/// The tolerance of a resonance speed (rpm). Basis: far below any printed digit. Doubling it saves
/// less than a step.
const RESONANCE_TOLERANCE_RPM: f64 = 1e-6;

/// The greatest number of steps of the search for a resonance. Basis: bisection alone needs 30.
/// Doubling it changes nothing.
const MAX_SEARCH_STEPS: usize = 60;

/// A mode at a speed, averaged over a turn of theta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeAtSpeed {
    /// The mean real part of s (1/s).
    pub re_per_s: f64,
    /// The mean imaginary part of s (rad/s).
    pub im_rad_per_s: f64,
    pub damping_ratio: f64,
    /// The mean damped natural frequency (cycles per minute).
    pub frequency_rpm: f64,
    /// The least value of the damped natural frequency over the turn.
    pub min_frequency_rpm: f64,
    /// The greatest value of the damped natural frequency over the turn.
    pub max_frequency_rpm: f64,
    /// The coordinates q1 to q10 (m, rad) at theta = 0 as real and imaginary part, of unit modal
    /// mass.
    pub shape: [[f64; 2]; COORDINATES],
}

/// A spin speed that equals a mode's damped natural frequency, as a mean over a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    pub speed_rpm: f64,
    /// The mode at that speed.
    pub mode: ModeAtSpeed,
}

/// A mode over speed.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeOverSpeed {
    /// The dominant motion at the first resonance, or else at the lowest speed.
    pub motion: ModeMotion,
    /// The mode at each speed.
    pub modes_at_speeds: Vec<ModeAtSpeed>,
    /// The resonances in rising order.
    pub resonances: Vec<Resonance>,
}

/// Follows every mode over rising speeds (rpm, at least one), each averaged over a turn of theta;
/// modes are in the order of their magnitude |s| at the lowest speed.
///
/// # Errors
/// [`ModesError`] at any of the speeds.
pub fn campbell(point: &Point, speeds_rpm: &[f64]) -> Result<Vec<ModeOverSpeed>, ModesError> {
    Ok(campbell_until(point, speeds_rpm, Cancel::Never)?.unwrap_or_default())
}

/// Follows every mode as [`campbell`] does; returns `None` once `cancel` is requested.
///
/// # Errors
/// The errors of [`campbell`].
pub fn campbell_until(
    point: &Point,
    speeds_rpm: &[f64],
    cancel: Cancel<'_>,
) -> Result<Option<Vec<ModeOverSpeed>>, ModesError> {
    let Some(&lowest) = speeds_rpm.first() else { return Ok(Some(Vec::new())) };
    let mut averages_and_modes = Vec::with_capacity(speeds_rpm.len());
    let mut current_modes = modes(point, 0.0, to_rad_per_s(lowest))?;
    for (k, &speed) in speeds_rpm.iter().enumerate() {
        if cancel.is_requested() {
            return Ok(None);
        }
        if k > 0 {
            current_modes = follow_modes(&current_modes, speeds_rpm[k - 1], speed, &|rpm| {
                modes(point, 0.0, to_rad_per_s(rpm))
            })?;
        }
        averages_and_modes
            .push((average_over_turn(point, speed, &current_modes)?, current_modes.clone()));
    }
    let modes_over_speed = (0..COORDINATES)
        .map(|mode| {
            let mut resonances = Vec::new();
            for k in 1..speeds_rpm.len() {
                let frequency_excess =
                    [k - 1, k].map(|k| averages_and_modes[k].0[mode].frequency_rpm - speeds_rpm[k]);
                // An overdamped motion has no resonance, not even at standstill.
                if (frequency_excess[0] > 0.0) != (frequency_excess[1] > 0.0)
                    && frequency_excess[0] != 0.0
                {
                    let previous_modes = &averages_and_modes[k - 1].1;
                    let bracket_rpm = [speeds_rpm[k - 1], speeds_rpm[k]];
                    resonances.extend(find_resonance(
                        point,
                        mode,
                        previous_modes,
                        bracket_rpm,
                        frequency_excess,
                    )?);
                }
            }
            let modes_at_speeds: Vec<_> =
                averages_and_modes.iter().map(|(averages, _)| averages[mode]).collect();
            let dominant_shape = resonances
                .first()
                .map_or(modes_at_speeds[0].shape, |resonance| resonance.mode.shape);
            Ok(ModeOverSpeed {
                motion: dominant_motion(point, &averages_and_modes[0].1.mass, &dominant_shape),
                modes_at_speeds,
                resonances,
            })
        })
        .collect::<Result<_, _>>()?;
    Ok(Some(modes_over_speed))
}

fn to_rad_per_s(rpm: f64) -> f64 {
    rpm * TAU / 60.0
}

/// Returns the modes at the end of an interval of speeds (rpm) or of angles theta (rad), in the
/// order of the modes `start_modes` at the interval's start.
fn follow_modes(
    start_modes: &Modes,
    start_speed_or_theta: f64,
    end_speed_or_theta: f64,
    modes_at: &dyn Fn(f64) -> Result<Modes, ModesError>,
) -> Result<Modes, ModesError> {
    follow_halving(
        start_modes,
        start_speed_or_theta,
        end_speed_or_theta,
        modes_at,
        modes_at(end_speed_or_theta)?,
        MAX_INTERVAL_HALVINGS,
    )
}

/// Returns the modes `end_modes` in the order of the modes `start_modes`, and halves the interval
/// at most `remaining_halvings` times.
fn follow_halving(
    start_modes: &Modes,
    start_speed_or_theta: f64,
    end_speed_or_theta: f64,
    modes_at: &dyn Fn(f64) -> Result<Modes, ModesError>,
    end_modes: Modes,
    remaining_halvings: u32,
) -> Result<Modes, ModesError> {
    let (mode_order, assurance) = match_modes(start_modes, &end_modes);
    if assurance >= MIN_MODAL_ASSURANCE || remaining_halvings == 0 {
        return Ok(Modes { modes: mode_order.map(|k| end_modes.modes[k]), ..end_modes });
    }
    let midpoint = 0.5 * (start_speed_or_theta + end_speed_or_theta);
    let midpoint_modes = follow_halving(
        start_modes,
        start_speed_or_theta,
        midpoint,
        modes_at,
        modes_at(midpoint)?,
        remaining_halvings - 1,
    )?;
    follow_halving(
        &midpoint_modes,
        midpoint,
        end_speed_or_theta,
        modes_at,
        end_modes,
        remaining_halvings - 1,
    )
}

/// Returns for each mode of `start_modes` the index of the mode of `end_modes` that continues it,
/// and the least MAC of a pair. Pairs are formed in the order of falling MAC.
fn match_modes(start_modes: &Modes, end_modes: &Modes) -> ([usize; COORDINATES], f64) {
    let mut mode_pairs = Vec::with_capacity(COORDINATES * COORDINATES);
    for (i, before) in start_modes.modes.iter().enumerate() {
        for (j, after) in end_modes.modes.iter().enumerate() {
            mode_pairs.push((modal_assurance(&end_modes.mass, &before.shape, &after.shape), i, j));
        }
    }
    mode_pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut mode_order = [usize::MAX; COORDINATES];
    let mut min_assurance = 1.0_f64;
    for (assurance, i, j) in mode_pairs {
        if mode_order[i] == usize::MAX && !mode_order.contains(&j) {
            mode_order[i] = j;
            min_assurance = min_assurance.min(assurance);
        }
    }
    (mode_order, min_assurance)
}

/// Averages every mode at a speed over a turn. `start_modes` holds the modes at theta = 0.
fn average_over_turn(
    point: &Point,
    speed_rpm: f64,
    start_modes: &Modes,
) -> Result<[ModeAtSpeed; COORDINATES], ModesError> {
    let speed_rad_per_s = to_rad_per_s(speed_rpm);
    let mut modes_by_angle = vec![start_modes.clone()];
    for k in 1..ANGLE_COUNT {
        let angle_rad = |k: usize| TAU * k as f64 / ANGLE_COUNT as f64;
        let modes_at = |angle_rad| modes(point, angle_rad, speed_rad_per_s);
        modes_by_angle.push(follow_modes(
            &modes_by_angle[k - 1],
            angle_rad(k - 1),
            angle_rad(k),
            &modes_at,
        )?);
    }
    let to_rpm = |rad_per_s: f64| rad_per_s * 60.0 / TAU;
    Ok(core::array::from_fn(|mode| {
        let turn_modes = modes_by_angle.iter().map(|modes| &modes.modes[mode]);
        let mean_over_turn = |value: fn(&Mode) -> f64| {
            turn_modes.clone().map(value).sum::<f64>() / ANGLE_COUNT as f64
        };
        let frequencies_rad_per_s = turn_modes.clone().map(|mode| mode.im_rad_per_s);
        let re_per_s = mean_over_turn(|mode| mode.re_per_s);
        let im_rad_per_s = mean_over_turn(|mode| mode.im_rad_per_s);
        ModeAtSpeed {
            re_per_s,
            im_rad_per_s,
            damping_ratio: -re_per_s / mean_over_turn(|mode| mode.magnitude_rad_per_s),
            frequency_rpm: to_rpm(im_rad_per_s),
            min_frequency_rpm: to_rpm(frequencies_rad_per_s.clone().fold(f64::INFINITY, f64::min)),
            max_frequency_rpm: to_rpm(frequencies_rad_per_s.fold(f64::NEG_INFINITY, f64::max)),
            shape: start_modes.modes[mode].shape,
        }
    }))
}

/// Finds the speed between two at which the mode's frequency equals the speed, by the Illinois
/// method (M. Dowell, P. Jarratt, BIT 11 (1971) 168), which keeps the root bracketed. Returns
/// `None` if the difference changes its sign by a jump, because the motion becomes or ceases to be
/// overdamped.
fn find_resonance(
    point: &Point,
    mode: usize,
    previous_modes: &Modes,
    [start, end]: [f64; 2],
    [mut low_excess, mut high_excess]: [f64; 2],
) -> Result<Option<Resonance>, ModesError> {
    let mut low_rpm = start;
    let mut high_rpm = end;
    let mut last_moved_side = 0;
    for _ in 0..MAX_SEARCH_STEPS {
        let speed_rpm =
            (low_rpm * high_excess - high_rpm * low_excess) / (high_excess - low_excess);
        let end_modes = follow_modes(previous_modes, start, speed_rpm, &|rpm| {
            modes(point, 0.0, to_rad_per_s(rpm))
        })?;
        let resonance =
            Resonance { speed_rpm, mode: average_over_turn(point, speed_rpm, &end_modes)?[mode] };
        let frequency_excess_rpm = resonance.mode.frequency_rpm - speed_rpm;
        if frequency_excess_rpm.abs() < RESONANCE_TOLERANCE_RPM {
            return Ok(Some(resonance));
        }
        if high_rpm - low_rpm < RESONANCE_TOLERANCE_RPM {
            break;
        }
        if (frequency_excess_rpm > 0.0) == (high_excess > 0.0) {
            (high_rpm, high_excess) = (speed_rpm, frequency_excess_rpm);
            low_excess *= if last_moved_side == 1 { 0.5 } else { 1.0 };
            last_moved_side = 1;
        } else {
            (low_rpm, low_excess) = (speed_rpm, frequency_excess_rpm);
            high_excess *= if last_moved_side == -1 { 0.5 } else { 1.0 };
            last_moved_side = -1;
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests;
