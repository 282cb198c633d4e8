//! Sums of few terms each, whose places are known at compile time.
//!
//! Most coefficients of the linear model vanish for every machine. A table in the source names the
//! others and compiles to code without loops, indices or branches: one multiplication per term.

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
                /// By entry, then function.
                terms: [lane_ode::N<T>; [$($first $(, $other)*),+].len()],
            }
        }

        impl $name<f64> {
            /// Entry and function of each term.
            const PLACES: [(usize, usize); [$($first $(, $other)*),+].len()] =
                [$(($entry, $first) $(, ($entry, $other))*),+];

            /// The terms that the table names, of all coefficients: by entry, then function.
            pub(crate) fn gather(all: &[[f64; $functions]; $entries]) -> Self {
                let coefficient = |(entry, function): (usize, usize)| all[entry][function];
                Self { terms: Self::PLACES.map(|place| lane_ode::N(coefficient(place))) }
            }
        }

        impl<T: lane_ode::Lane> $name<T> {
            /// The sums.
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
                    // Found when compiling, whatever expression it is.
                    sums[const { $entry }] = sum;
                )+
            }
        }
    };
}
pub(crate) use sparse_sums;

/// The next coefficient.
#[inline(always)]
pub(crate) fn next<T: Copy>(coefficients: &[N<T>], place: &mut usize) -> N<T> {
    *place += 1;
    coefficients[*place - 1]
}

/// What is summed: a number, or one with its first two derivatives. No loops: a model has
/// hundreds of terms, and each loop costs the compiler more than the term.
pub(crate) trait Summand<T>: Copy {
    /// A coefficient times this.
    fn scaled(self, coefficient: N<T>) -> Self;
    /// This plus a coefficient times another.
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
        let ([value, first, second], [by_value, by_first, by_second]) = (self, other);
        [
            value.plus_scaled(coefficient, by_value),
            first.plus_scaled(coefficient, by_first),
            second.plus_scaled(coefficient, by_second),
        ]
    }
}
