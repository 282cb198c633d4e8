//! The number of worker threads, and their pool.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// A lookup of environment variables.
pub type Environment<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Looks up an environment variable of this process.
pub fn read_variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

/// The greatest number of threads that is accepted. Basis: more than any machine has cores.
/// Doubling it accepts twice as many threads.
const MAX_THREADS: usize = 4096;

/// The environment variable in which Slurm gives the number of a task's cores.
const SLURM_CORES: &str = "SLURM_CPUS_PER_TASK";

/// An error of choosing or starting worker threads.
#[derive(Debug, thiserror::Error)]
pub enum ThreadsError {
    /// The system refused to start the threads.
    #[error("cannot start {threads} threads: {reason}\n  = help: try fewer with --threads")]
    Start {
        /// The number requested.
        threads: usize,
        /// The system's message.
        reason: String,
    },
    /// The scheduler's variable holds no valid number.
    #[error(
        "{SLURM_CORES} is `{given}`: expected a number of cores from 1 to {MAX_THREADS}\n  = help: \
         give --threads"
    )]
    Scheduler {
        /// The value of the variable.
        given: String,
    },
    /// A caller requests an invalid number.
    #[error("{threads} threads: expected a number from 1 to {MAX_THREADS}")]
    InvalidCount {
        /// The number requested.
        threads: usize,
    },
}

impl ThreadsError {
    /// Returns whether the requested number or the scheduler's variable is invalid.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Scheduler { .. } | Self::InvalidCount { .. })
    }
}

/// Parses a value of `--threads`.
///
/// # Errors
/// A text with the expected values.
pub fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads @ 1..=MAX_THREADS) => Ok(threads),
        _ => Err(format!("expected a number of threads from 1 to {MAX_THREADS}; got `{text}`")),
    }
}

/// Checks a number of threads that a program requests.
///
/// # Errors
/// [`ThreadsError::InvalidCount`].
pub fn check_count(threads: usize) -> Result<usize, ThreadsError> {
    let is_valid = (1..=MAX_THREADS).contains(&threads);
    if is_valid { Ok(threads) } else { Err(ThreadsError::InvalidCount { threads }) }
}

/// Returns the number of worker threads: that of `--threads`, else the cores that Slurm gave this
/// task, else those that the process may use.
///
/// # Errors
/// [`ThreadsError::Scheduler`].
pub fn choose_count(
    requested_count: Option<usize>,
    environment_lookup: Environment<'_>,
) -> Result<usize, ThreadsError> {
    match (requested_count, environment_lookup(SLURM_CORES)) {
        (Some(threads), _) => Ok(threads),
        (None, Some(given)) => parse_count(&given).map_err(|_| ThreadsError::Scheduler { given }),
        (None, None) => Ok(count_cores()),
    }
}

/// Returns the number of cores that this process may use.
pub fn count_cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Builds a pool of threads.
///
/// # Errors
/// [`ThreadsError::Start`].
pub fn build_pool(threads: usize) -> Result<ThreadPool, ThreadsError> {
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
    fn the_option_comes_before_slurm_and_slurm_before_the_cores() {
        let slurm_environment =
            |cores: &'static str| move |name: &str| (name == SLURM_CORES).then(|| cores.to_owned());
        assert_eq!(choose_count(None, &slurm_environment("3")).unwrap(), 3);
        assert_eq!(choose_count(Some(2), &slurm_environment("3")).unwrap(), 2);
        assert_eq!(choose_count(None, &|_| None).unwrap(), count_cores());
        for invalid in ["0", "x", "", "4097", "99999999"] {
            let error = choose_count(None, &slurm_environment(invalid)).unwrap_err().to_string();
            assert!(error.contains(&format!("SLURM_CPUS_PER_TASK is `{invalid}`")), "{error}");
            assert_eq!(choose_count(Some(2), &slurm_environment(invalid)).unwrap(), 2);
        }
    }
}
