//! Rodas5P: a linearly implicit method of order 5(4) for stiff systems, adaptive.
//!
//! Eight stages, one Jacobian and one factorisation a step; L-stable and stiffly accurate, so that
//! it steps over fast undamped vibrations. It is the independent reference for the explicit
//! methods, and the method for machines too stiff for them. It integrates one trajectory at a time:
//! lanes carry the Jacobian's columns (`Partials`).
//!
//! Coefficients: G. Steinebach, Construction of Rosenbrock-Wanner method Rodas5P and numerical
//! benchmarks within the Julia Differential Equations package, BIT Numerical Mathematics 63 (2023)
//! 27, in the transformed variables of Hairer and Wanner, Solving Ordinary Differential Equations
//! II, section IV.7, Eq. 7.25. The tests hold them against the order conditions.

use crate::adaptive::Lanes;
use crate::control::padded;
use crate::{Lu, N, Partials, Step, System as _, Task, Tolerance};

const STAGES: usize = 8;

/// gamma
const GAMMA: f64 = 0.21193756319429014;

/// Nodes: sums of the rows of alpha.
const NODE: [f64; STAGES] = [
    0.0,
    0.6358126895828704,
    0.4095798393397535,
    0.9769306725060716,
    0.4288403609558664,
    1.0,
    1.0,
    1.0,
];

/// What a stage takes of h f_t: sums of the rows of the matrix Gamma.
const TIME: [f64; STAGES] = [
    GAMMA,
    -0.42387512638858027,
    -0.3384627126235924,
    1.8046452872882734,
    2.325825639765069,
    0.0,
    0.0,
    0.0,
];

