//! Sparse linear combinations whose pattern is known at compile time.
//!
//! Most coefficients of the linear model vanish for every machine. A table in the source lists the
//! others. The table compiles to code without loops, indices or branches: one multiplication per
//! term.

use crate::lanes::{InLanes, ToDual};
use lane_ode::{Dual, Lane, N, OutOfLine, Real};

/// Declares a set of coefficients, and the entries as sums of coefficients times functions:
/// `entry => function function ...;`.
///
/// Sums of entries without a row in the table keep their values. `Name<f64>` has the coefficients
/// of one machine, `Name<T>` those of one machine per lane.
macro_rules! sparse_sums {
    (
        $(#[$doc:meta])*
        $name:ident: $functions:expr => $entries:expr;
        $($entry:expr => $first:ident $($other:ident)*;)+
    ) => {
        $crate::lanes::lane_struct! {
            $(#[$doc])*
            #[derive(Clone, Copy, Debug)]
            $name {
                /// The coefficients, by entry, then function.
                terms: [lane_ode::N<T>; [$($first $(, $other)*),+].len()],
            }
        }

        impl $name<f64> {
            /// The entry and the function of each term.
            pub(crate) const POSITIONS: [(usize, usize); [$($first $(, $other)*),+].len()] =
                [$(($entry, $first) $(, ($entry, $other))*),+];

            /// Selects the coefficients that the table lists.
            pub(crate) fn select_coefficients(all: &[[f64; $functions]; $entries]) -> Self {
                let coefficient = |(entry, function): (usize, usize)| all[entry][function];
                Self { terms: Self::POSITIONS.map(|position| lane_ode::N(coefficient(position))) }
            }
        }

        impl<T: lane_ode::Lane> $name<T> {
            /// Computes the entries that the table lists.
            #[inline(always)]
            pub(crate) fn sum<V: $crate::linear::sparse::Summand<T>>(
                &self,
                functions: &[V; $functions],
                sums: &mut [V; $entries],
            ) {
                use $crate::linear::sparse::take_next;
                let mut position = 0;
                $(
                    let sum = functions[$first].scaled(take_next(&self.terms, &mut position));
                    $(
                        let coefficient = take_next(&self.terms, &mut position);
                        let sum = sum.plus_scaled(coefficient, functions[$other]);
                    )*
                    // Evaluates the entry's expression at compile time.
                    sums[const { $entry }] = sum;
                )+
            }
        }
    };
}
pub(crate) use sparse_sums;

/// The coefficients of terms that are missing in the compile-time table, by entry, then function.
/// The list is empty if all of them are 0, as for most machines.
#[derive(Clone, Debug)]
pub(crate) struct FurtherTerms<T> {
    zero: N<T>,
    coefficients: Vec<N<T>>,
}

impl FurtherTerms<f64> {
    /// Creates a set without coefficients.
    pub(crate) const NONE: Self = Self { zero: N(0.0), coefficients: Vec::new() };

    /// Selects the coefficients of the table's entries, except those at one of its `positions`.
    pub(crate) fn select_coefficients<const FUNCTIONS: usize, const ENTRIES: usize>(
        all_coefficients: &[[f64; FUNCTIONS]; ENTRIES],
        positions: &[(usize, usize)],
    ) -> Self {
        let mut coefficients = vec![N(0.0); FUNCTIONS * ENTRIES];
        for entry in 0..ENTRIES {
            for function in 0..FUNCTIONS {
                let has_table_row = positions.iter().any(|position| position.0 == entry);
                if has_table_row && !positions.contains(&(entry, function)) {
                    coefficients[entry * FUNCTIONS + function] =
                        N(all_coefficients[entry][function]);
                }
            }
        }
        Self { zero: N(0.0), coefficients }
    }
}

impl<T> FurtherTerms<T> {
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.coefficients.is_empty()
    }
}

impl<T: Lane> FurtherTerms<T> {
    /// Adds the further terms to the sums of the table's terms.
    #[inline(always)]
    pub(crate) fn add<V: Summand<T>, const FUNCTIONS: usize, const ENTRIES: usize>(
        &self,
        functions: &[V; FUNCTIONS],
        sums: &mut [V; ENTRIES],
    ) {
        if !self.is_empty() {
            let coefficients = &self.coefficients;
            self.zero.0.run_out_of_line(AddFurtherTerms { coefficients, functions, sums });
        }
    }
}

/// The addition of further terms. A lane whose machine lacks a term adds 0, so that its result does
/// not depend on the machines in other lanes.
struct AddFurtherTerms<'a, T, V, const FUNCTIONS: usize, const ENTRIES: usize> {
    coefficients: &'a [N<T>],
    functions: &'a [V; FUNCTIONS],
    sums: &'a mut [V; ENTRIES],
}

