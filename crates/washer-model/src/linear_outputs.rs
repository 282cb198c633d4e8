//! The linear model's outputs: exact first order in the coordinates, harmonics 0 and 1 in theta.
//!
//! The part of order zero is what turns with the drum while the machine rests at its equilibrium.

use crate::coefficients::Bodies;

use crate::lanes::{GetLane, SetLane, Splat};
use crate::linear::seeded;
use crate::nonlinear::COORDINATES;
use crate::outputs::{Axes, CHANNELS, Motion, RADIAL};
use crate::sparse::sparse_sums;
use crate::spin::SpinState;
use lane_ode::{Lane, N, Real, Sample};

/// Columns of an expansion: the slope along each coordinate, then the value at equilibrium.
const COLUMNS: usize = COORDINATES + 1;
const AT_REST: usize = COORDINATES;

/// Every channel, then the two components of the radial distance.
const OUTPUTS: usize = CHANNELS + RADIAL;

/// Angles that determine harmonics 0 and 1: cos and sin of 2 pi k / 3.
const SAMPLES: [(f64, f64); 3] =
    [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];

/// Channels in which the drum turns: its front centre, and the mass centre of the machine.
const TURNING: core::ops::Range<usize> = 2..6;

/// Entries of the channels' terms: each channel, then the cos and sin parts of those that turn.
const CHANNEL_ENTRIES: usize = CHANNELS + 2 * (TURNING.end - TURNING.start);
/// Likewise of the radial distance; both components turn.
const RADIAL_ENTRIES: usize = 3 * RADIAL;

/// Entries of the channels that hold a part of order zero. The equilibrium has the unbalance up and the hinge bent in the
/// vertical plane alone, so that nothing of it moves along c2 with the sine.
const CHANNELS_AT_REST: [usize; 10] = [2, 3, 4, 5, 8, 10, 11, 12, 14, 15];
/// Likewise of the radial distance: all.
const RADIAL_AT_REST: [usize; RADIAL_ENTRIES] = [0, 1, 2, 3, 4, 5];

// The functions that the terms are of.
const Q1: usize = 0;
const Q2: usize = 1;
const Q3: usize = 2;
const Q4: usize = 3;
const Q5: usize = 4;
const Q6: usize = 5;
const Q7: usize = 6;
const Q8: usize = 7;
const Q9: usize = 8;
const Q10: usize = 9;

sparse_sums! {
    /// Coefficients of the channels.
    ChannelTerms: COORDINATES => CHANNEL_ENTRIES;
    0 => Q1 Q6;
    1 => Q2 Q5 Q6;
    2 => Q3 Q8 Q10;
    3 => Q4 Q7 Q8 Q10;
    4 => Q1 Q3 Q6 Q8 Q10;
    5 => Q2 Q4 Q5 Q6 Q7 Q8 Q10;
    6 => Q5;
    7 => Q6;
    8 => Q8 Q10;
    9 => Q9;
    10 => Q7 Q8 Q9 Q10;
    11 => Q7 Q9 Q10;
    12 => Q8 Q10;
    13 => Q9;
    14 => Q7 Q8 Q9 Q10;
    15 => Q7 Q9 Q10;
}

sparse_sums! {
    /// Coefficients of the radial distance.
    RadialTerms: COORDINATES => RADIAL_ENTRIES;
    0 => Q1 Q2 Q3 Q4 Q5 Q6 Q7 Q8 Q10;
    1 => Q2 Q4 Q5 Q7 Q8 Q10;
    2 => Q5 Q6 Q7 Q8 Q9 Q10;
    3 => Q5 Q6 Q7 Q9 Q10;
    4 => Q5 Q7 Q8 Q9 Q10;
    5 => Q5 Q7 Q9 Q10;
}

/// The outputs of one machine in `f64`, of one per lane in `T`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearOutputs<T> {
    channels: ChannelTerms<T>,
    channels_at_rest: [N<T>; CHANNELS_AT_REST.len()],
    radial: RadialTerms<T>,
    radial_at_rest: [N<T>; RADIAL_AT_REST.len()],
}

impl<T: Lane> SetLane<LinearOutputs<f64>> for LinearOutputs<T> {
    fn set_lane(&mut self, lane: usize, from: &LinearOutputs<f64>) {
        self.channels.set_lane(lane, &from.channels);
        self.channels_at_rest.set_lane(lane, &from.channels_at_rest);
        self.radial.set_lane(lane, &from.radial);
        self.radial_at_rest.set_lane(lane, &from.radial_at_rest);
    }
}

impl<T: Lane> LinearOutputs<T> {
    #[inline(always)]
    pub(crate) fn splat(zero: N<T>, outputs: &LinearOutputs<f64>) -> Self {
        Self {
            channels: ChannelTerms::splat(zero, &outputs.channels),
            channels_at_rest: Splat::splat(zero, &outputs.channels_at_rest),
            radial: RadialTerms::splat(zero, &outputs.radial),
            radial_at_rest: Splat::splat(zero, &outputs.radial_at_rest),
        }
    }

    /// Deviations of the channels from equilibrium, unbalance up.
    #[inline(always)]
    pub(crate) fn channels(&self, of: &LinearMotion<T>) -> [Sample<T>; CHANNELS] {
        let mut sums = [[of.cos[0].lit(0.0); 3]; CHANNEL_ENTRIES];
        self.channels.sum(&of.coordinates, &mut sums);
        add_at_rest(&mut sums, &CHANNELS_AT_REST, &self.channels_at_rest);
        of.turned::<CHANNEL_ENTRIES, CHANNELS>(sums, TURNING)
    }

