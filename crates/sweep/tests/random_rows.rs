//! Tests of rows of random machines of every kind against plain RK4, with a seed from the clock.
//!
//! `SEED=7 cargo test --release -p sweep --test random_rows` repeats a run; `ROWS=900` tests more
//! rows of each kind. The generator and the promise are those of `examples/differential_test.rs`.

#[path = "../examples/differential_test.rs"]
#[allow(dead_code, reason = "the example's own command line")]
mod differential_test;

use differential_test::{Found, GRID_ROWS, TrialKind, seed_from_clock, try_grids};

/// The share of machines that may have rows beyond their accuracy, beside one more.
///
/// Basis: of 228 machines in runs of `differential_test` four had some. With 72 rows a machine is a
/// share of 0.125. Doubling it allows three machines instead of two.
const EXCEPTIONAL_SHARE: f64 = 0.15;

/// Returns a number from the environment.
fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Tests rows of a kind against the promise.
///
/// The rows of a machine fail together, so machines are counted. One exceptional machine more than
/// the given share is accepted: at the rate of [`EXCEPTIONAL_SHARE`]'s basis, more than that are
/// exceptional in one run of some 2,000.
fn check_promise(kind: TrialKind, exceptional_share: f64, greatest_unconverged_share: f64) {
    let rows = from_environment("ROWS").unwrap_or(72);
    let seed = from_environment("SEED").unwrap_or_else(seed_from_clock);
    let found: Found = try_grids(rows, seed, kind);
    // `cargo test` shows the output of a failed test.
    eprintln!("seed {seed}: {found:?}");
    let machines = rows.div_ceil(GRID_ROWS);
    let allowed = 1 + (exceptional_share * machines as f64) as u64;
    assert!(found.exceptional_grids <= allowed, "seed {seed}: {:#?}", found.exceptions);
    let unconverged = found.unconverged as f64 / found.rows.max(1) as f64;
    assert!(unconverged <= greatest_unconverged_share, "seed {seed}: {unconverged} of {rows} rows");
    assert!(found.rows >= rows, "seed {seed}: {} rows of {rows}", found.rows);
}

#[test]
fn rows_of_random_machines_are_within_their_accuracy() {
    check_promise(TrialKind::Plain, EXCEPTIONAL_SHARE, 0.1);
}

#[test]
fn rows_that_graze_are_within_their_accuracy() {
    check_promise(TrialKind::Grazing, EXCEPTIONAL_SHARE, 0.1);
}

#[test]
fn rows_with_friction_and_stops_are_within_their_accuracy() {
    check_promise(TrialKind::Elements, EXCEPTIONAL_SHARE, 0.3);
}

#[test]
fn rows_behind_a_brake_are_within_their_accuracy() {
    check_promise(TrialKind::Jumps, EXCEPTIONAL_SHARE, 0.2);
}

/// With limits as near 1 as 1.0001, an error within the accuracy changes a verdict of one machine
/// in five.
#[test]
fn most_rows_of_micrometres_are_within_their_accuracy() {
    check_promise(TrialKind::Tiny, 0.5, 0.3);
}