/// Where a stage is evaluated: a_ij.
const A: [[f64; 7]; STAGES] = padded([
    &[],
    &[3.0],
    &[2.849394379747939, 0.45842242204463923],
    &[-6.954028509809101, 2.489845061869568, -10.358996098473584],
    &[2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
    &[LAST[0], LAST[1], LAST[2], LAST[3], LAST[4]],
    &[LAST[0], LAST[1], LAST[2], LAST[3], LAST[4], 1.0],
    &[LAST[0], LAST[1], LAST[2], LAST[3], LAST[4], 1.0, 1.0],
]);

/// The last three stages and the solution itself differ by whole stages: the last is the error's
/// estimate.
const LAST: [f64; 5] = [
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
];

/// What a stage takes of the earlier ones, over h: C_ij.
const C: [[f64; 7]; STAGES] = padded([
    &[],
    &[-14.155112264123755],
    &[-17.97296035885952, -2.859693295451294],
    &[147.12150275711716, -1.41221402718213, 71.68940251302358],
    &[165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
    &[
        24.854864614690072,
        -3.0009227002832186,
        47.4931110020768,
        5.5814197821558125,
        -0.6610691825249471,
    ],
    &[
        30.91273214028599,
        -3.1208243349937974,
        77.79954646070892,
        34.28646028294783,
        -19.097331116725623,
        -28.087943162872662,
    ],
    &[
        37.80277123390563,
        -3.2571969029072276,
        112.26918849496327,
        66.9347231244047,
        -40.06618937091002,
        -54.66780262877968,
        -9.48861652309627,
    ],
]);

/// The dense output over s from 0 to 1: x0 + s (x1 - x0 + (1 - s) (d1 + s (d2 + s d3))), d_r these
/// rows' sums of stages.
const DENSE: [[f64; STAGES]; 3] = [
    [
        25.948786856663858,
        -2.5579724845846235,
        10.433815404888879,
        -2.3679251022685204,
        0.524948541321073,
        1.1241088310450404,
        0.4272876194431874,
        -0.17202221070155493,
    ],
    [
        -9.91568850695171,
        -0.9689944594115154,
        3.0438037242978453,
        -24.495224566215796,
        20.176138334709044,
        15.98066361424651,
        -6.789040303419874,
        -6.710236069923372,
    ],
    [
        11.419903575922262,
        2.8879645146136994,
        72.92137995996029,
        80.12511834622643,
        -52.072871366152654,
        -59.78993625266729,
        -0.15582684282751913,
        4.883087185713722,
    ],
];

/// A task whose state is K coordinates, then their speeds, and which knows its partial derivatives.
pub trait Stiff<const D: usize, const K: usize>: Task<f64, D> {
    /// Finds the derivatives of the accelerations at time `t_s` and state `x`, within the current
    /// leg.
    fn partials(&self, t_s: f64, x: &[N<f64>; D], partials: &mut Partials<K>);
}

/// The matrix I/(gamma h) - J of one step, eliminated to the speeds: q' = u leaves K rows of 2 K.
struct Eliminated<const K: usize> {
    gamma_h: N<f64>,
    /// Of I/(gamma h) - da/du - gamma h da/dq.
    factors: Lu<K>,
}

impl<const K: usize> Eliminated<K> {
    #[inline(always)]
    fn new(partials: &Partials<K>, h: N<f64>) -> Option<Self> {
        let gamma_h = (h * GAMMA).v();
        let mut matrix = [[N(0.0); K]; K];
        for i in 0..K {
            for j in 0..K {
                matrix[i][j] =
                    -(gamma_h * partials.by_coordinate[i][j]).v() - partials.by_speed[i][j];
            }
            matrix[i][i] += gamma_h.recip();
        }
        Lu::new(matrix).map(|factors| Self { gamma_h, factors })
    }

    /// One stage.
    #[inline(always)]
    fn solve<const D: usize>(&self, partials: &Partials<K>, b: &[N<f64>; D]) -> [N<f64>; D] {
        let mut of_speeds = [N(0.0); K];
        for i in 0..K {
            let mut sum = N(0.0);
            for j in 0..K {
                sum += partials.by_coordinate[i][j] * b[j];
            }
            of_speeds[i] = b[K + i] + self.gamma_h * sum;
        }
        let speeds = self.factors.solve(&of_speeds);
        let mut stage = [N(0.0); D];
        for i in 0..K {
            stage[i] = (self.gamma_h * (b[i] + speeds[i])).v();
            stage[K + i] = speeds[i];
        }
        stage
    }
}

/// Runs every trajectory that the task has, one after another.
#[inline(always)]
pub fn integrate<const D: usize, const K: usize, P: Stiff<D, K>>(
    task: &mut P,
    tolerance: &Tolerance,
) {
    const { assert!(D == 2 * K, "a state is the coordinates and their speeds") };
    let mut x = [N(0.0); D];
    let mut lanes = Lanes::new(N(0.0));
    let mut partials = Partials::<K>::zero();
    let (mut is_fresh, mut is_known) = (true, false);

    loop {
        if lanes.take_up(task, &mut x) {
            (is_fresh, is_known) = (true, false);
        }
        if task.is_stopped() || !lanes.are_active() {
            return;
        }
        let h = lanes.steps();
        let (start, end) = (lanes.time, lanes.reached(0, h));
        if !is_known {
            task.partials(start.0, &x, &mut partials);
            is_known = true;
        }
        let eliminated = Eliminated::new(&partials, h);

        let mut stages = [[N(0.0); D]; STAGES];
        let mut y = x;
        let at_start = task.system().forcing_aside(start);
        let mut forcing = at_start;
        // A matrix without factors makes no step: the error stays NaN and the next try is shorter.
        let mut error = N(f64::NAN);
        if let Some(eliminated) = &eliminated {
            let per_h = h.recip();
            for stage in 0..STAGES {
                if stage > 0 && NODE[stage] != NODE[stage - 1] {
                    let time = if NODE[stage] == 1.0 { N(end) } else { h * NODE[stage] + start };
                    forcing = task.system().forcing_aside(time);
                }
                y = x;
                let mut earlier = [N(0.0); D];
                for j in 0..stage {
                    let weight = per_h.lit(C[stage][j]);
                    for i in 0..D {
                        y[i] += stages[j][i] * A[stage][j];
                        earlier[i] += weight * stages[j][i];
                    }
                }
                let slope = task.system().derivative_aside(&forcing, &y);
                let time_weight = (h * TIME[stage]).v();
                let mut b = slope;
                for i in 0..D {
                    b[i] = per_h * earlier[i] + slope[i];
                }
                for i in 0..K {
                    b[K + i] += time_weight * partials.by_time[i];
                }
                stages[stage] = eliminated.solve(&partials, &b);
            }
            for i in 0..D {
                y[i] += stages[STAGES - 1][i];
            }
            error = tolerance.norm(&x, &y, &stages[STAGES - 1]);
        }

        let accepted = error.0 < 1.0;
        let in_range = task.system().in_range(&y);
        let length_s = lanes.settle(h, error, [accepted, in_range], tolerance);
        if accepted {
            let dense = Dense::new(h, &x, &y, &stages);
            if is_fresh {
                task.begin(&at_start, &x, &dense.slope_before);
            }
            task.observe(
                &forcing,
                &Step {
                    end_s: lanes.time,
                    length_s,
                    before: &x,
                    slope_before: &dense.slope_before,
                    after: &y,
                    slope_after: &dense.slope_after,
                    dense: Some(&dense.fourth),
                },
            );
            x = y;
            (is_fresh, is_known) = (false, false);
        }
    }
}

/// The dense output of one step, in the terms of [`Step`]. Slopes at the ends are its own: the
/// right-hand side itself would multiply what is left of the fast vibrations by their squared
/// frequency.
struct Dense<const D: usize> {
    slope_before: [N<f64>; D],
    slope_after: [N<f64>; D],
    fourth: [N<f64>; D],
}

impl<const D: usize> Dense<D> {
    #[inline(always)]
    fn new(
        h: N<f64>,
        before: &[N<f64>; D],
        after: &[N<f64>; D],
        stages: &[[N<f64>; D]; STAGES],
    ) -> Self {
        let mut dense = Self { slope_before: *before, slope_after: *before, fourth: *before };
        let per_h = h.recip();
        for i in 0..D {
            let mut d = [N(0.0); 3];
            for r in 0..3 {
                for stage in 0..STAGES {
                    d[r] += stages[stage][i] * DENSE[r][stage];
                }
            }
            let difference = after[i] - before[i];
            dense.slope_before[i] = (per_h * (difference + d[0])).v();
            dense.slope_after[i] = (per_h * (difference - (d[0] + d[1] + d[2]))).v();
            // `Step::at` writes the polynomial with 1 - s where this one has s.
            dense.fourth[i] = -d[2];
        }
        dense
    }
}

#[cfg(test)]
mod tests;
