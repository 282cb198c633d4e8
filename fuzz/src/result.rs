//! `targets/result.rs` under libFuzzer.

#![no_main]

#[path = "targets/result.rs"]
mod target;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| target::run(bytes));
