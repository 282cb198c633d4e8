//! Searches, with or without a file that keeps their trials.

use std::path::Path;

use super::Execution;
use super::result::MemoryTable;
use crate::model::Washer;
use crate::plan::Plan;
pub use sweep_engine::boundary::BoundaryOptions;
use sweep_engine::boundary::BoundaryTask;
use sweep_engine::commands::boundary::search as trace_boundary;
use sweep_engine::optimise::Study;
use sweep_engine::optimise::file::{candidates_table, trial_columns};
use sweep_engine::optimise::search::search;
use sweep_engine::store::{OpenOutcome, TrialColumns, Trials};
use sweep_engine::{Error, Job, Table};
use sweep_files::Output;

/// Traces the boundary of a plan's grid; `None` if the interrupt was raised. If `output` is given,
/// the trials of an interrupted search are stored in a folder beside it, and another call continues
/// from them unless it is `fresh`.
///
/// # Errors
///
/// Returns an error if the plan has no range to search, if an option is out of bounds, and if the
/// file cannot be written.
pub fn find_boundary(
    plan: &Plan,
    options: &BoundaryOptions,
    output: Option<&Path>,
    fresh: bool,
    execution: Execution<'_>,
) -> Result<Option<MemoryTable>, Error> {
    if !(1..=1000).contains(&options.lattice) {
        return Err(Error::option("lattice", options.lattice, "from 1 to 1000"));
    }
    let task = BoundaryTask::new(plan, options)?;
    let trace_with_trials = |trials| trace_boundary(&task, trials, execution);
    let search_output =
        SearchOutput { job: &task.job(), trial_columns: task.trial_columns(), output, fresh };
    run_search(search_output, trace_with_trials, |boundary| task.table(boundary))
}

/// Computes the candidates of a study file; `None` if the interrupt was raised. `sets` has
/// constants `NAME=VALUE` for the study's grid. If `output` is given, it writes the file of `sweep
/// optimise` and stores the trials of an interrupted search, from which another call continues
/// unless it is `fresh`.
///
/// # Errors
///
/// Returns an error for mistakes in the study or its grid file, and if the file cannot be written.
pub fn optimise_study(
    path: &Path,
    sets: &[String],
    output: Option<&Path>,
    fresh: bool,
    execution: Execution<'_>,
) -> Result<Option<MemoryTable>, Error> {
    let study = Study::<Washer>::load(path, sets)?;
    let search_with_trials = |trials| search(&study, trials, execution);
    let search_output =
        SearchOutput { job: &study.job(), trial_columns: trial_columns(&study), output, fresh };
    run_search(search_output, search_with_trials, |candidates| candidates_table(&study, candidates))
}

/// The output of a search and the trials that are stored with it.
struct SearchOutput<'a> {
    job: &'a Job<'a>,
    trial_columns: TrialColumns,
    output: Option<&'a Path>,
    fresh: bool,
}

/// Runs a search with the trials that its output stores, and returns the result. A finished output
/// is read instead.
fn run_search<T>(
    search_output: SearchOutput<'_>,
    search: impl FnOnce(Option<Trials>) -> Result<(Option<T>, Option<Trials>), Error>,
    table: impl FnOnce(&T) -> Table,
) -> Result<Option<MemoryTable>, Error> {
    let SearchOutput { job, trial_columns: columns, output, fresh } = search_output;
    let kind = job.layout.kind;
    let output_file = output.map(|path| Output::begin(path, kind)).transpose()?;
    let open_trials = |path| Trials::open(path, job, columns, fresh);
    let trials = match output.map(open_trials).transpose()? {
        Some(OpenOutcome::Finished(())) => return output.map(MemoryTable::read).transpose(),
        Some(OpenOutcome::Open(trials)) => Some(trials),
        None => None,
    };
    let (search_result, trials) = search(trials)?;
    let Some(result) = search_result else { return Ok(None) };
    let table = MemoryTable::from_table(kind, table(&result))?;
    if let Some(file) = output_file {
        table.finish(file)?;
    }
    // The result is complete, so that a folder of trials that cannot be removed is not an error.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(table))
}
