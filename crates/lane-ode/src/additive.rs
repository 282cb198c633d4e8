//! Kennedy and Carpenter's additive method of order 5(4), `ARK5(4)8L[2]SA`: adaptive, every lane
//! with its own time and step, for systems with a stiff part ([`SemiImplicit`]).
//!
//! Every stage has two states, one by the explicit and one by the implicit formula. The stiff part
//! is evaluated at the second state, by solving a linear equation, and is damped if steps are long
//! against its periods (the method is L-stable). All other terms are evaluated at the first state.
//! A stiff part that changes with the state, as springs between turning bodies do, may be as stiff
//! at the end of a step as at its beginning.
//!
//! Coefficients: C. A. Kennedy, M. H. Carpenter, Additive Runge-Kutta schemes for
//! convection-diffusion-reaction equations, Applied Numerical Mathematics 44 (2003) 139. Two states
//! per stage, which keep the order: S. Boscarino, F. Filbet, G. Russo, High order semi-implicit
//! schemes for time dependent partial differential equations, Journal of Scientific Computing 68
//! (2016) 975. The tests measure the resulting order.

use crate::adaptive::AdaptiveLanes;
use crate::control::{ControlExponents, pad_rows};
use crate::{Lane, N, ObservedStep, SemiImplicit, System as _, Task, Tolerance};

/// Number of stages.
const STAGES: usize = 8;

/// Diagonal coefficient of the implicit matrix, in every row except the first.
pub const GAMMA: f64 = 41.0 / 200.0;

/// Nodes.
const C: [f64; STAGES] = [
    0.0,
    41.0 / 100.0,
    2_935_347_310_677.0 / 11_292_855_782_101.0,
    1_426_016_391_358.0 / 7_196_633_302_097.0,
    92.0 / 100.0,
    24.0 / 100.0,
    3.0 / 5.0,
    1.0,
];

/// Matrix of the explicit part.
const A_EXPLICIT: [[f64; STAGES]; STAGES] = pad_rows([
    &[],
    &[41.0 / 100.0],
    &[367_902_744_464.0 / 2_072_280_473_677.0, 677_623_207_551.0 / 8_224_143_866_563.0],
    &[1_268_023_523_408.0 / 10_340_822_734_521.0, 0.0, 1_029_933_939_417.0 / 13_636_558_850_479.0],
    &[
        14_463_281_900_351.0 / 6_315_353_703_477.0,
        0.0,
        66_114_435_211_212.0 / 5_879_490_589_093.0,
        -54_053_170_152_839.0 / 4_284_798_021_562.0,
    ],
    &[
        14_090_043_504_691.0 / 34_967_701_212_078.0,
        0.0,
        15_191_511_035_443.0 / 11_219_624_916_014.0,
        -18_461_159_152_457.0 / 12_425_892_160_975.0,
        -281_667_163_811.0 / 9_011_619_295_870.0,
    ],
    &[
        19_230_459_214_898.0 / 13_134_317_526_959.0,
        0.0,
        21_275_331_358_303.0 / 2_942_455_364_971.0,
        -38_145_345_988_419.0 / 4_862_620_318_723.0,
        -1.0 / 8.0,
        -1.0 / 8.0,
    ],
    &[
        -19_977_161_125_411.0 / 11_928_030_595_625.0,
        0.0,
        -40_795_976_796_054.0 / 6_384_907_823_539.0,
        177_454_434_618_887.0 / 12_078_138_498_510.0,
        782_672_205_425.0 / 8_267_701_900_261.0,
        -69_563_011_059_811.0 / 9_646_580_694_205.0,
        7_356_628_210_526.0 / 4_942_186_776_405.0,
    ],
]);

/// Weights of order 5, for both parts.
const B: [f64; STAGES] = [
    -872_700_587_467.0 / 9_133_579_230_613.0,
    0.0,
    0.0,
    22_348_218_063_261.0 / 9_555_858_737_531.0,
    -1_143_369_518_992.0 / 8_141_816_002_931.0,
    -39_379_526_789_629.0 / 19_018_526_304_540.0,
    32_727_382_324_388.0 / 42_900_044_865_799.0,
    41.0 / 200.0,
];

