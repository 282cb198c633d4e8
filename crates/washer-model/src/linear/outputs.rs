//! The outputs of the linear model, which are exact to first order in the coordinates, with
//! harmonics 0 and 1 in theta.
//!
//! The part of order zero is the motion of the turning drum while the machine is at its
//! equilibrium.

use crate::channel::{CHANNELS, Channel, channels};
use crate::coordinates::{
    COORDINATES, HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH,
    TUB_Y, TUB_YAW, TUB_Z, with_derivative,
};
use crate::lanes::{InLanes as _, ToDual as _, lane_struct};
use crate::linear::sparse::{FurtherTerms, sparse_sums};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::outputs::{BodyAxes, MovingCoordinates, RADIAL_COMPONENTS};
use core::array::from_fn;
use lane_ode::{Lane, N, OutOfLine, Real, Sample};

/// The number of columns of an expansion: the slope along each coordinate, then the value at
/// equilibrium.
const COLUMNS: usize = COORDINATES + 1;
/// The column of the value at equilibrium.
const REST_COLUMN: usize = COORDINATES;

/// The number of outputs: every channel, then the two components of the radial distance.
const OUTPUTS: usize = CHANNELS + RADIAL_COMPONENTS;

/// The sampling angles 2 pi k / 3 of harmonics 0 and 1, by cosine and sine.
const SAMPLE_ANGLES: [(f64, f64); 3] =
    [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];

/// Returns the index of a part of an output (part 0: steady, 1: cosine, 2: sine of theta) among the
/// terms of `outputs` outputs. Steady parts come first. Only the outputs in `harmonic_outputs` have
/// the other parts.
const fn entry_index(
    output: usize,
    harmonic_part: usize,
    harmonic_outputs: &[usize],
    outputs: usize,
) -> usize {
    if harmonic_part == 0 {
        return output;
    }
    let mut index = 0;
    while harmonic_outputs[index] != output {
        index += 1;
    }
    outputs + 2 * index + harmonic_part - 1
}

