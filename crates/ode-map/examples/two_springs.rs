//! A mass held by two springs at right angles and forced along the first: an oscillator of two
//! coordinates with quadratic and cubic terms.
//!
//! Touze, Thomas, Chaigne: Hardening/softening behaviour in non-linear oscillations of structural
//! systems using non-linear normal modes, Journal of Sound and Vibration 273 (2004).
//!
//! ```sh
//! cargo run --release -p ode-map --example two_springs -- run two_springs.toml
//! ```

use std::process::ExitCode;

use lane_ode::{N, Real};
use ode_map::{Coordinate, Oscillator, OscillatorParameter, Range};

#[derive(Clone, Debug, PartialEq)]
struct TwoSprings;

const fn parameter(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    range: Range,
    default: f64,
) -> OscillatorParameter {
    let source = "assumed: example 06 of NLvib has the same oscillator";
    OscillatorParameter { name, unit, description, range, default, source }
}

impl Oscillator<2, 4, 6> for TwoSprings {
    const VERSION: &'static str = env!("CARGO_PKG_VERSION");

    const PARAMETERS: [OscillatorParameter; 6] = [
        parameter(
            "omega_1_rad_per_s",
            "rad/s",
            "natural frequency along the first spring",
            Range::Positive,
            1.13,
        ),
        parameter(
            "omega_2_rad_per_s",
            "rad/s",
            "natural frequency along the second spring",
            Range::Positive,
            2.0,
        ),
        parameter("zeta_1", "1", "damping ratio along the first spring", Range::NonNegative, 0.01),
        parameter("zeta_2", "1", "damping ratio along the second spring", Range::NonNegative, 0.02),
        parameter("forcing", "1", "amplitude of the forcing along the first", Range::Any, 0.01),
        parameter(
            "forcing_rad_per_s",
            "rad/s",
            "frequency of the forcing",
            Range::NonNegative,
            1.0,
        ),
    ];

    const COORDINATES: [Coordinate; 2] = [
        Coordinate { name: "x1", unit: "1", description: "motion along the first spring" },
        Coordinate { name: "x2", unit: "1", description: "motion along the second spring" },
    ];

    #[inline(always)]
    fn accelerations<T: Real>(p: &[N<T>; 6], x: &[N<T>; 2], u: &[N<T>; 2]) -> [N<T>; 2] {
        let [omega_1, omega_2, zeta_1, zeta_2, ..] = *p;
        let ([x1, x2], [u1, u2]) = (*x, *u);
        let k1 = (omega_1 * omega_1).v();
        let k2 = (omega_2 * omega_2).v();
        let c = (0.5 * (k1 + k2)).v();
        let x1_squared = (x1 * x1).v();
        let x2_squared = (x2 * x2).v();
        let cubic_factor = (c * (x1_squared + x2_squared)).v();
        let coordinate_product = (x1 * x2).v();
        let quadratic_1 =
            0.5 * (k1 * (3.0 * x1_squared + x2_squared)).v() + (k2 * coordinate_product).v();
        let quadratic_2 =
            0.5 * (k2 * (3.0 * x2_squared + x1_squared)).v() + (k1 * coordinate_product).v();
        let linear_1 = k1 * x1 + (2.0 * zeta_1).v() * (omega_1 * u1).v();
        let linear_2 = k2 * x2 + (2.0 * zeta_2).v() * (omega_2 * u2).v();
        [
            -(cubic_factor * x1 + (linear_1 + quadratic_1)),
            -(cubic_factor * x2 + (linear_2 + quadratic_2)),
        ]
    }

    #[inline(always)]
    fn forcing<T: Real>(p: &[N<T>; 6], t: N<T>) -> [N<T>; 2] {
        let [.., amplitude, frequency] = *p;
        let (_, cos) = (frequency * t).v().sin_cos();
        [(amplitude * cos).v(), t.lit(0.0)]
    }
}

fn main() -> ExitCode {
    ode_map::main::<TwoSprings, 2, 4, 6>("two_springs")
}
