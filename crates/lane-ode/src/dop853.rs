//! The eighth-order Runge-Kutta method of Dormand and Prince with a fixed step.
//!
//! Coefficients: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.5,
//! and its program `dop853.f`. The formula's error estimate is omitted, because callers compare
//! whole trajectories; [`dop853_adaptive`](crate::dop853_adaptive) has it.
//!
//! On the imaginary axis the method is stable up to |h w| = 5.96. This is half a radian per stage,
//! against 0.71 of the classical method of order 4. The method is cheaper than the classical one
//! where accuracy, not stability, limits the step.

use crate::fixed::FixedSegments;
use crate::{Lane, N, ObservedStep, System as _, Task};
use core::hint::black_box;

/// The limit of stability on the imaginary axis: the method is stable up to this |h w|.
pub const DOP853_STABILITY_LIMIT: f64 = 5.96;

/// Number of stages, which is the number of evaluations of the right-hand side in a step.
pub const DOP853_STAGES: usize = 12;

/// Nodes.
pub(crate) const C: [f64; DOP853_STAGES] = [
    0.0,
    0.526001519587677318785587544488e-1,
    0.789002279381515978178381316732e-1,
    0.118_350_341_907_227_396_726_757_197_510,
    0.281_649_658_092_772_603_273_242_802_490,
    0.333_333_333_333_333_333_333_333_333_333,
    0.25,
    0.307_692_307_692_307_692_307_692_307_692,
    0.651_282_051_282_051_282_051_282_051_282,
    0.6,
    0.857_142_857_142_857_142_857_142_857_142,
    1.0,
];

/// The nonzero coefficients of a row, each with the index of its stage before it.
pub(crate) type SparseRow = &'static [(usize, f64)];

/// Rows of the matrix, from the second stage on.
pub(crate) const A: [SparseRow; DOP853_STAGES - 1] = [
    &[(0, 5.26001519587677318785587544488e-2)],
    &[(0, 1.97250569845378994544595329183e-2), (1, 5.91751709536136983633785987549e-2)],
    &[(0, 2.95875854768068491816892993775e-2), (2, 8.87627564304205475450678981324e-2)],
    &[
        (0, 2.41365134159266685502369798665e-1),
        (2, -8.84549479328286085344864962717e-1),
        (3, 9.24834003261792003115737966543e-1),
    ],
    &[
        (0, 3.7037037037037037037037037037e-2),
        (3, 1.70828608729473871279604482173e-1),
        (4, 1.25467687566822425016691814123e-1),
    ],
    &[
        (0, 3.7109375e-2),
        (3, 1.70252211019544039314978060272e-1),
        (4, 6.02165389804559606850219397283e-2),
        (5, -1.7578125e-2),
    ],
    &[
        (0, 3.70920001185047927108779319836e-2),
        (3, 1.70383925712239993810214054705e-1),
        (4, 1.07262030446373284651809199168e-1),
        (5, -1.53194377486244017527936158236e-2),
        (6, 8.27378916381402288758473766002e-3),
    ],
    &[
        (0, 6.24110958716075717114429577812e-1),
        (3, -3.360_892_629_446_941_294_068_571_098_25),
        (4, -8.68219346841726006818189891453e-1),
        (5, 2.75920996994467083049415600797e1),
        (6, 2.01540675504778934086186788979e1),
        (7, -4.34898841810699588477366255144e1),
    ],
    &[
        (0, 4.77662536438264365890433908527e-1),
        (3, -2.488_114_619_971_667_641_926_425_864_68),
        (4, -5.90290826836842996371446475743e-1),
        (5, 2.12300514481811942347288949897e1),
        (6, 1.52792336328824235832596922938e1),
        (7, -3.32882109689848629194453265587e1),
        (8, -2.03312017085086261358222928593e-2),
    ],
    &[
        (0, -9.3714243008598732571704021658e-1),
        (3, 5.186_372_428_844_063_708_300_238_532_09),
        (4, 1.091_437_348_996_729_578_185_002_546_54),
        (5, -8.149_787_010_746_926_125_139_972_673_57),
        (6, -1.85200656599969598641566180701e1),
        (7, 2.27394870993505042818970056734e1),
        (8, 2.493_605_552_679_652_389_870_893_967_62),
        (9, -3.046_764_471_898_219_500_382_366_902_2),
    ],
    &[
        (0, 2.273_310_147_516_538_207_923_597_684_49),
        (3, -1.05344954667372501984066689879e1),
        (4, -2.000_872_058_224_862_499_096_757_184_44),
        (5, -1.79589318631187989172765950534e1),
        (6, 2.79488845294199600508499808837e1),
        (7, -2.858_998_277_135_023_694_740_655_086_74),
        (8, -8.872_856_933_530_629_544_335_492_892_58),
        (9, 1.23605671757943030647266201528e1),
        (10, 6.43392746015763530355970484046e-1),
    ],
];

/// Weights of order 8.
pub(crate) const B: SparseRow = &[
    (0, 5.42937341165687622380535766363e-2),
    (5, 4.450_312_892_752_408_881_441_139_505_66),
    (6, 1.891_517_899_314_500_383_042_815_990_44),
    (7, -5.801_203_960_010_584_781_467_211_422_7),
    (8, 3.1116436695781989440891606237e-1),
    (9, -1.52160949662516078556178806805e-1),
    (10, 2.01365400804030348374776537501e-1),
    (11, 4.47106157277725905176885569043e-2),
];

