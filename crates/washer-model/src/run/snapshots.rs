//! Outputs at given instants, of many trajectories side by side: what measurements are compared
//! with.

use crate::channel::CHANNELS;
use crate::coordinates::{STATES, TUB};
use crate::run::model::tub_samples;
use crate::run::suspension::forces;
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Lane, MAX_LANES, N, Sample};
use std::sync::Arc;

/// An instant this share of a step past its end is its end.
const SLACK: f64 = 1e-9;

/// Which share of a lane's step an instant (s) is at, if the step leads so far.
pub(super) fn share_of_step(time_s: f64, end_s: f64, length_s: f64) -> Option<f64> {
    // An idle lane's step has no length, nor does its time go on.
    let is_reached = length_s != 0.0 && time_s <= end_s + SLACK * length_s;
    is_reached.then(|| (1.0 - (end_s - time_s) / length_s).clamp(0.0, 1.0))
}

/// What a trajectory shows at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// Of each channel, in the order of `Channel::ALL`: the deviation from equilibrium (m, rad),
    /// its rate (m/s, rad/s) and its acceleration (m/s^2, rad/s^2).
    pub channels: [[f64; 3]; CHANNELS],
    /// Place (m, rad) and speed of the tub's coordinates.
    tub: [[f64; 2]; 4],
}

impl Snapshot {
    /// Sum of all forces on the cabinet along c1, c2 and c3 (N), of the model that was integrated.
    pub fn cabinet_force_n(&self, point: &Point, model: ModelKind) -> [f64; 3] {
        let mut state = [0.0; STATES];
        for (q, [place, speed]) in TUB.into_iter().zip(self.tub) {
            state[q] = place;
            state[COORDINATES + q] = speed;
        }
        forces(point, model, &state).cabinet_n
    }
}

/// One lane's instants, and what was seen at those that have passed.
#[derive(Default)]
struct Album {
    instants_s: Arc<[f64]>,
    seen: Vec<Snapshot>,
}

/// The recorder, over lanes. Inside a step an output is the polynomial of degree 5 that meets its
/// values, rates and accelerations at both ends.
pub(super) struct Snapshots<T> {
    albums: [Album; MAX_LANES],
    channels: [Sample<T>; CHANNELS],
    tub: [Sample<T>; 4],
}

impl<T: Lane> Snapshots<T> {
    #[inline(always)]
    pub(super) fn new(zero: N<T>) -> Self {
        let still = Sample::still(zero, zero);
        Self { albums: Default::default(), channels: [still; CHANNELS], tub: [still; 4] }
    }

    /// Begins a point's trajectory in one lane.
    pub(super) fn set_point(&mut self, lane: usize, point: &Point) {
        let instants_s = Arc::clone(&point.instants_s);
        self.albums[lane] = Album { seen: Vec::with_capacity(instants_s.len()), instants_s };
    }

    /// What was seen in one lane.
    pub(super) fn finish(&mut self, lane: usize) -> Vec<Snapshot> {
        std::mem::take(&mut self.albums[lane].seen)
    }

    /// A state whose derivative is `dx`, with its channels: at the end of a step, of which end and
    /// length (s) are given, or where a leg begins.
    #[inline(always)]
    pub(super) fn see(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        (x, dx): (&[N<T>; STATES], &[N<T>; STATES]),
        channels: &[Sample<T>; CHANNELS],
    ) {
        let tub = tub_samples(x, dx);
        if let Some((end_s, length_s)) = step {
            for lane in 0..T::LANES {
                let (end_s, length_s) = (end_s.0.get(lane), length_s.0.get(lane));
                let album = &mut self.albums[lane];
                while let Some(&time_s) = album.instants_s.get(album.seen.len())
                    && let Some(share) = share_of_step(time_s, end_s, length_s)
                {
                    let mut seen = Snapshot { channels: [[0.0; 3]; CHANNELS], tub: [[0.0; 2]; 4] };
                    for i in 0..CHANNELS {
                        let at = between(&self.channels[i], &channels[i], lane, length_s, share);
                        seen.channels[i] = [at.value.0, at.slope.0, at.curvature.0];
                    }
                    for i in 0..4 {
                        let at = between(&self.tub[i], &tub[i], lane, length_s, share);
                        seen.tub[i] = [at.value.0, at.slope.0];
                    }
                    album.seen.push(seen);
                }
            }
        }
        self.channels = *channels;
        self.tub = tub;
    }
}

