//! Makes any oscillator a model of the engine: its equations are written once over
//! [`lane_ode::Real`], and all commands of `sweep_engine::commands` apply to it.
//!
//! An [`Oscillator`] declares its parameters, coordinates and accelerations. The linear model
//! follows from them by dual numbers at the equilibrium. Both models are integrated in lanes, by
//! RK4 or Dormand-Prince 5(4), or by RK4 in fixed steps that are halved until two runs agree.

mod equations;
mod map;
mod run;

pub use map::Map;
pub use sweep_parameter::{Channel as Coordinate, Range};

use std::process::ExitCode;

use lane_ode::{N, Real};

/// A parameter of an oscillator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillatorParameter {
    /// The name in grid files and of the result's column, which ends with the unit.
    pub name: &'static str,
    /// The unit; "1" for none.
    pub unit: &'static str,
    /// The meaning, in a phrase.
    pub description: &'static str,
    /// The values that the parameter may take.
    pub range: Range,
    /// The default value.
    pub default: f64,
    /// The source of the default value.
    pub source: &'static str,
}

/// An oscillator with `C` coordinates q, for which q'' = accelerations(q, q') + forcing(t), and `P`
/// parameters. `D` is twice `C`.
pub trait Oscillator<const C: usize, const D: usize, const P: usize>:
    Clone + std::fmt::Debug + PartialEq + Send + Sync + 'static
{
    /// The parameters.
    const PARAMETERS: [OscillatorParameter; P];
    /// The coordinates.
    const COORDINATES: [Coordinate; C];
    /// The version of the equations. Results of different versions are never combined.
    const VERSION: &'static str;

    /// Computes the accelerations q'' of the free motion at coordinates `q` with speeds `u`.
    fn accelerations<T: Real>(p: &[N<T>; P], q: &[N<T>; C], u: &[N<T>; C]) -> [N<T>; C];

    /// Computes the forcing at time `t`, which is added to the accelerations of both models.
    fn forcing<T: Real>(p: &[N<T>; P], t: N<T>) -> [N<T>; C];
}

/// Runs the program of an oscillator with this process's arguments. `name` is the program's name.
pub fn main<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    name: &'static str,
) -> ExitCode {
    sweep_engine::commands::main::<Map<O, C, D, P>>(name)
}
