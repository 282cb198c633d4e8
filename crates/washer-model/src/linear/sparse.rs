//! Sparse linear combinations whose pattern is known at compile time.
//!
//! Most coefficients of the linear model vanish for every machine. A table in the source names the
//! others. It compiles to code without loops, indices or branches: one multiplication per term.

/// Declares a set of coefficients, and the entries as sums of coefficients times functions:
/// `entry => function function ...;`.
///
/// Entries that are not named keep their values. `Name<f64>` holds the coefficients of one machine,
/// `Name<T>` those of one machine per lane.
use lane_ode::{N, Real};

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
            const PLACES: [(usize, usize); [$($first $(, $other)*),+].len()] =
                [$(($entry, $first) $(, ($entry, $other))*),+];

            /// Selects the coefficients that the table names.
            pub(crate) fn gather(all: &[[f64; $functions]; $entries]) -> Self {
                let coefficient = |(entry, function): (usize, usize)| all[entry][function];
                Self { terms: Self::PLACES.map(|place| lane_ode::N(coefficient(place))) }
            }
        }

        impl<T: lane_ode::Lane> $name<T> {
            /// Computes the entries that the table names.
            #[inline(always)]
            pub(crate) fn sum<V: $crate::linear::sparse::Summand<T>>(
                &self,
                functions: &[V; $functions],
                sums: &mut [V; $entries],
            ) {
                use $crate::linear::sparse::next;
                let mut place = 0;
                $(
                    let sum = functions[$first].scaled(next(&self.terms, &mut place));
                    $(
                        let coefficient = next(&self.terms, &mut place);
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

/// Returns the next coefficient.
#[inline(always)]
pub(crate) fn next<T: Copy>(coefficients: &[N<T>], place: &mut usize) -> N<T> {
    *place += 1;
    coefficients[*place - 1]
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
