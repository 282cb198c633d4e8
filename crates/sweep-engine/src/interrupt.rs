//! Handling of SIGINT, SIGTERM and SIGHUP. The first signal stops the run after its rows are
//! stored, the second ends the process at once.

use std::hash::RandomState;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::Error;
use sweep_files::panics;

/// Installs a handler of SIGXFSZ, which by default ends the process, so that exceeding a limit on
/// file size (`ulimit -f`) is an error of a write.
///
/// # Errors
/// The system's refusal of a handler.
pub fn survive_file_size_limits() -> io::Result<()> {
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    Ok(())
}

/// Draws the random numbers that the standard library's hash maps need, so that a failure is an
/// error at the start and not a panic later.
///
/// # Errors
/// A system that does not provide random numbers.
pub fn check_random_numbers() -> Result<(), Error> {
    let result = panics::catch_panic(|| drop(RandomState::new()));
    result.map_err(|panic| Error::File {
        action: "draw random numbers for",
        path: "this process".into(),
        source: io::Error::other(panic),
    })
}

/// A flag, shared by all threads, that signals set in order to stop the work.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    stop_flag: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Creates a flag that only [`Interrupt::raise`] sets.
    pub fn new() -> Self {
        Self::default()
    }

    /// Installs the handlers of this process. A second SIGINT or SIGTERM ends it at once with exit
    /// code 130 or 143.
    ///
    /// # Errors
    /// The system's refusal of a handler.
    pub fn install() -> io::Result<Self> {
        let interrupt = Self::new();
        for signal in [SIGINT, SIGTERM] {
            // The shutdown is registered first, so that it reads the flag before the same signal
            // sets the flag.
            flag::register_conditional_shutdown(
                signal,
                128 + signal,
                Arc::clone(&interrupt.stop_flag),
            )?;
            flag::register_usize(signal, Arc::clone(&interrupt.signal), signal as usize)?;
            flag::register(signal, Arc::clone(&interrupt.stop_flag))?;
        }
        // A closing terminal may send SIGHUP twice, so that a second one must not end the process.
        #[cfg(target_os = "linux")]
        if !ignores_hangups() {
            use signal_hook::consts::SIGHUP;
            flag::register_usize(SIGHUP, Arc::clone(&interrupt.signal), SIGHUP as usize)?;
            flag::register(SIGHUP, Arc::clone(&interrupt.stop_flag))?;
        }
        Ok(interrupt)
    }

    /// Sets the flag, as a signal of this number does.
    pub fn raise(&self, signal: usize) {
        self.signal.store(signal, Ordering::Relaxed);
        self.stop_flag.store(true, Ordering::Release);
    }

    /// Returns the flag itself, which long computations poll.
    pub fn flag(&self) -> &AtomicBool {
        &self.stop_flag
    }

    /// Returns whether the flag is set.
    pub fn is_raised(&self) -> bool {
        self.stop_flag.load(Ordering::Acquire)
    }

    /// Returns the signal that set the flag (1 for SIGHUP, 2 for SIGINT, 15 for SIGTERM).
    pub fn signal(&self) -> Option<u8> {
        if self.is_raised() { u8::try_from(self.signal.load(Ordering::Relaxed)).ok() } else { None }
    }
}

/// Returns whether this process ignores SIGHUP, as one started by `nohup` does.
#[cfg(target_os = "linux")]
fn ignores_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored_signals = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored_signals.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // SIGHUP is signal 1, the lowest bit. Without a mask, the process is taken to ignore it.
    mask.is_none_or(|mask| mask & 1 == 1)
}
