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
use sweep_engine::exit::Error;

use crate::speeds::MOST_SPEEDS;

/// Speeds that make no sense.
fn refused_speeds(count: usize, expected: String) -> Error {
    Error::option("speeds", format!("with {count} values"), expected)
}

/// Refuses speeds (rpm) that do not rise, fewer than `least` of them or too many, and any that is
/// not `allowed`, which are those `said`.
fn check_speeds(
    speeds_rpm: &[f64],
    least: usize,
    allowed: fn(f64) -> bool,
    said: &str,
) -> Result<(), Error> {
    let count = speeds_rpm.len();
    let rise = speeds_rpm.windows(2).all(|pair| pair[0] < pair[1]);
    let are_speeds = speeds_rpm.iter().all(|speed| speed.is_finite() && allowed(*speed));
    if rise && are_speeds && count >= least && count as f64 <= MOST_SPEEDS + 1.0 {
        return Ok(());
    }
    let expected = format!(
        "from {least} to {MOST_SPEEDS} finite speeds in rpm{said}, each above the one before"
    );
    Err(refused_speeds(count, expected))
}
