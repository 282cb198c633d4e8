//! Rows that are computed in memory, or into a file as the command does.

use std::path::Path;

use super::Effort;
use super::result::MemoryTable;
use sweep_engine::run::{Ended, RunOptions};
use sweep_engine::{Engine, Error, Job, run as runner};

/// How a run into a file ended.
#[derive(Debug)]
pub enum RanToFile {
    /// The file is in place; these are its rows.
    Whole(MemoryTable),
    /// The interrupt was raised. What is done is kept, and the same call goes on.
    Interrupted {
        /// Rows that are there.
        kept: u64,
        /// Points in all.
        points: u64,
    },
}

/// Rows to be computed, and what computes them.
pub struct Task<'a> {
    pub(super) job: Job<'a>,
    pub(super) engine: Box<dyn Engine + 'a>,
}

impl Task<'_> {
    /// Computes the rows into a result file: the same bytes as the command, resumed if it was
    /// interrupted. The whole of it, also in a task of a Slurm array.
    ///
    /// # Errors
    /// Everything that keeps the command from its end; finished chunks are kept whatever it is.
    pub fn to_file(
        &self,
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
        let report = runner::run(&*self.engine, &self.job, output, options, effort.interrupt)?;
        report.notes.iter().for_each(|note| tell(note));
        Ok(match report.ended {
            Ended::Already(..) | Ended::Finished(_) => RanToFile::Whole(MemoryTable::read(output)?),
            Ended::Interrupted { kept, points, .. } => RanToFile::Interrupted { kept, points },
            // Only what a scheduler's variables say makes a shard of a run.
            Ended::Shard(..) => RanToFile::Interrupted { kept: 0, points: self.job.points },
        })
    }
}
