//! Records the outputs at given instants, which fits compare with measurements.

use crate::channel::CHANNELS;
use crate::coordinates::{STATES, TUB_COORDINATES};
use crate::run::model::tub_samples;
use crate::run::suspension::compute_forces;
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Lane, MAX_LANES, N, Sample};
use std::sync::Arc;

/// The tolerance within which an instant beyond the end of a step counts as at the end, relative to
/// the step. Basis: the rounding errors of times are far smaller. Doubling it changes nothing.
const END_TOLERANCE: f64 = 1e-9;

/// Returns the position of an instant (s) in a lane's step, from 0 at the start to 1 at the end;
/// `None` if the instant is beyond the end of the step.
pub(super) fn position_in_step(time_s: f64, end_s: f64, length_s: f64) -> Option<f64> {
    // The step of an idle lane has no length.
    let is_reached = length_s != 0.0 && time_s <= end_s + END_TOLERANCE * length_s;
    is_reached.then(|| (1.0 - (end_s - time_s) / length_s).clamp(0.0, 1.0))
}

/// The outputs of a trajectory at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The deviation of each channel from equilibrium (m, rad), its rate (m/s, rad/s) and its
    /// acceleration (m/s^2, rad/s^2), in the order of `Channel::ALL`.
    pub channels: [[f64; 3]; CHANNELS],
    /// The tub's coordinates (m, rad), each with its speed.
    tub_coordinates: [[f64; 2]; 4],
}

impl Snapshot {
    /// Computes the sum of all forces on the cabinet along c1, c2 and c3 (N). `point` and `model`
    /// are those of the trajectory.
    pub fn cabinet_force_n(&self, point: &Point, model: ModelKind) -> [f64; 3] {
        let mut state = [0.0; STATES];
        for (q, [position, speed]) in TUB_COORDINATES.into_iter().zip(self.tub_coordinates) {
            state[q] = position;
            state[COORDINATES + q] = speed;
        }
        compute_forces(point, model, &state).cabinet_force_n
    }
}

/// The instants of one lane, and the snapshots so far.
#[derive(Default)]
struct LaneSnapshots {
    instants_s: Arc<[f64]>,
    snapshots: Vec<Snapshot>,
}

/// The recorder of snapshots over lanes. Inside a step, an output is the polynomial of degree 5
/// with the output's values, rates and accelerations at both ends.
pub(super) struct Snapshots<T> {
    lanes: [LaneSnapshots; MAX_LANES],
    channels: [Sample<T>; CHANNELS],
    tub_coordinates: [Sample<T>; 4],
}

impl<T: Lane> Snapshots<T> {
    #[inline(always)]
    pub(super) fn new(zero: N<T>) -> Self {
        let zero_sample = Sample::constant(zero, zero);
        Self {
            lanes: Default::default(),
            channels: [zero_sample; CHANNELS],
            tub_coordinates: [zero_sample; 4],
        }
    }

    /// Begins a point's trajectory in one lane.
    pub(super) fn set_point(&mut self, lane: usize, point: &Point) {
        let instants_s = Arc::clone(&point.instants_s);
        let recorded_snapshots = Vec::with_capacity(instants_s.len());
        self.lanes[lane] = LaneSnapshots { instants_s, snapshots: recorded_snapshots };
    }

    /// Removes and returns the snapshots of one lane.
    pub(super) fn finish(&mut self, lane: usize) -> Vec<Snapshot> {
        std::mem::take(&mut self.lanes[lane].snapshots)
    }

    /// Records the snapshots within a step that ends at the state `x` with derivative `dx` and with
    /// `channels`. `step` has the end and the length of the step (s); it is `None` at the start of
    /// a segment.
    #[inline(always)]
    pub(super) fn record(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        (x, dx): (&[N<T>; STATES], &[N<T>; STATES]),
        channels: &[Sample<T>; CHANNELS],
    ) {
        let tub = tub_samples(x, dx);
        if let Some((end_s, length_s)) = step {
            for lane in 0..T::LANES {
                let end_s = end_s.0.get(lane);
                let length_s = length_s.0.get(lane);
                let LaneSnapshots { instants_s, snapshots: recorded_snapshots } =
                    &mut self.lanes[lane];
                while let Some(&time_s) = instants_s.get(recorded_snapshots.len())
                    && let Some(step_position) = position_in_step(time_s, end_s, length_s)
                {
                    let mut snapshot =
                        Snapshot { channels: [[0.0; 3]; CHANNELS], tub_coordinates: [[0.0; 2]; 4] };
                    for i in 0..CHANNELS {
                        let sample = interpolate(
                            &self.channels[i],
                            &channels[i],
                            lane,
                            length_s,
                            step_position,
                        );
                        snapshot.channels[i] = [sample.value.0, sample.slope.0, sample.curvature.0];
                    }
                    for i in 0..4 {
                        let sample = interpolate(
                            &self.tub_coordinates[i],
                            &tub[i],
                            lane,
                            length_s,
                            step_position,
                        );
                        snapshot.tub_coordinates[i] = [sample.value.0, sample.slope.0];
                    }
                    recorded_snapshots.push(snapshot);
                }
            }
        }
        self.channels = *channels;
        self.tub_coordinates = tub;
    }
}

