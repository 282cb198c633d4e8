//! Sums of few terms each, whose places are known at compile time.
//!
//! Most coefficients of the linear model vanish for every machine. A table in the source names the
//! others and compiles to code without loops, indices or branches: one multiplication per term.

use lane_ode::{N, Real};

/// Declares a set of coefficients, and the entries as sums of coefficients times functions:
/// `entry => function function ...;`.
///
/// Entries that are not named keep their values. `Name<f64>` holds the coefficients of one machine,
/// `Name<T>` those of one machine per lane.
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
            /// The sums, of each of `W` sets of functions.
            #[inline(always)]
            pub(crate) fn sum<const W: usize>(
                &self,
                functions: &[[lane_ode::N<T>; W]; $functions],
                sums: &mut [[lane_ode::N<T>; W]; $entries],
            ) {
                use $crate::linear::sparse;
                let mut next = 0;
                $(
                    let sum = sparse::scaled(&self.terms, &mut next, &functions[$first]);
                    $(
                        let function = &functions[$other];
                        let sum = sparse::plus_scaled(sum, &self.terms, &mut next, function);
                    )*
                    // Found when compiling, whatever expression it is.
                    sums[const { $entry }] = sum;
                )+
            }
        }
    };
}
pub(crate) use sparse_sums;

/// The next coefficient times a function.
#[inline(always)]
pub(crate) fn scaled<T: Real, const W: usize>(
    coefficients: &[N<T>],
    next: &mut usize,
    function: &[N<T>; W],
) -> [N<T>; W] {
    let mut product = *function;
    for w in 0..W {
        product[w] = (coefficients[*next] * function[w]).v();
    }
    *next += 1;
    product
}

/// A sum plus the next coefficient times a function.
#[inline(always)]
pub(crate) fn plus_scaled<T: Real, const W: usize>(
    mut sum: [N<T>; W],
    coefficients: &[N<T>],
    next: &mut usize,
    function: &[N<T>; W],
) -> [N<T>; W] {
    for w in 0..W {
        sum[w] += coefficients[*next] * function[w];
    }
    *next += 1;
    sum
}