impl<T: Lane, V: Summand<T>, const FUNCTIONS: usize, const ENTRIES: usize> OutOfLine
    for AddFurtherTerms<'_, T, V, FUNCTIONS, ENTRIES>
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for entry in 0..ENTRIES {
            let mut sum = self.sums[entry];
            for function in 0..FUNCTIONS {
                let coefficient = self.coefficients[entry * FUNCTIONS + function];
                sum = sum.plus_scaled(coefficient, self.functions[function]);
            }
            self.sums[entry] = sum;
        }
    }
}

impl<T: Lane> InLanes<T> for FurtherTerms<T> {
    type SingleLane = FurtherTerms<f64>;

    #[inline(always)]
    fn splat(zero: N<T>, single: &FurtherTerms<f64>) -> Self {
        Self { zero: zero.lit(0.0), coefficients: Vec::splat(zero, &single.coefficients) }
    }

    /// Overwrites a lane. An empty list counts as a list of zeros.
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, single: &FurtherTerms<f64>) {
        let count = self.coefficients.len().max(single.coefficients.len());
        self.coefficients.resize(count, self.zero);
        for k in 0..count {
            let coefficient = single.coefficients.get(k).copied().unwrap_or(N(0.0));
            self.coefficients[k].set_lane(lane, &coefficient);
        }
    }

    #[inline(always)]
    fn get_lane(&self, lane: usize) -> FurtherTerms<f64> {
        FurtherTerms { zero: N(0.0), coefficients: self.coefficients.get_lane(lane) }
    }
}

impl<T: Real> ToDual for FurtherTerms<T> {
    type Dual = FurtherTerms<Dual<T>>;

    #[inline(always)]
    fn constant(&self) -> FurtherTerms<Dual<T>> {
        FurtherTerms { zero: self.zero.constant(), coefficients: self.coefficients.constant() }
    }
}

/// Returns the coefficient at a position, and advances the position.
#[inline(always)]
pub(crate) fn take_next<T: Copy>(coefficients: &[N<T>], position: &mut usize) -> N<T> {
    *position += 1;
    coefficients[*position - 1]
}

/// A summand: a number, or a number with its first two derivatives. Implementations have no loops,
/// because a model has hundreds of terms, and a loop costs the compiler more than the term.
pub(crate) trait Summand<T>: Copy {
    /// Returns the coefficient times this summand.
    fn scaled(self, coefficient: N<T>) -> Self;
    /// Returns this summand plus the coefficient times another one.
    fn plus_scaled(self, coefficient: N<T>, other: Self) -> Self;
}

impl<T: Real> Summand<T> for N<T> {
    #[inline(always)]
    fn scaled(self, coefficient: N<T>) -> Self {
        (coefficient * self).v()
    }
    #[inline(always)]
    fn plus_scaled(self, coefficient: N<T>, other: Self) -> Self {
        self + coefficient * other
    }
}

impl<T: Real> Summand<T> for [N<T>; 3] {
    #[inline(always)]
    fn scaled(self, coefficient: N<T>) -> Self {
        let [value, first, second] = self;
        [value.scaled(coefficient), first.scaled(coefficient), second.scaled(coefficient)]
    }
    #[inline(always)]
    fn plus_scaled(self, coefficient: N<T>, other: Self) -> Self {
        let [value, first, second] = self;
        let [other_value, other_first, other_second] = other;
        [
            value.plus_scaled(coefficient, other_value),
            first.plus_scaled(coefficient, other_first),
            second.plus_scaled(coefficient, other_second),
        ]
    }
}
