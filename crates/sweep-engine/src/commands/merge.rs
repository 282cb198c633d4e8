//! `sweep merge GRID.toml`: joins the finished shards of a run to its result.

use super::run::{done, rows};
use super::{Lines as _, ResultArgs, installed};
use crate::config::section::counted;
use crate::store::{OpenRun, Opened, Tally};
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
    let content = |tally: &Tally| Ok(rows(tally, &job));
    merge_job(args, &plan.name, &job, &args.target.output(&plan), &content)
}

/// Joins the shards of a job. `content` describes the finished file.
///
/// # Errors
/// The errors of [`run`], and those of `content`.
pub fn merge_job(
    args: &MergeArgs,
    name: &str,
    job: &Job<'_>,
    output: &Path,
    content: &dyn Fn(&Tally) -> Result<String, Error>,
) -> Result<Exit, Error> {
    let interrupt = installed()?;
    let mut run = match OpenRun::open_for_merge(output, job)? {
        Opened::Open(run) => run,
        Opened::Finished((file, tally)) => {
            let there = format!("{name}: all {} points are there already\n", file.points);
            tell((there + &content(&tally)?).trim_end());
            return Ok(done(args.fail_on_error, &tally.by_status));
        }
    };
    run.take_notes().iter().for_each(|note| tell(note));
    let Some(tally) = run.join(job, &|| interrupt.stopped())? else {
        tell("interrupted; the chunks are kept");
        return Ok(Exit::interrupted(interrupt.signal()));
    };
    run.complete(job, &tally, None)?.iter().for_each(|note| tell(note));
    let mut text = format!("{name}: joined {}\n", counted(tally.points as usize, "point"));
    text += &content(&tally)?;
    text.line("file", output.display());
    tell(text.trim_end());
    Ok(done(args.fail_on_error, &tally.by_status))
}
