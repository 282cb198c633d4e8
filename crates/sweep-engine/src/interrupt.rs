//! SIGINT, SIGTERM and SIGHUP: the first asks the run to stop where nothing is lost, the second
//! leaves at once.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Takes SIGXFSZ, whose default is death, so that a file-size limit (`ulimit -f`) is met as a
/// failed write with a path and advice.
///
/// # Errors
/// When the system refuses a handler.
pub fn survive_file_size_limits() -> io::Result<()> {
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    Ok(())
}

/// The stop flag, shared with whoever has work to put down.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    stop: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// A flag that only [`Interrupt::raise`] sets.
    pub fn new() -> Self {
        Self::default()
    }

    /// Installs the handlers for this process. A second SIGINT or SIGTERM ends it at once with 130
    /// or 143.
    ///
    /// # Errors
    /// When the system refuses a handler.
    pub fn install() -> io::Result<Self> {
        let interrupt = Self::new();
        for signal in [SIGINT, SIGTERM] {
            // Order matters: the shutdown looks at the flag before this signal's own registration
            // sets it.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&interrupt.stop))?;
            flag::register_usize(signal, Arc::clone(&interrupt.signal), signal as usize)?;
            flag::register(signal, Arc::clone(&interrupt.stop))?;
        }
        // A terminal that closes may send it twice, so that a second one changes nothing.
        #[cfg(target_os = "linux")]
        if hears_hangups() {
            use signal_hook::consts::SIGHUP;
            flag::register_usize(SIGHUP, Arc::clone(&interrupt.signal), SIGHUP as usize)?;
            flag::register(SIGHUP, Arc::clone(&interrupt.stop))?;
        }
        Ok(interrupt)
    }

    /// Asks for a stop, as a signal of this number would.
    pub fn raise(&self, signal: usize) {
        self.signal.store(signal, Ordering::Relaxed);
        self.stop.store(true, Ordering::Release);
    }

    /// Whether a stop was asked for.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// The signal that asked (1 for SIGHUP, 2 for SIGINT, 15 for SIGTERM).
    pub fn signal(&self) -> Option<u8> {
        if self.stopped() { u8::try_from(self.signal.load(Ordering::Relaxed)).ok() } else { None }
    }
}

/// Whether SIGHUP is not ignored, as `nohup` has it.
#[cfg(target_os = "linux")]
fn hears_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // The lowest bit is signal 1.
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|it| it & 1 == 0)
}
