//! The name of the program, for the commands that messages advise.

use std::sync::OnceLock;

static PROGRAM: OnceLock<&str> = OnceLock::new();

/// The program's name.
pub fn program() -> &'static str {
    PROGRAM.get().copied().unwrap_or("sweep")
}

/// Says once how the program is called; `sweep` unless somebody does.
pub fn call_program(name: &'static str) {
    let _ = PROGRAM.set(name);
}
