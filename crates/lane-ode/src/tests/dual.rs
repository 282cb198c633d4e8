//! Tests of the derivatives of dual numbers against closed forms and differences.

use crate::{Dual, N, Real};

/// A function f(x) over plain numbers, over dual numbers, and over dual numbers of dual numbers,
/// with f' and f'' in closed form.
struct DerivativeCase {
    name: &'static str,
    plain: fn(N<f64>) -> N<f64>,
    dual: fn(N<Dual<f64>>) -> N<Dual<f64>>,
    nested_dual: fn(N<Dual<Dual<f64>>>) -> N<Dual<Dual<f64>>>,
    closed_form: fn(f64) -> [f64; 2],
}

/// Makes a case from one expression, compiled for plain numbers, for duals and for duals of duals.
macro_rules! case {
    ($name:literal, |$x:ident| $f:expr, |$y:ident| $closed_form:expr) => {
        DerivativeCase {
            name: $name,
            plain: |$x| ($f).into(),
            dual: |$x| ($f).into(),
            nested_dual: |$x| ($f).into(),
            closed_form: |$y: f64| $closed_form,
        }
    };
}

const CASES: &[DerivativeCase] = &[
    case!("x + x", |x| x + x, |_x| [2.0, 0.0]),
    case!("x - 3", |x| x - 3.0, |_x| [1.0, 0.0]),
    case!("-x", |x| -x, |_x| [-1.0, 0.0]),
    case!("x x", |x| x * x, |x| [2.0 * x, 2.0]),
    case!("x x + x", |x| x * x + x, |x| [2.0 * x + 1.0, 2.0]),
    case!("x x - x", |x| x * x - x, |x| [2.0 * x - 1.0, 2.0]),
    case!("x - x x", |x| x - x * x, |x| [1.0 - 2.0 * x, -2.0]),
    case!("1 / x", |x| 1.0 / x, |x| [-1.0 / (x * x), 2.0 / (x * x * x)]),
    case!("(x + 1) / (x x + 2)", |x| (x + 1.0) / (x * x + 2.0), |x| {
        let d = x * x + 2.0;
        [
            (2.0 - x * x - 2.0 * x) / (d * d),
            (-2.0 - 2.0 * x) / (d * d) - 4.0 * x * (2.0 - x * x - 2.0 * x) / (d * d * d),
        ]
    }),
    case!("sqrt x", |x| x.sqrt(), |x| [0.5 / x.sqrt(), -0.25 / (x * x.sqrt())]),
    case!("sin x", |x| x.sin_cos().0, |x| [x.cos(), -x.sin()]),
    case!("cos x", |x| x.sin_cos().1, |x| [-x.sin(), -x.cos()]),
    case!("|x - 2|", |x| (x - 2.0).abs(), |x| [(x - 2.0).signum(), 0.0]),
    case!("x if x < 1.5 else x x", |x| x.where_less(x.lit(1.5), x, (x * x).v()), |x| if x < 1.5 {
        [1.0, 0.0]
    } else {
        [2.0 * x, 2.0]
    }),
    case!("sin(x x) / sqrt(x + 2)", |x| (x * x).v().sin_cos().0 / (x + 2.0).sqrt(), |x| {
        let ((s, c), r) = ((x * x).sin_cos(), (x + 2.0).sqrt());
        let first_derivative = 2.0 * x * c / r - 0.5 * s / (r * r * r);
        let second_derivative =
            (2.0 * c - 4.0 * x * x * s) / r - 2.0 * x * c / (r * r * r) + 0.75 * s / r.powi(5);
        [first_derivative, second_derivative]
    }),
];

const ARGUMENTS: [f64; 6] = [0.3, 0.7, 1.1, 1.9, 2.6, 3.3];

fn is_close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * (1.0 + b.abs())
}

#[test]
fn first_and_second_derivatives_agree_with_closed_forms() {
    for case in CASES {
        for x in ARGUMENTS {
            let [first, second] = (case.closed_form)(x);
            let y = (case.dual)(N(Dual { value: x, slope: 1.0 })).0;
            assert_eq!(
                y.value.to_bits(),
                (case.plain)(N(x)).0.to_bits(),
                "{}: value at {x}",
                case.name
            );
            assert!(
                is_close(y.slope, first, 1e-14),
                "{}: {} against {first} at {x}",
                case.name,
                y.slope
            );
            let inner_dual = Dual { value: x, slope: 1.0 };
            let y = (case.nested_dual)(N(Dual {
                value: inner_dual,
                slope: Dual { value: 1.0, slope: 0.0 },
            }))
            .0;
            assert!(is_close(y.slope.value, first, 1e-14), "{}: first of two at {x}", case.name);
            assert!(
                is_close(y.slope.slope, second, 1e-13),
                "{}: {} against {second} at {x}",
                case.name,
                y.slope.slope
            );
        }
    }
}

#[test]
fn derivatives_agree_with_differences() {
    const H: f64 = 1e-5;
    for case in CASES {
        for x in ARGUMENTS {
            let difference = ((case.plain)(N(x + H)).0 - (case.plain)(N(x - H)).0) / (2.0 * H);
            let y = (case.dual)(N(Dual { value: x, slope: 1.0 })).0;
            assert!(
                is_close(y.slope, difference, 1e-8),
                "{}: {} against {difference}",
                case.name,
                y.slope
            );
        }
    }
}

#[test]
fn the_derivative_is_proportional_to_the_slope_and_zero_for_constants() {
    for case in CASES {
        let unit_derivative = (case.dual)(N(Dual { value: 1.1, slope: 1.0 })).0.slope;
        let scaled_derivative = (case.dual)(N(Dual { value: 1.1, slope: -3.0 })).0.slope;
        assert!(is_close(scaled_derivative, -3.0 * unit_derivative, 1e-14), "{}", case.name);
        assert_eq!((case.dual)(N(1.1).constant()).0.slope, 0.0, "{}", case.name);
    }
    assert_eq!(Dual::constant(2.0).lit(7.0).slope, 0.0);
}
