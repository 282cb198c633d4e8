//! The cancellation of long computations.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};

/// A cancellation, which a computation polls. Once it is requested, the computation ends soon, and
/// its result is incomplete or meaningless.
#[derive(Clone, Copy, Default)]
pub enum Cancel<'a> {
    /// A cancellation that is never requested.
    #[default]
    Never,
    /// A cancellation that is requested by setting the flag.
    Flag(&'a AtomicBool),
    /// A cancellation that is requested once the function returns true. The function is called from
    /// any thread.
    When(&'a (dyn Fn() -> bool + Sync)),
}

impl Cancel<'_> {
    /// Returns whether the computation has to stop.
    pub fn is_requested(self) -> bool {
        match self {
            Self::Never => false,
            Self::Flag(flag) => flag.load(Ordering::Acquire),
            Self::When(condition) => condition(),
        }
    }
}

impl fmt::Debug for Cancel<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cancel").field("is_requested", &self.is_requested()).finish()
    }
}