/// Matrix of the implicit part below its diagonal. Its last row equals the weights.
const A_IMPLICIT: [[f64; STAGES]; STAGES] = pad_rows([
    &[],
    &[41.0 / 200.0],
    &[41.0 / 400.0, -567_603_406_766.0 / 11_931_857_230_679.0],
    &[683_785_636_431.0 / 9_252_920_307_686.0, 0.0, -110_385_047_103.0 / 1_367_015_193_373.0],
    &[
        3_016_520_224_154.0 / 10_081_342_136_671.0,
        0.0,
        30_586_259_806_659.0 / 12_414_158_314_087.0,
        -22_760_509_404_356.0 / 11_113_319_521_817.0,
    ],
    &[
        218_866_479_029.0 / 1_489_978_393_911.0,
        0.0,
        638_256_894_668.0 / 5_436_446_318_841.0,
        -1_179_710_474_555.0 / 5_321_154_724_896.0,
        -60_928_119_172.0 / 8_023_461_067_671.0,
    ],
    &[
        1_020_004_230_633.0 / 5_715_676_835_656.0,
        0.0,
        25_762_820_946_817.0 / 25_263_940_353_407.0,
        -2_161_375_909_145.0 / 9_755_907_335_909.0,
        -211_217_309_593.0 / 5_846_859_502_534.0,
        -4_269_925_059_573.0 / 7_827_059_040_749.0,
    ],
    &B,
]);

/// Weights of the embedded formula of order 4.
const B_HAT: [f64; STAGES] = [
    -975_461_918_565.0 / 9_796_059_967_033.0,
    0.0,
    0.0,
    78_070_527_104_295.0 / 32_432_590_147_079.0,
    -548_382_580_838.0 / 3_424_219_808_633.0,
    -33_438_840_321_285.0 / 15_594_753_105_479.0,
    3_629_800_801_594.0 / 4_656_183_773_603.0,
    4_035_322_873_751.0 / 18_575_991_585_200.0,
];

/// Integrates every trajectory of the task. The lanes accept and reject steps independently.
#[inline(always)]
pub fn integrate<T: Lane, const D: usize, P: Task<T, D>>(
    zero: T,
    task: &mut P,
    tolerance: &Tolerance,
) where
    P::System: SemiImplicit<T, D>,
{
    let zero = N(zero);
    let mut x = [zero; D];
    let mut lanes = AdaptiveLanes::new(zero, ControlExponents::Order5);
    let mut k = [[zero; D]; STAGES];
    let mut start_state = x;
    let mut start_slope = x;
    let mut length_s = zero;
    let mut is_start = lanes.start_pending_lanes(task, &mut x);
    while lanes.has_active_lane() && !task.cancel().is_requested() {
        let forcing = task.system().forcing_out_of_line(lanes.time_s);
        k[0] = task.system().derivative(&forcing, &x);
        if is_start {
            task.begin(&forcing, &x, &k[0]);
        } else {
            task.observe(
                &forcing,
                &ObservedStep {
                    end_s: lanes.time_s,
                    length_s,
                    start_state: &start_state,
                    start_slope: &start_slope,
                    end_state: &x,
                    end_slope: &k[0],
                    dense_term: None,
                },
            );
            is_start = lanes.start_pending_lanes(task, &mut x);
            if is_start {
                continue;
            }
        }
        is_start = false;

        let h = lanes.steps(tolerance);
        // The equations of an idle lane need a positive g as well.
        let g = N((h * GAMMA).v().0.larger(zero.lit(f64::MIN_POSITIVE.sqrt()).0));
        let mut y = x;
        let mut r = x;
        for stage in 1..STAGES {
            for i in 0..D {
                let mut explicit = zero;
                let mut implicit = zero;
                for j in 0..stage {
                    explicit += k[j][i] * A_EXPLICIT[stage][j];
                    implicit += k[j][i] * A_IMPLICIT[stage][j];
                }
                y[i] = x[i] + h * explicit;
                r[i] = x[i] + h * implicit;
            }
            let forcing = task.system().forcing(h * C[stage] + lanes.time_s);
            k[stage] = task.system().solve_implicit_stage(&forcing, &y, &r, g);
        }
        let mut error = [zero; D];
        for i in 0..D {
            let mut sum = zero;
            let mut error_sum = zero;
            for j in 0..STAGES {
                sum += k[j][i] * B[j];
                error_sum += k[j][i] * (B[j] - B_HAT[j]);
            }
            y[i] = x[i] + h * sum;
            error[i] = (h * error_sum).v();
        }

        let in_range = task.system().in_range(&y);
        let error = tolerance.error_norm(&x, &y, &error);
        start_state = x;
        start_slope = k[0];
        let accepted_lanes = error.0.less(zero.lit(1.0).0);
        for i in 0..D {
            x[i] = N(T::select(accepted_lanes, y[i].0, x[i].0));
        }
        length_s = lanes.accept_or_reject(h, error, [accepted_lanes, in_range], tolerance);
    }
}
