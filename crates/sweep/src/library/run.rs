//! A run into a file, as the command's.

use std::path::Path;

use super::Effort;
use super::result::ResultTable;
use crate::engine::{Engine, ModelEngine};
use crate::plan::Plan;
use sweep_engine::run::{Ended, RunOptions};
use sweep_engine::{Error, Job, run as runner};

/// How a run into a file ended.
#[derive(Debug)]
pub enum RanToFile {
    /// The file is in place; these are its rows.
    Whole(ResultTable),
    /// The interrupt was raised. What is done is kept, and the same call goes on.
    Interrupted {
        /// Rows that are there.
        kept: u64,
        /// Points in all.
        points: u64,
    },
}

/// Runs a plan into a result file: the same bytes as `sweep run`, resumed if it was interrupted.
/// The whole of it, also in a task of a Slurm array.
///
/// # Errors
/// Everything that keeps the command from its end; finished chunks are kept whatever it is.
pub fn run_to_file(
    plan: &Plan,
    output: &Path,
    fresh: bool,
    tell: &dyn Fn(&str),
    effort: Effort<'_>,
) -> Result<RanToFile, Error> {
    into_file(&ModelEngine::new(plan)?, &Job::of(plan), output, fresh, tell, effort)
}

/// Computes a job into its result file.
///
/// # Errors
/// As [`run_to_file`].
pub(super) fn into_file(
    engine: &dyn Engine,
    job: &Job<'_>,
    output: &Path,
    fresh: bool,
    tell: &dyn Fn(&str),
    effort: Effort<'_>,
) -> Result<RanToFile, Error> {
    let options = RunOptions {
        threads: effort.threads()?,
        fresh,
        shard: None,
        progress: effort.progress,
        environment: &|_| None,
        tell,
    };
    let report = runner::run(engine, job, output, options, effort.interrupt)?;
    report.notes.iter().for_each(|note| tell(note));
    match report.ended {
        Ended::Already(..) | Ended::Finished(_) => Ok(RanToFile::Whole(ResultTable::read(output)?)),
        Ended::Interrupted { kept, points, .. } => Ok(RanToFile::Interrupted { kept, points }),
        // Only what a scheduler's variables say makes a shard of a run.
        Ended::Shard(_) => Ok(RanToFile::Interrupted { kept: 0, points: job.points }),
    }
}