    /// The drum's front centre from the tub axis, along t2 and t3.
    #[inline(always)]
    pub(crate) fn radial(&self, of: &LinearMotion<T>) -> [Sample<T>; RADIAL] {
        let mut sums = [[of.cos[0].lit(0.0); 3]; RADIAL_ENTRIES];
        self.radial.sum(&of.coordinates, &mut sums);
        add_at_rest(&mut sums, &RADIAL_AT_REST, &self.radial_at_rest);
        of.turned::<RADIAL_ENTRIES, RADIAL>(sums, 0..RADIAL)
    }
}

/// Adds the parts of order zero, which have no derivatives of their own: an entry's turn brings them.
#[inline(always)]
fn add_at_rest<T: Real, const ENTRIES: usize, const K: usize>(
    sums: &mut [[N<T>; 3]; ENTRIES],
    places: &[usize; K],
    at_rest: &[N<T>; K],
) {
    for i in 0..K {
        sums[places[i]][0] += at_rest[i];
    }
}

/// What the outputs are made of, each with two time derivatives.
pub(crate) struct LinearMotion<T> {
    /// Deviations from equilibrium.
    coordinates: [[N<T>; 3]; COORDINATES],
    /// Of theta.
    cos: [N<T>; 3],
    sin: [N<T>; 3],
}

impl<T: Real> LinearMotion<T> {
    /// Deviations from equilibrium at an instant.
    #[inline(always)]
    pub(crate) fn new(spin: &SpinState<T>, motion: &Motion<T>) -> Self {
        let zero = spin.sin.lit(0.0);
        let (n, nn, acceleration) = (spin.speed, (spin.speed * spin.speed).v(), spin.acceleration);
        let mut coordinates = [[zero; 3]; COORDINATES];
        for j in 0..COORDINATES {
            coordinates[j] = [motion.q[j], motion.u[j], motion.a[j]];
        }
        Self {
            coordinates,
            cos: [spin.cos, -(n * spin.sin).v(), -(acceleration * spin.sin + nn * spin.cos)],
            sin: [spin.sin, (n * spin.cos).v(), acceleration * spin.cos - nn * spin.sin],
        }
    }

    /// Outputs from their sums, cos and sin parts after all others.
    #[inline(always)]
    fn turned<const ENTRIES: usize, const M: usize>(
        &self,
        mut sums: [[N<T>; 3]; ENTRIES],
        turning: core::ops::Range<usize>,
    ) -> [Sample<T>; M] {
        let zero = self.cos[0].lit(0.0);
        let mut part = M;
        for output in turning {
            for turn in [&self.cos, &self.sin] {
                let product = product(turn, &sums[part]);
                part += 1;
                for w in 0..3 {
                    sums[output][w] += product[w];
                }
            }
        }
        let mut outputs = [Sample::still(zero, zero); M];
        for i in 0..M {
            let [value, slope, curvature] = sums[i];
            outputs[i] = Sample { value, slope, curvature };
        }
        outputs
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
pub(crate) fn linearise_outputs<T: Lane>(
    bodies: &Bodies<T>,
    q: &[N<T>; COORDINATES],
) -> Vec<LinearOutputs<f64>> {
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
                samples[k][output][AT_REST] = N(y.value.0.value);
                samples[k][output][j] = N(y.value.0.slope);
            }
        }
    }
    (0..T::LANES).map(|lane| of_lane(&samples.get_lane(lane))).collect()
}

fn of_lane(samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3]) -> LinearOutputs<f64> {
    let mut channels = [[0.0; COORDINATES]; CHANNEL_ENTRIES];
    let mut channels_at_rest = [0.0; CHANNEL_ENTRIES];
    let mut radial = [[0.0; COORDINATES]; RADIAL_ENTRIES];
    let mut radial_at_rest = [0.0; RADIAL_ENTRIES];
    for output in 0..OUTPUTS {
        for column in 0..COLUMNS {
            let values = samples.map(|sample| sample[output][column].0);
            let mean = (values[0] + values[1] + values[2]) / 3.0;
            let cos = (2.0 * values[0] - values[1] - values[2]) / 3.0;
            let sin = (values[1] - values[2]) * 2.0 * SAMPLES[1].1 / 3.0;
            // Channels are deviations from their values at theta = 0, where the cosine's part is whole.
            let steady = if column == AT_REST && output < CHANNELS { -cos } else { mean };
            for (part, coefficient) in [steady, cos, sin].into_iter().enumerate() {
                let (entry, terms, at_rest) = if output >= CHANNELS {
                    let entry = entry(output - CHANNELS, part, RADIAL, 0);
                    (entry, &mut radial[..], &mut radial_at_rest[..])
                } else if part == 0 || TURNING.contains(&output) {
                    let entry = entry(output, part, CHANNELS, TURNING.start);
                    (entry, &mut channels[..], &mut channels_at_rest[..])
                } else {
                    continue;
                };
                if column == AT_REST {
                    at_rest[entry] = coefficient;
                } else {
                    terms[entry][column] = coefficient;
                }
            }
        }
    }
    LinearOutputs {
        channels: ChannelTerms::gather(&channels),
        channels_at_rest: CHANNELS_AT_REST.map(|entry| N(channels_at_rest[entry])),
        radial: RadialTerms::gather(&radial),
        radial_at_rest: RADIAL_AT_REST.map(|entry| N(radial_at_rest[entry])),
    }
}

/// Where a part (0: steady, 1: cos, 2: sin) of an output stands among `count` of them, the first of
/// which that turns is `first`.
const fn entry(output: usize, part: usize, count: usize, first: usize) -> usize {
    if part == 0 { output } else { count + 2 * (output - first) + part - 1 }
}
