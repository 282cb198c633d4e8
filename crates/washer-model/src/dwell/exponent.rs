//! Largest Lyapunov exponents, by near twins that are brought back close after every turn.

use super::hold::{Held, hold};
use super::starts::size;
use crate::coordinates::{COORDINATES, STATES, TUB};
use crate::stability::orbit::Row;
use core::f64::consts::TAU;
use lane_ode::Simd;

/// How close a twin is, as a share of the greatest coordinate.
const CLOSE: f64 = 1e-7;

/// Turns before any count, and turns that do, in parts whose scatter gives the error.
const FIRST_TURNS: usize = 16;
const PARTS: usize = 8;
const TURNS_A_PART: usize = 32;

/// How fast neighbours part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponent {
    /// Largest Lyapunov exponent (1/s).
    pub per_s: f64,
    /// Its standard error (1/s), from the scatter of its parts.
    pub error_per_s: f64,
}

impl Exponent {
    /// Whether it is above 0 by more than chance: three standard errors.
    pub fn is_positive(&self) -> bool {
        self.per_s > 3.0 * self.error_per_s
    }
}

/// How far two states are apart, in the tub's coordinates (m, rad) and their speeds by the drum's.
pub(super) fn apart(row: &Row<'_>, a: &[f64; STATES], b: &[f64; STATES]) -> f64 {
    let speed = row.speed_rpm * TAU / 60.0;
    let gap = |&i: &usize| {
        let j = COORDINATES + i;
        (a[i] - b[i]).abs() + (a[j] - b[j]).abs() / speed
    };
    TUB.iter().map(gap).fold(0.0, f64::max)
}

/// Of each the exponent from here on, with a direction of speeds in which the twin starts off; none
/// where one leaves the model's range.
pub(super) fn exponents(
    simd: Simd,
    asked: &[(Held<'_>, [f64; COORDINATES])],
) -> Vec<Option<Exponent>> {
    let close: Vec<f64> =
        asked.iter().map(|(held, _)| CLOSE * size(held.row.point, &held.state)).collect();
    let mut pairs = Vec::with_capacity(2 * asked.len());
    for ((held, direction), close) in asked.iter().zip(&close) {
        let speed = held.row.speed_rpm * TAU / 60.0;
        let mut twin = *held;
        for i in 0..COORDINATES {
            twin.state[COORDINATES + i] += close * speed * direction[i];
        }
        pairs.extend([*held, twin]);
    }
    let mut parts = vec![[0.0_f64; PARTS]; asked.len()];
    for turn in 0..FIRST_TURNS + PARTS * TURNS_A_PART {
        let turned = hold(simd, &pairs, 1);
        for (k, close) in close.iter().enumerate() {
            let (Some(one), Some(twin)) = (turned[2 * k].first(), turned[2 * k + 1].first()) else {
                parts[k][0] = f64::NAN;
                continue;
            };
            let row = pairs[2 * k].row;
            let gap = apart(&row, &one.end, &twin.end);
            if let Some(counted) = turn.checked_sub(FIRST_TURNS) {
                parts[k][counted / TURNS_A_PART] += libm::log(gap / close);
            }
            pairs[2 * k].state = one.end;
            pairs[2 * k + 1].state =
                core::array::from_fn(|i| one.end[i] + (twin.end[i] - one.end[i]) * (close / gap));
        }
    }
    let found = parts.iter().zip(asked).map(|(parts, (held, _))| {
        let part_s = TURNS_A_PART as f64 * held.row.turn_s();
        let mean = parts.iter().sum::<f64>() / PARTS as f64;
        let squares: f64 = parts.iter().map(|part| (part - mean) * (part - mean)).sum();
        let error = (squares / (PARTS * (PARTS - 1)) as f64).sqrt();
        let exponent = Exponent { per_s: mean / part_s, error_per_s: error / part_s };
        (exponent.per_s.is_finite() && exponent.error_per_s.is_finite()).then_some(exponent)
    });
    found.collect()
}
