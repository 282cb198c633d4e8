//! `sweep merge GRID.toml`: joins the finished shards of a run to its result.

use super::run::{exit_code_by_status, format_counts};
use super::{Lines as _, ResultArgs, install_interrupt};
use crate::config::section::format_count;
use crate::store::{OpenOutcome, OpenRun, Tally};
use crate::{Error, Exit, Job, Model, Plan, tell};
use std::path::Path;

/// Arguments of `sweep merge`.
#[derive(Debug, clap::Args)]
pub struct MergeArgs {
    #[command(flatten)]
    /// The grid file and the output of the run.
    pub target: ResultArgs,
    /// Exit with 3 if any row failed
    #[arg(long)]
    fail_on_error: bool,
}

/// Joins the shards of a grid's run.
///
/// # Errors
/// Mistakes in the grid file, [`crate::store::StoreError::Incomplete`] if chunks are missing, and
/// other errors of the store.
pub fn run<M: Model>(args: &MergeArgs) -> Result<Exit, Error> {
    let plan: Plan<M> = args.target.grid.load()?;
    let job = Job::new(&plan);
    let describe_content = |tally: &Tally| Ok(format_counts(tally, &job));
    merge_job(args, &plan.name, &job, &args.target.output(&plan), &describe_content)
}

/// Joins the shards of a job. `describe_content` describes the finished file.
///
/// # Errors
/// The errors of [`run`], and those of `describe_content`.
pub fn merge_job(
    args: &MergeArgs,
    name: &str,
    job: &Job<'_>,
    output: &Path,
    describe_content: &dyn Fn(&Tally) -> Result<String, Error>,
) -> Result<Exit, Error> {
    let interrupt = install_interrupt()?;
    let mut run = match OpenRun::open_for_merge(output, job)? {
        OpenOutcome::Open(run) => run,
        OpenOutcome::Finished((file, tally)) => {
            let finished_note = format!("{name}: all {} points are there already\n", file.points);
            tell((finished_note + &describe_content(&tally)?).trim_end());
            return Ok(exit_code_by_status(args.fail_on_error, &tally.by_status));
        }
    };
    run.take_notes().iter().for_each(|note| tell(note));
    let Some(tally) = run.join(job, &|| interrupt.is_raised())? else {
        tell("interrupted; the chunks are kept");
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    run.complete(job, &tally, None)?.iter().for_each(|note| tell(note));
    let mut text = format!("{name}: joined {}\n", format_count(tally.points as usize, "point"));
    text += &describe_content(&tally)?;
    text.line("file", output.display());
    tell(text.trim_end());
    Ok(exit_code_by_status(args.fail_on_error, &tally.by_status))
}
