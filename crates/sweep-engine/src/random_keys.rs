//! Draws the keys of hash maps before any work.

use std::hash::RandomState;

use arrow_array::builder::StringDictionaryBuilder;
use arrow_array::types::Int32Type;
use sweep_files::panics::caught;

/// The system gives no random numbers.
#[derive(Debug, thiserror::Error)]
#[error(
    "the system gives no random numbers, which maps of this program's libraries are keyed with\n  \
     = help: allow this process the system call getrandom, or let it read /dev/urandom"
)]
pub struct NoRandomNumbers;

/// Draws the keys of hash maps: the standard library's, once a thread, and those of Arrow's columns
/// of words, once a process. Both are drawn where the first map is made, with a panic where the
/// system refuses.
///
/// # Errors
/// [`NoRandomNumbers`].
pub fn draw_random_keys() -> Result<(), NoRandomNumbers> {
    let draw = || {
        let _ = RandomState::new();
        drop(StringDictionaryBuilder::<Int32Type>::new());
    };
    caught(draw).map_err(|_| NoRandomNumbers)
}
