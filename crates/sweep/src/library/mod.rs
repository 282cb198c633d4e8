//! The commands' work as functions: what programs call, with results in memory. The commands call
//! what they share with it here.
//!
//! What may take long takes an [`Interrupt`](crate::Interrupt): raised from another thread, it ends
//! the work in a fraction of a second.

pub(crate) mod boundary;
mod evaluate;
mod explain;
pub(crate) mod modes;
pub(crate) mod parameters;
mod points;
mod result;
mod run;
mod stability;
mod trace;

pub use boundary::{BoundaryOptions, find_boundary};
pub use evaluate::{Evaluated, Evaluator};
pub use explain::{Explained, explain_point};
pub use modes::find_modes;
pub use parameters::list_parameters;
pub use points::PointTable;
pub use result::{ResultKind, ResultTable};
pub use run::{RanToFile, run_to_file};
pub use stability::{find_stability, stability_to_file};
pub use trace::{TraceOptions, trace_point};

/// What a search or an evaluation needs beside its question.
#[derive(Clone, Copy, Debug)]
pub struct Effort<'a> {
    /// Worker threads; if `None`, what Slurm gave this task, else the cores of this machine.
    pub threads: Option<usize>,
    /// How progress is shown, on standard error.
    pub progress: crate::progress::ProgressMode,
    /// Ends the work early.
    pub interrupt: &'a crate::interrupt::Interrupt,
}

impl Effort<'_> {
    /// The threads to work with.
    fn threads(&self) -> Result<usize, crate::threads::ThreadsError> {
        let environment = |name: &str| std::env::var(name).ok();
        match self.threads {
            Some(threads) => crate::threads::checked(threads),
            None => crate::threads::count(None, &environment),
        }
    }
}

/// Speeds that make no sense.
fn refused_speeds(count: usize, expected: String) -> crate::exit::Error {
    let given = format!("with {count} values");
    crate::exit::Error::Option { option: "speeds", given, expected }
}
