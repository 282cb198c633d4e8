//! Sums of few terms each, whose places are known when compiling.
//!
//! Most coefficients of the linear model vanish for every machine. A table in the source says which do not, and becomes code without
//! loops, indices or branches: a multiplication per term.

use lane_ode::{N, Real};

/// Declares a set of coefficients and the entries that they make of given functions: `entry => function function ...;`.
///
/// Entries that are not named stay as they are. Coefficients of one machine stand in `Name<f64>`, of one per lane in `Name<T>`.
macro_rules! sparse_sums {
    (
        $(#[$doc:meta])*
        $name:ident: $functions:expr => $entries:expr;
        $($entry:expr => $first:ident $($other:ident)*;)+
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name<T>([lane_ode::N<T>; [$($first $(, $other)*),+].len()]);

        impl $name<f64> {
            /// Entry and function of each term.
            const PLACES: [(usize, usize); [$($first $(, $other)*),+].len()] =
                [$(($entry, $first) $(, ($entry, $other))*),+];

            /// The terms that the table names, of all coefficients: by entry, then function.
            pub(crate) fn gather(all: &[[f64; $functions]; $entries]) -> Self {
                Self(Self::PLACES.map(|(entry, function)| lane_ode::N(all[entry][function])))
            }
        }

        impl<T: lane_ode::Lane> $name<T> {
            #[inline(always)]
            pub(crate) fn splat(zero: lane_ode::N<T>, from: &$name<f64>) -> Self {
                Self($crate::lanes::Splat::splat(zero, &from.0))
            }

            /// The sums, of each of `W` sets of functions.
            #[inline(always)]
            pub(crate) fn sum<const W: usize>(
                &self,
                functions: &[[lane_ode::N<T>; W]; $functions],
                sums: &mut [[lane_ode::N<T>; W]; $entries],
            ) {
                let mut next = 0;
                $(
                    let sum = $crate::sparse::scaled(&self.0, &mut next, &functions[$first]);
                    $(let sum = $crate::sparse::plus_scaled(sum, &self.0, &mut next, &functions[$other]);)*
                    sums[$entry] = sum;
                )+
            }
        }

        impl<T: lane_ode::Lane> $crate::lanes::SetLane<$name<f64>> for $name<T> {
            fn set_lane(&mut self, lane: usize, from: &$name<f64>) {
                self.0.set_lane(lane, &from.0);
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
