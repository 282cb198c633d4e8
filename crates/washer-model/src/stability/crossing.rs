//! Disturbances while a run crosses a band of speeds: the run itself by classical Runge-Kutta on
//! the machine as it is, its tangent map by dual numbers along it.

use super::Response;
use super::turn::step;
use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES, mirrored};
use crate::machine::spin::{SpinStretch, stretch_at};
use crate::nonlinear::coupling::Coupling;
use crate::point::Point;
use crate::run::model::{LaneModel, Nonlinear};
use core::f64::consts::TAU;
use faer::linalg::solvers::Solve as _;
use faer::{Mat, Side};
use lane_ode::{Aside, Kernel, Lane, N, Simd, System};

/// A stretch of time in which a run crosses a band of speeds.
#[derive(Clone, Copy, Debug)]
pub struct Crossing<'a> {
    /// When it enters the band and when it leaves it (s).
    pub from_to_s: [f64; 2],
    /// The periodic responses at the speeds of those two times, where there are any; where the drum
    /// turns backwards, those of the mirrored machine, whose drum turns forwards.
    pub responses: [Option<&'a Response>; 2],
    /// Whether the drum turns backwards.
    pub is_backward: bool,
}

/// The effect of a crossing on disturbances, measured by their energy: kinetic, and that of the
/// linear stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossed {
    /// Largest factor by which the amplitude of a small disturbance grows: the largest singular
    /// value of the tangent map in units of the square root of energy.
    pub amplification: f64,
    /// Energy (J) of the run's own departure from the periodic response, at both ends; none where
    /// there is no response.
    pub departure_j: [Option<f64>; 2],
}

/// A run that left the range in which the model means anything.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the nonlinear run leaves the model's range at {time_s:.3} s")]
pub struct LeftRange {
    /// When (s).
    pub time_s: f64,
}

