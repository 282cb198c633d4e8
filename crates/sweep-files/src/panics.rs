//! Catches panics of libraries that read data from outside.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use parquet::errors::ParquetError;

thread_local! {
    /// Whether this thread is inside [`catch_panic`], which reports panics.
    static CATCHES_PANICS: Cell<bool> = const { Cell::new(false) };
}

/// Calls `function` and turns a panic into its message; nothing is printed. Data that `function`
/// has changed must not be used after a panic.
///
/// # Errors
/// The message of a panic.
pub fn catch_panic<T>(function: impl FnOnce() -> T) -> Result<T, String> {
    // The panic hook is set once per process.
    static INSTALL_HOOK: Once = Once::new();
    INSTALL_HOOK.call_once(|| {
        let previous_hook = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CATCHES_PANICS.get() {
                previous_hook(info);
            }
        }));
    });
    let was_catching = CATCHES_PANICS.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(function));
    CATCHES_PANICS.set(was_catching);
    result.map_err(|panic| panic_message(panic.as_ref()).to_owned())
}

/// Calls the Parquet library like [`catch_panic`]; `context` begins the message about a panic. The
/// library panics on some damaged files and some files of other programs, and when it writes and
/// gets no memory.
///
/// # Errors
/// The library's own; [`ParquetError::General`] for a panic.
pub fn catch_in_parquet<T>(
    context: &str,
    function: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ParquetError> {
    catch_panic(function)
        .unwrap_or_else(|panic| Err(ParquetError::General(format!("{context}: {panic}"))))
}

/// Returns the message of a panic.
pub fn panic_message(panic: &(dyn Any + Send)) -> &str {
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
pub fn into_content<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_comes_back_as_its_message() {
        assert_eq!(catch_panic(|| 7), Ok(7));
        assert_eq!(
            catch_panic(|| -> u8 { panic!("row {} is no row", 3) }),
            Err("row 3 is no row".to_owned())
        );
        let nested_result = catch_panic(|| catch_panic(|| -> u8 { panic!("inside") }));
        assert_eq!(nested_result, Ok(Err("inside".to_owned())));
        assert!(!CATCHES_PANICS.get());
    }
}