macro_rules! expand {
    ($($(#[$doc:meta])* $name:ident, $key:literal, $description:literal, $kind:ident, $from:tt,
        steady [$($steady:ident)+]
        $(, turning cos [$($cos:ident)+] sin [$($sin:ident)+] rest [$($part:literal)+])?;
    )+) => {
        /// The channels with harmonics of theta.
        const HARMONIC_CHANNELS: &[usize] = &[$($(channel_index!($name $($part)+),)?)+];

        /// The entries of the channels' parts of order zero.
        const CHANNEL_REST_ENTRIES: &[usize] =
            &[$($($(channel_entry(Channel::$name, $part),)+)?)+];

        sparse_sums! {
            /// The coefficients of the channels.
            ChannelTerms: COORDINATES => CHANNEL_ENTRIES;
            $(channel_entry(Channel::$name, 0) => $($steady)+;)+
            $($(
                channel_entry(Channel::$name, 1) => $($cos)+;
                channel_entry(Channel::$name, 2) => $($sin)+;
            )?)+
        }
    };
}
macro_rules! channel_index {
    ($name:ident $($part:literal)+) => {
        Channel::$name.index()
    };
}
channels!(expand);

/// The number of entries of the channels' terms.
const CHANNEL_ENTRIES: usize = CHANNELS + 2 * HARMONIC_CHANNELS.len();

const fn channel_entry(channel: Channel, harmonic_part: usize) -> usize {
    entry_index(channel.index(), harmonic_part, HARMONIC_CHANNELS, CHANNELS)
}

/// The components of the radial distance that have harmonics of theta, which are both.
const HARMONIC_RADIAL_COMPONENTS: [usize; RADIAL_COMPONENTS] = [0, 1];
/// The number of entries of the radial distance's terms.
const RADIAL_ENTRIES: usize = 3 * RADIAL_COMPONENTS;
/// The entries of the radial distance's parts of order zero, which are all.
const RADIAL_REST_ENTRIES: [usize; RADIAL_ENTRIES] = [0, 1, 2, 3, 4, 5];

const fn radial_entry(component: usize, harmonic_part: usize) -> usize {
    entry_index(component, harmonic_part, &HARMONIC_RADIAL_COMPONENTS, RADIAL_COMPONENTS)
}

sparse_sums! {
    /// The coefficients of the radial distance.
    RadialTerms: COORDINATES => RADIAL_ENTRIES;
    radial_entry(0, 0) => TUB_Y TUB_Z SHAFT_Y SHAFT_Z TUB_YAW TUB_PITCH SHAFT_YAW SHAFT_PITCH
        HINGE_PITCH;
    radial_entry(1, 0) => TUB_Z SHAFT_Z TUB_YAW SHAFT_YAW SHAFT_PITCH HINGE_PITCH;
    radial_entry(0, 1) => TUB_YAW TUB_PITCH SHAFT_YAW SHAFT_PITCH HINGE_YAW HINGE_PITCH;
    radial_entry(0, 2) => TUB_YAW TUB_PITCH SHAFT_YAW HINGE_YAW HINGE_PITCH;
    radial_entry(1, 1) => TUB_YAW SHAFT_YAW SHAFT_PITCH HINGE_YAW HINGE_PITCH;
    radial_entry(1, 2) => TUB_YAW SHAFT_YAW HINGE_YAW HINGE_PITCH;
}

lane_struct! {
    /// The coefficients of the outputs, for one machine in `f64`, for one machine per lane in `T`.
    #[derive(Clone, Debug)]
    LinearOutputs {
        channel_terms: ChannelTerms<T>,
        channel_rest_values: [N<T>; CHANNEL_REST_ENTRIES.len()],
        radial_terms: RadialTerms<T>,
        radial_rest_values: [N<T>; RADIAL_REST_ENTRIES.len()],
        /// The terms that only skewed drums have, by entry, then column.
        further_channel_terms: FurtherTerms<T>,
        further_radial_terms: FurtherTerms<T>,
    }
}

impl<T: Lane> LinearOutputs<T> {
    /// Computes the deviations of the channels from equilibrium, unbalance up.
    #[inline(always)]
    pub(crate) fn channels(&self, motion: &LinearMotion<T>) -> [Sample<T>; CHANNELS] {
        let mut sums = [[motion.cos[0].lit(0.0); 3]; CHANNEL_ENTRIES];
        self.channel_terms.sum(&motion.coordinates, &mut sums);
        add_rest_values(&mut sums, CHANNEL_REST_ENTRIES, &self.channel_rest_values);
        if !self.further_channel_terms.is_empty() {
            self.further_channel_terms.add(&motion.columns(), &mut sums);
        }
        motion.combine_harmonics::<CHANNEL_ENTRIES, CHANNELS>(sums, HARMONIC_CHANNELS)
    }

    /// Computes the position of the drum's front centre relative to the tub axis, along t2 and t3.
    #[inline(always)]
    pub(crate) fn radial_position(
        &self,
        motion: &LinearMotion<T>,
    ) -> [Sample<T>; RADIAL_COMPONENTS] {
        let mut sums = [[motion.cos[0].lit(0.0); 3]; RADIAL_ENTRIES];
        self.radial_terms.sum(&motion.coordinates, &mut sums);
        add_rest_values(&mut sums, &RADIAL_REST_ENTRIES, &self.radial_rest_values);
        if !self.further_radial_terms.is_empty() {
            self.further_radial_terms.add(&motion.columns(), &mut sums);
        }
        motion.combine_harmonics::<RADIAL_ENTRIES, RADIAL_COMPONENTS>(
            sums,
            &HARMONIC_RADIAL_COMPONENTS,
        )
    }
}

/// Adds the parts of order zero to the sums' values. These parts are constant in the drum's frame;
/// the products with cosine and sine of theta have time derivatives.
#[inline(always)]
fn add_rest_values<T: Real, const ENTRIES: usize, const K: usize>(
    sums: &mut [[N<T>; 3]; ENTRIES],
    entries: &[usize],
    at_rest: &[N<T>; K],
) {
    for i in 0..K {
        sums[entries[i]][0] += at_rest[i];
    }
}

/// The coordinates and the functions of theta, each with two time derivatives.
pub(crate) struct LinearMotion<T> {
    /// The deviations from equilibrium.
    coordinates: [[N<T>; 3]; COORDINATES],
    /// The cosine of theta.
    cos: [N<T>; 3],
    /// The sine of theta.
    sin: [N<T>; 3],
}

impl<T: Real> LinearMotion<T> {
    /// Computes the motion at an instant from deviations from equilibrium.
    #[inline(always)]
    pub(crate) fn new(spin: &SpinState<T>, motion: &MovingCoordinates<T>) -> Self {
        let zero = spin.sin.lit(0.0);
        let speed = spin.speed;
        let speed_squared = (spin.speed * spin.speed).v();
        let acceleration = spin.acceleration;
        let mut coordinates = [[zero; 3]; COORDINATES];
        for j in 0..COORDINATES {
            coordinates[j] = [motion.q[j], motion.u[j], motion.a[j]];
        }
        Self {
            coordinates,
            cos: [
                spin.cos,
                -(speed * spin.sin).v(),
                -(acceleration * spin.sin + speed_squared * spin.cos),
            ],
            sin: [
                spin.sin,
                (speed * spin.cos).v(),
                acceleration * spin.cos - speed_squared * spin.sin,
            ],
        }
    }

    /// Returns the factors of an expansion's columns: the coordinates, then 1.
    #[inline(always)]
    fn columns(&self) -> [[N<T>; 3]; COLUMNS] {
        let zero = self.cos[0].lit(0.0);
        let mut columns = [[zero.lit(1.0), zero, zero]; COLUMNS];
        columns[..COORDINATES].copy_from_slice(&self.coordinates);
        columns
    }

    /// Combines steady, cosine and sine parts to outputs.
    #[inline(always)]
    fn combine_harmonics<const ENTRIES: usize, const M: usize>(
        &self,
        mut sums: [[N<T>; 3]; ENTRIES],
        harmonic_outputs: &[usize],
    ) -> [Sample<T>; M] {
        let zero = self.cos[0].lit(0.0);
        let mut entry = M;
        for &output in harmonic_outputs {
            for harmonic in [&self.cos, &self.sin] {
                let product = multiply_derivatives(harmonic, &sums[entry]);
                entry += 1;
                for derivative in 0..3 {
                    sums[output][derivative] += product[derivative];
                }
            }
        }
        let mut outputs = [Sample::constant(zero, zero); M];
        for i in 0..M {
            let [value, slope, curvature] = sums[i];
            outputs[i] = Sample { value, slope, curvature };
        }
        outputs
    }
}

/// Computes a product with its first two time derivatives.
#[inline(always)]
fn multiply_derivatives<T: Real>(a: &[N<T>; 3], b: &[N<T>; 3]) -> [N<T>; 3] {
    let slope = a[0] * b[1] + a[1] * b[0];
    let curvature = a[0] * b[2] + (a[2] * b[0] + 2.0 * (a[1] * b[1]).v());
    [(a[0] * b[0]).v(), slope, curvature]
}

/// The linearisation of the outputs of one machine per lane about the equilibrium `q`.
pub(crate) struct OutputLinearisation<'a, T> {
    pub(crate) bodies: &'a Bodies<T>,
    pub(crate) q: &'a [N<T>; COORDINATES],
}

