//! The cancellation of long computations.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};

/// A cancellation, which a computation polls. Once it is requested, the computation ends soon, and
/// its result is meaningless or a part of the whole.
#[derive(Clone, Copy, Default)]
pub enum Cancel<'a> {
    /// No request, ever.
    #[default]
    Never,
    /// A request once the flag is set.
    Flag(&'a AtomicBool),
    /// A request once the function returns true, from any thread.
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