/// Interpolates one lane of an output at a share of the step between two samples.
#[inline(always)]
fn interpolate<T: Lane>(
    start: &Sample<T>,
    end: &Sample<T>,
    lane: usize,
    length_s: f64,
    step_position: f64,
) -> Sample<f64> {
    let to_lane_sample = |sample: &Sample<T>| Sample {
        value: N(sample.value.0.get(lane)),
        slope: N(sample.slope.0.get(lane)),
        curvature: N(sample.curvature.0.get(lane)),
    };
    Sample::interpolate(&to_lane_sample(start), &to_lane_sample(end), N(length_s), step_position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::history::{InitialDeviation, integrate_history};
    use crate::{
        Channel, Machine, Method, Profile, Recorders, Spin, Timing, prepare, simulate_with,
    };
    use lane_ode::Simd;

    #[test]
    fn snapshots_agree_with_a_history_and_do_not_depend_on_other_lanes() {
        let timing = Timing { end_s: 3.0, window_s: [0.0, 3.0], checkpoints: 0 };
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 300.0, ramp_s: 1.3 };
        let machines: Vec<(Machine, Spin)> = [0.2, 0.4, 0.6]
            .map(|mass_kg| {
                let mut machine = Machine::paper();
                machine.unbalance.mass_kg = mass_kg;
                (machine, spin.clone())
            })
            .into();
        let interval_s = 0.0137;
        let instants_s: Arc<[f64]> = (0..=218).map(|k| f64::from(k) * interval_s).collect();
        let points: Vec<Point> = prepare(Simd::widest(), &machines, &timing)
            .into_iter()
            .map(|point| point.unwrap().with_snapshots_at(Arc::clone(&instants_s)))
            .collect();
        let recorders = Recorders { with_snapshots: true, ..Recorders::default() };
        let method = Method::rk4(2e-4);
        for model in ModelKind::ALL {
            let all_points: Vec<&Point> = points.iter().collect();
            let (_, readings_in_lanes) =
                simulate_with(Simd::widest(), model, &method, &all_points, recorders);
            let (_, single_reading) =
                simulate_with(Simd::Scalar, model, &method, &all_points[1..2], recorders);
            assert_eq!(readings_in_lanes[1].snapshots, single_reading[0].snapshots);
            let history = integrate_history(
                model,
                &method,
                all_points[1],
                &InitialDeviation::default(),
                interval_s,
            );
            let mut largest_values = [0.0_f64; 3];
            let mut largest_differences = [0.0_f64; 3];
            let yaw_index = Channel::TubYaw.index();
            for (k, snapshot) in single_reading[0].snapshots.iter().enumerate() {
                let expected = history.instant_outputs(k).unwrap();
                let pairs = [
                    (snapshot.channels[yaw_index][0], expected.channels[yaw_index]),
                    (snapshot.channels[yaw_index][1], expected.rates[yaw_index]),
                    (snapshot.channels[yaw_index][2], expected.accelerations[yaw_index]),
                ];
                for (i, (value, expected)) in pairs.into_iter().enumerate() {
                    largest_values[i] = largest_values[i].max(expected.abs());
                    largest_differences[i] = largest_differences[i].max((value - expected).abs());
                }
                let force = snapshot.cabinet_force_n(all_points[1], model);
                let expected = history.forces(k).unwrap().cabinet_force_n;
                let error_n = (0..3).map(|i| (force[i] - expected[i]).abs()).fold(0.0, f64::max);
                assert!(error_n < 1e-4, "{error_n} N at {k}");
            }
            assert_eq!(single_reading[0].snapshots.len(), instants_s.len());
            let errors = [0, 1, 2].map(|i| largest_differences[i] / largest_values[i]);
            assert!(errors[0] < 1e-9 && errors[1] < 1e-6 && errors[2] < 1e-4, "{errors:?}");
        }
    }
}
