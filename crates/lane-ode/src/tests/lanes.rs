//! Tests that each operation of each lane type gives the bits of plain `f64`, for any numbers in
//! the other lanes.

use super::array::Array;
use super::instruction_sets;
use crate::{Kernel, Lane, N, Simd, trig};
use core::hint::black_box;

/// The operands of one lane.
type Operands = [f64; 3];

/// The number of results for the operands.
const RESULT_COUNT: usize = 21;

/// Returns the results by IEEE 754 and the standard library. `black_box` prevents the compiler from
/// fusing a negation with its sum (`aarch64::negated`).
fn expected_results([a, b, c]: Operands) -> [f64; RESULT_COUNT] {
    let (sin, cos) = trig::sin_cos(a);
    let (sin_turns, cos_turns) = trig::sin_cos_turns(N(a));
    [
        c,
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        a.mul_add(b, c),
        a.mul_add(b, -c),
        (-a).mul_add(b, c),
        -black_box(a.mul_add(b, c)),
        -black_box(a.mul_add(b, -c)),
        -black_box((-a).mul_add(b, c)),
        a.sqrt(),
        a.abs(),
        sin,
        cos,
        sin_turns.0,
        cos_turns.0,
        a.round_ties_even(),
        if a < b { a } else { c },
        if b < a { a } else { b },
    ]
}

struct LaneOperations<'a>(&'a [Operands]);

impl Kernel for LaneOperations<'_> {
    type Output = Vec<[f64; RESULT_COUNT]>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut result_rows = Vec::new();
        for group in self.0.chunks(T::LANES) {
            let mut operands = [zero; 3];
            for (lane, values) in group.iter().enumerate() {
                for i in 0..3 {
                    operands[i].set(lane, values[i]);
                }
            }
            let [a, b, c] = operands;
            let (sin, cos) = a.sin_cos();
            let (sin_turns, cos_turns) = trig::sin_cos_turns(N(a));
            let results = [
                c,
                a.add(b),
                a.sub(b),
                a.mul(b),
                a.div(b),
                a.neg(),
                a.mul_add(b, c),
                a.mul_sub(b, c),
                a.neg_mul_add(b, c),
                a.mul_add(b, c).neg(),
                a.mul_sub(b, c).neg(),
                a.neg_mul_add(b, c).neg(),
                a.sqrt(),
                a.abs(),
                sin,
                cos,
                sin_turns.0,
                cos_turns.0,
                a.round(),
                T::select(a.less(b), a, c),
                a.larger(b),
            ];
            let less_bits = T::bits(a.less(b));
            let mut are_all_less = true;
            for (lane, [a, b, _]) in group.iter().enumerate() {
                assert_eq!(less_bits >> lane & 1 == 1, a < b, "{a} < {b}");
                are_all_less &= a < b;
                result_rows.push(results.map(|r| r.get(lane)));
            }
            if group.len() == T::LANES {
                assert_eq!(T::all(a.less(b)), are_all_less);
                assert_eq!(less_bits >> T::LANES, 0, "bits beyond the last lane");
            }
            assert!((0..T::LANES).all(|lane| zero.lit(-1.5).get(lane) == -1.5));
        }
        result_rows
    }
}

/// Returns all pairs of special values, then random numbers of all magnitudes.
fn operands() -> Vec<Operands> {
    let special_numbers = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        1.5,
        2.5,
        -2.5,
        f64::MIN_POSITIVE,
        -f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        f64::MIN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        f64::EPSILON,
        core::f64::consts::FRAC_PI_4,
        -core::f64::consts::FRAC_PI_2,
        4_503_599_627_370_497.5,
    ];
    let mut operand_rows = Vec::new();
    for a in special_numbers {
        for b in special_numbers {
            operand_rows.push([
                a,
                b,
                special_numbers[(operand_rows.len() * 7) % special_numbers.len()],
            ]);
        }
    }
    let mut rng = fastrand::Rng::with_seed(1);
    for _ in 0..20_000 {
        let mut random_number = || (rng.f64() * 2.0 - 1.0) * 2.0_f64.powi(rng.i32(-40..40));
        operand_rows.push([random_number(), random_number(), random_number()]);
    }
    // Fused operations differ from two rounded ones for products and sums of similar magnitude.
    for _ in 0..20_000 {
        let [a, b] = [rng.f64() + 0.5, rng.f64() + 0.5];
        operand_rows.push([a, b, -a * b]);
    }
    operand_rows
}

/// Returns whether both numbers have the same bits. Two NaN are the same, because their sign and
/// payload depend on the processor.
fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

fn check_results(name: &str, operands: &[Operands], results: &[[f64; RESULT_COUNT]]) {
    assert_eq!(operands.len(), results.len());
    for (operands, results) in operands.iter().zip(results) {
        let expected_row = expected_results(*operands);
        for i in 0..RESULT_COUNT {
            assert!(
                is_same(results[i], expected_row[i]),
                "{name}, result {i} of {operands:?}: {} against {}",
                results[i],
                expected_row[i]
            );
        }
    }
}

#[test]
fn every_operation_of_every_instruction_set_gives_the_bits_of_plain_numbers() {
    let operands = operands();
    for simd in instruction_sets() {
        check_results(simd.name(), &operands, &simd.dispatch(LaneOperations(&operands)));
    }
}

#[test]
fn every_operation_of_plain_arrays_gives_the_bits_of_plain_numbers() {
    let operands = operands();
    check_results("Array<2>", &operands, &LaneOperations(&operands).run(Array([0.0; 2])));
    check_results("Array<3>", &operands, &LaneOperations(&operands).run(Array([0.0; 3])));
}

struct CountLanes;

impl Kernel for CountLanes {
    type Output = usize;

    #[inline(always)]
    fn run<T: Lane>(self, _: T) -> usize {
        T::LANES
    }
}

#[test]
fn every_instruction_set_has_its_number_of_lanes() {
    for simd in instruction_sets() {
        assert_eq!(simd.dispatch(CountLanes), simd.lanes(), "{}", simd.name());
    }
    let baseline_set = if cfg!(target_arch = "aarch64") { Simd::Neon } else { Simd::Scalar };
    assert!(
        instruction_sets().contains(&baseline_set),
        "every processor of this architecture has {baseline_set:?}"
    );
    let absent_sets = Simd::ALL.into_iter().filter(|simd| !simd.is_available());
    assert!(
        absent_sets.into_iter().all(|simd| simd.dispatch(CountLanes) == 1),
        "what is absent runs on one lane"
    );
    assert_eq!(Simd::check_processor(), Ok(()));
}
