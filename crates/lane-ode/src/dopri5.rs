//! Dormand and Prince's method of order 5(4), adaptive, every lane with its own time and step.
//!
//! Coefficients: J. R. Dormand, P. J. Prince, J. Comp. Appl. Math. 6 (1980) 19, Table 2; dense
//! output and step control: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
//! sections II.4 to II.6.

use crate::adaptive::AdaptiveLanes;
use crate::control::{ControlExponents, pad_rows};
use crate::{Lane, N, ObservedStep, System as _, Task, Tolerance};

/// Number of stages.
const STAGES: usize = 7;

/// Nodes.
const C: [f64; STAGES] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// Matrix. Its last row equals the weights of order 5.
const A: [[f64; 6]; STAGES] = pad_rows([
    &[],
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
]);

/// Weights of order 5 less those of order 4.
const E: [f64; STAGES] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Coefficients of the dense output's fourth-order term (Hairer's `dopri5.f`, d1 to d7).
const DENSE_WEIGHTS: [f64; STAGES] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// Computes h times a weighted sum of the stages' slopes.
#[inline(always)]
fn combine_stages<T: Lane, const D: usize>(
    h: N<T>,
    k: &[[N<T>; D]; STAGES],
    weights: &[f64; STAGES],
) -> [N<T>; D] {
    let mut sums = [h.lit(0.0); D];
    for i in 0..D {
        for stage in 0..STAGES {
            sums[i] += k[stage][i] * weights[stage];
        }
        sums[i] = (h * sums[i]).v();
    }
    sums
}

/// Integrates every trajectory of the task. The lanes accept and reject steps independently.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(
    zero: T,
    task: &mut P,
    tolerance: &Tolerance,
) {
    let zero = N(zero);
    let mut x = [zero; D];
    let mut lanes = AdaptiveLanes::new(zero, ControlExponents::Order5);
    let mut k = [[zero; D]; STAGES];
    let mut is_start = true;

    loop {
        is_start |= lanes.start_pending_lanes(task, &mut x);
        if task.cancel().is_requested() || !lanes.has_active_lane() {
            return;
        }
        let h = lanes.steps(tolerance);

        // The last stage of a step is the first of the next, except after the start of a segment.
        let mut y = x;
        for stage in usize::from(!is_start)..STAGES {
            let forcing = task.system().forcing(h * C[stage] + lanes.time_s);
            for i in 0..D {
                let mut slope_sum = zero;
                for j in 0..stage {
                    slope_sum += k[j][i] * A[stage][j];
                }
                y[i] = x[i] + h * slope_sum;
            }
            k[stage] = task.system().derivative(&forcing, &y);
            if stage == 0 {
                task.begin(&forcing, &x, &k[0]);
            }
        }
        is_start = false;

        let in_range = task.system().in_range(&y);
        let error = tolerance.error_norm(&x, &y, &combine_stages(h, &k, &E));
        let accepted_lanes = error.0.less(zero.lit(1.0).0);
        let start_state = x;
        let start_slope = k[0];
        let dense_term = combine_stages(h, &k, &DENSE_WEIGHTS);
        for i in 0..D {
            x[i] = N(T::select(accepted_lanes, y[i].0, x[i].0));
            k[0][i] = N(T::select(accepted_lanes, k[STAGES - 1][i].0, k[0][i].0));
        }
        let length_s = lanes.accept_or_reject(h, error, [accepted_lanes, in_range], tolerance);
        let forcing = task.system().forcing_out_of_line(lanes.time_s);
        task.observe(
            &forcing,
            &ObservedStep {
                end_s: lanes.time_s,
                length_s,
                start_state: &start_state,
                start_slope: &start_slope,
                end_state: &x,
                end_slope: &k[0],
                dense_term: Some(&dense_term),
            },
        );
    }
}
