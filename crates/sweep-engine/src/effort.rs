//! The effort of a search or an evaluation: its threads and its interruption.

/// How a search or an evaluation is to be done.
#[derive(Clone, Copy, Debug)]
pub struct Effort<'a> {
    /// Worker threads; if `None`, what Slurm gave this task, else the cores of this machine.
    pub threads: Option<usize>,
    /// How progress is shown, on standard error.
    pub progress: crate::progress::ProgressMode,
    /// Ends the work early.
    pub interrupt: &'a crate::interrupt::Interrupt,
}

impl Effort<'_> {
    /// The threads to work with.
    ///
    /// # Errors
    /// A number that is none, asked for or of a scheduler.
    pub fn threads(&self) -> Result<usize, crate::threads::ThreadsError> {
        match self.threads {
            Some(threads) => crate::threads::checked(threads),
            None => crate::threads::count(None, &crate::threads::process),
        }
    }
}
