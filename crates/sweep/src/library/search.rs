//! Searches, with or without a file that keeps their trials.

use std::path::Path;

use super::Effort;
use super::result::MemoryTable;
use crate::model::Washer;
use crate::plan::Plan;
pub use sweep_engine::boundary::BoundaryOptions;
use sweep_engine::boundary::BoundaryTask;
use sweep_engine::commands::boundary::search as trace;
use sweep_engine::optimise::Study;
use sweep_engine::optimise::file::table as study_table;
use sweep_engine::optimise::search::search;
use sweep_engine::store::{Opened, Trials};
use sweep_engine::{Error, Job, Table};
use sweep_files::{FileKind, Output};

/// Traces the boundary of a plan's grid; `None` if the interrupt was raised. With an output, the
/// trials of an interrupted search are kept beside it, and another call continues from them unless
/// it is `fresh`.
///
/// # Errors
/// Returns an error if the plan has no range to search, if an option is out of bounds, and if the
/// file cannot be written.
pub fn find_boundary(
    plan: &Plan,
    options: &BoundaryOptions,
    output: Option<&Path>,
    fresh: bool,
    effort: Effort<'_>,
) -> Result<Option<MemoryTable>, Error> {
    if !(1..=1000).contains(&options.lattice) {
        return Err(Error::option("lattice", options.lattice, "from 1 to 1000"));
    }
    let task = BoundaryTask::new(plan, options)?;
    let search = |trials| trace(&task, trials, effort);
    run_search((&task.job(), FileKind::Boundary), (output, fresh), search, |found| {
        task.table(found)
    })
}

/// Computes the candidates of a study file; `None` if the interrupt was raised. `sets` has
/// constants `NAME=VALUE` for its grid. With an output, it writes the file of `sweep optimise`, and
/// keeps the trials of an interrupted search, from which another call continues unless it is
/// `fresh`.
///
/// # Errors
/// Returns an error for mistakes in the study or its grid file, and if the file cannot be written.
pub fn optimise_study(
    path: &Path,
    sets: &[String],
    output: Option<&Path>,
    fresh: bool,
    effort: Effort<'_>,
) -> Result<Option<MemoryTable>, Error> {
    let study = Study::<Washer>::load(path, sets)?;
    let search = |trials| search(&study, trials, effort);
    run_search((&study.job(), FileKind::Optimise), (output, fresh), search, |tried| {
        study_table(&study, tried)
    })
}

/// Runs a search with the trials that its output keeps, and returns its table. A finished output is
/// read instead.
fn run_search<T>(
    (job, kind): (&Job<'_>, FileKind<'static>),
    (output, fresh): (Option<&Path>, bool),
    search: impl FnOnce(Option<Trials>) -> Result<(Option<T>, Option<Trials>), Error>,
    table: impl FnOnce(&T) -> Table,
) -> Result<Option<MemoryTable>, Error> {
    let file = output.map(|path| Output::begin(path, kind)).transpose()?;
    let trials = match output.map(|path| Trials::open(path, job, fresh)).transpose()? {
        Some(Opened::Finished(())) => return output.map(MemoryTable::read).transpose(),
        Some(Opened::Open(trials)) => Some(trials),
        None => None,
    };
    let (found, trials) = search(trials)?;
    let Some(found) = found else { return Ok(None) };
    let result = MemoryTable::from_table(kind, table(&found))?;
    if let Some(file) = file {
        result.finish(file)?;
    }
    // The result is complete, so a folder of trials that cannot be removed is no error.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(result))
}
