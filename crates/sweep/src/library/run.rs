//! Computation of rows in memory, or into a file like that of the command.

use std::path::Path;

use super::Execution;
use super::result::MemoryTable;
use sweep_engine::run::{RunEnd, RunOptions};
use sweep_engine::{Engine, Error, Job, run as runner};

/// The end of a run into a file.
#[derive(Debug)]
pub enum FileRunEnd {
    /// The run is complete; the table has the rows of its file.
    Complete(MemoryTable),
    /// The interrupt was raised. Finished chunks are stored, and another call continues the run.
    Interrupted {
        /// The number of stored rows.
        stored_rows: u64,
        /// The number of all points.
        points: u64,
    },
}

/// A job with the engine that computes its rows.
pub struct EvaluationTask<'a> {
    pub(super) job: Job<'a>,
    pub(super) engine: Engine<'a>,
}

impl EvaluationTask<'_> {
    /// Computes the rows into a result file with the bytes of the command's file. An interrupted
    /// run continues. All rows are computed, also in a task of a Slurm array.
    ///
    /// # Errors
    ///
    /// Returns the errors of the command. Finished chunks are stored.
    pub fn compute_to_file(
        &self,
        output: &Path,
        fresh: bool,
        tell: &dyn Fn(&str),
        execution: Execution<'_>,
    ) -> Result<FileRunEnd, Error> {
        let options = RunOptions {
            threads: execution.threads()?,
            starts_over: fresh,
            shard: None,
            progress: execution.progress,
            environment: &|_| None,
            show_message: tell,
        };
        let report = runner::run(&self.engine, &self.job, output, options, execution.interrupt)?;
        report.notes.iter().for_each(|note| tell(note));
        Ok(match report.end {
            RunEnd::AlreadyFinished(..) | RunEnd::Finished(_) => {
                FileRunEnd::Complete(MemoryTable::read(output)?)
            }
            RunEnd::Interrupted { stored_points: stored_rows, points, .. } => {
                FileRunEnd::Interrupted { stored_rows, points }
            }
            // A run has shards only if the scheduler's variables are set.
            RunEnd::Shard(..) => {
                FileRunEnd::Interrupted { stored_rows: 0, points: self.job.points }
            }
        })
    }
}
