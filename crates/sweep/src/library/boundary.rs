//! The search for a boundary, with or without a file that keeps what it finds out.

use std::path::Path;

use super::Effort;
use super::result::ResultTable;
use crate::plan::Plan;
use sweep_engine::boundary::file::{job, table};
use sweep_engine::boundary::quantity::traced;
use sweep_engine::boundary::search::{BoundaryTask, Stopped};
use sweep_engine::commands::boundary::search;
use sweep_engine::exit::Error;
use sweep_engine::store::{OpenedTrials, Trials};
use sweep_files::{FileKind, Output};

/// What is asked of a boundary.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryOptions<'a> {
    /// Any column of numbers that the plan's rows can have.
    pub quantity: &'a str,
    /// Where its limit is, in the column's unit; if `None`, its own.
    pub limit: Option<f64>,
    /// Width of the final brackets, in the second axis's unit, or as a fraction of its value if it
    /// is logarithmic; if `None`, 1/480 of the range.
    pub tolerance: Option<f64>,
    /// Cells along each axis of the lattice that guards against islands, 1 to 1000.
    pub lattice: u16,
    /// The file to write, which keeps what an interrupted search has found out; without one, it is
    /// lost.
    pub output: Option<&'a Path>,
    /// Whether to start over.
    pub fresh: bool,
}

/// Traces the boundary of a plan's grid; `None` if the interrupt was raised.
///
/// # Errors
/// A plan without a range to search, options that make no sense, and whatever keeps the file from
/// being written.
pub fn find_boundary(
    plan: &Plan,
    options: BoundaryOptions<'_>,
    effort: Effort<'_>,
) -> Result<Option<ResultTable>, Error> {
    if !(1..=1000).contains(&options.lattice) {
        return Err(Error::option("lattice", options.lattice, "from 1 to 1000"));
    }
    let (quantity, plan) = &traced(plan, options.quantity, options.limit)?;
    let task = BoundaryTask::new(plan, options.tolerance, usize::from(options.lattice))?;
    let job = job(plan, quantity, &task);
    let begin = |path| Output::begin(path, FileKind::Boundary);
    let file = options.output.map(begin).transpose()?;
    let trials = match options.output.map(|path| Trials::open(path, &job, options.fresh)) {
        None => None,
        Some(opened) => match opened? {
            OpenedTrials::Open(trials) => Some(*trials),
            OpenedTrials::Finished => {
                return options.output.map(ResultTable::read).transpose();
            }
        },
    };
    let (found, trials) = search(plan, quantity, &task, trials, effort)?;
    let found = match found {
        Ok(found) => found,
        Err(Stopped::Failed(error)) => return Err(error.into()),
        Err(Stopped::Interrupted) => return Ok(None),
    };
    let found = table(&job, plan, quantity, &task, &found);
    let found = ResultTable::of_table(FileKind::Boundary, found)?;
    if let Some(file) = file {
        found.finish(file)?;
    }
    // What it says matters where a user watches the folder.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(found))
}
