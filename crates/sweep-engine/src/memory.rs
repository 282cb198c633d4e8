//! Asks for address space before any work. An allocation that fails later aborts the process
//! without advice.

use std::hint::black_box;

const MIB: usize = 1 << 20;

/// What any command may need, beside its threads. A trace of 50 s ends under `ulimit -v 48000`,
/// which the program itself counts towards, and is aborted under 44000.
const BASE_BYTES: usize = 32 * MIB;

/// A thread's stack, with its guard and the stack of its signal handler.
const THREAD_BYTES: usize = 2 * MIB + MIB / 4;

/// What the allocator may set aside for a thread's heap, and once more while it aligns one: glibc's
/// sizes. A thread whose heap has no room takes from the others', which can then be too small.
const HEAP_BYTES: usize = 64 * MIB;

/// The system does not give the memory that a command needs.
#[derive(Debug, thiserror::Error)]
#[error(
    "too little memory: the system refused {} MiB of address space\n  = help: raise the limit \
     (`ulimit -v`, or that of the container), or use fewer threads",
    bytes / MIB
)]
pub struct NoMemory {
    bytes: usize,
}

/// Makes sure of the address space that a command needs beside its threads.
///
/// # Errors
/// What the system refused, and what to do.
pub fn ensure_memory() -> Result<(), NoMemory> {
    ensure(BASE_BYTES)
}

/// The same, with so many threads.
///
/// # Errors
/// [`NoMemory`].
pub fn ensure_memory_for(threads: usize) -> Result<(), NoMemory> {
    ensure(BASE_BYTES + threads * THREAD_BYTES)
}

/// Makes sure of the address space for results of so many bytes, which are in memory whole.
///
/// # Errors
/// [`NoMemory`].
pub fn ensure_memory_of(bytes: usize) -> Result<(), NoMemory> {
    ensure((BASE_BYTES / 2).saturating_add(bytes))
}

/// The same, with so many threads that all take part in making them.
///
/// # Errors
/// [`NoMemory`].
pub fn ensure_heaps(threads: usize, bytes: usize) -> Result<(), NoMemory> {
    let heaps = threads * (THREAD_BYTES + HEAP_BYTES) + HEAP_BYTES;
    ensure_memory_of(heaps.saturating_add(bytes))
}

/// Reserves as many bytes, and returns them untouched.
fn ensure(bytes: usize) -> Result<(), NoMemory> {
    let mut reserved = Vec::<u8>::new();
    reserved.try_reserve_exact(bytes).map_err(|_| NoMemory { bytes })?;
    black_box(&mut reserved);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused_with_what_to_do() {
        let error = ensure(isize::MAX as usize).unwrap_err().to_string();
        assert!(error.contains("MiB of address space") && error.contains("ulimit -v"), "{error}");
        assert!(ensure_memory_for(2).is_ok());
    }
}
