//! Duffing's oscillator x'' + damping x' + x + cubic x^3 = forcing cos(frequency t), without units:
//! the textbook case of a resonance that bends, jumps and, with a softening spring, breaks.
//!
//! Nayfeh, Mook: Nonlinear Oscillations, Wiley (1979), section 4.1.
//!
//! ```sh
//! cargo run --release -p ode-map --example duffing -- run duffing.toml
//! ```

use std::process::ExitCode;

use lane_ode::{N, Real};
use ode_map::{Coordinate, Oscillator, OscillatorParameter, Range};

#[derive(Clone, Debug, PartialEq)]
struct Duffing;

const fn parameter(
    name: &'static str,
    description: &'static str,
    range: Range,
    default: f64,
) -> OscillatorParameter {
    let source = "assumed: Krack and Gross, Harmonic Balance (2019), chapter 5, exercise 1";
    OscillatorParameter { name, unit: "1", description, range, default, source }
}

impl Oscillator<1, 2, 4> for Duffing {
    const VERSION: &'static str = env!("CARGO_PKG_VERSION");

    const PARAMETERS: [OscillatorParameter; 4] = [
        parameter("damping", "coefficient of the speed", Range::NonNegative, 0.05),
        parameter("cubic", "coefficient of the cubed displacement", Range::Any, 0.1),
        parameter("forcing", "amplitude of the forcing", Range::Any, 0.18),
        parameter("frequency", "angular frequency of the forcing", Range::NonNegative, 1.0),
    ];

    const COORDINATES: [Coordinate; 1] =
        [Coordinate { name: "x", unit: "1", description: "displacement" }];

    #[inline(always)]
    fn accelerations<T: Real>(p: &[N<T>; 4], x: &[N<T>; 1], u: &[N<T>; 1]) -> [N<T>; 1] {
        let [damping, cubic, ..] = *p;
        let [x] = *x;
        let [u] = *u;
        let stiffness = cubic * x.squared().v() + 1.0;
        [-(stiffness * x + (damping * u).v())]
    }

    #[inline(always)]
    fn forcing<T: Real>(p: &[N<T>; 4], t: N<T>) -> [N<T>; 1] {
        let [.., amplitude, frequency] = *p;
        let (_, cos) = (frequency * t).v().sin_cos();
        [(amplitude * cos).v()]
    }
}

fn main() -> ExitCode {
    ode_map::main::<Duffing, 1, 2, 4>("duffing")
}