impl<T: Lane> OutOfLine for OutputLinearisation<'_, T> {
    type Output = Vec<LinearOutputs<f64>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { bodies, q } = self;
        let zero = q[0].lit(0.0);
        let dual_bodies = bodies.constant();
        let zeros = [zero.constant(); COORDINATES];
        let mut samples = [[[zero; COLUMNS]; OUTPUTS]; 3];
        for (k, (cos, sin)) in SAMPLE_ANGLES.into_iter().enumerate() {
            let spin = SpinState::new((zero.lit(sin), zero.lit(cos)), zero, zero).constant();
            for j in 0..COORDINATES {
                let motion =
                    MovingCoordinates { q: with_derivative(q, j, 1.0), u: zeros, a: zeros };
                let axes = BodyAxes::new(&spin, &motion);
                let channels = axes.channels(&dual_bodies, &motion);
                let radial_position = axes.radial_position(&dual_bodies, &motion);
                for (output, y) in channels.iter().chain(&radial_position).enumerate() {
                    samples[k][output][REST_COLUMN] = N(y.value.0.value);
                    samples[k][output][j] = N(y.value.0.slope);
                }
            }
        }
        (0..T::LANES)
            .map(|lane| {
                select_lane_coefficients(&samples.get_lane(lane), bodies.is_skewed_in(lane))
            })
            .collect()
    }
}