/// Follows a point's nonlinear run from rest through crossings, in order of time and apart, in
/// steps of at most `step_s`.
///
/// # Errors
/// Per crossing, [`LeftRange`] where the run does not get to its end.
#[must_use]
pub fn cross(
    point: &Point,
    step_s: f64,
    crossings: &[Crossing<'_>],
) -> Vec<Result<Crossed, LeftRange>> {
    let start = <Nonlinear<f64> as LaneModel<f64>>::at_rest(point);
    let mut time_s = 0.0;
    let mut state = start;
    let mut failure = None;
    let mut crossed = Vec::with_capacity(crossings.len());
    for crossing in crossings {
        let mut follow = |to_s: f64| -> Result<[f64; STATES], LeftRange> {
            if let Some(failure) = failure {
                return Err(failure);
            }
            let followed = run(point, step_s, [time_s, to_s], &state);
            failure = followed.failure;
            (time_s, state) = (to_s, followed.end);
            failure.map_or(Ok(state), Err)
        };
        let [from_s, to_s] = crossing.from_to_s;
        crossed.push(follow(from_s).and_then(|entry| {
            let exit = follow(to_s)?;
            let map = Simd::dispatch_narrow(Tangent { point, step_s, crossing, entry: &entry });
            let energies = crossing.from_to_s.map(|at_s| Energy::new(point, at_s));
            let departure = |end: usize, state: &[f64; STATES]| {
                let response = crossing.responses[end]?;
                let at_s = crossing.from_to_s[end];
                let at = response_at(point, step_s, response, crossing.is_backward, at_s);
                let apart = core::array::from_fn(|i| state[i] - at[i]);
                Some(energies[end].of(&apart))
            };
            Ok(Crossed {
                amplification: amplification(&energies, &map),
                departure_j: [departure(0, &entry), departure(1, &exit)],
            })
        }));
    }
    crossed
}

/// Returns the largest deviations (m, rad; in the order of [`Channel::ALL`](crate::Channel::ALL))
/// of the nonlinear model within a window, in a run that enters each crossing on the periodic
/// response instead of on what is left from before. The run is otherwise that of [`cross`]. None of
/// a crossing's own responses is there where it is `None`: the run then goes on as it is.
///
/// # Errors
/// [`LeftRange`].
pub fn peaks_without_departures(
    point: &Point,
    step_s: f64,
    crossings: &[Crossing<'_>],
    window_s: [f64; 2],
) -> Result<[f64; CHANNELS], LeftRange> {
    let mut state = <Nonlinear<f64> as LaneModel<f64>>::at_rest(point);
    let mut time_s = 0.0;
    let mut peaks = [0.0_f64; CHANNELS];
    let mut follow = |to_s: f64, state: &mut [f64; STATES]| {
        // The window's edges are ends of stretches too.
        for edge_s in [window_s[0].min(to_s), window_s[1].min(to_s), to_s] {
            if edge_s > time_s {
                let followed = run(point, step_s, [time_s, edge_s], state);
                if let Some(failure) = followed.failure {
                    return Err(failure);
                }
                if time_s >= window_s[0] && edge_s <= window_s[1] {
                    for (peak, further) in peaks.iter_mut().zip(followed.peaks) {
                        *peak = peak.max(further);
                    }
                }
                (time_s, *state) = (edge_s, followed.end);
            }
        }
        Ok(())
    };
    for crossing in crossings {
        let from_s = crossing.from_to_s[0];
        if from_s > window_s[1] {
            break;
        }
        follow(from_s, &mut state)?;
        if let Some(response) = crossing.responses[0] {
            state = response_at(point, step_s, response, crossing.is_backward, from_s);
        }
    }
    follow(window_s[1], &mut state)?;
    Ok(peaks)
}

/// Even steps within one stretch of the spin.
struct Leg {
    stretch: SpinStretch,
    start_s: f64,
    step_s: f64,
    steps: usize,
}

impl Leg {
    fn time_s(&self, steps: f64) -> f64 {
        self.start_s + self.step_s * steps
    }

    /// Returns the forcing of step `k`: at its start, its middle and its end.
    #[inline(always)]
    fn forcings<T: Lane, S: System<T, STATES>>(
        &self,
        zero: N<T>,
        system: &S,
        k: usize,
    ) -> [S::Forcing; 3] {
        let mut forcings = [system.forcing_aside(zero.lit(self.time_s(k as f64))); 3];
        // No closure: it would be compiled without the instruction set.
        for place in 1..3 {
            let steps = k as f64 + 0.5 * place as f64;
            forcings[place] = system.forcing_aside(zero.lit(self.time_s(steps)));
        }
        forcings
    }
}

/// Returns the time from `from_s` to `to_s`, cut where the spin has a kink.
fn legs(point: &Point, step_s: f64, [from_s, to_s]: [f64; 2]) -> Vec<Leg> {
    let kinks = point.stretches.iter().map(|stretch| stretch.start_s.0);
    let inside = kinks.filter(|&kink_s| kink_s > from_s && kink_s < to_s);
    let mut start_s = from_s;
    let mut legs = Vec::new();
    for end_s in inside.chain([to_s]) {
        let steps = ((end_s - start_s) / step_s).ceil().max(1.0);
        legs.push(Leg {
            stretch: point.stretches[stretch_at(&point.stretches, start_s)],
            start_s,
            step_s: (end_s - start_s) / steps,
            steps: steps as usize,
        });
        start_s = end_s;
    }
    legs
}

/// The end of a run over a stretch of time.
struct Followed {
    end: [f64; STATES],
    /// Largest deviations of the channels at steps, which are short beside any motion of theirs.
    peaks: [f64; CHANNELS],
    failure: Option<LeftRange>,
}

fn run(point: &Point, step_s: f64, from_to_s: [f64; 2], start: &[f64; STATES]) -> Followed {
    let legs = legs(point, step_s, from_to_s);
    Simd::one_lane(Run { point, legs: &legs, start })
}

struct Run<'a> {
    point: &'a Point,
    legs: &'a [Leg],
    start: &'a [f64; STATES],
}

impl Aside for Run<'_> {
    type Output = Followed;

    #[inline(always)]
    fn run(self) -> Followed {
        let zero = N(0.0);
        let mut model: Nonlinear<f64> = LaneModel::splat(zero, self.point, Coupling::Springs);
        let mut x = [zero; STATES];
        for i in 0..STATES {
            x[i] = N(self.start[i]);
        }
        let mut peaks = [0.0_f64; CHANNELS];
        let mut failure = None;
        'run: for leg in self.legs {
            model.set_spin(0, &leg.stretch);
            for k in 0..leg.steps {
                let forcings = leg.forcings(zero, &model, k);
                step(&model, N(leg.step_s), &forcings, &mut x);
                if !model.in_range(&x) {
                    failure = Some(LeftRange { time_s: leg.time_s(k as f64 + 1.0) });
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
        let mut end = [0.0; STATES];
        for i in 0..STATES {
            end[i] = x[i].0;
        }
        Followed { end, peaks, failure }
    }
}

/// The tangent map over a crossing: column by column what becomes of a unit of each coordinate and
/// speed. Lanes carry the columns.
struct Tangent<'a> {
    point: &'a Point,
    step_s: f64,
    crossing: &'a Crossing<'a>,
    entry: &'a [f64; STATES],
}

impl Kernel for Tangent<'_> {
    type Output = Vec<[f64; STATES]>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let zero = N(zero).constant();
        let legs = legs(self.point, self.step_s, self.crossing.from_to_s);
        let mut model: Nonlinear<lane_ode::Dual<T>> =
            LaneModel::splat(zero, self.point, Coupling::Springs);
        let mut columns = Vec::with_capacity(STATES);
        while columns.len() < STATES {
            let first = columns.len();
            let mut x = [zero; STATES];
            for i in 0..STATES {
                x[i] = zero.lit(self.entry[i]);
            }
            for lane in 0..T::LANES {
                // Lanes that are left over repeat the last.
                let column = (first + lane).min(STATES - 1);
                x[column].0.slope.set(lane, 1.0);
            }
            for leg in &legs {
                for lane in 0..T::LANES {
                    model.set_spin(lane, &leg.stretch);
                }
                for k in 0..leg.steps {
                    let forcings = leg.forcings(zero, &model, k);
                    step(&model, zero.lit(leg.step_s), &forcings, &mut x);
                }
            }
            for lane in 0..T::LANES.min(STATES - first) {
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

/// Returns the periodic response at the drum's angle of a time.
fn response_at(
    point: &Point,
    step_s: f64,
    response: &Response,
    is_backward: bool,
    at_s: f64,
) -> [f64; STATES] {
    let speed_rad_per_s = response.speed_rpm * TAU / 60.0;
    let (start, direction) = match is_backward {
        true => (mirrored(&response.start), -1.0),
        false => (response.start, 1.0),
    };
    let angle = (direction * theta_rad(point, at_s)).rem_euclid(TAU);
    let end_s = angle / speed_rad_per_s;
    if end_s <= 0.0 {
        return start;
    }
    let steps = (end_s / step_s).ceil().max(1.0);
    let leg = Leg {
        stretch: SpinStretch::steady(direction * response.speed_rpm),
        start_s: 0.0,
        step_s: end_s / steps,
        steps: steps as usize,
    };
    Simd::one_lane(Run { point, legs: &[leg], start: &start }).end
}

/// Returns the drum's angle (rad) at a time, up to whole turns.
fn theta_rad(point: &Point, at_s: f64) -> f64 {
    let spin = point.stretches[stretch_at(&point.stretches, at_s)].at(N(at_s));
    libm::atan2(spin.sin.0, spin.cos.0)
}

/// The energy of disturbances at the drum's angle of a time: L L^T of twice it, where it is
/// positive definite.
struct Energy {
    root: Option<Mat<f64>>,
}

impl Energy {
    fn new(point: &Point, at_s: f64) -> Self {
        let matrices = point.matrices(theta_rad(point, at_s), 0.0, 0.0);
        let twice = Mat::from_fn(STATES, STATES, |i, j| {
            let block_i = i / COORDINATES;
            let block_j = j / COORDINATES;
            let i = i % COORDINATES;
            let j = j % COORDINATES;
            match (block_i, block_j) {
                (0, 0) => 0.5 * (matrices.stiffness[i][j] + matrices.stiffness[j][i]),
                (1, 1) => matrices.mass[i][j],
                _ => 0.0,
            }
        });
        let root = twice.llt(Side::Lower).ok().map(|factors| factors.L().to_owned());
        Self { root }
    }

    /// Returns the energy (J) of a disturbance; not finite without a stable equilibrium.
    fn of(&self, disturbance: &[f64; STATES]) -> f64 {
        let Some(root) = &self.root else { return f64::NAN };
        let part = |j: usize| (j..STATES).map(|i| root[(i, j)] * disturbance[i]).sum::<f64>();
        0.5 * (0..STATES).map(|j| part(j) * part(j)).sum::<f64>()
    }
}

/// Returns the largest singular value of L2^T Phi L1^-T.
fn amplification([before, after]: &[Energy; 2], map: &[[f64; STATES]]) -> f64 {
    let (Some(before), Some(after)) = (&before.root, &after.root) else { return f64::NAN };
    let map = Mat::from_fn(STATES, STATES, |i, j| map[j][i]);
    let weighted = after.transpose() * &map;
    let scaled = before.partial_piv_lu().solve(weighted.transpose().to_owned());
    let values = scaled.singular_values();
    values.ok().and_then(|values| values.first().copied()).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests;
