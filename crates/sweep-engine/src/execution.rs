//! The threads, the progress and the interrupt of a search or an evaluation.

use crate::threads::{self};
use crate::{Interrupt, ProgressMode, ThreadsError};

/// The threads, the display of progress and the interrupt of a search or an evaluation.
#[derive(Clone, Copy, Debug)]
pub struct Execution<'a> {
    /// The number of worker threads; if `None`, the cores that Slurm gave this task, else those of
    /// this machine.
    pub threads: Option<usize>,
    /// The form in which progress is shown on standard error.
    pub progress: ProgressMode,
    /// The interrupt that ends the work early.
    pub interrupt: &'a Interrupt,
}

impl Execution<'_> {
    /// Returns the number of worker threads.
    ///
    /// # Errors
    /// An invalid number, given by the caller or by a scheduler.
    pub fn threads(&self) -> Result<usize, ThreadsError> {
        match self.threads {
            Some(threads) => threads::check_count(threads),
            None => threads::choose_count(None, &threads::read_variable),
        }
    }
}

/// The options of a command for threads and progress.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct ExecutionArgs {
    /// Worker threads [default: SLURM_CPUS_PER_TASK, else the cores of this machine]
    #[arg(long, value_name = "N", value_parser = threads::parse_count)]
    pub threads: Option<usize>,
    /// Display of progress: auto (a bar on a terminal, else a line a minute), plain (a line every
    /// 5 s) or none
    #[arg(
        long,
        value_name = "auto|plain|none",
        default_value = "auto",
        hide_possible_values = true
    )]
    pub progress: ProgressMode,
}

impl ExecutionArgs {
    /// Adds an interrupt to the options.
    pub fn with_interrupt(self, interrupt: &Interrupt) -> Execution<'_> {
        Execution { threads: self.threads, progress: self.progress, interrupt }
    }
}
