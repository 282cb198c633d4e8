//! Dormand and Prince's method of order 5(4), adaptive, every lane with its own time and step.
//!
//! Coefficients: J. R. Dormand, P. J. Prince, J. Comp. Appl. Math. 6 (1980) 19, Table 2; dense
//! output and step control: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
//! sections II.4 to II.6.

use crate::control::{StepControl, Tolerance, Verdict};
use crate::lane::{Lane, MAX_LANES};
use crate::num::N;
use crate::system::{Count, Ended, Failure, Step, System as _, Task};

const STAGES: usize = 7;

/// Nodes c.
const NODE: [f64; STAGES] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// The matrix A; its last row is also the weights of order 5.
const A: [[f64; 6]; STAGES] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Weights of order 5 less those of order 4.
const ERROR: [f64; STAGES] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// The dense output's fourth-order term (Hairer's `dopri5.f`, d1 to d7).
const DENSE: [f64; STAGES] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// h times a weighted sum of the stages' slopes.
#[inline(always)]
fn combined<T: Lane, const D: usize>(
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

/// The state of one lane.
#[derive(Clone, Copy, Default)]
struct Progress {
    is_active: bool,
    end_s: f64,
    count: Count,
}

/// Runs every trajectory that the task has; no lane waits for another's error.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(
    zero: T,
    task: &mut P,
    tolerance: &Tolerance,
) {
    let zero = N(zero);
    let mut x = [zero; D];
    let mut t = zero;
    let mut control = StepControl::new(zero);
    let mut k = [[zero; D]; STAGES];
    let mut lanes = [Progress::default(); MAX_LANES];
    let mut ended = [Some(Ended::Idle); MAX_LANES];
    let mut is_fresh = true;

    loop {
        for lane in 0..T::LANES {
            let Some(how) = ended[lane].take() else { continue };
            is_fresh = true;
            let leg = task.next_leg(lane, how, &mut x);
            lanes[lane] = Progress {
                is_active: leg.is_some(),
                end_s: leg.map_or(0.0, |l| l.end_s),
                ..Progress::default()
            };
            t.0.set(lane, leg.map_or(0.0, |l| l.start_s));
            control.start(lane, leg.map_or(0.0, |l| l.step_s));
        }
        if task.is_stopped() || !lanes[..T::LANES].iter().any(|lane| lane.is_active) {
            return;
        }
        // Never past the end of a leg, nor a sliver short of it.
        let mut h = control.step;
        for (lane, progress) in lanes[..T::LANES].iter().enumerate() {
            let left = progress.end_s - t.0.get(lane);
            if progress.is_active && h.0.get(lane) * 1.01 >= left {
                h.0.set(lane, left);
            } else if !progress.is_active {
                h.0.set(lane, 0.0);
            }
        }

        // The last stage of a step is the first of the next, unless something new has begun.
        let mut y = x;
        for stage in usize::from(!is_fresh)..STAGES {
            let forcing = task.system().forcing(h * NODE[stage] + t);
            for i in 0..D {
                let mut sum = zero;
                for j in 0..stage {
                    sum += k[j][i] * A[stage][j];
                }
                y[i] = x[i] + h * sum;
            }
            k[stage] = task.system().derivative(&forcing, &y);
            if stage == 0 {
                task.begin(&forcing, &x, &k[0]);
            }
        }
        is_fresh = false;

        let error = tolerance.norm(&x, &y, &combined(h, &k, &ERROR));
        let accepted = T::bits(error.0.less(zero.lit(1.0).0));
        let in_range = T::bits(task.system().in_range(&y));

        // Lane by lane: bookkeeping in scalars is small beside seven evaluations.
        let mut length = zero;
        let before = x;
        let slope_before = k[0];
        let mut slope_after = k[0];
        let dense = combined(h, &k, &DENSE);
        let next = control.proposals(error, h);
        for (lane, progress) in
            lanes[..T::LANES].iter_mut().enumerate().filter(|(_, lane)| lane.is_active)
        {
            let step = h.0.get(lane);
            let time = t.0.get(lane);
            let is_last = time + step >= progress.end_s || step == progress.end_s - time;
            let fail = |reason, time_s, count| Some(Ended::Failed { reason, time_s, count });
            if accepted >> lane & 1 == 1 {
                let reached = if is_last { progress.end_s } else { time + step };
                length.0.set(lane, step);
                t.0.set(lane, reached);
                for i in 0..D {
                    x[i].0.set(lane, y[i].0.get(lane));
                    slope_after[i].0.set(lane, k[STAGES - 1][i].0.get(lane));
                }
                progress.count.accepted += 1;
                if in_range >> lane & 1 == 0 {
                    ended[lane] = fail(Failure::Diverged, reached, progress.count);
                } else if is_last {
                    ended[lane] = Some(Ended::Arrived(progress.count));
                }
                control.settle(lane, Verdict::Accepted, &next);
            } else {
                progress.count.rejected += 1;
                control.settle(lane, Verdict::Rejected, &next);
                if control.step.0.get(lane) <= 16.0 * f64::EPSILON * time.abs().max(progress.end_s)
                {
                    let reason = if in_range >> lane & 1 == 0 {
                        Failure::Diverged
                    } else {
                        Failure::StepTooSmall
                    };
                    ended[lane] = fail(reason, time, progress.count);
                }
            }
            let made = progress.count.accepted + progress.count.rejected;
            if made >= tolerance.max_steps && ended[lane].is_none() {
                ended[lane] = fail(Failure::StepLimit, time, progress.count);
            }
        }
        k[0] = slope_after;
        let forcing = task.system().forcing(t);
        task.observe(
            &forcing,
            &Step {
                end_s: t,
                length_s: length,
                before: &before,
                slope_before: &slope_before,
                after: &x,
                slope_after: &slope_after,
                dense: Some(&dense),
            },
        );
    }
}