/// Integrates every trajectory of the task. A lane starts the next trajectory as soon as its own
/// has ended.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(zero: T, task: &mut P) {
    let zero = N(zero);
    let mut x = [zero; D];
    let mut segments = FixedSegments::new(zero);
    while let Some(mut step_limit) = segments.start_pending_lanes(task, &mut x) {
        let clock = segments.clock;
        let mut index = segments.step_index;
        let h = clock.h;
        let mut time_s = clock.time_after(index);
        // `black_box` prevents the compiler from copying the forcing repeatedly.
        let mut forcing = task.system().forcing_out_of_line(time_s);
        let forcing = black_box(&mut forcing);
        // The states at the start of this step and of the last one, which swap places, and the
        // state of a stage.
        let mut states = [x; 3];
        // The slopes of the stages, and the first slope of the last step, which observers need.
        let mut slopes = [x; DOP853_STAGES + 1];
        // Index of a stage's state among the states.
        const STAGE_STATE: usize = 2;
        // Index of the last step's first slope among the slopes.
        const PREVIOUS_SLOPE: usize = DOP853_STAGES;
        let mut current_index = 0;
        let mut previous_index = 1;
        let mut is_start = true;
        let mut step_count = 0;
        loop {
            // The iteration after the last step only evaluates the slope, because observers need it
            // at both ends of a step.
            let is_last = step_count == step_limit;
            let next_time_s = clock.time_after(index + 1.0);
            for stage in 0..DOP853_STAGES {
                if stage == 0 {
                    slopes[0] = task.system().derivative(forcing, &states[current_index]);
                    if is_start {
                        task.begin(forcing, &states[current_index], &slopes[0]);
                        is_start = false;
                    } else {
                        task.observe(
                            forcing,
                            &ObservedStep {
                                end_s: time_s,
                                length_s: h,
                                start_state: &states[previous_index],
                                start_slope: &slopes[PREVIOUS_SLOPE],
                                end_state: &states[current_index],
                                end_slope: &slopes[0],
                                dense_term: None,
                            },
                        );
                    }
                    if is_last {
                        break;
                    }
                    slopes[PREVIOUS_SLOPE] = slopes[0];
                    continue;
                }
                let stage_time = clock.time_after(index + C[stage]);
                task.system().update_forcing(
                    if stage == DOP853_STAGES - 1 { next_time_s } else { stage_time },
                    forcing,
                );
                add_slopes(h, A[stage - 1], &slopes, &mut states, current_index, STAGE_STATE);
                slopes[stage] = task.system().derivative(forcing, &states[STAGE_STATE]);
            }
            if is_last {
                break;
            }
            add_slopes(h, B, &slopes, &mut states, current_index, previous_index);
            (current_index, previous_index) = (previous_index, current_index);
            index = index + 1.0;
            time_s = next_time_s;
            step_count += 1;
            let in_range = task.system().in_range(&states[current_index]);
            if !T::all(in_range) && segments.end_failed_segments(in_range, time_s, step_count) {
                step_limit = step_count;
            }
        }
        x = states[current_index];
        segments.step_index = index;
        segments.count_steps(step_count);
    }
}

/// Number of coordinates whose sums are kept in registers. Basis: AVX2 has sixteen registers.
/// Doubling it has sums stored in memory.
const SUMS_IN_REGISTERS: usize = 10;

/// Computes a state from state `source_index` and the slopes weighted by a row's coefficients, and
/// stores it as state `target_index`.
#[expect(clippy::manual_memcpy, reason = "sums are registers, not memory")]
#[inline(always)]
pub(crate) fn add_slopes<T: Lane, const D: usize, const K: usize, const S: usize>(
    h: N<T>,
    row: SparseRow,
    slopes: &[[N<T>; D]; K],
    states: &mut [[N<T>; D]; S],
    source_index: usize,
    target_index: usize,
) {
    // Coordinates are summed in groups whose sums fit in registers. Each weight is loaded once for
    // a group, and the sums of a group are computed independently of each other.
    for first in (0..D).step_by(SUMS_IN_REGISTERS) {
        let mut x = [h; SUMS_IN_REGISTERS];
        for i in 0..SUMS_IN_REGISTERS.min(D - first) {
            x[i] = states[source_index][first + i];
        }
        for (stage, weight) in row {
            let weighted_step = (h * *weight).v();
            for i in 0..SUMS_IN_REGISTERS.min(D - first) {
                x[i] += weighted_step * slopes[*stage][first + i];
            }
        }
        for i in 0..SUMS_IN_REGISTERS.min(D - first) {
            states[target_index][first + i] = x[i];
        }
    }
}

/// Returns the factor by which a step of z' = i y z, of length 1, changes the magnitude of z.
#[cfg(test)]
pub(crate) fn amplification(y: f64) -> f64 {
    let combine = |row: SparseRow, slopes: &[[f64; 2]]| {
        row.iter().fold([1.0, 0.0], |[re, im], (stage, weight)| {
            [re + weight * slopes[*stage][0], im + weight * slopes[*stage][1]]
        })
    };
    let slope_at = |[re, im]: [f64; 2]| [-y * im, y * re];
    let mut slopes = vec![slope_at([1.0, 0.0])];
    for row in A {
        slopes.push(slope_at(combine(row, &slopes)));
    }
    let [re, im] = combine(B, &slopes);
    re.hypot(im)
}
