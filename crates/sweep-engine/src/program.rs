//! The name of the program, for the command lines in messages.

use std::sync::OnceLock;

/// The name, if [`set_program`] has set it.
static PROGRAM: OnceLock<&str> = OnceLock::new();

/// Returns the program's name.
pub fn program() -> &'static str {
    PROGRAM.get().copied().unwrap_or("sweep")
}

/// Sets the program's name, which is `sweep` by default; only the first call has an effect.
pub fn set_program(name: &'static str) {
    let _ = PROGRAM.set(name);
}
