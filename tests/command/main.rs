//! The command as a user runs it: what it writes, says and leaves behind.
//!
//! These tests belong to the package `sweep`, whose manifest names this file, because Cargo tells
//! only a package's own tests where its binary is. They need a Rust toolchain and a POSIX shell.
//! A test that needs more is ignored and names what it needs; `.ci/run` installs that and runs it.

#![allow(missing_docs, reason = "a test is documented by its name")]

mod boundary;
mod corpora;
mod decisions;
mod determinism;
mod dwell;
mod elements;
mod explain;
mod faults;
mod files;
mod fit;
mod flips;
mod goldens;
mod home;
mod limits;
mod optimise;
mod pictures;
mod stability;

use std::process::Command;

/// Sends a signal by its short name. `kill` is built into every shell, and only some systems have
/// it as a program.
#[cfg(unix)]
fn signal(name: &str, process: u32) {
    let script = format!("kill -{name} {process}");
    let status = Command::new("sh").args(["-c", &script]).status().expect("sh runs");
    assert!(status.success(), "process {process} takes no {name}");
}
