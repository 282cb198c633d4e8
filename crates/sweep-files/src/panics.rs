//! Catches panics of libraries that read data from outside.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use parquet::errors::ParquetError;

thread_local! {
    /// Whether this thread is inside [`caught`], which reports panics.
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Calls `work` and turns a panic into its message; nothing is printed. Data that `work` has
/// changed must not be used after a panic.
///
/// # Errors
/// The message of a panic.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    // The panic hook is set once per process.
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous_hook = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CAUGHT.get() {
                previous_hook(info);
            }
        }));
    });
    let was_caught = CAUGHT.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    CAUGHT.set(was_caught);
    result.map_err(|panic| text(panic.as_ref()).to_owned())
}

/// Calls the Parquet library like [`caught`]; `what` begins the message about a panic. The library
/// panics on some damaged files and some files of other programs, and when it writes and gets no
/// memory.
///
/// # Errors
/// The library's own; [`ParquetError::General`] for a panic.
pub fn in_parquet<T>(
    what: &str,
    work: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ParquetError> {
    caught(work).unwrap_or_else(|panic| Err(ParquetError::General(format!("{what}: {panic}"))))
}

/// Returns the message of a panic.
pub fn text(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
}

/// Locks a mutex, even if a panic has poisoned it.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the content of a mutex, even if a panic has poisoned it.
pub fn unlocked<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_comes_back_as_its_message() {
        assert_eq!(caught(|| 7), Ok(7));
        assert_eq!(
            caught(|| -> u8 { panic!("row {} is no row", 3) }),
            Err("row 3 is no row".to_owned())
        );
        let nested_result = caught(|| caught(|| -> u8 { panic!("inside") }));
        assert_eq!(nested_result, Ok(Err("inside".to_owned())));
        assert!(!CAUGHT.get());
    }
}
