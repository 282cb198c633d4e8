//! How many threads work, and the pool of them.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Looks up a variable of a scheduler; the process environment outside tests.
pub type Environment<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Whether to end early, asked by any thread.
pub type Cancel<'a> = &'a (dyn Fn() -> bool + Sync);

/// Looks up a variable of this process.
pub fn process(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

/// As many threads as a process can sensibly ask for.
const MOST: usize = 4096;

/// Slurm's variable with the cores of a task.
const SLURM_CORES: &str = "SLURM_CPUS_PER_TASK";

/// Why there are no threads to work with.
#[derive(Debug, thiserror::Error)]
pub enum ThreadsError {
    /// The system would not start them.
    #[error("cannot start {threads} threads: {reason}\n  = help: try fewer with --threads")]
    Start {
        /// How many were asked for.
        threads: usize,
        /// What the system answered.
        reason: String,
    },
    /// The scheduler's number is none, or beyond reason.
    #[error(
        "{SLURM_CORES} is `{given}`: expected a number of cores from 1 to {MOST}\n  = help: give \
         --threads"
    )]
    Scheduler {
        /// The variable's value.
        given: String,
    },
    /// A program asks for none, or beyond reason.
    #[error("{threads} threads: expected a number from 1 to {MOST}")]
    Asked {
        /// How many.
        threads: usize,
    },
}

impl ThreadsError {
    /// Whether the number asked for, or the scheduler's variable, is wrong.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Scheduler { .. } | Self::Asked { .. })
    }
}

/// A value of `--threads`.
///
/// # Errors
/// What was expected instead.
pub fn parse(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads @ 1..=MOST) => Ok(threads),
        _ => Err(format!("expected a number of threads from 1 to {MOST}; got `{text}`")),
    }
}

/// A number of threads that a program asks for.
///
/// # Errors
/// [`ThreadsError::Asked`].
pub fn checked(threads: usize) -> Result<usize, ThreadsError> {
    let is_sensible = (1..=MOST).contains(&threads);
    if is_sensible { Ok(threads) } else { Err(ThreadsError::Asked { threads }) }
}

/// The threads to work with: those asked for by `--threads`, else the cores that Slurm gave this
/// task, else those that the process may use.
///
/// # Errors
/// [`ThreadsError::Scheduler`].
pub fn count(asked: Option<usize>, environment: Environment<'_>) -> Result<usize, ThreadsError> {
    match (asked, environment(SLURM_CORES)) {
        (Some(threads), _) => Ok(threads),
        (None, Some(given)) => parse(&given).map_err(|_| ThreadsError::Scheduler { given }),
        (None, None) => Ok(cores()),
    }
}

/// The cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A pool of so many threads.
///
/// # Errors
/// [`ThreadsError::Start`].
pub fn pool(threads: usize) -> Result<ThreadPool, ThreadsError> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("sweep-{i}"))
        .build()
        .map_err(|error| ThreadsError::Start { threads, reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_those_asked_for_or_what_slurm_gave_or_the_cores() {
        let slurm =
            |cores: &'static str| move |name: &str| (name == SLURM_CORES).then(|| cores.to_owned());
        assert_eq!(count(None, &slurm("3")).unwrap(), 3);
        assert_eq!(count(Some(2), &slurm("3")).unwrap(), 2);
        assert_eq!(count(None, &|_| None).unwrap(), cores());
        for nonsense in ["0", "x", "", "4097", "99999999"] {
            let error = count(None, &slurm(nonsense)).unwrap_err().to_string();
            assert!(error.contains(&format!("SLURM_CPUS_PER_TASK is `{nonsense}`")), "{error}");
            assert_eq!(count(Some(2), &slurm(nonsense)).unwrap(), 2);
        }
    }
}
