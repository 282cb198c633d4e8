//! The linear model's outputs: first order in the coordinates, harmonics 0 and 1 in theta.

use crate::coefficients::Bodies;
use crate::harmonics::Term;
use crate::lanes::GetLane;
use crate::linear::seeded;
use crate::nonlinear::COORDINATES;
use crate::outputs::{CHANNELS, OUTPUTS, outputs};
use lane_ode::{Lane, N, Real};

/// Angles that determine harmonics 0 and 1: cos and sin of 2 pi k / 3.
const SAMPLES: [(f64, f64); 3] =
    [(1.0, 0.0), (-0.5, 0.866_025_403_784_438_6), (-0.5, -0.866_025_403_784_438_6)];

/// A constant column, then one per coordinate.
const COLUMNS: usize = COORDINATES + 1;

/// Below this share of the largest coefficient a term is the sampling's rounding.
const NOISE: f64 = 1e-13;

/// What the outputs are sums of: 1, cos and sin of theta, each times 1 and every coordinate.
pub(crate) const FEATURES: usize = 3 * COLUMNS;

/// The features at coordinates `q` (deviations).
#[inline(always)]
pub(crate) fn features<R: Real>((sin, cos): (N<R>, N<R>), q: &[N<R>; COORDINATES]) -> [N<R>; FEATURES] {
    let mut features = [sin.lit(1.0); FEATURES];
    features[1..COLUMNS].copy_from_slice(q);
    for column in 0..COLUMNS {
        features[COLUMNS + column] = (cos * features[column]).v();
        features[2 * COLUMNS + column] = (sin * features[column]).v();
    }
    features
}

/// Expands the nonlinear outputs of one machine per lane about the equilibrium `q`, as sparse terms: output, then feature.
#[inline(always)]
pub(crate) fn linearise_outputs<T: Lane>(bodies: &Bodies<T>, q: &[N<T>; COORDINATES]) -> Vec<Vec<Term>> {
    let zero = q[0].lit(0.0);
    let lifted = bodies.constant();
    let mut samples = [[[zero; COLUMNS]; OUTPUTS]; 3];
    for (k, (cos, sin)) in SAMPLES.into_iter().enumerate() {
        let theta = (zero.lit(sin).constant(), zero.lit(cos).constant());
        for j in 0..COORDINATES {
            let y = outputs(&lifted, theta, &seeded(q, j, 1.0));
            for output in 0..OUTPUTS {
                samples[k][output][0] = N(y[output].0.value);
                samples[k][output][1 + j] = N(y[output].0.slope);
            }
        }
    }
    (0..T::LANES).map(|lane| of_lane(&samples.get_lane(lane))).collect()
}

fn of_lane(samples: &[[[N<f64>; COLUMNS]; OUTPUTS]; 3]) -> Vec<Term> {
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
    terms
}
