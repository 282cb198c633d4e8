//! Tests of sine and cosine against arbitrary precision.

use crate::{N, trig};
use astro_float_num::{BigFloat, Consts, RoundingMode};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The precision of the reference in bits. Basis: arguments close to a multiple of pi/2 lose 60 to
/// 80 bits. Doubling it doubles the time.
const PRECISION_BITS: usize = 320;
const TO_NEAREST: RoundingMode = RoundingMode::ToEven;

struct Reference {
    constants: Consts,
}

impl Reference {
    fn new() -> Self {
        Self { constants: Consts::new().unwrap() }
    }

    /// Returns the greater error of `computed` sine and cosine of `angle`, in units in the last
    /// place of the true values.
    fn greater_error(&mut self, angle: &BigFloat, (sin, cos): (f64, f64)) -> f64 {
        let true_sin = angle.sin(PRECISION_BITS, TO_NEAREST, &mut self.constants);
        let true_cos = angle.cos(PRECISION_BITS, TO_NEAREST, &mut self.constants);
        ulps(sin, &true_sin).max(ulps(cos, &true_cos))
    }

    /// Returns the errors of an angle in radians.
    fn error_in_radians(&mut self, x: f64) -> f64 {
        self.greater_error(&BigFloat::from_f64(x, PRECISION_BITS), trig::sin_cos(x))
    }

    /// Returns the errors of an angle in turns.
    fn error_in_turns(&mut self, turns: f64) -> f64 {
        let two_pi = self.constants.pi(PRECISION_BITS, TO_NEAREST).mul(
            &BigFloat::from_f64(2.0, PRECISION_BITS),
            PRECISION_BITS,
            TO_NEAREST,
        );
        let angle =
            BigFloat::from_f64(turns, PRECISION_BITS).mul(&two_pi, PRECISION_BITS, TO_NEAREST);
        let (sin, cos) = trig::sin_cos_turns(N(turns));
        self.greater_error(&angle, (sin.0, cos.0))
    }
}

/// Returns the distance between `computed` and `exact` in units in the last place of `exact`.
fn ulps(computed: f64, exact: &BigFloat) -> f64 {
    let difference =
        BigFloat::from_f64(computed, PRECISION_BITS).sub(exact, PRECISION_BITS, TO_NEAREST);
    if difference.is_zero() {
        return 0.0;
    }
    // A double m 2^e with m from 1/2 to 1 has 53 bits, the last of which has the value 2^(e - 53).
    let unit_exponent = exact.exponent().unwrap() - 53;
    let (digit_words, _, _, exponent, _) = difference.as_raw_parts().unwrap();
    let leading_fraction = *digit_words.last().unwrap() as f64 / 2.0_f64.powi(64);
    leading_fraction * 2.0_f64.powi(exponent - unit_exponent)
}

/// Returns the largest error over the angles.
fn largest_error(
    name: &str,
    angles: impl Iterator<Item = f64>,
    mut error: impl FnMut(f64) -> f64,
) -> f64 {
    let mut max_error = 0.0_f64;
    let mut worst_angle = 0.0;
    for angle in angles {
        let error = error(angle);
        assert!(error.is_finite(), "{name}: {angle}");
        if error > max_error {
            (max_error, worst_angle) = (error, angle);
        }
    }
    eprintln!("{name}: at most {max_error:.4} ulp, at {worst_angle:e}");
    max_error
}

/// Generates `count` random numbers of either sign from a seed.
fn random_numbers(
    seed: u64,
    count: usize,
    number: impl Fn(f64) -> f64,
) -> impl Iterator<Item = f64> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..count).map(move |_| number(rng.f64()).copysign(rng.f64() - 0.5))
}

#[test]
fn sines_of_coordinates_are_within_1_5_ulp() {
    let mut reference = Reference::new();
    // Within a quarter turn on one path, up to where a trajectory has diverged on the other.
    let small_angles =
        random_numbers(1, 3000, |u| u * FRAC_PI_4)
            .chain(random_numbers(2, 1000, |u| 10.0_f64.powf(-12.0 * u)));
    assert!(largest_error("below pi/4", small_angles, |x| reference.error_in_radians(x)) < 1.2);
    let wide_angles = random_numbers(3, 3000, |u| FRAC_PI_4 + u * FRAC_PI_4);
    assert!(largest_error("pi/4 to pi/2", wide_angles, |x| reference.error_in_radians(x)) < 1.5);
}

#[test]
fn sines_of_any_angle_are_within_1_5_ulp() {
    let mut reference = Reference::new();
    let large = random_numbers(4, 3000, |u| 10.0_f64.powf(6.0 * u));
    assert!(largest_error("up to 1e6", large, |x| reference.error_in_radians(x)) < 1.5);
    // Almost all digits cancel at these angles.
    let angles_near_zeros = (1..500_u32)
        .map(|k| f64::from(k * k) * FRAC_PI_2)
        .chain((1..500).map(|k| f64::from(k) * PI));
    assert!(
        largest_error("near multiples of pi/2", angles_near_zeros, |x| reference
            .error_in_radians(x))
            < 1.5
    );
}

#[test]
fn sines_of_any_number_of_turns_are_within_1_6_ulp() {
    let mut reference = Reference::new();
    assert!(
        largest_error("turns below 1/2", random_numbers(5, 3000, |u| 0.5 * u), |t| reference
            .error_in_turns(t))
            < 1.6
    );
    let large_angles = random_numbers(6, 3000, |u| 10.0_f64.powf(9.0 * u));
    assert!(largest_error("up to 1e9 turns", large_angles, |t| reference.error_in_turns(t)) < 1.6);
    // Angles near multiples of a quarter turn, but not the multiples themselves, at which sine or
    // cosine is zero and has no unit in the last place.
    let close_turns =
        (0..2000_i32).map(|k| f64::from(k) * 0.125 + 1e-9 * (0.5 + f64::from(k % 7 - 3)));
    assert!(
        largest_error("near eighths of a turn", close_turns, |t| reference.error_in_turns(t)) < 1.6
    );
}

#[test]
fn whole_turns_are_removed_without_rounding() {
    for fraction in [0.0, 0.125, 0.2, -0.3, 0.499] {
        let [near, far] = [1.0, 1048576.0].map(|turns| {
            // The fraction, rounded such that the sum with `turns` is exact.
            let rounded_fraction: f64 = (fraction + turns) - turns;
            (
                trig::sin_cos_turns(N(rounded_fraction)),
                trig::sin_cos_turns(N(rounded_fraction + turns)),
            )
        });
        for ((sin, cos), (sin_later, cos_later)) in [near, far] {
            assert_eq!(sin.0.to_bits(), sin_later.0.to_bits(), "{fraction}");
            assert_eq!(cos.0.to_bits(), cos_later.0.to_bits(), "{fraction}");
        }
    }
}

#[test]
fn quarter_turns_are_exact() {
    for (turns, sin, cos) in
        [(0.0, 0.0, 1.0), (0.25, 1.0, 0.0), (0.5, 0.0, -1.0), (0.75, -1.0, 0.0), (7.25, 1.0, 0.0)]
    {
        let (s, c) = trig::sin_cos_turns(N(turns));
        assert_eq!((s.0, c.0), (sin, cos), "{turns} turns");
    }
}
