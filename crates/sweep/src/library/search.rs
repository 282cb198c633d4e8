//! Searches, with or without a file that keeps what they find out.

use std::path::Path;

use super::Effort;
use super::result::MemoryTable;
use crate::model::Washer;
use crate::plan::Plan;
pub use sweep_engine::boundary::BoundaryOptions;
use sweep_engine::boundary::BoundaryTask;
use sweep_engine::commands::boundary::search as trace;
use sweep_engine::optimise::Study;
use sweep_engine::optimise::file::{table as study_table, trial_columns};
use sweep_engine::optimise::search::search;
use sweep_engine::store::{Opened, TrialColumns, Trials};
use sweep_engine::{Error, Job, Table};
use sweep_files::Output;

/// Traces the boundary of a plan's grid; `None` if the interrupt was raised. The output keeps what
/// an interrupted search has found out, and goes on there; `fresh` starts over.
///
/// # Errors
/// A plan without a range to search, options that make no sense, and whatever keeps the file from
/// being written.
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
    let stored = Stored { job: &task.job(), columns: task.trial_columns(), output, fresh };
    found(stored, search, |found| task.table(found))
}

/// The candidates of a study file, constants `NAME=VALUE` over those of its grid; `None` if the
/// interrupt was raised. With an output it writes that file, byte for byte as `sweep optimise`
/// does, and goes on there after an interruption; `fresh` starts over.
///
/// # Errors
/// Mistakes in the study and its grid file, and whatever keeps the file from being written.
pub fn optimise_study(
    path: &Path,
    sets: &[String],
    output: Option<&Path>,
    fresh: bool,
    effort: Effort<'_>,
) -> Result<Option<MemoryTable>, Error> {
    let study = Study::<Washer>::load(path, sets)?;
    let search = |trials| search(&study, trials, effort);
    let stored = Stored { job: &study.job(), columns: trial_columns(&study), output, fresh };
    found(stored, search, |tried| study_table(&study, tried))
}

/// The output of a search and the trials that it keeps.
struct Stored<'a> {
    job: &'a Job<'a>,
    columns: TrialColumns,
    output: Option<&'a Path>,
    fresh: bool,
}

/// Returns the result of a search, with the trials that its output keeps. A finished output is
/// read.
fn found<T>(
    stored: Stored<'_>,
    search: impl FnOnce(Option<Trials>) -> Result<(Option<T>, Option<Trials>), Error>,
    table: impl FnOnce(&T) -> Table,
) -> Result<Option<MemoryTable>, Error> {
    let Stored { job, columns, output, fresh } = stored;
    let kind = job.layout.kind;
    let file = output.map(|path| Output::begin(path, kind)).transpose()?;
    let open = |path| Trials::open(path, job, columns, fresh);
    let trials = match output.map(open).transpose()? {
        Some(Opened::Finished(())) => return output.map(MemoryTable::read).transpose(),
        Some(Opened::Open(trials)) => Some(trials),
        None => None,
    };
    let (found, trials) = search(trials)?;
    let Some(found) = found else { return Ok(None) };
    let found = MemoryTable::of_table(kind, table(&found))?;
    if let Some(file) = file {
        found.finish(file)?;
    }
    // What it says matters where a user watches the folder.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(found))
}
