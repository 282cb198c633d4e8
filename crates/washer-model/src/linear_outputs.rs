//! The linear model's outputs: first order in the coordinates, harmonics 0 and 1 in theta.

use crate::coefficients::Bodies;

use crate::lanes::{GetLane, SetLane};
use crate::linear::seeded;
use crate::nonlinear::COORDINATES;
use crate::outputs::{Axes, CHANNELS, Motion, RADIAL};
use crate::sparse::sparse_sums;
use crate::spin::SpinState;
use lane_ode::{Lane, N, Real, Sample};

/// Every channel, then the two components of the radial distance.
const OUTPUTS: usize = CHANNELS + RADIAL;

/// Angles that determine harmonics 0 and 1: cos and sin of 2 pi k / 3.
const SAMPLES: [(f64, f64); 3] =
    [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];

/// A constant column, then one per coordinate: the functions that the terms are of.
const COLUMNS: usize = COORDINATES + 1;

/// Channels in which the drum turns: its front centre, and the mass centre of the machine.
const TURNING: core::ops::Range<usize> = 2..6;

/// Entries of the channels' terms: each channel, then the cos and sin parts of those that turn.
const CHANNEL_ENTRIES: usize = CHANNELS + 2 * (TURNING.end - TURNING.start);
/// Likewise of the radial distance; both components turn.
const RADIAL_ENTRIES: usize = 3 * RADIAL;

// The functions that the terms are of.
const ONE: usize = 0;
const Q1: usize = 1;
const Q2: usize = 2;
const Q3: usize = 3;
const Q4: usize = 4;
const Q5: usize = 5;
const Q6: usize = 6;
const Q7: usize = 7;
const Q8: usize = 8;
const Q9: usize = 9;
const Q10: usize = 10;

sparse_sums! {
    /// Coefficients of the channels.
    ChannelTerms: COLUMNS => CHANNEL_ENTRIES;
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
    RadialTerms: COLUMNS => RADIAL_ENTRIES;
    0 => ONE Q1 Q2 Q3 Q4 Q5 Q6 Q7 Q8 Q10;
    1 => ONE Q2 Q4 Q5 Q7 Q8 Q10;
    2 => ONE Q5 Q6 Q7 Q8 Q9 Q10;
    3 => ONE Q5 Q6 Q7 Q9 Q10;
    4 => ONE Q5 Q7 Q8 Q9 Q10;
    5 => ONE Q5 Q7 Q9 Q10;
}

/// The outputs of one machine in `f64`, of one per lane in `T`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearOutputs<T> {
    channels: ChannelTerms<T>,
    radial: RadialTerms<T>,
}

impl<T: Lane> SetLane<LinearOutputs<f64>> for LinearOutputs<T> {
    fn set_lane(&mut self, lane: usize, from: &LinearOutputs<f64>) {
        self.channels.set_lane(lane, &from.channels);
        self.radial.set_lane(lane, &from.radial);
    }
}

impl<T: Lane> LinearOutputs<T> {
    #[inline(always)]
    pub(crate) fn splat(zero: N<T>, outputs: &LinearOutputs<f64>) -> Self {
        Self {
            channels: ChannelTerms::splat(zero, &outputs.channels),
            radial: RadialTerms::splat(zero, &outputs.radial),
        }
    }

    /// Deviations of the channels from equilibrium.
    #[inline(always)]
    pub(crate) fn channels(&self, of: &LinearMotion<T>) -> [Sample<T>; CHANNELS] {
        let mut sums = [[of.cos[0].lit(0.0); 3]; CHANNEL_ENTRIES];
        self.channels.sum(&of.columns, &mut sums);
        of.turned::<CHANNEL_ENTRIES, CHANNELS>(sums, TURNING)
    }

    /// The drum's front centre from the tub axis, along t2 and t3.
    #[inline(always)]
    pub(crate) fn radial(&self, of: &LinearMotion<T>) -> [Sample<T>; RADIAL] {
        let mut sums = [[of.cos[0].lit(0.0); 3]; RADIAL_ENTRIES];
        self.radial.sum(&of.columns, &mut sums);
        of.turned::<RADIAL_ENTRIES, RADIAL>(sums, 0..RADIAL)
    }
}

/// What the outputs are made of, each with two time derivatives.
pub(crate) struct LinearMotion<T> {
    /// 1, then the coordinates.
    columns: [[N<T>; 3]; COLUMNS],
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
        let mut columns = [[zero; 3]; COLUMNS];
        columns[ONE][0] = zero.lit(1.0);
        for j in 0..COORDINATES {
            columns[Q1 + j] = [motion.q[j], motion.u[j], motion.a[j]];
        }
        Self {
            columns,
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
                samples[k][output][0] = N(y.value.0.value);
                samples[k][output][1 + j] = N(y.value.0.slope);
            }
        }
    }
    (0..T::LANES).map(|lane| of_lane(&samples.get_lane(lane))).collect()
}

fn of_lane(samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3]) -> LinearOutputs<f64> {
    let (channels, radial) = coefficients(samples);
    LinearOutputs { channels: ChannelTerms::gather(&channels), radial: RadialTerms::gather(&radial) }
}

/// Coefficients of all functions in each entry, from the samples.
fn coefficients(
    samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3],
) -> ([[f64; COLUMNS]; CHANNEL_ENTRIES], [[f64; COLUMNS]; RADIAL_ENTRIES]) {
    let mut channels = [[0.0; COLUMNS]; CHANNEL_ENTRIES];
    let mut radial = [[0.0; COLUMNS]; RADIAL_ENTRIES];
    for output in 0..OUTPUTS {
        for column in 0..COLUMNS {
            // Outputs of the linear model are linear in q: channels have no constant (model page, section 5).
            if column == ONE && output < CHANNELS {
                continue;
            }
            let values = samples.map(|sample| sample[output][column].0);
            let mean = (values[0] + values[1] + values[2]) / 3.0;
            let cos = (2.0 * values[0] - values[1] - values[2]) / 3.0;
            let sin = (values[1] - values[2]) * 2.0 * SAMPLES[1].1 / 3.0;
            for (part, coefficient) in [mean, cos, sin].into_iter().enumerate() {
                if output >= CHANNELS {
                    radial[entry(output - CHANNELS, part, RADIAL, 0)][column] = coefficient;
                } else if part == 0 || TURNING.contains(&output) {
                    channels[entry(output, part, CHANNELS, TURNING.start)][column] = coefficient;
                }
            }
        }
    }
    (channels, radial)
}

/// Where a part (0: steady, 1: cos, 2: sin) of an output stands among `count` of them, the first of which that turns is `first`.
const fn entry(output: usize, part: usize, count: usize, first: usize) -> usize {
    if part == 0 { output } else { count + 2 * (output - first) + part - 1 }
}
