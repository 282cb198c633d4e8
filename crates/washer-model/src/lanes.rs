//! Structures of lane values, written and read lane by lane as plain numbers.

use core::marker::PhantomData;
use lane_ode::{Dual, Lane, N, Real};

/// A structure of lane values. `SingleLane` is the same structure of plain numbers, with the values
/// of one lane.
pub(crate) trait InLanes<T: Lane> {
    /// The structure of plain numbers.
    type SingleLane;
    /// Returns a structure with the same numbers in every lane. `zero` is any value of the lane
    /// type.
    fn splat(zero: N<T>, single: &Self::SingleLane) -> Self;
    /// Overwrites a lane.
    fn set_lane(&mut self, lane: usize, single: &Self::SingleLane);
    /// Returns the numbers of a lane.
    fn get_lane(&self, lane: usize) -> Self::SingleLane;
}

/// A structure that can be converted to dual numbers with derivatives of zero.
pub(crate) trait ToDual {
    /// The structure of dual numbers.
    type Dual;
    /// Returns the structure with derivatives of zero.
    fn constant(&self) -> Self::Dual;
}

impl<T: Lane> InLanes<T> for N<T> {
    type SingleLane = N<f64>;
    #[inline(always)]
    fn splat(zero: Self, single: &N<f64>) -> Self {
        zero.lit(single.0)
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, single: &N<f64>) {
        self.0.set(lane, single.0);
    }
    #[inline(always)]
    fn get_lane(&self, lane: usize) -> N<f64> {
        N(self.0.get(lane))
    }
}

impl<T: Real> ToDual for N<T> {
    type Dual = N<Dual<T>>;
    #[inline(always)]
    fn constant(&self) -> N<Dual<T>> {
        N::constant(*self)
    }
}

impl<T: Lane, A: InLanes<T> + Copy, const K: usize> InLanes<T> for [A; K] {
    type SingleLane = [A::SingleLane; K];
    #[inline(always)]
    fn splat(zero: N<T>, single: &[A::SingleLane; K]) -> Self {
        let mut array = [A::splat(zero, &single[0]); K];
        for i in 1..K {
            array[i] = A::splat(zero, &single[i]);
        }
        array
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, single: &[A::SingleLane; K]) {
        self.iter_mut().zip(single).for_each(|(to, from)| to.set_lane(lane, from));
    }
    #[inline(always)]
    fn get_lane(&self, lane: usize) -> [A::SingleLane; K] {
        core::array::from_fn(|i| self[i].get_lane(lane))
    }
}

impl<A: ToDual<Dual: Copy>, const K: usize> ToDual for [A; K] {
    type Dual = [A::Dual; K];
    #[inline(always)]
    fn constant(&self) -> [A::Dual; K] {
        let mut array = [self[0].constant(); K];
        for i in 1..K {
            array[i] = self[i].constant();
        }
        array
    }
}

// `splat` and `constant` have loops instead of closures, because only code that is inlined into an
// entry function is compiled for its instruction set.
impl<T: Lane, A: InLanes<T>> InLanes<T> for Vec<A> {
    type SingleLane = Vec<A::SingleLane>;
    #[inline(always)]
    fn splat(zero: N<T>, single: &Vec<A::SingleLane>) -> Self {
        let mut list = Self::with_capacity(single.len());
        for item in single {
            list.push(A::splat(zero, item));
        }
        list
    }
    /// Overwrites a lane; both lists have the same length.
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, single: &Vec<A::SingleLane>) {
        self.iter_mut().zip(single).for_each(|(to, from)| to.set_lane(lane, from));
    }
    #[inline(always)]
    fn get_lane(&self, lane: usize) -> Vec<A::SingleLane> {
        self.iter().map(|item| item.get_lane(lane)).collect()
    }
}

impl<A: ToDual> ToDual for Vec<A> {
    type Dual = Vec<A::Dual>;
    #[inline(always)]
    fn constant(&self) -> Vec<A::Dual> {
        let mut list = Vec::with_capacity(self.len());
        for item in self {
            list.push(item.constant());
        }
        list
    }
}

/// A flag over lanes that is set if it is set for the machine in any lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnyLaneFlag<T>(bool, PhantomData<T>);

impl<T> AnyLaneFlag<T> {
    /// Creates the flag of one machine.
    pub(crate) fn new(is_set: bool) -> Self {
        Self(is_set, PhantomData)
    }

    /// Returns whether the flag is set for any machine.
    #[inline(always)]
    pub(crate) fn is_set(&self) -> bool {
        self.0
    }
}

impl<T: Lane> InLanes<T> for AnyLaneFlag<T> {
    type SingleLane = AnyLaneFlag<f64>;
    #[inline(always)]
    fn splat(_: N<T>, single: &AnyLaneFlag<f64>) -> Self {
        Self::new(single.0)
    }
    #[inline(always)]
    fn set_lane(&mut self, _: usize, single: &AnyLaneFlag<f64>) {
        self.0 |= single.0;
    }
    #[inline(always)]
    fn get_lane(&self, _: usize) -> AnyLaneFlag<f64> {
        AnyLaneFlag::new(self.0)
    }
}

impl<T: Real> ToDual for AnyLaneFlag<T> {
    type Dual = AnyLaneFlag<Dual<T>>;
    #[inline(always)]
    fn constant(&self) -> AnyLaneFlag<Dual<T>> {
        AnyLaneFlag::new(self.0)
    }
}

/// Declares a structure over a number `T` and implements [`InLanes`] and [`ToDual`] for it.
///
/// Fields are `N<T>` where no types are given.
macro_rules! lane_struct {
    ($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident),* $(,)?
    }) => {
        $crate::lanes::lane_struct! {
            $(#[$meta])* $name { $($(#[$field_meta])* $field: lane_ode::N<T>),* }
        }
    };
    ($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident: $type:ty),* $(,)?
    }) => {
        $(#[$meta])*
        pub(crate) struct $name<T> {
            $($(#[$field_meta])* pub(crate) $field: $type,)*
        }

        impl<T: lane_ode::Lane> $crate::lanes::InLanes<T> for $name<T> {
            type SingleLane = $name<f64>;
            #[inline(always)]
            fn splat(zero: lane_ode::N<T>, single: &$name<f64>) -> Self {
                Self { $($field: $crate::lanes::InLanes::splat(zero, &single.$field),)* }
            }
            #[inline(always)]
            fn set_lane(&mut self, lane: usize, single: &$name<f64>) {
                $($crate::lanes::InLanes::set_lane(&mut self.$field, lane, &single.$field);)*
            }
            #[inline(always)]
            fn get_lane(&self, lane: usize) -> $name<f64> {
                $name { $($field: $crate::lanes::InLanes::get_lane(&self.$field, lane),)* }
            }
        }

        impl<T: lane_ode::Real> $crate::lanes::ToDual for $name<T> {
            type Dual = $name<lane_ode::Dual<T>>;
            #[inline(always)]
            fn constant(&self) -> $name<lane_ode::Dual<T>> {
                $name { $($field: $crate::lanes::ToDual::constant(&self.$field),)* }
            }
        }
    };
}
pub(crate) use lane_struct;
