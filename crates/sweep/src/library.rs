//! The commands' work as functions with results in memory, for programs.
//!
//! Functions that may take long take an [`Interrupt`](crate::Interrupt). Raised from another
//! thread, it ends the work in a fraction of a second.

pub(crate) mod boundary;
mod evaluate;
mod explain;
mod fit;
pub(crate) mod modes;
mod optimise;
pub(crate) mod parameters;
mod points;
mod result;
mod run;
mod stability;
mod trace;

pub use boundary::{BoundaryOptions, find_boundary};
pub use evaluate::{Evaluated, Evaluator};
pub use explain::{Explained, explain_point};
pub use fit::fit_tables;
pub use modes::find_modes;
pub use optimise::optimise_study;
pub use parameters::list_parameters;
pub use points::PointTable;
pub use result::ResultTable;
pub use run::{RanToFile, run_to_file};
pub use stability::{find_held, held_to_file};
pub use trace::{TraceOptions, trace_point};

pub use sweep_engine::effort::Effort;

/// Speeds that make no sense.
fn refused_speeds(count: usize, expected: String) -> sweep_engine::exit::Error {
    sweep_engine::exit::Error::option("speeds", format!("with {count} values"), expected)
}
