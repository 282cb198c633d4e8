//! Tests of the command: its files, output and exit codes.
//!
//! These tests belong to the package `sweep`, whose manifest names this file, because Cargo passes
//! the path of a binary to tests of the same package only. They need a Rust toolchain and a POSIX
//! shell. A test that needs more is ignored, with the reason; `.ci/run` installs it and runs the
//! test.

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
mod limits;
mod optimise;
mod pictures;
mod stability;
mod test_folder;

use std::process::Command;

/// Sends a signal by its short name. It uses the shell's `kill`, because not all systems have the
/// program.
#[cfg(unix)]
fn send_signal(signal_name: &str, process_id: u32) {
    let script = format!("kill -{signal_name} {process_id}");
    let exit_status = Command::new("sh").args(["-c", &script]).status().expect("sh runs");
    assert!(exit_status.success(), "process {process_id} takes no {signal_name}");
}
