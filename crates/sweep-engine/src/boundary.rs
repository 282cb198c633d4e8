//! The boundary: for each value of the first axis, the places along the second where a quantity
//! passes its limit, without filling the grid.
//!
//! The quantity enters as a signed distance from its limit, negative on the reliable side; this
//! module knows no machine. A line is a value of the first axis, along which the second axis is
//! searched.
//!
//! 1. The lattice (`lattice`): evenly spread lines are evaluated at evenly spread columns. Every
//!    change of side between neighbouring samples is a bracket, narrowed by the ITP method (`itp`).
//!    Gaps in which two roots may hide are searched by Piyavskii's method (`lipschitz`).
//! 2. The lines between are predicted by continuation (`continuation`), those in the middle of the
//!    gaps first. A line whose neighbours disagree, or whose sides are not as predicted, is
//!    evaluated at the lattice's columns instead.
//! 3. Intervals on whose side neighbouring lines disagree are subdivided in both.
//!
//! Islands wider than a cell of the lattice are found in every line that passes them; `trace` has
//! the proof.
//!
//! Positions depend on values alone, never on threads or lanes, so the result is a pure function of
//! the input.

mod continuation;
pub mod file;
mod itp;
mod lattice;
mod line;
mod lipschitz;
pub mod quantity;
mod sample;
pub mod search;
#[cfg(test)]
mod tests;
mod trace;

pub use quantity::TracedQuantity;
pub use search::{BoundaryOptions, BoundaryTask};
pub use trace::trace_boundary;

use sweep_parameter::named;

/// A point to evaluate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryTrial {
    /// The number of the curve: a combination of the axes beyond the second.
    pub curve_index: usize,
    /// The value of the first axis.
    pub first_value: f64,
    /// The value of the second axis.
    pub second_value: f64,
}

/// The range of the second axis that is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchRange {
    /// The least value.
    pub least: f64,
    /// The greatest value.
    pub greatest: f64,
    /// Whether crossings are predicted along the logarithm of the first axis.
    pub is_first_log: bool,
    /// Whether the second axis is searched in its logarithm.
    pub is_second_log: bool,
    /// The greatest width of a final bracket: in the second axis's unit, or as a fraction of its
    /// value if that axis is logarithmic.
    pub tolerance: f64,
    /// The number of cells of the lattice along each axis, at least 1.
    pub lattice_cells: usize,
}

named! {
    /// The kind of a row of the boundary file, in the order of the file's dictionary.
    pub enum SideChangeKind {
        /// The quantity passes its limit continuously within the bracket.
        Crossing = "crossing",
        /// The quantity jumps over its limit within the bracket.
        Jump = "jump",
        /// On one side of the bracket the quantity is not defined (a model failed, or there is
        /// nothing to compare).
        Undefined = "undefined",
        /// The quantity is on the reliable side at every evaluated point of the line.
        AllReliable = "none_in_range_reliable",
        /// The quantity is on the unreliable side at every evaluated point of the line.
        AllUnreliable = "none_in_range_unreliable",
        /// The quantity is not defined at any evaluated point of the line.
        AllUndefined = "none_in_range_undefined",
    }
}

/// A change of side on a line: the bracket in which the quantity passes its limit, jumps over it or
/// becomes undefined, or the statement that there is no change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideChange {
    /// The kind.
    pub kind: SideChangeKind,
    /// The value of the second axis at which the quantity is at its limit; `None` unless it is a
    /// crossing.
    pub position: Option<f64>,
    /// The values of the second axis between which the side changes, the lower first.
    pub bracket: Option<[f64; 2]>,
    /// Signed distances from the limit at the bracket's ends, where defined.
    pub distances: [Option<f64>; 2],
}

/// The changes of side at one value of the first axis.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryRow {
    /// The value of the first axis.
    pub first_value: f64,
    /// The changes of side from the least to the greatest value of the second axis; never empty.
    pub side_changes: Vec<SideChange>,
    /// The number of points evaluated.
    pub trial_count: usize,
}

/// The traced curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TracedBoundary {
    /// The rows of each curve, in the first axis's order.
    pub rows_by_curve: Vec<Vec<BoundaryRow>>,
    /// The number of points evaluated.
    pub trial_count: usize,
    /// The number of batches in which they were evaluated.
    pub batch_count: usize,
}
