//! The linear model's outputs: first order in the coordinates, harmonics 0 and 1 in theta.

use crate::coefficients::Bodies;
use crate::harmonics::{Term, TermLanes};
use crate::lanes::GetLane;
use crate::linear::seeded;
use crate::nonlinear::COORDINATES;
use crate::outputs::{Axes, CHANNELS, Motion, RADIAL};
use crate::spin::SpinState;
use lane_ode::{Lane, N, Real, Sample};

/// Every channel, then the two components of the radial distance.
const OUTPUTS: usize = CHANNELS + RADIAL;

/// Angles that determine harmonics 0 and 1: cos and sin of 2 pi k / 3.
const SAMPLES: [(f64, f64); 3] =
    [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];

/// A constant column, then one per coordinate.
const COLUMNS: usize = COORDINATES + 1;

/// Below this share of the largest coefficient a term is the sampling's rounding.
const NOISE: f64 = 1e-13;

/// What the outputs are sums of: 1, cos and sin of theta, each times 1 and every coordinate.
pub(crate) const FEATURES: usize = 3 * COLUMNS;

/// The outputs, as sparse terms.
#[derive(Clone, Debug)]
pub(crate) struct LinearOutputs {
    channels: Vec<Term>,
    radial: Vec<Term>,
}

/// One machine's outputs per lane.
pub(crate) struct OutputLanes<T> {
    channels: TermLanes<T>,
    radial: TermLanes<T>,
}

impl<T: Lane> OutputLanes<T> {
    pub(crate) fn splat(zero: N<T>, outputs: &LinearOutputs) -> Self {
        Self {
            channels: TermLanes::splat(zero, &outputs.channels),
            radial: TermLanes::splat(zero, &outputs.radial),
        }
    }

    pub(crate) fn set_lane(&mut self, lane: usize, outputs: &LinearOutputs) {
        self.channels.set_lane(lane, &outputs.channels);
        self.radial.set_lane(lane, &outputs.radial);
    }

    /// Deviations of the channels from equilibrium, where the features move.
    #[inline(always)]
    pub(crate) fn channels(&self, features: &Features<T>) -> [Sample<T>; CHANNELS] {
        samples(&self.channels, features)
    }

    /// The drum's front centre from the tub axis, along t2 and t3.
    #[inline(always)]
    pub(crate) fn radial(&self, features: &Features<T>) -> [Sample<T>; RADIAL] {
        samples(&self.radial, features)
    }
}

#[inline(always)]
fn samples<T: Lane, const M: usize>(terms: &TermLanes<T>, features: &Features<T>) -> [Sample<T>; M] {
    let zero = features[0][1];
    let mut sums = [[zero; 3]; M];
    terms.sum(features, &mut sums);
    core::array::from_fn(|i| Sample { value: sums[i][0], slope: sums[i][1], curvature: sums[i][2] })
}

/// The features with two time derivatives.
pub(crate) type Features<T> = [[N<T>; 3]; FEATURES];

/// The features at deviations from equilibrium in motion; written in place, because they are too many to be moved.
#[inline(always)]
pub(crate) fn write_features<T: Real>(spin: &SpinState<T>, motion: &Motion<T>, features: &mut Features<T>) {
    let zero = spin.sin.lit(0.0);
    let (n, nn) = (spin.speed, (spin.speed * spin.speed).v());
    let acceleration = spin.acceleration;
    let one = [zero.lit(1.0), zero, zero];
    let cos = [spin.cos, -(n * spin.sin).v(), -(acceleration * spin.sin + nn * spin.cos)];
    let sin = [spin.sin, (n * spin.cos).v(), acceleration * spin.cos - nn * spin.sin];
    features[0] = one;
    features[COLUMNS] = cos;
    features[2 * COLUMNS] = sin;
    for j in 0..COORDINATES {
        let q = [motion.q[j], motion.u[j], motion.a[j]];
        features[1 + j] = q;
        features[COLUMNS + 1 + j] = product(&cos, &q);
        features[2 * COLUMNS + 1 + j] = product(&sin, &q);
    }
}

/// A product with its two derivatives.
#[inline(always)]
fn product<T: Real>(a: &[N<T>; 3], b: &[N<T>; 3]) -> [N<T>; 3] {
    let slope = a[0] * b[1] + a[1] * b[0];
    let curvature = a[0] * b[2] + (a[2] * b[0] + 2.0 * (a[1] * b[1]).v());
    [(a[0] * b[0]).v(), slope, curvature]
}

/// Expands the nonlinear outputs of one machine per lane about the equilibrium `q`.
#[inline(always)]
pub(crate) fn linearise_outputs<T: Lane>(bodies: &Bodies<T>, q: &[N<T>; COORDINATES]) -> Vec<LinearOutputs> {
    let zero = q[0].lit(0.0);
    let lifted = bodies.constant();
    let still = [zero.constant(); COORDINATES];
    let mut samples = [[[zero; COLUMNS]; OUTPUTS]; 3];
    for (k, (cos, sin)) in SAMPLES.into_iter().enumerate() {
        let spin = SpinState::new((zero.lit(sin), zero.lit(cos)), zero, zero).constant();
        for j in 0..COORDINATES {
            let motion = Motion { q: seeded(q, j, 1.0), u: still, a: still };
            let axes = Axes::new(&spin, &motion);
            let (channels, radial) = (axes.channels(&lifted, &motion), axes.radial(&lifted, &motion));
            for (output, y) in channels.iter().chain(&radial).enumerate() {
                samples[k][output][0] = N(y.value.0.value);
                samples[k][output][1 + j] = N(y.value.0.slope);
            }
        }
    }
    (0..T::LANES).map(|lane| of_lane(&samples.get_lane(lane))).collect()
}

fn of_lane(samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3]) -> LinearOutputs {
    let mut terms = Vec::with_capacity(128);
    for output in 0..OUTPUTS {
        for column in 0..COLUMNS {
            let values = samples.map(|sample| sample[output][column].0);
            let mean = (values[0] + values[1] + values[2]) / 3.0;
            let cos = (2.0 * values[0] - values[1] - values[2]) / 3.0;
            let sin = (values[1] - values[2]) * 2.0 * SAMPLES[1].1 / 3.0;
            // Outputs of the linear model are linear in q: channels have no constant (model page, section 5).
            if column == 0 && output < CHANNELS {
                continue;
            }
            for (harmonic, coefficient) in [mean, cos, sin].into_iter().enumerate() {
                let key = (output as u16, (harmonic * COLUMNS + column) as u16);
                terms.push(Term { key, coefficient });
            }
        }
    }
    let largest = terms.iter().fold(0.0_f64, |m, t| m.max(t.coefficient.abs()));
    terms.retain(|term| term.coefficient.abs() > NOISE * largest);
    terms.sort_unstable_by_key(|term| term.key);
    let mut radial = terms.split_off(terms.partition_point(|term| usize::from(term.key.0) < CHANNELS));
    for term in &mut radial {
        term.key.0 -= CHANNELS as u16;
    }
    LinearOutputs { channels: terms, radial }
}
