//! The monodromy matrix of the machine as it is, by classical Runge-Kutta in steps that follow its
//! bearings: slow, and without anything that the fast answer rests on.

use super::monodromy::Square;
use super::orbit::{Row, model};
use super::turn::{Clock, Unwatched, Watch, turn};
use crate::coordinates::STATES;
use crate::modes::{NoModes, highest_frequency_rad_per_s};
use crate::run::model::Nonlinear;
use core::f64::consts::TAU;
use lane_ode::{Aside, Dual, Lu, N, System as _};

/// Step times the greatest frequency.
const STEP_PHASE: f64 = 1.0;

/// The relative miss of a turn that has closed. Basis: a tenth of what rows have. Doubling it
/// changes nothing.
const CLOSED_TURN: f64 = 1e-9;

/// Rounds of Newton's method: it starts where the fast answer ended.
const MOST_ROUNDS: usize = 6;

/// The response and its monodromy matrix, of coordinates and speeds per `unit_per_s`.
pub(super) struct Plain<'a> {
    row: Row<'a>,
    start: [f64; STATES],
    unit_per_s: f64,
}

impl<'a> Plain<'a> {
    /// Starts from a state close to the response.
    pub(super) fn new(
        row: &Row<'a>,
        start: [f64; STATES],
        unit_per_s: f64,
    ) -> Result<Self, NoModes> {
        let highest = highest_frequency_rad_per_s(row.point, row.speed_rpm * TAU / 60.0)?;
        let steps = (row.turn_s() * highest / STEP_PHASE).ceil().max(100.0) as usize;
        Ok(Self { row: Row { steps, caps: None, ..*row }, start, unit_per_s })
    }
}

impl Aside for Plain<'_> {
    /// Nothing where Newton's method finds no response.
    type Output = Option<Square>;

    #[inline(always)]
    fn run(self) -> Option<Square> {
        let zero = N(0.0).constant();
        let tangent: Nonlinear<Dual<f64>> = model(zero, &[self.row]);
        let clock =
            Clock { step_s: zero.lit(self.row.step_s()), steps: self.row.steps, hinge_kept: None };
        let mut x = self.start;
        for _ in 0..MOST_ROUNDS {
            let mut columns = vec![[zero; STATES]; STATES];
            for j in 0..STATES {
                for i in 0..STATES {
                    columns[j][i] = zero.lit(x[i]);
                }
                columns[j][j].0.slope = 1.0;
            }
            turn(&tangent, &clock, &mut columns, None::<&mut Unwatched>);
            let mut matrix = [[N(0.0); STATES]; STATES];
            let mut apart = matrix;
            let mut missing = [N(0.0); STATES];
            for i in 0..STATES {
                missing[i] = N(columns[0][i].0.value - x[i]);
                for j in 0..STATES {
                    let slope = columns[j][i].0.slope;
                    matrix[i][j] = N(slope);
                    apart[i][j] = N(-slope);
                }
                apart[i][i] = apart[i][i] + 1.0;
            }
            let correction = Lu::new(apart)?.solve(&missing);
            let mut moved = 0.0_f64;
            let mut size = 0.0_f64;
            for i in 0..STATES {
                if !correction[i].0.is_finite() {
                    return None;
                }
                x[i] += correction[i].0;
                if i < STATES / 2 {
                    moved = moved.max(correction[i].0.abs());
                    size = size.max((x[i] - self.row.point.equilibrium()[i]).abs());
                }
            }
            if moved <= CLOSED_TURN * size {
                return Some(per_unit(&matrix, self.unit_per_s));
            }
        }
        None
    }
}

/// Returns the matrix over speeds per `unit_per_s`.
fn per_unit(matrix: &Square, unit_per_s: f64) -> Square {
    let unit = |i: usize| if i < STATES / 2 { 1.0 } else { unit_per_s };
    let mut scaled = *matrix;
    for i in 0..STATES {
        for j in 0..STATES {
            scaled[i][j] = N(matrix[i][j].0 * unit(j) / unit(i));
        }
    }
    scaled
}

/// The integral over a turn from a state of the sum of the Jacobian's diagonal.
pub(super) struct Trace<'a> {
    pub(super) row: Row<'a>,
    pub(super) start: [f64; STATES],
}

struct Diagonal<'m> {
    model: &'m Nonlinear<Dual<f64>>,
    step_s: f64,
    steps: usize,
    sum: f64,
}

impl Watch<Dual<f64>, Nonlinear<Dual<f64>>> for Diagonal<'_> {
    fn see(
        &mut self,
        k: usize,
        forcing: &<Nonlinear<Dual<f64>> as lane_ode::System<Dual<f64>, STATES>>::Forcing,
        x: &[N<Dual<f64>>; STATES],
        _: &[N<Dual<f64>>; STATES],
    ) {
        if k == self.steps {
            return;
        }
        for j in STATES / 2..STATES {
            let mut seeded = *x;
            seeded[j].0.slope = 1.0;
            self.sum += self.step_s * self.model.derivative(forcing, &seeded)[j].0.slope;
        }
    }
}

impl Aside for Trace<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let zero = N(0.0).constant();
        let model: Nonlinear<Dual<f64>> = model(zero, &[self.row]);
        let step_s = self.row.step_s();
        let steps = self.row.steps;
        let clock = Clock { step_s: zero.lit(step_s), steps, hinge_kept: None };
        let mut states = [self.start.map(|x| zero.lit(x))];
        let mut diagonal = Diagonal { model: &model, step_s, steps, sum: 0.0 };
        turn(&model, &clock, &mut states, Some(&mut diagonal));
        diagonal.sum
    }
}
