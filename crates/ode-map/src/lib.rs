//! Any oscillator as a model of the engine: its equations once over [`lane_ode::Real`], and every
//! command of `sweep_engine::commands`.
//!
//! An [`Oscillator`] declares its parameters, coordinates and accelerations. The linear model comes
//! from dual numbers at the equilibrium. Both models run through lanes, by fixed steps that are
//! halved until two runs agree, or by one of two methods.

mod equations;
mod map;
mod run;

pub use map::Map;
pub use sweep_parameter::{Channel as Coordinate, Range};

use std::process::ExitCode;

use lane_ode::{N, Real};

/// A parameter of an oscillator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in grid files and of the result's column; it ends with the unit.
    pub name: &'static str,
    /// Unit; "1" for none.
    pub unit: &'static str,
    /// What it is, in a phrase.
    pub description: &'static str,
    /// Values it may take.
    pub range: Range,
    /// Its default.
    pub default: f64,
    /// Where that comes from.
    pub source: &'static str,
}

/// Coordinates q with q'' = accelerations(q, q') + forcing(t): `C` coordinates, `P` parameters. `D`
/// is twice `C`.
pub trait Oscillator<const C: usize, const D: usize, const P: usize>:
    Clone + std::fmt::Debug + PartialEq + Send + Sync + 'static
{
    /// The parameters.
    const PARAMETERS: [Parameter; P];
    /// The coordinates.
    const COORDINATES: [Coordinate; C];
    /// Version of the equations: results of different versions are never mixed.
    const VERSION: &'static str;

    /// The free motion: q'' at coordinates `q` with speeds `u`.
    fn accelerations<T: Real>(p: &[N<T>; P], q: &[N<T>; C], u: &[N<T>; C]) -> [N<T>; C];

    /// The drive at time `t`, added to the accelerations of both models.
    fn forcing<T: Real>(p: &[N<T>; P], t: N<T>) -> [N<T>; C];
}

/// The program of an oscillator: does what this process's arguments say. `name` is its name.
pub fn main<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    name: &'static str,
) -> ExitCode {
    sweep_engine::commands::main::<Map<O, C, D, P>>(name)
}
