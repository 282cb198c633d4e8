//! The boundary: for each value of the first axis, the places along the second where a quantity
//! passes its limit, without filling the grid.
//!
//! The quantity enters as a signed distance from its limit, negative on the reliable side;
//! nothing here knows a machine. Trials are evaluated in batches, and what a batch costs is counted
//! in lane groups (`batch.rs`): nine trials cost as much as sixteen.
//!
//! 1. A lattice: evenly spread values of the second axis, in evenly spread rows. It finds every
//!    island wider than its cells.
//! 2. In those rows, nets around where the side should change (`net`), until they catch a bracket
//!    within tolerance (`row`). Distances that hint at more are followed (`look`).
//! 3. The rows between start from the places that their neighbours' roots predict (`warm`), from
//!    the middle of each gap outwards. Where the curve is smooth, two trials a row are enough.
//! 4. Where neighbouring rows disagree, both are looked at until the pocket that one has is found
//!    in the other, or closes between them (`pockets`).
//!
//! All rows at work share a batch, and rows begin in whole lane groups. The trials that fill up the
//! last group make the widest nets closer (`batch`).
//!
//! Which trials are made depends on values alone, never on threads or lanes, so the result is a
//! pure function of the input.

mod batch;
pub mod file;
mod neighbour;
mod net;
mod pockets;
pub mod quantity;
mod refine;
mod row;
pub mod search;
mod span;
#[cfg(test)]
mod tests;
mod trace;
mod warm_start;

use neighbour::{Neighbour, hint, nearest, shared};
use net::{Net, Want};
pub use quantity::TracedQuantity;
use row::RowSearch;
pub use search::{BoundaryOptions, BoundaryTask};
use span::{Hint, Question, Side, SideRange, Span, Tried};
pub use trace::trace;

use sweep_parameter::named;

/// A point to evaluate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Which curve: a combination of the axes beyond the second.
    pub curve: usize,
    /// Value of the first axis.
    pub first: f64,
    /// Value of the second axis.
    pub second: f64,
}

/// The stretch of the second axis that is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Least value.
    pub least: f64,
    /// Greatest value.
    pub greatest: f64,
    /// The first axis is even in its logarithm, so roots are carried along that.
    pub first_log: bool,
    /// The second axis is searched in its logarithm.
    pub second_log: bool,
    /// Brackets end no wider than this: in the second axis's unit, or as a fraction of its value if
    /// that axis is logarithmic.
    pub tolerance: f64,
    /// Cells of the lattice along each axis, at least 1.
    pub lattice: usize,
}

named! {
    /// What a row of the boundary file says, in the order of the file's dictionary.
    pub enum EdgeKind {
        /// The quantity passes its limit continuously within the bracket.
        Crossing = "crossing",
        /// The quantity leaps over its limit within the bracket, however closely one looks.
        Jump = "jump",
        /// On one side of the bracket the quantity is not defined (a model failed, or there is
        /// nothing to compare).
        Undefined = "undefined",
        /// On the reliable side wherever it was evaluated.
        NoneReliable = "none_in_range_reliable",
        /// Not on the reliable side wherever it was evaluated.
        NoneUnreliable = "none_in_range_unreliable",
        /// Not defined wherever it was evaluated.
        NoneUndefined = "none_in_range_undefined",
    }
}

/// One place where the side changes, or the news that there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// What it is.
    pub kind: EdgeKind,
    /// Where the quantity is at its limit; only a crossing has such a place.
    pub at: Option<f64>,
    /// The values of the second axis between which the side changes, the lower first.
    pub bracket: Option<[f64; 2]>,
    /// Signed distances from the limit at the bracket's ends, where defined.
    pub distances: [Option<f64>; 2],
}

/// All that is known about one value of the first axis.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedRow {
    /// Value of the first axis.
    pub first: f64,
    /// From the least to the greatest value of the second axis; never empty.
    pub edges: Vec<Edge>,
    /// Trial points it took.
    pub trials: usize,
}

/// The traced curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traced {
    /// Per curve, its rows in the first axis's order.
    pub curves: Vec<Vec<TracedRow>>,
    /// Trial points in all.
    pub trials: usize,
    /// Lane groups that they filled, the last of every batch perhaps in part.
    pub lane_groups: usize,
    /// Batches they went in.
    pub rounds: usize,
}
