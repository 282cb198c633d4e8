//! The effort of a search or an evaluation: its threads and its interruption.

use crate::threads::{self};
use crate::{Interrupt, ProgressMode, ThreadsError};

/// How a search or an evaluation is to be done.
#[derive(Clone, Copy, Debug)]
pub struct Effort<'a> {
    /// Worker threads; if `None`, what Slurm gave this task, else the cores of this machine.
    pub threads: Option<usize>,
    /// How progress is shown, on standard error.
    pub progress: ProgressMode,
    /// Ends the work early.
    pub interrupt: &'a Interrupt,
}

impl Effort<'_> {
    /// The threads to work with.
    ///
    /// # Errors
    /// A number that is none, asked for or of a scheduler.
    pub fn threads(&self) -> Result<usize, ThreadsError> {
        match self.threads {
            Some(threads) => threads::checked(threads),
            None => threads::count(None, &threads::process),
        }
    }
}

/// The same as a command's options.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct EffortArgs {
    /// Worker threads [default: SLURM_CPUS_PER_TASK, else the cores of this machine]
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    pub threads: Option<usize>,
    /// How progress is shown: auto (a bar on a terminal, else a line a minute), plain (a line every
    /// 5 s) or none
    #[arg(
        long,
        value_name = "auto|plain|none",
        default_value = "auto",
        hide_possible_values = true
    )]
    pub progress: ProgressMode,
}

impl EffortArgs {
    /// Until the interrupt is raised.
    pub fn with(self, interrupt: &Interrupt) -> Effort<'_> {
        Effort { threads: self.threads, progress: self.progress, interrupt }
    }
}