/// One lane of an output, a `share` of a step from one sample to the next.
#[inline(always)]
fn between<T: Lane>(
    start: &Sample<T>,
    end: &Sample<T>,
    lane: usize,
    length_s: f64,
    share: f64,
) -> Sample<f64> {
    let of = |sample: &Sample<T>| Sample {
        value: N(sample.value.0.get(lane)),
        slope: N(sample.slope.0.get(lane)),
        curvature: N(sample.curvature.0.get(lane)),
    };
    Sample::between(&of(start), &of(end), N(length_s), share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::history::{Start, history};
    use crate::{
        Channel, Machine, Method, Profile, Recorders, Spin, Timing, prepare, simulate_with,
    };
    use lane_ode::Simd;

    #[test]
    fn snapshots_are_those_of_a_history_in_any_company() {
        let timing = Timing { end_s: 3.0, window_s: [0.0, 3.0], checkpoints: 0 };
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 300.0, ramp_s: 1.3 };
        let machines: Vec<(Machine, Spin)> = [0.2, 0.4, 0.6]
            .map(|mass_kg| {
                let mut machine = Machine::paper();
                machine.unbalance.mass_kg = mass_kg;
                (machine, spin.clone())
            })
            .into();
        let every_s = 0.0137;
        let instants: Arc<[f64]> = (0..=218).map(|k| f64::from(k) * every_s).collect();
        let points: Vec<Point> = prepare(Simd::best(), &machines, &timing)
            .into_iter()
            .map(|point| point.unwrap().seen_at(Arc::clone(&instants)))
            .collect();
        let wanted = Recorders { snapshots: true, ..Recorders::default() };
        let method = Method::Rk4 { step_s: 2e-4 };
        for model in ModelKind::ALL {
            let all: Vec<&Point> = points.iter().collect();
            let (_, together) = simulate_with(Simd::best(), model, &method, &all, wanted);
            let (_, alone) = simulate_with(Simd::Scalar, model, &method, &all[1..2], wanted);
            assert_eq!(together[1].snapshots, alone[0].snapshots);
            let known = history(model, &method, all[1], &Start::default(), every_s);
            let mut largest = [0.0_f64; 3];
            let mut apart = [0.0_f64; 3];
            let yaw = Channel::TubYaw.index();
            for (k, seen) in alone[0].snapshots.iter().enumerate() {
                let expected = known.instant(k).unwrap();
                let pair = [
                    (seen.channels[yaw][0], expected.channels[yaw]),
                    (seen.channels[yaw][1], expected.rates[yaw]),
                    (seen.channels[yaw][2], expected.accelerations[yaw]),
                ];
                for (i, (ours, theirs)) in pair.into_iter().enumerate() {
                    largest[i] = largest[i].max(theirs.abs());
                    apart[i] = apart[i].max((ours - theirs).abs());
                }
                let force = seen.cabinet_force_n(all[1], model);
                let theirs = known.forces(k).unwrap().cabinet_n;
                let apart_n = (0..3).map(|i| (force[i] - theirs[i]).abs()).fold(0.0, f64::max);
                assert!(apart_n < 1e-4, "{apart_n} N at {k}");
            }
            assert_eq!(alone[0].snapshots.len(), instants.len());
            let shares = [0, 1, 2].map(|i| apart[i] / largest[i]);
            assert!(shares[0] < 1e-9 && shares[1] < 1e-6 && shares[2] < 1e-4, "{shares:?}");
        }
    }
}