/// Computes the coefficients of one lane from samples at three angles.
fn select_lane_coefficients(
    samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3],
    is_skewed: bool,
) -> LinearOutputs<f64> {
    let mut channel_terms = [[0.0; COORDINATES]; CHANNEL_ENTRIES];
    let mut channel_rest_values = [0.0; CHANNEL_ENTRIES];
    let mut radial_terms = [[0.0; COORDINATES]; RADIAL_ENTRIES];
    let mut radial_rest_values = [0.0; RADIAL_ENTRIES];
    for output in 0..OUTPUTS {
        for column in 0..COLUMNS {
            let values = samples.map(|sample| sample[output][column].0);
            let mean = (values[0] + values[1] + values[2]) / 3.0;
            let cos = (2.0 * values[0] - values[1] - values[2]) / 3.0;
            let sin = (values[1] - values[2]) * 2.0 * SAMPLE_ANGLES[1].1 / 3.0;
            // Channels are deviations from their values at theta = 0, where the cosine is 1.
            let steady_coefficient =
                if column == REST_COLUMN && output < CHANNELS { -cos } else { mean };
            for (harmonic_part, coefficient) in
                [steady_coefficient, cos, sin].into_iter().enumerate()
            {
                let (entry, terms, at_rest) = if output >= CHANNELS {
                    let entry = radial_entry(output - CHANNELS, harmonic_part);
                    (entry, &mut radial_terms[..], &mut radial_rest_values[..])
                } else if harmonic_part == 0 || HARMONIC_CHANNELS.contains(&output) {
                    let entry = entry_index(output, harmonic_part, HARMONIC_CHANNELS, CHANNELS);
                    (entry, &mut channel_terms[..], &mut channel_rest_values[..])
                } else {
                    continue;
                };
                if column == REST_COLUMN {
                    at_rest[entry] = coefficient;
                } else {
                    terms[entry][column] = coefficient;
                }
            }
        }
    }
    let [further_channel_terms, further_radial_terms] = if is_skewed {
        [
            select_further_terms(
                &channel_terms,
                &channel_rest_values,
                &ChannelTerms::POSITIONS,
                CHANNEL_REST_ENTRIES,
            ),
            select_further_terms(
                &radial_terms,
                &radial_rest_values,
                &RadialTerms::POSITIONS,
                &RADIAL_REST_ENTRIES,
            ),
        ]
    } else {
        [FurtherTerms::NONE, FurtherTerms::NONE]
    };
    LinearOutputs {
        further_channel_terms,
        further_radial_terms,
        channel_terms: ChannelTerms::select_coefficients(&channel_terms),
        channel_rest_values: from_fn(|k| N(channel_rest_values[CHANNEL_REST_ENTRIES[k]])),
        radial_terms: RadialTerms::select_coefficients(&radial_terms),
        radial_rest_values: RADIAL_REST_ENTRIES.map(|entry| N(radial_rest_values[entry])),
    }
}

/// Selects the terms that are neither at the table's positions nor in the rest column of the
/// entries with a part of order zero, `at_rest`.
fn select_further_terms<const ENTRIES: usize>(
    slopes: &[[f64; COORDINATES]; ENTRIES],
    values: &[f64; ENTRIES],
    table_positions: &[(usize, usize)],
    at_rest: &[usize],
) -> FurtherTerms<f64> {
    let all_coefficients: [[f64; COLUMNS]; ENTRIES] = from_fn(|entry| {
        from_fn(|column| slopes[entry].get(column).copied().unwrap_or(values[entry]))
    });
    let at_rest = at_rest.iter().map(|entry| (*entry, REST_COLUMN));
    let table_entries: Vec<_> = table_positions.iter().copied().chain(at_rest).collect();
    FurtherTerms::select_coefficients(&all_coefficients, &table_entries)
}
